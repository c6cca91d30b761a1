//! Levels awake and asleep.

use super::{Contradicted, FEWEST, Shown, bends, median};
use crate::diagnose::noise::{Loudness, Schedule};

/// Standard errors from which on the windows contradict the deviations.
const CONTRADICTED: f64 = 4.0;

/// Levels awake and asleep that the average deviations say; the same where they cannot.
pub(super) fn said(dev_ng: &[f64], sleeps: &[bool]) -> [f64; 2] {
    let mean = |state: bool| {
        let of_state = dev_ng.iter().zip(sleeps).filter(|(_, sleeps)| **sleeps == state);
        let (sum, n) = of_state.fold((0.0, 0usize), |(s, n), (d, _)| (s + d, n + 1));
        (n >= FEWEST && sum > 0.0).then(|| sum / n as f64)
    };
    match (mean(false), mean(true)) {
        (Some(awake), Some(asleep)) => [awake, asleep],
        _ => [1.0, 1.0],
    }
}

/// The levels awake and asleep, where the windows contradict those said.
pub(super) fn by_crew(residual_ng: &[f64], schedule: &Schedule, said: &Loudness, sleeps: &[bool]) -> Option<Shown> {
    let all = bends(residual_ng, schedule, said);
    let of = |state: bool| median(all.iter().filter(|(i, _)| sleeps[*i] == state).map(|(_, bend)| *bend));
    let ((awake, e), (asleep, f)) = (of(false)?, of(true)?);
    let level = |state: bool| sleeps.iter().position(|s| *s == state).map_or(1.0, |i| said.activity[i]);
    let was = level(false) / level(true);
    let now = was * awake / asleep;
    let differ = (now / was).ln().abs() > CONTRADICTED * e.hypot(f);
    differ.then(|| (Loudness::of_crew([now, 1.0], sleeps), Contradicted::Crew { said: was, shown: now }, 0.0))
}
