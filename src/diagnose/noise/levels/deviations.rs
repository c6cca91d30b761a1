//! Levels of stretches that the deviations inside the windows set apart, whatever the crew does.

use super::changes::changes;
use super::{Contradicted, Shown, bends, median};
use crate::diagnose::noise::{Loudness, Schedule};

/// Standard deviation of the logarithm of how loud a stretch is about what its deviations say.
const OF_DEVIATIONS: f64 = 0.15;

/// Stretches that are louder or quieter by their deviations than the crew's sleep says, the same for all axes, by their first windows;
/// none without deviations.
pub(super) fn stretches(dev_ng: [&[f64]; 3], sleeps: &[bool]) -> Vec<usize> {
    if dev_ng.iter().any(|dev| dev.iter().any(|dev| *dev <= 0.0)) {
        return vec![0];
    }
    let logarithm = |i: usize| dev_ng.iter().map(|dev| dev[i].ln()).sum::<f64>() / 3.0;
    let all: Vec<f64> = (0..sleeps.len()).map(logarithm).collect();
    let middle = |state: bool| {
        let mut of_state: Vec<f64> = all.iter().zip(sleeps).filter(|(_, s)| **s == state).map(|(x, _)| *x).collect();
        let middle = of_state.len() / 2;
        if of_state.is_empty() { 0.0 } else { *of_state.select_nth_unstable_by(middle, f64::total_cmp).1 }
    };
    let middles = [middle(false), middle(true)];
    let beyond: Vec<f64> = all.iter().zip(sleeps).map(|(x, sleeps)| x - middles[usize::from(*sleeps)]).collect();
    changes(&beyond)
}

/// Levels of such stretches beside what is said: what their deviations say, moved towards what their windows show by the errors of
/// both. Windows at an edge are as loud as the louder side.
pub(super) fn by_deviations(
    dev_ng: &[f64],
    residual_ng: &[f64],
    schedule: &Schedule,
    said: &Loudness,
    begins: &[usize],
) -> Shown {
    let n = schedule.len();
    let stretch = |i: usize| begins.partition_point(|begin| *begin <= i) - 1;
    let mut bends_of: Vec<Vec<f64>> = vec![Vec::new(); begins.len()];
    bends(residual_ng, schedule, said).into_iter().for_each(|(i, bend)| bends_of[stretch(i)].push(bend));
    let shown: Vec<Option<(f64, f64)>> =
        bends_of.into_iter().map(|bends| median(bends.into_iter()).map(|(size, error)| (size.ln(), error))).collect();
    let ends = begins[1..].iter().copied().chain([n]);
    let mean = |(begin, end): (&usize, usize)| {
        (*begin..end).map(|i| (dev_ng[i] / said.activity[i]).ln()).sum::<f64>() / (end - begin) as f64
    };
    let of_dev: Vec<f64> = begins.iter().zip(ends).map(mean).collect();
    // How much more a bend is than a deviation: the mean over the stretches, each by its error.
    let (mut sum, mut weights) = (0.0, 0.0);
    for (dev, (size, error)) in of_dev.iter().zip(&shown).filter_map(|(dev, shown)| Some((dev, shown.as_ref()?))) {
        let weight = (error * error + OF_DEVIATIONS * OF_DEVIATIONS).recip();
        sum += weight * (size - dev);
        weights += weight;
    }
    let more = if weights > 0.0 { sum / weights } else { 0.0 };
    let both = |(dev, shown): (&f64, &Option<(f64, f64)>)| match shown {
        Some((size, error)) => {
            let [of_dev, of_windows] = [OF_DEVIATIONS, *error].map(|error| (error * error).recip());
            ((dev + more) * of_dev + size * of_windows) / (of_dev + of_windows)
        }
        None => dev + more,
    };
    let levels: Vec<f64> = of_dev.iter().zip(&shown).map(both).collect();
    let near = |i: usize| [i.saturating_sub(1), i, (i + 1).min(n - 1)].map(|i| levels[stretch(i)]);
    let louder = |i: usize| near(i).into_iter().fold(f64::NEG_INFINITY, f64::max).exp();
    let raw: Vec<f64> = (0..n).map(|i| said.activity[i] * louder(i)).collect();
    let mut sorted = levels.clone();
    sorted.sort_by(f64::total_cmp);
    let [quietest, loudest] = [0, sorted.len() - 1].map(|i| (sorted[i] - sorted[sorted.len() / 2]).exp());
    // Where the stretches are the windows did not choose, and of how loud they are they chose a part.
    (Loudness::of_levels(&raw), Contradicted::Deviations { quietest, loudest }, begins.len() as f64)
}
