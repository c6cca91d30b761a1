//! How loud an axis is while the crew is awake, and while it sleeps.
//!
//! The average deviations inside the windows say so, but what is quick need not be in proportion to what a window's mean keeps. So it
//! is a claim, and tested on the steps from window to window; where they contradict it, the likelier of both is taken, and told.

use super::{Loudness, Schedule, fit_and_likelihoods};

/// Fewest windows asleep, and awake, for the two to be told apart.
const FEWEST: usize = 30;
/// Standard errors from which on the steps contradict the deviations.
const CONTRADICTED: f64 = 4.0;
/// Evaluations of the fits that are compared.
const EVALUATIONS: usize = 110;
/// Longest step that counts: windows further apart differ by more than the quick noise.
const STEP_MAX_S: f64 = 60.0;
/// Relative standard error of a median of the magnitudes of n normal numbers, times the root of n; of n steps half are counted as
/// independent.
const OF_A_MEDIAN: f64 = 1.166 * std::f64::consts::SQRT_2;

/// What the deviations say of an axis, and its windows contradict: how many times as loud it is awake as asleep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contradicted {
    /// By the deviations.
    pub said: f64,
    /// By the steps from window to window.
    pub shown: f64,
}

/// Levels awake and asleep that the average deviations say; the same where they cannot.
fn said(dev_ng: &[f64], sleeps: &[bool]) -> [f64; 2] {
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

/// How many times as large the steps of a residual are awake as asleep, and the relative standard error of that.
fn shown(residual_ng: &[f64], schedule: &Schedule, sleeps: &[bool]) -> Option<(f64, f64)> {
    let median = |state: bool| {
        let steps = (1..schedule.len())
            .filter(|i| schedule.step_s[*i] <= STEP_MAX_S && sleeps[*i] == state && sleeps[i - 1] == state);
        let mut sizes: Vec<f64> = steps.map(|i| (residual_ng[i] - residual_ng[i - 1]).abs()).collect();
        let (n, middle) = (sizes.len(), sizes.len() / 2);
        let size = (n >= FEWEST).then(|| *sizes.select_nth_unstable_by(middle, f64::total_cmp).1)?;
        (size > 0.0).then_some((size, n as f64))
    };
    let ((awake, n), (asleep, m)) = (median(false)?, median(true)?);
    Some((awake / asleep, OF_A_MEDIAN * (n.recip() + m.recip()).sqrt()))
}

/// How loud the windows of three axes are, from deviations, sleep and residual; and where the windows contradict the deviations.
pub fn settled(
    dev_ng: [&[f64]; 3],
    sleeps: &[bool],
    residual_ng: [&[f64]; 3],
    schedule: &Schedule,
) -> ([Loudness; 3], [Option<Contradicted>; 3]) {
    let levels = dev_ng.map(|dev| said(dev, sleeps));
    let as_said = levels.map(|levels| Loudness::of_crew(levels, sleeps));
    let contradicted: [Option<Contradicted>; 3] = std::array::from_fn(|k| {
        let said = levels[k][0] / levels[k][1];
        let (shown, error) = shown(residual_ng[k], schedule, sleeps)?;
        ((shown / said).ln().abs() > CONTRADICTED * error).then_some(Contradicted { said, shown })
    });
    if contradicted.iter().all(Option::is_none) {
        return (as_said, contradicted);
    }
    let as_shown: [Loudness; 3] = std::array::from_fn(|k| {
        contradicted[k].map_or(as_said[k].clone(), |c| Loudness::of_crew([c.shown, 1.0], sleeps))
    });
    let shared = schedule.shared_ng.each_ref().map(|errors| &errors[..]);
    let likelihoods = |loudness: &[Loudness; 3]| {
        fit_and_likelihoods(residual_ng, shared, schedule, loudness.each_ref(), None, EVALUATIONS).map(|(_, l)| l)
    };
    let (by_said, by_shown) = (likelihoods(&as_said), likelihoods(&as_shown));
    let better: [bool; 3] = std::array::from_fn(|k| by_shown[k] > by_said[k]);
    let axes: [_; 3] = std::array::from_fn(|k| {
        if better[k] { (as_shown[k].clone(), contradicted[k]) } else { (as_said[k].clone(), None) }
    });
    let contradicted = axes.each_ref().map(|axis| axis.1);
    (axes.map(|axis| axis.0), contradicted)
}

#[cfg(test)]
mod tests {
    use super::super::{AxisNoise, simulate};
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// A day and a half at 25 s with two nights, the deviations saying 1.7 to 1, and noise that is `ratio` to 1.
    fn record(seed: u64, noise: &AxisNoise, ratio: f64) -> ([Loudness; 3], [Option<Contradicted>; 3]) {
        let schedule =
            Schedule::new(&(0..5200).filter(|i| i % 400 > 30).map(|i| 25.0 * f64::from(i)).collect::<Vec<f64>>());
        let sleeps: Vec<bool> = schedule.clock_s.iter().map(|t| t % 86_400.0 < 28_800.0).collect();
        let dev_ng: Vec<f64> = sleeps.iter().map(|sleeps| if *sleeps { 200.0 } else { 340.0 }).collect();
        let true_loudness = Loudness::of_crew([ratio, 1.0], &sleeps);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let residual: [Vec<f64>; 3] =
            std::array::from_fn(|_| simulate(noise, &schedule, &true_loudness, || StandardNormal.sample(&mut rng)));
        settled([&dev_ng; 3], &sleeps, residual.each_ref().map(|x| &x[..]), &schedule)
    }

    const WHITE: AxisNoise =
        AxisNoise { white_ng: 60.0, short_ng: 10.0, short_tau_s: 100.0, slow_ng: 2.0, slow_tau_s: 3000.0 };

    #[test]
    fn deviations_that_say_what_the_windows_show_are_believed() {
        // Slow noise is as loud asleep as awake, and makes the steps more alike than the quick noise is.
        let slow = AxisNoise { slow_ng: 120.0, slow_tau_s: 400.0, ..WHITE };
        for seed in 0..20 {
            for noise in [WHITE, slow] {
                let (loudness, contradicted) = record(seed, &noise, 1.7);
                assert_eq!(contradicted, [None; 3], "{seed} {noise:?}");
                let [quietest, loudest] = [f64::min, f64::max]
                    .map(|which| loudness[0].activity.iter().copied().reduce(which).unwrap_or_default());
                assert!((loudest / quietest - 1.7).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn deviations_that_the_windows_contradict_are_not() {
        let red = AxisNoise { white_ng: 5.0, short_ng: 80.0, short_tau_s: 110.0, slow_ng: 1.0, slow_tau_s: 3000.0 };
        for (seed, noise) in [(1, WHITE), (2, red), (3, red)] {
            for ratio in [1.0, 3.0] {
                for contradicted in record(seed, &noise, ratio).1 {
                    let found = contradicted.unwrap_or_else(|| panic!("{seed} {ratio} {noise:?}"));
                    assert!((found.said - 1.7).abs() < 1e-9 && (found.shown / ratio).ln().abs() < 0.15, "{found:?}");
                }
            }
        }
    }
}
