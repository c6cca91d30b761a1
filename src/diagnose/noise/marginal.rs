//! The slow part of the noise, marginalised: what a residual gains by slow noise, and what it costs to have chosen it.

use std::iter::successors;

use super::likelihood::{Products, Series, products};
use super::{AxisNoise, Loudness, Schedule};
use crate::math::shared_work;

/// Amplitudes, ng, and correlation times, s, of the slow part over which it is marginalised: each about the middle of its share of
/// an axis of logarithms.
pub(super) const SLOW_AMPLITUDES_NG: [f64; 12] = [0.35, 0.7, 1.4, 2.8, 5.6, 8.0, 11.2, 16.0, 22.4, 32.0, 45.0, 64.0];
pub(super) const SLOW_TIMES_S: [f64; 6] = [300.0, 615.0, 1260.0, 2570.0, 5270.0, 10_800.0];
/// Times beyond them.
const BEYOND_S: [f64; 2] = [146.0, 22_100.0];
/// Louder slow noise than this, ng, has amplitudes and times about its own, which are known better than by a step of these.
const LOUD_NG: f64 = 45.0;
/// Those amplitudes reach so many times beyond that fitted, by steps of the root of two.
const REACH: f64 = 3.0;
/// Amplitudes reach down to this share of the white noise: less cannot be told from none.
const UNSEEN: f64 = 0.02;
/// The trial of hardly any slow noise: the smallest amplitude, of a time in the middle.
const LEAST: usize = 4;
/// Noises weighed side by side.
const LANES: usize = 4;

/// Amplitudes over which the slow part of a noise is marginalised, ng: most noises need no others than those above.
pub(super) fn amplitudes_ng(fitted: &AxisNoise) -> Vec<f64> {
    let step = std::f64::consts::SQRT_2;
    let [least, most] = [SLOW_AMPLITUDES_NG[0], SLOW_AMPLITUDES_NG[SLOW_AMPLITUDES_NG.len() - 1]];
    let below = successors(Some(least / step), |a| Some(a / step)).take_while(|a| *a > UNSEEN * fitted.white_ng);
    let mut all: Vec<f64> = below.collect();
    all.reverse();
    all.extend(SLOW_AMPLITUDES_NG);
    if fitted.slow_ng > LOUD_NG {
        all.extend(successors(Some(most * step), |a| Some(a * step)).take_while(|a| *a < REACH * fitted.slow_ng));
        through(&mut all, fitted.slow_ng);
    }
    all
}

/// Its correlation times, s: with that beyond the shortest or the longest where the fitted one is nearer to it.
pub(super) fn times_s(fitted: &AxisNoise) -> Vec<f64> {
    let mut all = SLOW_TIMES_S.to_vec();
    let [shorter, longer] = BEYOND_S;
    if fitted.slow_tau_s < (shorter * SLOW_TIMES_S[0]).sqrt() {
        all.push(shorter);
    }
    if fitted.slow_tau_s > (longer * SLOW_TIMES_S[SLOW_TIMES_S.len() - 1]).sqrt() {
        all.push(longer);
    }
    if fitted.slow_ng > LOUD_NG {
        through(&mut all, fitted.slow_tau_s);
    }
    all
}

/// What each amplitude stands for on the axis of logarithms: what lies half way to those beside it.
pub(super) fn widths(amplitudes_ng: &[f64]) -> Vec<f64> {
    let last = amplitudes_ng.len() - 1;
    let width = |a: usize| 0.5 * (amplitudes_ng[(a + 1).min(last)] / amplitudes_ng[a.saturating_sub(1)]).ln();
    (0..=last).map(width).collect()
}

/// Moves values by the ratio that puts the nearest of them at another.
fn through(values: &mut [f64], at: f64) {
    let ratios = values.iter().map(|value| at / value);
    let ratio = ratios.min_by(|a, b| a.ln().abs().total_cmp(&b.ln().abs())).unwrap_or(1.0);
    values.iter_mut().for_each(|value| *value *= ratio);
}

/// The slow part of the noise of all axes, marginalised.
#[derive(Debug, Clone, Copy)]
pub struct SlowPart {
    /// Log likelihood above that at the noise given.
    pub above_fit: f64,
    /// Log likelihood above that of hardly any slow noise: how much it is needed.
    pub above_none: f64,
}

/// The restricted likelihood of residuals, every slow part marginalised over its amplitude and correlation time: their logarithms are
/// as likely everywhere in the range.
///
/// A residual that needs slow noise of one amplitude has it at the price of having chosen it; one that needs none may have
/// any that is small. Without that price slow noise takes what a slow effect made.
pub fn slow_part_marginalised(
    noise: &[AxisNoise; 3],
    residual_ng: &[Vec<f64>; 3],
    schedule: &Schedule,
    loudness: &[Loudness; 3],
) -> SlowPart {
    // The fitted noise of an axis, then those that share the amplitudes and times.
    let mut trials: Vec<(usize, AxisNoise, f64)> = Vec::new();
    let mut first = [0; 4];
    for (k, noise) in noise.iter().enumerate() {
        trials.push((k, *noise, f64::NAN));
        let (amplitudes_ng, times_s) = (amplitudes_ng(noise), times_s(noise));
        for (slow_ng, share) in amplitudes_ng.iter().zip(widths(&amplitudes_ng)) {
            trials.extend(
                times_s.iter().map(|tau_s| (k, AxisNoise { slow_ng: *slow_ng, slow_tau_s: *tau_s, ..*noise }, share)),
            );
        }
        first[k + 1] = trials.len();
    }
    // Noises that need other amplitudes and times have them at the same density.
    let whole = (SLOW_AMPLITUDES_NG[11] / SLOW_AMPLITUDES_NG[0]).ln() * SLOW_TIMES_S.len() as f64;
    let groups: Vec<&[(usize, AxisNoise, f64)]> = trials.chunks(LANES).collect();
    let weighed = |group: &&[(usize, AxisNoise, f64)]| {
        let lane: [&(usize, AxisNoise, f64); LANES] = std::array::from_fn(|l| &group[l.min(group.len() - 1)]);
        let series = lane.map(|t| Series { data: &residual_ng[t.0], shared: &schedule.shared_ng[t.0] });
        let found = products(&lane.map(|t| t.1), schedule, lane.map(|t| &loudness[t.0]), series);
        let likelihood = |products: &Products| products.log_likelihood(1.0);
        found.iter().take(group.len()).map(likelihood).collect::<Vec<f64>>()
    };
    let likelihoods: Vec<f64> = shared_work::map(&groups, weighed).into_iter().flatten().collect();
    let mut all = SlowPart { above_fit: 0.0, above_none: 0.0 };
    for axis in first.windows(2).map(|ends| ends[0]..ends[1]) {
        let (trials, likelihoods) = (&trials[axis.clone()], &likelihoods[axis]);
        let at_fit = likelihoods[0];
        let weighed = trials[1..].iter().zip(&likelihoods[1..]).map(|(t, l)| t.2 / whole * (l - at_fit).exp());
        let above_fit = weighed.sum::<f64>().max(1e-300).ln();
        all.above_fit += above_fit;
        all.above_none += above_fit + at_fit - likelihoods[LEAST];
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// A residual without slow noise may have any that is small: many amplitudes do as well as none. One with slow noise needs
    /// about that which it has.
    #[test]
    fn slow_noise_that_is_needed_costs_more_than_slow_noise_that_is_not() {
        let schedule = Schedule::new(&(0..3000).map(|i| 25.0 * f64::from(i)).collect::<Vec<f64>>());
        let loudness = std::array::from_fn(|_| Loudness::even(vec![1.0; schedule.len()]));
        let noise = |slow_ng| AxisNoise {
            white_ng: 60.0,
            short_ng: 10.0,
            short_tau_s: 100.0,
            slow_ng,
            slow_tau_s: 3000.0,
            resonance: None,
        };
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut marginal = |made: f64, fitted: f64| {
            let residual = std::array::from_fn(|_| {
                simulate(&noise(made), &schedule, &loudness[0], || StandardNormal.sample(&mut rng))
            });
            slow_part_marginalised(&[noise(fitted); 3], &residual, &schedule, &loudness).above_fit
        };
        let (none, loud) = (marginal(0.0, 1.0), marginal(30.0, 30.0));
        // A third of the amplitudes, each axis: at least ln 1/4 a piece; of thirty nanograms a few cells of seventy-two.
        assert!(none > 3.0 * 0.25_f64.ln() && loud < none - 2.0, "{none} {loud}");
    }

    /// Slow noise of any size has amplitudes and times about it: one cell of seventy-two or so costs 4.3 an axis, and no more is paid.
    #[test]
    fn slow_noise_of_any_size_is_marginalised_over_its_own_amplitudes() {
        let schedule = Schedule::new(&(0..3000).map(|i| 25.0 * f64::from(i)).collect::<Vec<f64>>());
        let loudness = std::array::from_fn(|_| Loudness::even(vec![1.0; schedule.len()]));
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for scale in [0.02_f64, 1.0, 8.0, 40.0] {
            let noise = AxisNoise {
                white_ng: 60.0 * scale.min(1.0),
                short_ng: 10.0 * scale.min(1.0),
                short_tau_s: 100.0,
                slow_ng: 30.0 * scale,
                slow_tau_s: 3000.0,
                resonance: None,
            };
            let residual =
                std::array::from_fn(|_| simulate(&noise, &schedule, &loudness[0], || StandardNormal.sample(&mut rng)));
            let slow = slow_part_marginalised(&[noise; 3], &residual, &schedule, &loudness);
            assert!((-14.0..0.0).contains(&slow.above_fit) && slow.above_none > 10.0, "{scale}: {slow:?}");
        }
    }
}
