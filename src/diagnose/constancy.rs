//! Whether the sizes of a finding are the same throughout the record: a catalogue effect has constant ones. One whose size follows the
//! time, the crew, the attitude, the Sun or the number of the log's entry is something else that looks like it.
//!
//! The fitted series of every member is tried times each of what it might follow, one coefficient each, beside the set.

use super::case::HALF_WINDOW_S;
use super::catalogue::{LOGGED_PUSHES, Shape};
use super::design::{Chosen, Column, Frame, Raw};
use super::instants::still_warm;
use super::measure::{coverage, union};
use super::scene::{Axes, Scene};
use super::search::{Entry, Set};

/// Prior size of a relative change, one standard deviation of what it follows.
const SIZE: f64 = 0.5;
/// Log prior odds that the size of a member follows anything at all.
const LOG_PRIOR: f64 = -4.0;
/// Times in which a push recovers from the one before, s: a factor of five apart, between which a decay is much the same.
const PAUSES_S: [f64; 2] = [300.0, 1500.0];

/// A member whose size follows something.
#[derive(Debug, Clone, PartialEq)]
pub struct Follows {
    /// Number of the member in its set.
    pub member: usize,
    /// What its size follows, in words.
    pub what: String,
    /// By how much of its size it changes for one standard deviation of that.
    pub change: f64,
    /// Standard error of `change`.
    pub sigma: f64,
    /// Log posterior odds against the same size throughout.
    pub log_odds: f64,
}

/// What a size might follow, at the windows.
struct Covariate {
    what: String,
    series: Vec<f64>,
    /// The kind of entry whose pushes alone it can change.
    of_kind: Option<&'static str>,
}

/// The member of a set, at its noise, whose size follows something most plainly; none where all are as likely to be the same throughout.
pub fn follows_most(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set) -> Option<Follows> {
    let covariates = covariates(scene);
    let chosen = set.chosen(frame);
    let contributions = set.contributions(scene, frame, entries);
    let of_member = |(member, series): (usize, &Axes)| {
        let effect = entries[set.members[member].entry].effect()?;
        if set.members[member].linear() == 0 {
            return None;
        }
        let kind = LOGGED_PUSHES.iter().find(|(id, _)| *id == effect.id).map(|(_, kind)| *kind);
        let tried = covariates.iter().filter(|c| c.of_kind.is_none() || c.of_kind == kind);
        let (tried, changed): (Vec<&Covariate>, Vec<Raw>) =
            tried.filter_map(|c| Some((c, changed(series, c)?))).unzip();
        let sizes = vec![SIZE; changed.len()];
        let columns = frame.columns(&Shape::Columns(changed).on_axes(&sizes, 1.0));
        let found: Vec<Follows> =
            tried.iter().zip(columns).map(|(c, column)| of_one(&chosen, member, c, column)).collect();
        let best = found.iter().max_by(|a, b| a.log_odds.total_cmp(&b.log_odds))?.clone();
        let sum: f64 = found.iter().map(|f| (f.log_odds - best.log_odds).exp()).sum();
        Some(Follows { log_odds: best.log_odds + (sum / found.len() as f64).ln() + LOG_PRIOR, ..best })
    };
    contributions.iter().enumerate().filter_map(of_member).max_by(|a, b| a.log_odds.total_cmp(&b.log_odds))
}

/// The series of a member times a covariate; none where that hardly changes.
fn changed(series: &Axes, c: &Covariate) -> Option<Raw> {
    let relative = about_itself(series, &c.series)?;
    Some(series.each_ref().map(|axis| Some(axis.iter().zip(&relative).map(|(x, r)| x * r).collect())))
}

/// One covariate for one member: `log_odds` are the evidence alone.
fn of_one(chosen: &Chosen, member: usize, c: &Covariate, column: Column) -> Follows {
    let normal = chosen.normal(&[column]);
    let (mean, covariance) = normal.posterior();
    Follows {
        member,
        what: c.what.clone(),
        change: SIZE * mean[0],
        sigma: SIZE * covariance[(0, 0)].max(0.0).sqrt(),
        log_odds: normal.gain(1.0),
    }
}

/// A covariate about its mean where the series of a member is, over its deviation there; none where it hardly changes.
fn about_itself(series: &Axes, covariate: &[f64]) -> Option<Vec<f64>> {
    let weight: Vec<f64> = (0..covariate.len()).map(|i| series.iter().map(|axis| axis[i] * axis[i]).sum()).collect();
    let total: f64 = weight.iter().sum();
    let of = |f: &dyn Fn(f64) -> f64| weight.iter().zip(covariate).map(|(w, x)| w * f(*x)).sum::<f64>() / total;
    let mean = of(&|x| x);
    let deviation = of(&|x| (x - mean).powi(2)).sqrt();
    let largest = covariate.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    (deviation > 1e-6 * largest && deviation.is_finite())
        .then(|| covariate.iter().map(|x| (x - mean) / deviation).collect())
}

fn covariates(s: &Scene) -> Vec<Covariate> {
    let clock_s = s.clock_s();
    let [start, end] = s.span_s();
    let mut all = Vec::new();
    let mut add = |what: &str, series: Vec<f64>| all.push(Covariate { what: what.into(), series, of_kind: None });
    let time: Vec<f64> = clock_s.iter().map(|t| 2.0 * (t - start) / (end - start) - 1.0).collect();
    add("the time squared, from the middle of the record", time.iter().map(|t| t * t).collect());
    add("the time", time);
    add("the crew's sleep", coverage(clock_s, &union(s.case.spans("crew_sleep"))));
    add("the sunlight", s.measure_scalar(|g| s.sunlit[g]));
    add("the sensor temperature", s.measure_scalar(|g| s.temperature_c[g]));
    add("the density", s.measure_scalar(|g| s.case.ancillary.density_kg_m3[g]));
    add("the body rate", s.measure_scalar(|g| s.w_rad_s[g].norm()));
    add("the geomagnetic field", s.measure_scalar(|g| s.field_body_t[g].norm()));
    let size = |g: usize| s.simulated_grid_ng.iter().map(|axis| axis[g] * axis[g]).sum::<f64>().sqrt();
    add("the size of the modelled signal", s.measure_scalar(size));
    let (u, noon) = s.orbit_angles_rad();
    for (name, angle) in [("the argument of latitude", &u), ("the angle from orbital noon", &noon)] {
        add(&format!("the sine of {name}"), s.measure_scalar(|g| angle[g].sin()));
        add(&format!("the cosine of {name}"), s.measure_scalar(|g| angle[g].cos()));
    }
    for k in 0..3 {
        let axis = ["x", "y", "z"][k];
        add(&format!("the flight direction's {axis}"), s.measure_scalar(|g| (s.body[g] * s.v_m_s[g].normalize())[k]));
        add(&format!("the local vertical's {axis}"), s.measure_scalar(|g| (s.body[g] * s.r_m[g].normalize())[k]));
        add(&format!("the Sun's {axis}"), s.measure_scalar(|g| (s.body[g] * s.sun[g])[k]));
    }
    for (_, kind) in LOGGED_PUSHES {
        of_entries(s, kind, &mut all);
    }
    all
}

/// What one push of a kind may have more or less of than the next: whether its number is even, and how long the pause before it was.
fn of_entries(s: &Scene, kind: &'static str, all: &mut Vec<Covariate>) {
    let spans = s.case.spans(kind);
    if spans.len() < 2 {
        return;
    }
    let at_windows = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let last = |t: &f64| spans.partition_point(|span| span[0] <= t + HALF_WINDOW_S).saturating_sub(1);
        s.clock_s().iter().map(|t| of(last(t))).collect()
    };
    let mut add = |what: String, series| all.push(Covariate { what, series, of_kind: Some(kind) });
    add(format!("whether the number of the {kind} is even"), at_windows(&|n| f64::from(u8::from(n % 2 == 0))));
    for pause_s in PAUSES_S {
        let warm = still_warm(&spans, pause_s);
        add(format!("the pause before the {kind}"), at_windows(&|n| warm[n]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_covariate_is_taken_about_its_mean_where_the_member_is() {
        let series: Axes = [vec![0.0, 0.0, 3.0, 3.0], vec![0.0; 4], vec![0.0, 0.0, 4.0, 4.0]];
        assert_eq!(about_itself(&series, &[9.0, 9.0, 1.0, 3.0]).unwrap(), [7.0, 7.0, -1.0, 1.0]);
        assert_eq!(about_itself(&series, &[0.0, 1.0, 2.0, 2.0]), None);
    }
}
