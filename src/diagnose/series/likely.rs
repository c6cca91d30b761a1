//! The likeliest instants, delays, pushes and oscillations of a series, each tried in one noise: those few that are worth being weighed with
//! a noise of their own. Not here: whether they are claimed (see `search`).

use super::follow::{Follows, equation};
use super::read::{Axis, Series};
use super::red::{self, Beat, Noise};
use super::search::{candidates, design, golden, plain};
use crate::diagnose::earlier::REACH_S;

/// The likeliest instants of a step that are weighed in full.
const STEPS: usize = 3;
/// Part of the record at either end in which nothing is taken to begin or end: of that too little is seen.
const EDGE: usize = 40;
/// The longest delay tried, as a part of the record: of what is later still too little is left to be predicted.
const DELAY_MAX: f64 = 0.2;
/// Places between which a push for a while is looked for, and how many of such, and of oscillations, are weighed in full.
const EDGES: usize = 24;
const IN_TIME: usize = 3;

/// The instants at which a step is likeliest, each moment between two blocks tried in the noise that the model has without
/// one.
pub(super) fn likely_steps(series: &Series, axis: &Axis, model: &[Follows], beat: &Beat) -> Vec<Follows> {
    let without = in_noise_about(series, axis, model, beat);
    let steps = instants(series).map(Follows::Step);
    likeliest(steps.map(|step| (step, without(&[model, &[step]].concat()))), STEPS)
}

/// Between two blocks, not near the ends: what begins or ends there is a step, or none.
fn instants(series: &Series) -> impl Iterator<Item = f64> {
    let n = series.t_s.len();
    let margin = (n / EDGE).max(2);
    (margin..n - margin).map(|i| 0.5 * (series.t_s[i - 1] + series.t_s[i]))
}

/// The likeliest delays of every temperature, each multiple of a beat tried: in the noise that the model has without one, and in that which it
/// has with the likeliest of those, or with the likeliest response in a time constant. Without, what follows late is taken for slow noise,
/// beside which one delay is hardly likelier than another.
pub(super) fn likely_delays(series: &Series, axis: &Axis, model: &[Follows], beat: &Beat) -> Vec<Follows> {
    let with = |follows: &Follows| [model, &[*follows]].concat();
    let longest = (DELAY_MAX * series.t_s.len() as f64).min(REACH_S / series.beat_s()) as usize;
    let without = in_noise_about(series, axis, model, beat);
    let temperatures = series.covariates.iter().enumerate().filter(|(_, covariate)| covariate.is_temperature());
    let of_one = |(k, _)| {
        let delays = (1..=longest).map(move |beats| Follows::Delayed(k, beats as f64 * series.beat_s()));
        let constants = candidates(series, axis);
        let constants = constants.iter().filter(|c| matches!(c, Follows::Temperature(of, _) if *of == k));
        let first = likeliest(delays.clone().map(|delay| (delay, without(&with(&delay)))), 1);
        let relaxing = likeliest(constants.map(|constant| (*constant, without(&with(constant)))), 1);
        let again = first.iter().chain(&relaxing).flat_map(|found| {
            let in_noise = in_noise_about(series, axis, &with(found), beat);
            likeliest(delays.clone().map(|delay| (delay, in_noise(&with(&delay)))), 1)
        });
        let again: Vec<Follows> = again.collect();
        [first, again].concat()
    };
    temperatures.flat_map(of_one).collect()
}

/// Twice the log likelihood of a model in the noise that the axis has about another.
fn in_noise_about<'a>(
    series: &'a Series,
    axis: &'a Axis,
    about: &[Follows],
    beat: &'a Beat,
) -> impl Fn(&[Follows]) -> f64 + 'a {
    let known = equation(series, axis, about);
    in_noise(series, axis, red::best(&known.values, &design(series, &known), beat).0, beat)
}

/// Twice the log likelihood of a model in a noise.
fn in_noise<'a>(series: &'a Series, axis: &'a Axis, noise: Noise, beat: &'a Beat) -> impl Fn(&[Follows]) -> f64 + 'a {
    move |model| {
        let equation = equation(series, axis, model);
        red::in_noise(&equation.values, &design(series, &equation), beat, noise)
    }
}

/// The likeliest of some, best first, so many of them.
fn likeliest(tried: impl Iterator<Item = (Follows, f64)>, count: usize) -> Vec<Follows> {
    let mut all: Vec<(Follows, f64)> = tried.collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    all.into_iter().take(count).map(|(follows, _)| follows).collect()
}

/// The likeliest pushes for a while: their ends some of a grid over the record, then at their best between those beside. In the noise that
/// the model has without one and in a quiet one, and once more in that which it has with the likeliest: without, a push is taken for slow noise.
pub(super) fn likely_pulses(series: &Series, axis: &Axis, model: &[Follows], beat: &Beat) -> Vec<Follows> {
    let (t_s, n) = (&series.t_s, series.t_s.len());
    if n <= 2 * EDGES {
        return Vec::new();
    }
    let spacing_s = (t_s[n - 1] - t_s[0]) / EDGES as f64;
    let all: Vec<f64> = instants(series).collect();
    let edges: Vec<f64> = (0..=EDGES).map(|i| all[i * (all.len() - 1) / EDGES]).collect();
    let near = |at: f64| all.iter().copied().filter(move |t| (t - at).abs() <= spacing_s);
    let found_in = |in_noise: &dyn Fn(&[Follows]) -> f64| {
        let weighed = |pulse: Follows| (pulse, in_noise(&[model, &[pulse]].concat()));
        let pairs = edges.iter().enumerate().flat_map(|(i, from)| edges[i + 1..].iter().map(move |to| (*from, *to)));
        let coarse = likeliest(pairs.map(|(from, to)| weighed(Follows::Pulse(from, to - from))), IN_TIME);
        let finer = |mut at: Follows| {
            for end in [true, false, true, false] {
                let Follows::Pulse(from, length) = at else { break };
                let moved =
                    |t: f64| if end { Follows::Pulse(from, t - from) } else { Follows::Pulse(t, from + length - t) };
                let ends = near(if end { from + length } else { from }).map(|t| weighed(moved(t)));
                at = likeliest(ends, 1).first().copied().unwrap_or(at);
            }
            at
        };
        likeliest(coarse.into_iter().map(|pulse| weighed(finer(pulse))), IN_TIME)
    };
    let without = found_in(&in_noise_about(series, axis, model, beat));
    let quiet = found_in(&in_noise(series, axis, Noise::QUIET, beat));
    let again = [&without, &quiet].into_iter().filter_map(|found| found.first()).flat_map(|first| {
        let about = [model, &[*first]].concat();
        found_in(&in_noise_about(series, axis, &about, beat))
    });
    let again: Vec<Follows> = again.collect();
    [again, without, quiet].concat()
}

/// The likeliest oscillations, but for those of a day, which a temperature has.
pub(super) fn likely_lines(series: &Series, axis: &Axis, model: &[Follows], beat: &Beat) -> Vec<Follows> {
    let in_noise = in_noise_about(series, axis, model, beat);
    let (t_s, n) = (&series.t_s, series.t_s.len());
    let span_s = t_s[n - 1] - t_s[0];
    let days = span_s / 86_400.0;
    let apart = |cycles: &f64| (1..=2).all(|k| (cycles - f64::from(k) * days).abs() > 1.0);
    let cycles = (4..).map(|i| 0.5 * f64::from(i)).take_while(|cycles| *cycles < n as f64 / 4.0).filter(apart);
    let line = |cycles: f64| {
        let both = [0.0, 0.25].map(|turn| Follows::Line(span_s / cycles, turn * std::f64::consts::TAU));
        let with = [model, &both].concat();
        let fit = plain(series, axis, &with);
        let [sine, cosine] = [fit[model.len()], fit[model.len() + 1]];
        (Follows::Line(span_s / cycles, cosine.atan2(sine)), in_noise(&with))
    };
    let finer = |follows: Follows| {
        let Follows::Line(period_s, _) = follows else { return follows };
        let cycles = span_s / period_s;
        line(golden(cycles - 0.5, cycles + 0.5, 16, &mut |cycles| line(cycles).1)).0
    };
    likeliest(cycles.map(line), IN_TIME).into_iter().map(finer).collect()
}
