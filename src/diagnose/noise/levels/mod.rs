//! How loud an axis is while the crew is awake, while it sleeps, and from hour to hour.
//!
//! The average deviations inside the windows and the log of sleep say so, but what is quick need not be in proportion to what a
//! window's mean keeps, and who makes noise need not be in a log. So it is a claim, and tested on how the windows bend from one to the
//! next, in which nothing slow has a share; where they contradict it, the likelier of both is taken, and told.

mod changes;
mod crew;
mod deviations;
mod half_hours;

use super::{EVALUATIONS, Loudness, Schedule, fit_and_likelihoods};

/// Fewest windows asleep, awake, or of half an hour, for a level of their own.
const FEWEST: usize = 30;
/// Longest step that counts: windows further apart differ by more than the quick noise.
const STEP_MAX_S: f64 = 60.0;
/// Relative standard error of a median of the magnitudes of n normal numbers, times the root of n; of n bends half are counted as
/// independent.
const OF_A_MEDIAN: f64 = 1.166 * std::f64::consts::SQRT_2;

/// What is said of an axis by its log of sleep, and its deviations or its windows contradict.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Contradicted {
    /// How many times as loud it is awake as asleep.
    Crew {
        /// By the deviations.
        said: f64,
        /// By the windows.
        shown: f64,
    },
    /// Some stretches are louder than others whatever the crew does, by the deviations, and the windows agree.
    Deviations {
        /// The quietest, beside the middle one.
        quietest: f64,
        /// The loudest.
        loudest: f64,
    },
    /// Some half hours are louder than others, whatever the crew does.
    HalfHours {
        /// The quietest, beside the middle one.
        quietest: f64,
        /// The loudest.
        loudest: f64,
    },
}

impl Contradicted {
    /// The quietest and the loudest stretch by the deviations.
    pub fn of_deviations(self) -> Option<[f64; 2]> {
        match self {
            Self::Deviations { quietest, loudest } => Some([quietest, loudest]),
            _ => None,
        }
    }

    /// The quietest and the loudest half hour by the windows.
    pub fn of_half_hours(self) -> Option<[f64; 2]> {
        match self {
            Self::HalfHours { quietest, loudest } => Some([quietest, loudest]),
            _ => None,
        }
    }
}

/// How much a residual bends at its windows, over how loud they are said to be: the magnitudes, each with its window.
fn bends(residual_ng: &[f64], schedule: &Schedule, loudness: &Loudness) -> Vec<(usize, f64)> {
    let evenly = |i: &usize| {
        let [before, after] = [schedule.step_s[*i], schedule.step_s[i + 1]];
        before <= STEP_MAX_S && after <= STEP_MAX_S && (0.8..1.25).contains(&(after / before))
    };
    let bend = |i: usize| {
        let (at, [before, after]) = (residual_ng[i], [residual_ng[i - 1], residual_ng[i + 1]]);
        (i, ((after - at) - (at - before) * schedule.step_s[i + 1] / schedule.step_s[i]).abs() / loudness.activity[i])
    };
    (1..schedule.len().saturating_sub(1)).filter(evenly).map(bend).collect()
}

/// The median of some bends, and its relative standard error; none of too few.
fn median(bends: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let mut sizes: Vec<f64> = bends.collect();
    let (n, middle) = (sizes.len(), sizes.len() / 2);
    let size = (n >= FEWEST).then(|| *sizes.select_nth_unstable_by(middle, f64::total_cmp).1)?;
    (size > 0.0).then_some((size, OF_A_MEDIAN / (n as f64).sqrt()))
}

/// A level that the windows show against the one said, and by how much likelier its noise must be.
type Shown = (Loudness, Contradicted, f64);

/// How loud the windows of three axes are, from deviations, sleep and residual; and where the windows contradict that.
pub fn settled(
    dev_ng: [&[f64]; 3],
    sleeps: &[bool],
    residual_ng: [&[f64]; 3],
    schedule: &Schedule,
) -> ([Loudness; 3], [Option<Contradicted>; 3]) {
    let mut settled = dev_ng.map(|dev| (Loudness::of_crew(crew::said(dev, sleeps), sleeps), None));
    decide(&mut settled, residual_ng, schedule, |k, said| crew::by_crew(residual_ng[k], schedule, said, sleeps));
    if let Some(stretches) = deviations::stretches(dev_ng, sleeps) {
        decide(&mut settled, residual_ng, schedule, |k, said| {
            Some(deviations::by_deviations(&stretches, k, residual_ng[k], schedule, said))
        });
    }
    if (0..3).any(|k| half_hours::are_uneven(residual_ng[k], schedule, &settled[k].0)) {
        decide(&mut settled, residual_ng, schedule, |k, _| half_hours::by_half_hours(residual_ng[k], schedule));
    }
    let contradicted = settled.each_ref().map(|axis| axis.1);
    (settled.map(|axis| axis.0), contradicted)
}

/// Takes what the windows show where it makes the noise of an axis likelier than what was said, by more than its price; where it does of
/// one axis, what moves the vehicle moves the others too, and they have it for nothing.
fn decide(
    settled: &mut [(Loudness, Option<Contradicted>); 3],
    residual_ng: [&[f64]; 3],
    schedule: &Schedule,
    show: impl Fn(usize, &Loudness) -> Option<Shown>,
) {
    let shown: [Option<Shown>; 3] = std::array::from_fn(|k| show(k, &settled[k].0));
    if shown.iter().all(Option::is_none) {
        return;
    }
    let shared = schedule.shared_ng.each_ref().map(|errors| &errors[..]);
    let likelihoods = |loudness: [&Loudness; 3]| {
        fit_and_likelihoods(residual_ng, shared, schedule, loudness, None, EVALUATIONS).map(|(_, l)| l)
    };
    let before = likelihoods(settled.each_ref().map(|axis| &axis.0));
    let after = likelihoods(std::array::from_fn(|k| shown[k].as_ref().map_or(&settled[k].0, |shown| &shown.0)));
    let gains: [f64; 3] = std::array::from_fn(|k| after[k] - before[k]);
    let is_shown = shown.iter().zip(gains).any(|(shown, gain)| shown.as_ref().is_some_and(|(_, _, by)| gain > *by));
    for ((k, shown), gain) in shown.into_iter().enumerate().zip(gains) {
        if let Some((loudness, contradicted, _)) = shown
            && is_shown
            && gain > 0.0
        {
            settled[k] = (loudness, Some(contradicted));
        }
    }
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

    const WHITE: AxisNoise = AxisNoise {
        white_ng: 60.0,
        short_ng: 10.0,
        short_tau_s: 100.0,
        slow_ng: 2.0,
        slow_tau_s: 3000.0,
        resonance: None,
    };

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
        let red = AxisNoise {
            white_ng: 5.0,
            short_ng: 80.0,
            short_tau_s: 110.0,
            slow_ng: 1.0,
            slow_tau_s: 3000.0,
            resonance: None,
        };
        for (seed, noise) in [(1, WHITE), (2, red), (3, red)] {
            for ratio in [1.0, 3.0] {
                for contradicted in record(seed, &noise, ratio).1 {
                    let Some(Contradicted::Crew { said, shown }) = contradicted else {
                        panic!("{seed} {ratio} {noise:?}: {contradicted:?}")
                    };
                    assert!((said - 1.7).abs() < 1e-9 && (shown / ratio).ln().abs() < 0.15, "{said} {shown}");
                }
            }
        }
    }

    /// Four hours three times as loud that no log has, and noise whose level wanders: the levels are within a third of the true ones where
    /// these are even for an hour, and never lower by more.
    #[test]
    fn hours_that_no_log_has_are_as_loud_as_they_are() {
        let schedule = Schedule::new(&(0..5200).map(|i| 25.0 * f64::from(i)).collect::<Vec<f64>>());
        let loud = |t: f64| if (40_000.0..54_400.0).contains(&t) { 3.0 } else { 1.0 };
        let wandering = |t: f64| (0.6 * (t / 9000.0).sin()).exp();
        let levels: [&dyn Fn(f64) -> f64; 2] = [&loud, &wandering];
        for (seed, level) in levels.into_iter().enumerate() {
            let mut truth: Vec<f64> = schedule.clock_s.iter().map(|t| level(*t)).collect();
            let rms = (truth.iter().map(|x| x * x).sum::<f64>() / truth.len() as f64).sqrt();
            truth.iter_mut().for_each(|x| *x /= rms);
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed as u64);
            let noise = Loudness::even(truth.clone());
            let residual: [Vec<f64>; 3] =
                std::array::from_fn(|_| simulate(&WHITE, &schedule, &noise, || StandardNormal.sample(&mut rng)));
            let (never, dev_ng) = (vec![false; schedule.len()], vec![200.0; schedule.len()]);
            let (loudness, contradicted) =
                settled([&dev_ng; 3], &never, residual.each_ref().map(|x| &x[..]), &schedule);
            for (loudness, contradicted) in loudness.iter().zip(contradicted) {
                assert!(matches!(contradicted, Some(Contradicted::HalfHours { .. })), "{contradicted:?}");
                let middle = |x: &[f64]| x[1000];
                for i in (200..5000).step_by(100) {
                    let ratio = loudness.activity[i] / middle(&loudness.activity) * middle(&truth) / truth[i];
                    let even = truth[i - 150..i + 150].iter().all(|x| (x / truth[i] - 1.0).abs() < 0.01);
                    assert!(ratio > 0.6 && (!even || ratio < 1.67), "{seed} {i}: {ratio}");
                }
            }
        }
    }
}
