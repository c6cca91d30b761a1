//! Forms with a memory: after the edges of the shadow, after logged events, after manoeuvres, late behind the attitude, with the time.

use super::Collector;
use crate::diagnose::case::HALF_WINDOW_S;
use crate::diagnose::catalogue::LOGGED_KINDS;
use crate::diagnose::instants::{manoeuvres, still_warm, terminators};
use crate::diagnose::measure::{coverage, decay, relaxing, union, weighted_coverage};
use crate::diagnose::scene::Scene;
use crate::math::robust::median;
use crate::physics::Vec3;

/// Times in which what a logged event begins dies away, s: a factor of three apart, between which a decay hardly differs.
const EVENT_TAUS_S: [f64; 4] = [200.0, 600.0, 2000.0, 6000.0];
/// The same after a manoeuvre or a gap, which warm or cool what is large.
pub(super) const PAUSE_TAUS_S: [f64; 4] = [300.0, 1000.0, 3000.0, 10_000.0];
/// Times in which what is warmed, or a sensor, follows late, s.
pub(super) const LATE_S: [f64; 3] = [1000.0, 3000.0, 10_000.0];

/// Decays after instants in order, each forgetting the one before: exp(-(t - last)/tau).
pub(super) fn since(scene: &Scene, instants: &[(f64, f64)], tau_s: f64) -> Vec<f64> {
    let next = |n: usize| instants.get(n + 1).map_or(f64::INFINITY, |(t, _)| *t);
    decays(scene, instants, tau_s, next)
}

/// Decays after instants, each beside those before.
fn added(scene: &Scene, instants: &[(f64, f64)], tau_s: f64) -> Vec<f64> {
    decays(scene, instants, tau_s, |_| f64::INFINITY)
}

/// Sum of decays after instants, number `n` until the instant `ends(n)`.
fn decays(scene: &Scene, instants: &[(f64, f64)], tau_s: f64, ends: impl Fn(usize) -> f64) -> Vec<f64> {
    let clock = scene.clock_s();
    let mut sum = vec![0.0; clock.len()];
    for (n, (instant, amplitude)) in instants.iter().enumerate() {
        let end = ends(n);
        let first = clock.partition_point(|t| t + HALF_WINDOW_S <= *instant);
        let last = clock.partition_point(|t| t - HALF_WINDOW_S < end.min(instant + 12.0 * tau_s)).max(first);
        let pulse = decay(&clock[first..last], *instant, tau_s);
        // What goes at its end: the same decay continued after it.
        let gone = if end.is_finite() { decay(&clock[first..last], end, tau_s) } else { vec![0.0; last - first] };
        let left = if end.is_finite() { (-(end - instant) / tau_s).exp() } else { 0.0 };
        for ((total, p), g) in sum[first..last].iter_mut().zip(pulse).zip(gone) {
            *total += amplitude * (p - left * g);
        }
    }
    sum
}

pub(super) fn terminator(c: &mut Collector) {
    let s = c.scene;
    let all = terminators(s);
    let only = |sign: f64| all.iter().filter(|x| x.1 == sign).map(|x| (x.0, 1.0)).collect::<Vec<_>>();
    let place = "after the edges of the shadow";
    for tau in [60.0, 150.0, 300.0, 600.0, 1200.0, 2400.0] {
        let both: Vec<(f64, f64)> = all.iter().map(|x| (x.0, 1.0)).collect();
        for (what, list) in [
            ("every terminator crossing", both),
            ("every terminator crossing, signed", all.clone()),
            ("sunrise", only(1.0)),
            ("sunset", only(-1.0)),
        ] {
            c.windows(format!("exp(-(time since {what})/{tau:.0} s)"), "shadow", place, since(s, &list, tau));
        }
    }
}

/// Whether no more than one of the instants can be seen in the record, at which something begins and dies away within `tau_s`. What begins
/// once is the catalogue's own leak or step, whatever the log says of the instant.
fn begins_once(s: &Scene, instants: &[(f64, f64)], tau_s: f64) -> bool {
    let [start, end] = s.span_s();
    instants.iter().filter(|(t, _)| *t < end && t + 3.0 * tau_s > start).count() <= 1
}

pub(super) fn events(c: &mut Collector) {
    let s = c.scene;
    for kind in s.case.kinds_tried() {
        let spans = s.case.spans(kind);
        let mut starts: Vec<(f64, f64)> = spans.iter().map(|x| (x[0], 1.0)).collect();
        starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut ends: Vec<(f64, f64)> = spans.iter().map(|x| (x[1], 1.0)).collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        for tau in EVENT_TAUS_S {
            for (what, list) in
                [("start", &starts), ("end", &ends)].iter().filter(|(_, list)| !begins_once(s, list, tau))
            {
                c.windows(
                    format!("exp(-(time since {what} of {kind})/{tau:.0} s)"),
                    "time_since_event",
                    "after logged events",
                    since(s, list, tau),
                );
            }
        }
        for lag in [120.0, 300.0, 900.0, 2700.0] {
            let late: Vec<[f64; 2]> = spans.iter().map(|x| [x[0] + lag, x[1] + lag]).collect();
            c.windows(
                format!("{kind}, {lag:.0} s late"),
                "time_since_event",
                "after logged events",
                coverage(s.clock_s(), &late),
            );
        }
        c.family("time_since_event", "after logged events", after_both_ends(s, kind, &spans));
        c.family("time_since_event", "while logged events last", close_ones(s, kind, &spans));
        c.family("time_since_event", "while logged events last", alternating(s, kind, &spans));
        echoes(c, kind, &ends);
        for (what, list) in [("start", &starts), ("end", &ends)] {
            c.family("time_since_event", "between logged events", ramps(s, kind, what, list));
        }
        if !begins_once(s, &starts, 0.0) {
            let so_far = |t: &f64| starts.partition_point(|x| x.0 <= *t) as f64;
            let count = s.clock_s().iter().map(so_far).collect();
            c.windows(format!("number of {kind} so far"), "time_since_event", "after logged events", count);
        }
        if !LOGGED_KINDS.contains(&kind) {
            c.windows(
                format!("{kind} lasts"),
                "time_since_event",
                "during logged events",
                coverage(s.clock_s(), &union(spans)),
            );
        }
    }
    let ends: Vec<(f64, f64)> = manoeuvres(s).into_iter().filter(|x| x.1 < 0.0).map(|x| (x.0, 1.0)).collect();
    for tau in PAUSE_TAUS_S.into_iter().filter(|tau| !begins_once(s, &ends, *tau)) {
        c.windows(
            format!("exp(-(time since manoeuvre)/{tau:.0} s)"),
            "time_since_manoeuvre",
            "after manoeuvres",
            since(s, &ends, tau),
        );
    }
}

/// Whatever follows the attitude late, as what the Earth or the Sun warms.
pub(super) fn attitude(c: &mut Collector) {
    let s = c.scene;
    let all = 0..s.grid_s.len();
    let radial: Vec<Vec3> = all.clone().map(|g| s.body[g] * s.r_m[g].normalize()).collect();
    let sun: Vec<Vec3> = all.map(|g| s.body[g] * s.sun[g] * s.sunlit[g]).collect();
    for (what, covariate, direction) in [("r/|r|", "attitude", &radial), ("nu s", "sun_angle", &sun)] {
        let mut members = Vec::new();
        for tau_s in LATE_S {
            let mut late = direction.clone();
            // What warms may warm another, and that pushes.
            for after in ["relaxing", "relaxing twice"] {
                late = relaxing(&s.grid_s, &late, tau_s);
                let parts = [0, 1, 2].map(|k| s.measure_scalar(|g| late[g][k]));
                members.push((format!("x, y, z of {what} in the body, {after} in {tau_s:.0} s"), parts.to_vec()));
            }
        }
        c.several_family(covariate, "after changes of attitude", members);
    }
}

/// A push while an entry lasts that turns its sense from one entry to the next.
fn alternating(s: &Scene, kind: &str, spans: &[[f64; 2]]) -> Vec<(String, Vec<f64>)> {
    const ENOUGH: usize = 4;
    if spans.len() < ENOUGH {
        return Vec::new();
    }
    let signs = [1.0, -1.0].into_iter().cycle();
    let formula = format!("{kind} lasts, its sign changed from entry to entry");
    vec![(formula, weighted_coverage(s.clock_s(), spans.iter().copied().zip(signs)))]
}

/// What dies away after the start and after the end of every entry alike, or in the opposite sense: of entries that last longer than it
/// takes, since of others the one is not over when the other begins.
fn after_both_ends(s: &Scene, kind: &str, spans: &[[f64; 2]]) -> Vec<(String, Vec<f64>)> {
    let mut lengths_s: Vec<f64> = spans.iter().map(|[start, end]| end - start).collect();
    let usual_s = median(&mut lengths_s).unwrap_or(0.0);
    let mut members = Vec::new();
    for tau_s in EVENT_TAUS_S.into_iter().filter(|tau_s| *tau_s < usual_s) {
        for (sense, words) in [(1.0, ""), (-1.0, ", signed")] {
            let mut changes: Vec<(f64, f64)> = spans.iter().flat_map(|[a, b]| [(*a, 1.0), (*b, sense)]).collect();
            changes.sort_by(|a, b| a.0.total_cmp(&b.0));
            if !begins_once(s, &changes, tau_s) {
                let pushes = since(s, &changes, tau_s);
                members.push((format!("exp(-(time since start or end of {kind}{words})/{tau_s:.0} s)"), pushes));
            }
        }
    }
    members
}

/// A push while an entry lasts that is the less the longer ago the one before ended: a pump, a valve, a tank that need time.
fn close_ones(s: &Scene, kind: &str, spans: &[[f64; 2]]) -> Vec<(String, Vec<f64>)> {
    const ENOUGH: usize = 8;
    if spans.len() < ENOUGH {
        return Vec::new();
    }
    let push = |tau_s: f64| {
        let formula = format!("{kind} lasts, exp(-(pause before it)/{tau_s:.0} s)");
        (formula, weighted_coverage(s.clock_s(), spans.iter().copied().zip(still_warm(spans, tau_s))))
    };
    EVENT_TAUS_S.into_iter().map(push).collect()
}

/// A push some time after every entry of the log, that dies away, each beside those before: delays closer than the time it lasts, so
/// that none falls between. Of what is logged all the time the delay is anyone's guess, and the last push alone is looked at.
fn echoes(c: &mut Collector, kind: &str, ends: &[(f64, f64)]) {
    // Beyond, the pushes of a long delay overlap into one, and adding them up is what takes time.
    const OFTEN: usize = 200;
    let s = c.scene;
    let mut members = Vec::new();
    for (tau, step) in [(400.0, 300.0), (1000.0, 500.0), (2500.0, 1000.0)] {
        let step = if ends.len() > OFTEN { 2.0 * step } else { step };
        for delay in (1..).map(|i| step * f64::from(i)).take_while(|delay| *delay < 6100.0) {
            let late: Vec<(f64, f64)> = ends.iter().map(|x| (x.0 + delay, 1.0)).collect();
            if begins_once(s, &late, tau) {
                continue;
            }
            let pushes = if ends.len() > OFTEN { since(s, &late, tau) } else { added(s, &late, tau) };
            members.push((format!("exp(-(time since {delay:.0} s after {kind})/{tau:.0} s)"), pushes));
        }
    }
    c.family("time_since_event", "some time after logged events", members);
}

/// Time since the last of the entries. Of the one before the record nothing is logged: where the first entry comes late, it may have
/// been anywhere in the day before.
fn ramps(s: &Scene, kind: &str, what: &str, instants: &[(f64, f64)]) -> Vec<(String, Vec<f64>)> {
    const DAY_S: f64 = 86_400.0;
    const LATE_S: f64 = 3600.0;
    let Some(first) = instants.first().map(|x| x.0) else { return Vec::new() };
    let earliest = (first - s.span_s()[0]).max(0.0);
    let earlier: &[f64] = if earliest > LATE_S { &[1.0, 0.875, 0.75, 0.625, 0.5] } else { &[1.0] };
    earlier
        .iter()
        .filter(|days| **days == 1.0 || **days * DAY_S > earliest)
        .map(|days| {
            let unlogged =
                if *days < 1.0 { format!(", one {:.0} h before the first", 24.0 * days) } else { String::new() };
            (format!("time since {what} of {kind}{unlogged}"), ramp(s.clock_s(), instants, first - days * DAY_S))
        })
        .collect()
}

/// Time since the last of the instants, days, and since `before` ahead of the first.
fn ramp(clock_s: &[f64], instants: &[(f64, f64)], before: f64) -> Vec<f64> {
    let last = |t: f64| instants[..instants.partition_point(|x| x.0 <= t)].last().map_or(before, |x| x.0.max(before));
    clock_s.iter().map(|t| (t - last(*t)) / 86_400.0).collect()
}

pub(super) fn clock(c: &mut Collector) {
    let s = c.scene;
    let [start, end] = s.span_s();
    let t: Vec<f64> = s.clock_s().iter().map(|t| (t - start) / (end - start) * 2.0 - 1.0).collect();
    c.windows("t^2", "time", "the whole record, t from -1 to 1", t.iter().map(|x| x * x).collect());
    c.windows("t^3", "time", "the whole record, t from -1 to 1", t.iter().map(|x| x.powi(3)).collect());
    c.several(
        "t, t^2",
        "time",
        "the whole record, t from its first window",
        &[&|g| s.grid_s[g] - start, &|g| (s.grid_s[g] - start).powi(2)],
    );
    c.family("time", "from an instant of no log on", creeps(s));
    c.family("time", "the whole record, more and more", growths(s));
    c.family("time", "the whole record, less and less", hyperbolas(s));
    for hours in [6.0, 8.0, 12.0, 24.0, 48.0] {
        let rate = std::f64::consts::TAU / (hours * 3600.0);
        c.several(
            format!("sin, cos of a {hours:.0} h cycle"),
            "time",
            "a daily or shorter cycle",
            &[&|g| (rate * s.grid_s[g]).sin(), &|g| (rate * s.grid_s[g]).cos()],
        );
    }
    for near in lines((end - start) / s.period_s) {
        let sine_and_cosine = |cycles: &f64| {
            let rate = std::f64::consts::TAU * cycles / s.period_s;
            let (sines, cosines): (Vec<f64>, Vec<f64>) = s.grid_s.iter().map(|t| (rate * t).sin_cos()).unzip();
            let parts = [sines, cosines].map(|part| s.measure_scalar(|g| part[g]));
            (format!("sin, cos at {cycles:.3} cycles per orbit"), parts.to_vec())
        };
        c.several_family("per_orbit_line", "a line of the spectrum", near.iter().map(sine_and_cosine));
    }
}

/// Lines of the spectrum that are tried, in cycles per orbit, in a record of so many revolutions, those weighed together that are near to
/// each other: the slow ones, which slow noise would hide from a later look at what remains, every half cycle over the record from one
/// on, so that none falls between two.
fn lines(revolutions: f64) -> Vec<Vec<f64>> {
    const SLOW: usize = 64;
    const STEP: f64 = 0.05;
    let slow: Vec<f64> = (2..=SLOW).map(|i| 0.5 * i as f64 / revolutions).take_while(|cycles| *cycles <= 1.0).collect();
    let last = slow.last().copied().unwrap_or(0.0);
    let quick = (1..=40).map(|i| STEP * f64::from(i)).filter(|cycles| *cycles > last);
    let quick = quick.chain([2.5, 8.0, 12.0, 16.0]).map(|cycles| vec![cycles]);
    slow.chunks(2).map(<[f64]>::to_vec).chain(quick).collect()
}

/// What grows as fast as it is large.
fn growths(s: &Scene) -> Vec<(String, Vec<f64>)> {
    let [start, end] = s.span_s();
    let growth = |share: f64| {
        let tau_s = share * (end - start);
        let grown = s.clock_s().iter().map(|t| ((t - end) / tau_s).exp()).collect();
        (format!("exp((t - {end:.0} s)/{tau_s:.0} s)"), grown)
    };
    [0.05, 0.09, 0.16, 0.28, 0.5].map(growth).to_vec()
}

/// What falls from the beginning on slower than an exponential: 1/t, from some time before.
fn hyperbolas(s: &Scene) -> Vec<(String, Vec<f64>)> {
    let [start, end] = s.span_s();
    let hyperbola = |share: f64| {
        let before_s = share * (end - start);
        let fallen = s.clock_s().iter().map(|t| (1.0 + (t - start) / before_s).recip()).collect();
        (format!("1/(1 + (t - {start:.0} s)/{before_s:.0} s)"), fallen)
    };
    [0.02, 0.05, 0.12, 0.3].map(hyperbola).to_vec()
}

/// What creeps with the logarithm of time, as materials do under a load, from an instant of no log on.
fn creeps(s: &Scene) -> Vec<(String, Vec<f64>)> {
    const ONSETS: usize = 32;
    let [start, end] = s.span_s();
    let mut members = Vec::new();
    for i in 0..ONSETS {
        let onset_s = start + (end - start) * i as f64 / ONSETS as f64;
        for tau_s in [100.0, 1000.0, 10_000.0] {
            let creep = s.clock_s().iter().map(|t| ((t - onset_s).max(0.0) / tau_s).ln_1p()).collect();
            members.push((format!("log(1 + max(t - {onset_s:.0} s, 0)/{tau_s:.0} s)"), creep));
        }
    }
    members
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_slow_line_falls_between_two_that_are_tried_whatever_the_length_of_the_record() {
        for revolutions in [4.0, 16.0, 24.0, 31.8] {
            let tried = lines(revolutions).concat();
            assert!(tried.windows(2).all(|w| w[1] > w[0]), "{tried:?}");
            // In cycles over the record: a quarter away, a line keeps nine tenths of its amplitude.
            let mut cycles = 1.0;
            while cycles < revolutions {
                let away = tried.iter().map(|line| (line * revolutions - cycles).abs()).fold(f64::INFINITY, f64::min);
                assert!(away <= 0.26, "{cycles} cycles in {revolutions} revolutions: {away}");
                cycles += 0.01;
            }
        }
        // Weeks are searched as coarsely as the quick lines.
        assert!(lines(300.0).concat().len() < 120);
    }
}
