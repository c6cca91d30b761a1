//! Does the residual switch between two levels, where slow noise would wander?
//!
//! A push that goes on and off at instants of no log (a valve that sticks, an instrument of two states) has the spectrum of slow
//! noise; what tells them apart is that the levels are two, and that the axes switch together. A hidden Markov chain of two states at
//! its best against slow noise at its best, independent from axis to axis, both on bins of the residual. The ratio of the likelihood
//! of a mixture to the best likelihood of noise exceeds x in at most one record of noise in x (Wasserman et al. 2020); the best chain is
//! likelier than the mixture by what its amplitudes, times and axes were chosen for. How much that is has been counted (see [`CHOSEN`]);
//! the fall of the bound is kept.

use super::chain::Chain;
use super::{Remains, sharing};
use crate::diagnose::answer::Interval;
use crate::diagnose::noise::{AxisNoise, BIN_S, Binned};
use crate::math::shared_work;

/// Fewest switches: one or two are a step or a push, and the catalogue has those.
const SWITCHES_MIN: usize = 4;
/// Rounds of the fit: of the axis that begins, and of the axes it is carried on to.
const ROUNDS: [usize; 2] = [25, 10];
/// Fewest bins, a little over three hours: fewer have no room for the fewest switches.
const BINS_MIN: usize = 30;
/// Log likelihood of the axis that begins, above slow noise, from which on it is carried on to others.
const WORTH_MORE_AXES: f64 = -1.5;
/// Bins over which a residual is smoothed to begin with.
const SMOOTH: [usize; 2] = [1, 4];

/// How many times oftener noise has a chain that is likelier by some ratio than the bound of a single chain allows: one to four times
/// in 22,000 records of slow noise of 2.5 to 45 ng and 5 min to 3 h, at log ratios of 3 to 11; a test counts.
const CHOSEN: f64 = 5.0;

/// The axes that may switch together.
const AXES: [&[usize]; 7] = [&[0], &[1], &[2], &[0, 1], &[0, 2], &[1, 2], &[0, 1, 2]];

/// Log likelihood above slow noise, axes, and the chain.
type Switching = (f64, &'static [usize], Chain);

/// Whether it switches.
pub(super) fn switching(binned: &[Binned; 3], noise: &[AxisNoise; 3], begins_s: f64) -> Option<Remains> {
    let bins = (0..binned[0].mean_ng.len()).filter(|i| binned.iter().all(|b| b.variance_ng2[*i].is_finite())).count();
    if bins < BINS_MIN {
        return None;
    }
    let wanders: [f64; 3] = std::array::from_fn(|k| binned[k].likeliest_slow_noise(&noise[k]));
    let above = |chain: &Chain, axes: &[usize]| chain.log_likelihood - axes.iter().map(|k| wanders[*k]).sum::<f64>();
    let begins: Vec<(usize, usize)> = (0..3).flat_map(|axis| SMOOTH.map(|smooth| (axis, smooth))).collect();
    let from = |(begin, smooth): &(usize, usize)| -> Option<Switching> {
        let alone = Chain::fitted(&[&binned[*begin]], Chain::first_guess(&binned[*begin], *smooth)?, ROUNDS[0])?;
        if above(&alone, &[*begin]) < WORTH_MORE_AXES {
            return None;
        }
        let carried = AXES.into_iter().filter(|axes| axes.contains(begin)).filter_map(|axes| {
            let series: Vec<&Binned> = axes.iter().map(|k| &binned[*k]).collect();
            let chain = Chain::fitted(&series, alone.up.clone(), ROUNDS[1])?;
            (chain.switches >= SWITCHES_MIN).then(|| (above(&chain, axes), axes, chain))
        });
        carried.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let found = shared_work::map(&begins, from).into_iter().flatten();
    let (ratio, axes, chain) = found.reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    let mut push_ng = [0.0; 3];
    axes.iter().zip(&chain.levels).for_each(|(k, [down, up])| push_ng[*k] = up - down);
    let [off_s, on_s] = chain.leaves.map(|p| BIN_S / p);
    Some(Remains {
        probability: (CHOSEN * (-ratio).exp()).min(1.0),
        energy: 2.0 * ratio,
        form: "s(t) d, d fixed in the body, s(t) now 0 and now 1".into(),
        axis: format!("d = [{:.1}, {:.1}, {:.1}] ng", push_ng[0], push_ng[1], push_ng[2]),
        axes: sharing(push_ng),
        location: format!(
            "two levels, {} switches; on the average {on_s:.0} s at s = 1 and {off_s:.0} s at s = 0",
            chain.switches
        ),
        intervals: intervals_up(&chain.up, begins_s),
        period_s: None,
    })
}

/// When it is more likely up than down.
fn intervals_up(up: &[f64], begins_s: f64) -> Vec<Interval> {
    let mut intervals: Vec<Interval> = Vec::new();
    for (i, _) in up.iter().enumerate().filter(|(_, up)| **up > 0.5) {
        let [start_s, end_s] = [i, i + 1].map(|bin| begins_s + bin as f64 * BIN_S);
        match intervals.last_mut() {
            Some(last) if last.end_s == start_s => last.end_s = end_s,
            _ => intervals.push(Interval { start_s, end_s, why: "the upper level".into() }),
        }
    }
    intervals
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::{Loudness, Schedule, simulate};
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};

    const NOISE: AxisNoise = AxisNoise {
        white_ng: 60.0,
        short_ng: 10.0,
        short_tau_s: 100.0,
        slow_ng: 0.0,
        slow_tau_s: 3000.0,
        resonance: None,
    };

    /// A record of 36 h, with slow noise or a push along y that switches.
    fn record(seed: u64, slow_ng: f64, push_ng: f64) -> [Binned; 3] {
        let schedule =
            Schedule::new(&(0..5200).filter(|i| i % 400 > 30).map(|i| 25.0 * f64::from(i)).collect::<Vec<f64>>());
        let loudness = Loudness::even(vec![1.0; schedule.len()]);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let noise = AxisNoise { slow_ng, ..NOISE };
        let mut until_s = 0.0;
        let mut is_up = false;
        let up: Vec<bool> = schedule
            .clock_s
            .iter()
            .map(|t| {
                while *t > until_s {
                    is_up = !is_up;
                    until_s += 1500.0 + 7000.0 * rng.random::<f64>();
                }
                is_up
            })
            .collect();
        std::array::from_fn(|k| {
            let mut x = simulate(&noise, &schedule, &loudness, || StandardNormal.sample(&mut rng));
            if k == 1 {
                x.iter_mut().zip(&up).for_each(|(x, up)| *x += push_ng * f64::from(*up));
            }
            Binned::new(&x, &NOISE, &schedule, &loudness)
        })
    }

    #[test]
    fn a_push_that_switches_is_found_with_its_size_and_slow_noise_is_none() {
        let found = switching(&record(1, 0.0, 80.0), &[NOISE; 3], 0.0).unwrap();
        // Each level lasts 5,000 s in the mean.
        let up_s: f64 = found.intervals.iter().map(|up| up.end_s - up.start_s).sum();
        assert!(found.intervals.len() > 5 && (30_000.0..100_000.0).contains(&up_s), "{:?}", found.intervals);
        assert!(found.probability < 1e-6 && found.axes == ["y"], "{found:?}");
        let size: f64 = found.axis.split(", ").nth(1).and_then(|x| x.parse().ok()).unwrap();
        assert!((size.abs() - 80.0).abs() < 8.0, "{found:?}");
        // Forty records of slow noise: a probability below a hundred-thousandth has one chance in 2,500 among them.
        for seed in 0..40 {
            let probability = switching(&record(seed, 15.0, 0.0), &[NOISE; 3], 0.0).map_or(1.0, |r| r.probability);
            assert!(probability > 1e-5, "{seed}: {probability}");
        }
    }

    /// Records of 16, 48 and 120 h of slow noise of all sizes and times, on axes that are louder and quieter.
    #[test]
    #[cfg_attr(not(feature = "slow"), ignore = "slow")]
    fn slow_noise_is_as_improbable_as_a_chain_as_is_said() {
        for (windows, records) in [(2300, 4000), (6900, 4000), (17_000, 1000)] {
            let clock_s: Vec<f64> = (0..windows).filter(|i| i % 400 > 30).map(|i| 25.0 * f64::from(i)).collect();
            let (schedule, loudness) = (Schedule::new(&clock_s), Loudness::even(vec![1.0; clock_s.len()]));
            let of = |seed: u64| {
                let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
                let slow_tau_s = 300.0 * 36_f64.powf(rng.random());
                let loud = 5.0 + 25.0 * rng.random::<f64>();
                let noise: [AxisNoise; 3] = [120.0, 50.0, 70.0].map(|white_ng| {
                    let slow_ng = loud * (0.5 + rng.random::<f64>());
                    AxisNoise { white_ng, slow_ng, slow_tau_s, ..NOISE }
                });
                let binned = std::array::from_fn(|k| {
                    let x = simulate(&noise[k], &schedule, &loudness, || StandardNormal.sample(&mut rng));
                    Binned::new(&x, &noise[k], &schedule, &loudness)
                });
                switching(&binned, &noise, 0.0).map_or(1.0, |found| found.probability)
            };
            let all: Vec<f64> = (0..records).map(of).collect();
            for p in [0.3, 0.1, 0.03, 0.01, 3e-3] {
                let share = all.iter().filter(|x| **x <= p).count() as f64 / f64::from(records as u32);
                println!("{windows} windows: {share} of noise at a probability of {p}");
                assert!(share <= p, "{windows} windows: {share} of noise at a probability of {p}");
            }
        }
    }
}
