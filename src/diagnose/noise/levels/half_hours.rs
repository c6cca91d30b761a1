//! Levels from half hour to half hour that no deviation and no log has: what the windows alone show.

use super::{Contradicted, Shown, bends, median};
use crate::diagnose::noise::{Loudness, Schedule};

/// Standard deviations of chi square from which on half hours differ.
const UNEVEN: f64 = 8.0;
/// Length of a stretch with a level of its own, s.
const STRETCH_S: f64 = 1800.0;

/// The half hour of a window.
fn half_hour(schedule: &Schedule, i: usize) -> usize {
    ((schedule.clock_s[i] - schedule.clock_s[0]) / STRETCH_S) as usize
}

/// How loud every half hour is beside the middle one, over how loud it is said to be: a logarithm, and its standard error.
fn of_half_hours(residual_ng: &[f64], schedule: &Schedule, said: &Loudness) -> Vec<Option<(f64, f64)>> {
    let all = bends(residual_ng, schedule, said);
    let Some((middle, _)) = median(all.iter().map(|(_, bend)| *bend)) else { return Vec::new() };
    let mut of_half_hours: Vec<Vec<f64>> = vec![Vec::new(); half_hour(schedule, schedule.len() - 1) + 1];
    all.iter().for_each(|(i, bend)| of_half_hours[half_hour(schedule, *i)].push(*bend));
    let level = |bends: Vec<f64>| median(bends.into_iter()).map(|(size, error)| ((size / middle).ln(), error));
    of_half_hours.into_iter().map(level).collect()
}

/// Whether half hours differ beyond what is said.
pub(super) fn are_uneven(residual_ng: &[f64], schedule: &Schedule, said: &Loudness) -> bool {
    let beyond = of_half_hours(residual_ng, schedule, said);
    let n = beyond.iter().flatten().count() as f64;
    let chi2: f64 = beyond.iter().flatten().map(|(x, error)| (x / error).powi(2)).sum();
    chi2 > n + UNEVEN * (2.0 * n).sqrt()
}

/// Levels of half hours, whatever the crew does: as far as they are known, each moved towards the middle one by its error (James and
/// Stein 1961). The noise changes at some instant inside one of them, so that each is as loud as
/// the louder of itself and those beside it. A level for each is bought by a likelihood that is higher by their number.
pub(super) fn by_half_hours(residual_ng: &[f64], schedule: &Schedule) -> Option<Shown> {
    let levels = of_half_hours(residual_ng, schedule, &Loudness::even(vec![1.0; schedule.len()]));
    let level = |i: usize| {
        let near = levels[i.saturating_sub(1)..(i + 2).min(levels.len())].iter().flatten();
        let moved = near.map(|(x, error)| if x.abs() > *error { x - error * error / x } else { 0.0 });
        moved.reduce(f64::max).unwrap_or(0.0).exp()
    };
    let n = levels.iter().flatten().count() as f64;
    if n < 2.0 {
        return None;
    }
    let levels: Vec<f64> = (0..levels.len()).map(level).collect();
    let [quietest, loudest] = [f64::min, f64::max].map(|which| levels.iter().copied().reduce(which).unwrap_or(1.0));
    let raw: Vec<f64> = (0..schedule.len()).map(|i| levels[half_hour(schedule, i)]).collect();
    Some((Loudness::of_levels(&raw), Contradicted::HalfHours { quietest, loudest }, n))
}
