//! Flicker noise: slow noise of about the same power in every octave, to hours and days. No autoregression has it, and where a sensor
//! does, the slowest octaves, which an autoregression lacks, look like a step, a drift or a leak.
//!
//! Every hypothesis is weighed with the possibility that the slow noise of the sensor is such: a mixture of the two kinds, each
//! marginalised over its amplitude, on bins of what the hypothesis leaves. Where neither is needed, or the autoregression is
//! enough, the mixture changes nothing.

use nalgebra::{DMatrix, DVector};

use super::binned::{BIN_S, Binned, means};
use super::likelihood::Products;
use super::marginal::{amplitudes_ng, times_s, widths};
use super::{AxisNoise, Loudness, Schedule};
use crate::math::shared_work;

/// Autoregressions of these correlation times, s, and of equal power are flicker noise from ten minutes to two days: two octaves from
/// each to the next.
const TIMES_S: [f64; 5] = [600.0, 2400.0, 9600.0, 38_400.0, 153_600.0];
const KINDS: usize = TIMES_S.len();
/// Share of sensors whose slow noise is taken for flicker noise before anything is seen: nobody has counted them. At a tenth flicker noise
/// must show itself by odds of ten, and where it does not, evidence changes by a tenth.
const SHARE: f64 = 0.1;
/// Fewest bins: in less than three hours the slow octaves do not show.
const BINS_MIN: usize = 30;

/// Log likelihood that a residual gains where slow noise may be flicker noise on all axes, above slow noise that is an autoregression on
/// each.
pub fn where_it_may_be_flicker(
    noise: &[AxisNoise; 3],
    residual_ng: &[Vec<f64>; 3],
    schedule: &Schedule,
    loudness: &[Loudness; 3],
) -> f64 {
    let above = shared_work::map(&[0, 1, 2], |k| {
        flicker_above_autoregression(&noise[*k], &residual_ng[*k], schedule, &schedule.shared_ng[*k], &loudness[*k])
    });
    let above: f64 = above.into_iter().sum();
    (1.0 - SHARE + SHARE * above.exp().min(1e300)).ln()
}

/// The same of one axis, where it is flicker noise.
fn flicker_above_autoregression(
    noise: &AxisNoise,
    residual_ng: &[f64],
    schedule: &Schedule,
    shared_ng: &[Vec<f64>],
    loudness: &Loudness,
) -> f64 {
    let binned = Binned::new(residual_ng, noise, schedule, loudness);
    if binned.variance_ng2.iter().filter(|v| v.is_finite()).count() < BINS_MIN {
        return 0.0;
    }
    let shared: Vec<Vec<f64>> = shared_ng.iter().map(|error| means(error, schedule, loudness)).collect();
    let series = Series { binned: &binned, shared: &shared };
    let amplitudes_ng = amplitudes_ng(noise);
    let times_s = times_s(noise);
    let mut autoregressions = Vec::with_capacity(amplitudes_ng.len() * times_s.len());
    let mut flickers = Vec::with_capacity(amplitudes_ng.len());
    for (slow_ng, width) in amplitudes_ng.iter().zip(widths(&amplitudes_ng)) {
        // Both kinds are marginalised over the same amplitudes, so that what those stand for in all is not asked.
        let (variance, share) = (slow_ng * slow_ng, width.ln());
        let of_one = |tau_s: &f64| share - (times_s.len() as f64).ln() + series.log_likelihood([*tau_s], variance);
        autoregressions.extend(times_s.iter().map(of_one));
        flickers.push(share + series.log_likelihood(TIMES_S, variance / KINDS as f64));
    }
    log_sum(&flickers) - log_sum(&autoregressions)
}

/// Means of a residual, and of errors that all windows share.
struct Series<'a> {
    binned: &'a Binned,
    shared: &'a [Vec<f64>],
}

impl Series<'_> {
    /// Restricted log likelihood, but for its constant, of autoregressions of these times and of this variance each beside the quick
    /// noise.
    fn log_likelihood<const K: usize>(&self, times_s: [f64; K], variance: f64) -> f64 {
        let kinds = times_s.map(of_means);
        let columns = 2 + self.shared.len();
        let mut states = vec![[0.0; K]; columns];
        let mut p = [[0.0; K]; K];
        for (i, (share, _)) in kinds.iter().enumerate() {
            p[i][i] = share * variance;
        }
        let (mut log_det, mut count) = (0.0, 0.0);
        let mut sums = DMatrix::zeros(columns, columns);
        let mut innovations = DVector::zeros(columns);
        for (bin, (mean, quick)) in self.binned.mean_ng.iter().zip(&self.binned.variance_ng2).enumerate() {
            if quick.is_finite() {
                let along: [f64; K] = std::array::from_fn(|i| p[i].iter().sum());
                let total = along.iter().sum::<f64>() + quick;
                let values = [*mean, 1.0].into_iter().chain(self.shared.iter().map(|error| error[bin]));
                for ((innovation, value), state) in innovations.iter_mut().zip(values).zip(&mut states) {
                    *innovation = value - state.iter().sum::<f64>();
                    state.iter_mut().zip(along).for_each(|(x, along)| *x += along / total * *innovation);
                }
                for a in 0..columns {
                    for b in 0..=a {
                        sums[(a, b)] += innovations[a] * innovations[b] / total;
                    }
                }
                for i in 0..K {
                    for j in 0..K {
                        p[i][j] -= along[i] * along[j] / total;
                    }
                }
                log_det += total.ln();
                count += 1.0;
            }
            for i in 0..K {
                for j in 0..K {
                    p[i][j] *= kinds[i].1 * kinds[j].1;
                }
                p[i][i] += (1.0 - kinds[i].1 * kinds[i].1) * kinds[i].0 * variance;
            }
            for state in &mut states {
                state.iter_mut().zip(&kinds).for_each(|(x, (_, keep))| *x *= keep);
            }
        }
        let nuisance = columns - 1;
        let products = Products {
            log_det,
            count,
            energy: sums[(0, 0)],
            along: DVector::from_fn(nuisance, |j, _| sums[(j + 1, 0)]),
            nuisance: DMatrix::from_fn(nuisance, nuisance, |a, b| sums[(a.max(b) + 1, a.min(b) + 1)]),
        };
        products.log_likelihood(1.0)
    }
}

/// What the means of an autoregression over bins have of its variance, and of themselves from one to the next.
fn of_means(tau_s: f64) -> (f64, f64) {
    let x = tau_s / BIN_S;
    let gone = 1.0 - (-1.0 / x).exp();
    let share = 2.0 * x - 2.0 * x * x * gone;
    (share, x * x * gone * gone / share)
}

fn log_sum(logs: &[f64]) -> f64 {
    let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    top + logs.iter().map(|x| (x - top).exp()).sum::<f64>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn schedule() -> Schedule {
        let clock: Vec<f64> = (0..5200).filter(|i| i % 600 > 38).map(|i| 25.0 * f64::from(i)).collect();
        Schedule::new(&clock)
    }

    const QUICK: AxisNoise = AxisNoise {
        white_ng: 80.0,
        short_ng: 15.0,
        short_tau_s: 100.0,
        slow_ng: 0.01,
        slow_tau_s: 3000.0,
        resonance: None,
    };

    /// Records of quick noise beside autoregressions of these times and of equal power, `slow_ng` together.
    fn records(seed: u64, times_s: &[f64], slow_ng: f64) -> (Schedule, [Loudness; 3], [Vec<f64>; 3]) {
        let schedule = schedule();
        let loudness: [Loudness; 3] = std::array::from_fn(|_| Loudness::even(vec![1.0; schedule.len()]));
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let residual = std::array::from_fn(|k| {
            let mut normal = || StandardNormal.sample(&mut rng);
            let mut sum = simulate(&QUICK, &schedule, &loudness[k], &mut normal);
            for tau_s in times_s {
                let slow = AxisNoise {
                    white_ng: 0.0,
                    short_ng: 0.0,
                    slow_ng: slow_ng / (times_s.len() as f64).sqrt(),
                    slow_tau_s: *tau_s,
                    ..QUICK
                };
                let part = simulate(&slow, &schedule, &loudness[k], &mut normal);
                sum.iter_mut().zip(part).for_each(|(x, y)| *x += y);
            }
            sum
        });
        (schedule, loudness, residual)
    }

    /// Twelve records each. Noise of one kind is likelier by x as the other in one record in x at most (Ville): a gain of six would be
    /// one in four hundred.
    #[test]
    fn flicker_noise_gains_and_neither_an_autoregression_nor_quick_noise_alone_loses_more_than_its_share() {
        let gain = |times_s: &[f64], slow_ng: f64| -> Vec<f64> {
            let of_record = |seed| {
                let (schedule, loudness, residual) = records(seed, times_s, slow_ng);
                let noise = AxisNoise { slow_ng: slow_ng.max(0.01), ..QUICK };
                where_it_may_be_flicker(&[noise; 3], &residual, &schedule, &loudness)
            };
            (0..12).map(of_record).collect()
        };
        let least = (1.0 - SHARE).ln();
        let octaves: Vec<f64> = (0..10).map(|i| 300.0 * 2f64.powi(i)).collect();
        let [of_flicker, of_one, of_none] = [gain(&octaves, 60.0), gain(&[3000.0], 25.0), gain(&[], 0.0)];
        assert!(of_flicker.iter().filter(|gain| **gain > 1.0).count() > 6, "{of_flicker:?}");
        for of_another in [&of_one, &of_none] {
            assert!(of_another.iter().all(|gain| (least - 1e-9..6.0).contains(gain)), "{of_another:?}");
            let nearly_none = of_another.iter().filter(|gain| gain.abs() < 0.2).count();
            assert!(nearly_none > 8, "{of_another:?}");
        }
    }

    /// A dozen bins, the covariance of their means written out.
    #[test]
    fn the_likelihood_is_that_of_the_covariance() {
        let quick = [900.0, 400.0, f64::INFINITY, 500.0, 400.0, 400.0, 700.0, f64::INFINITY, 400.0, 300.0];
        let mean = [12.0, -3.0, 0.0, 25.0, 8.0, -14.0, 3.0, 0.0, 30.0, 11.0];
        let error: Vec<f64> = (0..10).map(f64::from).collect();
        let binned = Binned { mean_ng: mean.to_vec(), variance_ng2: quick.to_vec() };
        let found = Series { binned: &binned, shared: std::slice::from_ref(&error) }.log_likelihood(TIMES_S, 90.0);
        let kept: Vec<usize> = (0..10).filter(|i| f64::is_finite(quick[*i])).collect();
        let covariance = DMatrix::from_fn(kept.len(), kept.len(), |a, b| {
            let (i, j) = (kept[a], kept[b]);
            let slow: f64 =
                TIMES_S.map(of_means).iter().map(|(s, keep)| 90.0 * s * keep.powi(i.abs_diff(j) as i32)).sum();
            slow + error[i] * error[j] + if i == j { quick[i] } else { 0.0 }
        });
        let inverse = covariance.clone().try_inverse().unwrap();
        let (one, d) = (DVector::from_element(kept.len(), 1.0), DVector::from_fn(kept.len(), |a, _| mean[kept[a]]));
        let (cc, dc, dd) = (one.dot(&(&inverse * &one)), one.dot(&(&inverse * &d)), d.dot(&(&inverse * &d)));
        let direct = -0.5 * (covariance.determinant().ln() + dd - dc * dc / cc + cc.ln());
        assert!((found - direct).abs() < 1e-8, "{found} {direct}");
    }
}
