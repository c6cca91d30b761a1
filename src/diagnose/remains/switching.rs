//! Does the residual switch between two levels, where slow noise would wander?
//!
//! A push that goes on and off at instants of no log (a valve that sticks, an instrument of two states) has the spectrum of slow
//! noise; what tells them apart is that the levels are two. A hidden Markov chain of two states, its levels and rates fitted by
//! expectation and maximisation (Baum et al. 1970), against slow noise at its best, both on bins of the residual. The ratio of a
//! likelihood that is charged for its free numbers (Schwarz 1978) to the best likelihood of noise exceeds x in at most one record of
//! noise in x (Wasserman et al. 2020).

use super::{Remains, sharing};
use crate::diagnose::noise::{BIN_S, Binned};
use crate::math::shared_work;

/// Fewest switches: one or two are a step or a push, and the catalogue has those.
const SWITCHES_MIN: f64 = 4.0;
/// Slow noise compared with: amplitudes, ng, and correlation times, s.
const SLOW_NG: [f64; 12] = [0.5, 1.0, 2.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0];
const SLOW_TAU_S: [f64; 6] = [300.0, 700.0, 1500.0, 3000.0, 6500.0, 14_000.0];
/// Rounds of the fit: of the axis that begins, and of the axes it is carried on to.
const ROUNDS: [usize; 2] = [25, 10];
/// Log evidence of the axis that begins above which it is carried on to others.
const WORTH_MORE_AXES: f64 = -10.0;
/// A state lasts between one bin and a third of them.
const LEAVES: [f64; 2] = [0.01, 0.5];
/// Bins over which a residual is smoothed to begin with.
const SMOOTH: [usize; 2] = [1, 4];

/// The axes that may switch together.
const AXES: [&[usize]; 7] = [&[0], &[1], &[2], &[0, 1], &[0, 2], &[1, 2], &[0, 1, 2]];

/// Log evidence above slow noise, axes, and the chain.
type Switching = (f64, &'static [usize], Chain);

/// Whether it switches.
pub(super) fn switching(binned: &[Binned; 3]) -> Option<Remains> {
    let bins = (0..binned[0].mean_ng.len()).filter(|i| binned.iter().all(|b| b.variance_ng2[*i].is_finite())).count();
    if bins < 30 {
        return None;
    }
    let wanders: [f64; 3] = std::array::from_fn(|k| likeliest_slow_noise(&binned[k]));
    // What a chain of so many axes says above slow noise, charged for its free numbers.
    let above = |chain: &Chain, axes: &[usize]| {
        let noise: f64 = axes.iter().map(|k| wanders[*k]).sum();
        chain.log_likelihood - noise - 0.5 * (2.0 + axes.len() as f64) * (bins as f64).ln()
    };
    let begins: Vec<(usize, usize)> = (0..3).flat_map(|axis| SMOOTH.map(|smooth| (axis, smooth))).collect();
    let from = |(begin, smooth): &(usize, usize)| -> Option<Switching> {
        let alone = Chain::fitted(&[&binned[*begin]], Chain::begin(&binned[*begin], *smooth)?, ROUNDS[0])?;
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
    let (above, axes, chain) = found.reduce(|best, next| if next.0 > best.0 { next } else { best })?;
    let mut push_ng = [0.0; 3];
    axes.iter().zip(&chain.levels).for_each(|(k, [down, up])| push_ng[*k] = up - down);
    let [on_s, off_s] = chain.leaves.map(|p| BIN_S / p);
    Some(Remains {
        probability: (AXES.len() as f64 * (-above).exp()).min(1.0),
        energy: chain.energy(axes, binned),
        form: "s(t) d, d fixed in the body, s(t) now 0 and now 1".into(),
        axis: format!("d = [{:.1}, {:.1}, {:.1}] ng", push_ng[0], push_ng[1], push_ng[2]),
        axes: sharing(push_ng),
        location: format!(
            "two levels, about {:.0} switches at instants of no log; {on_s:.0} s of one and {off_s:.0} s of the other on the average",
            chain.switches
        ),
    })
}

/// The best log likelihood of slow noise.
fn likeliest_slow_noise(binned: &Binned) -> f64 {
    let of = |slow_ng: &f64| SLOW_TAU_S.map(|tau_s| binned.log_likelihood_of_slow_noise(*slow_ng, tau_s));
    SLOW_NG.iter().flat_map(of).fold(f64::NEG_INFINITY, f64::max)
}

/// A chain of two states that several series share.
struct Chain {
    /// Probability of being up, per bin.
    up: Vec<f64>,
    /// Levels down and up of each series, ng.
    levels: Vec<[f64; 2]>,
    /// Probability per bin to leave up, and to leave down.
    leaves: [f64; 2],
    log_likelihood: f64,
    switches: f64,
}

impl Chain {
    /// Up where the smoothed series is above its mean.
    fn begin(series: &Binned, smooth: usize) -> Option<Vec<f64>> {
        let weight: Vec<f64> = series.variance_ng2.iter().map(|v| 1.0 / v).collect();
        let mean_of = |range: std::ops::Range<usize>| {
            let (sum, all) = range.fold((0.0, 0.0), |(s, w), i| (s + weight[i] * series.mean_ng[i], w + weight[i]));
            if all > 0.0 { sum / all } else { f64::NAN }
        };
        let n = weight.len();
        let middle = mean_of(0..n);
        let up: Vec<f64> = (0..n)
            .map(|i| match mean_of(i.saturating_sub(smooth)..(i + smooth + 1).min(n)) {
                x if x.is_nan() => 0.5,
                x => f64::from(x > middle),
            })
            .collect();
        middle.is_finite().then_some(up)
    }

    /// Levels and rates, by expectation and maximisation from a first guess of when it is up.
    fn fitted(series: &[&Binned], up: Vec<f64>, rounds: usize) -> Option<Self> {
        let mut chain = Self { up, levels: Vec::new(), leaves: [0.1; 2], log_likelihood: 0.0, switches: 0.0 };
        for _ in 0..rounds {
            chain.levels = series.iter().map(|s| levels(s, &chain.up)).collect::<Option<Vec<[f64; 2]>>>()?;
            chain.expect(series);
        }
        chain.log_likelihood.is_finite().then_some(chain)
    }

    /// Where it is at these levels and rates, its likelihood, and the rates that this makes likeliest.
    fn expect(&mut self, series: &[&Binned]) {
        let n = self.up.len();
        let log_density = |i: usize, state: usize| -> f64 {
            let each = series.iter().zip(&self.levels).filter(|(s, _)| s.variance_ng2[i].is_finite());
            each.map(|(s, l)| -0.5 * (s.mean_ng[i] - l[state]).powi(2) / s.variance_ng2[i]).sum()
        };
        let [leave_up, leave_down] = self.leaves;
        let next =
            |p: [f64; 2]| [p[0] * (1.0 - leave_down) + p[1] * leave_up, p[0] * leave_down + p[1] * (1.0 - leave_up)];
        let mut densities = Vec::with_capacity(n);
        let mut forward: Vec<[f64; 2]> = Vec::with_capacity(n);
        let finite = |s: &&Binned| s.variance_ng2.iter().filter(|v| v.is_finite()).map(|v| v.ln()).sum::<f64>();
        let mut log_likelihood = -0.5 * series.iter().map(finite).sum::<f64>();
        let mut p = [leave_up / (leave_up + leave_down), leave_down / (leave_up + leave_down)];
        for i in 0..n {
            let logs = [log_density(i, 0), log_density(i, 1)];
            let top = logs[0].max(logs[1]);
            let density = logs.map(|l| (l - top).exp());
            let joint = [p[0] * density[0], p[1] * density[1]];
            let sum = joint[0] + joint[1];
            log_likelihood += top + sum.ln();
            forward.push(joint.map(|x| x / sum));
            densities.push(density);
            p = next(forward[i]);
        }
        let mut backward = [1.0; 2];
        let (mut stays, mut left) = ([0.0; 2], [0.0; 2]);
        for i in (0..n).rev() {
            let both = [forward[i][0] * backward[0], forward[i][1] * backward[1]];
            self.up[i] = both[1] / (both[0] + both[1]);
            if i == 0 {
                break;
            }
            let ahead = [densities[i][0] * backward[0], densities[i][1] * backward[1]];
            let moves = [
                [forward[i - 1][0] * (1.0 - leave_down) * ahead[0], forward[i - 1][0] * leave_down * ahead[1]],
                [forward[i - 1][1] * leave_up * ahead[0], forward[i - 1][1] * (1.0 - leave_up) * ahead[1]],
            ];
            let all: f64 = moves.iter().flatten().sum();
            stays[0] += moves[0][0] / all;
            left[0] += moves[0][1] / all;
            left[1] += moves[1][0] / all;
            stays[1] += moves[1][1] / all;
            backward = [
                (1.0 - leave_down) * ahead[0] + leave_down * ahead[1],
                leave_up * ahead[0] + (1.0 - leave_up) * ahead[1],
            ];
            let scale = backward[0] + backward[1];
            backward = backward.map(|x| x / scale);
        }
        let rate = |state: usize| (left[state] / (left[state] + stays[state]).max(1e-12)).clamp(LEAVES[0], LEAVES[1]);
        self.leaves = [rate(1), rate(0)];
        self.switches = left[0] + left[1];
        self.log_likelihood = log_likelihood;
    }

    /// Square of the signal-to-noise ratio of what switches, its mean taken away.
    fn energy(&self, axes: &[usize], binned: &[Binned; 3]) -> f64 {
        let of_axis = |(k, [down, up]): (&usize, &[f64; 2])| {
            let weight = |i: usize| 1.0 / binned[*k].variance_ng2[i];
            let n = self.up.len();
            let all: f64 = (0..n).map(weight).sum();
            let mean = (0..n).map(|i| weight(i) * self.up[i]).sum::<f64>() / all;
            (0..n).map(|i| weight(i) * (self.up[i] - mean).powi(2)).sum::<f64>() * (up - down).powi(2)
        };
        axes.iter().zip(&self.levels).map(of_axis).sum()
    }
}

/// Levels down and up that make a series likeliest, `None` where it is only ever one of them.
fn levels(series: &Binned, up: &[f64]) -> Option<[f64; 2]> {
    let mut sums = [[0.0; 2]; 2];
    for ((mean, variance), up) in series.mean_ng.iter().zip(&series.variance_ng2).zip(up) {
        for (sum, share) in sums.iter_mut().zip([1.0 - up, *up]) {
            sum[0] += share * mean / variance;
            sum[1] += share / variance;
        }
    }
    sums.iter().all(|s| s[1] > 0.0).then(|| sums.map(|[x, w]| x / w))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::{AxisNoise, Loudness, Schedule, simulate};
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};

    const NOISE: AxisNoise =
        AxisNoise { white_ng: 60.0, short_ng: 10.0, short_tau_s: 100.0, slow_ng: 0.0, slow_tau_s: 3000.0 };

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
        let found = switching(&record(1, 0.0, 80.0)).unwrap();
        assert!(found.probability < 1e-6 && found.axes == ["y"], "{found:?}");
        let size: f64 = found.axis.split(", ").nth(1).and_then(|x| x.parse().ok()).unwrap();
        assert!((size.abs() - 80.0).abs() < 8.0, "{found:?}");
        // Forty records of slow noise: a probability below a thousandth has one chance in twenty-five among them.
        for seed in 0..40 {
            let probability = switching(&record(seed, 15.0, 0.0)).map_or(1.0, |r| r.probability);
            assert!(probability > 1e-3, "{seed}: {probability}");
        }
    }
}
