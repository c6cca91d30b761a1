//! A residual in bins that are long beside the quick noise: the mean of each, and the variance that the quick noise gives it.

use super::marginal::{SLOW_AMPLITUDES_NG, SLOW_TIMES_S};
use super::{AxisNoise, Loudness, Schedule};

/// Length of a bin, s: several correlation times of the short part as it mostly is.
pub const BIN_S: f64 = 400.0;
/// Fewest windows of a bin.
const WINDOWS_MIN: usize = 4;

/// A residual in bins, from the first window to the last; a bin with too few windows has no mean and an infinite variance.
#[derive(Debug, Clone)]
pub struct Binned {
    /// Means, ng.
    pub mean_ng: Vec<f64>,
    /// Their variances by white and short noise and by a resonance, ng^2.
    pub variance_ng2: Vec<f64>,
}

impl Binned {
    /// Of a residual at the windows. Windows in which a burst is are left out.
    pub fn new(residual_ng: &[f64], noise: &AxisNoise, schedule: &Schedule, loudness: &Loudness) -> Self {
        let bins = bins(schedule, loudness);
        let mut binned = Self { mean_ng: vec![0.0; bins.len()], variance_ng2: vec![f64::INFINITY; bins.len()] };
        for (bin, windows) in bins.iter().enumerate().filter(|(_, windows)| windows.len() >= WINDOWS_MIN) {
            let count = windows.len() as f64;
            binned.mean_ng[bin] = windows.iter().map(|i| residual_ng[*i]).sum::<f64>() / count;
            binned.variance_ng2[bin] = variance_of_sum(windows, noise, schedule, &loudness.activity) / (count * count);
        }
        binned
    }

    /// The best log likelihood of slow noise beside white and short noise: of that fitted, and of all that is weighed against it.
    pub fn likeliest_slow_noise(&self, fitted: &AxisNoise) -> f64 {
        let of = |slow_ng: &f64| SLOW_TIMES_S.map(|tau_s| self.log_likelihood_of_slow_noise(*slow_ng, tau_s));
        let at_fit = self.log_likelihood_of_slow_noise(fitted.slow_ng, fitted.slow_tau_s);
        SLOW_AMPLITUDES_NG.iter().flat_map(of).fold(at_fit, f64::max)
    }

    /// Log likelihood, but for its constant, of white and short noise beside slow noise; the mean is fitted.
    fn log_likelihood_of_slow_noise(&self, slow_ng: f64, slow_tau_s: f64) -> f64 {
        let keep = (-BIN_S / slow_tau_s).exp();
        let variance = slow_ng * slow_ng;
        let (mut state, mut p) = ([0.0; 2], variance);
        let (mut log_det, mut squares) = (0.0, [0.0; 3]);
        for (mean, noise) in self.mean_ng.iter().zip(&self.variance_ng2) {
            if noise.is_finite() {
                let innovation = [mean - state[0], 1.0 - state[1]];
                let total = p + noise;
                log_det += total.ln();
                squares[0] += innovation[0] * innovation[0] / total;
                squares[1] += innovation[0] * innovation[1] / total;
                squares[2] += innovation[1] * innovation[1] / total;
                state = std::array::from_fn(|i| state[i] + p / total * innovation[i]);
                p *= noise / total;
            }
            state = state.map(|x| keep * x);
            p = keep * keep * p + (1.0 - keep * keep) * variance;
        }
        let [dd, dc, cc] = squares;
        if cc > 0.0 { -0.5 * (log_det + dd - dc * dc / cc) } else { 0.0 }
    }
}

/// The windows of each bin, without those in which a burst is.
fn bins(schedule: &Schedule, loudness: &Loudness) -> Vec<Vec<usize>> {
    let bin = |i: usize| ((schedule.clock_s[i] - schedule.clock_s[0]) / BIN_S) as usize;
    let n = schedule.len();
    let mut bins = vec![Vec::new(); if n == 0 { 0 } else { bin(n - 1) + 1 }];
    let bursts = |i: usize| loudness.is_odd(i) || (i > 0 && loudness.burst[i - 1] > 1.0);
    (0..n).filter(|i| !bursts(*i)).for_each(|i| bins[bin(i)].push(i));
    bins
}

/// Means of another series over the same bins.
pub(super) fn means(series: &[f64], schedule: &Schedule, loudness: &Loudness) -> Vec<f64> {
    let mean = |windows: &Vec<usize>| windows.iter().map(|i| series[*i]).sum::<f64>() / windows.len().max(1) as f64;
    bins(schedule, loudness).iter().map(mean).collect()
}

/// Variance of the sum of some windows, in order.
fn variance_of_sum(windows: &[usize], noise: &AxisNoise, schedule: &Schedule, activity: &[f64]) -> f64 {
    let [white, short] = [noise.white_ng.powi(2), noise.short_ng.powi(2)];
    let oscillating = |i: usize, j: usize, apart_s: f64| {
        noise.resonance.map_or(0.0, |r| {
            r.rms_ng.powi(2) * r.transition(apart_s)[0][0] * r.loudness(activity[i]) * r.loudness(activity[j])
        })
    };
    let new = |i: usize| white * activity[i].powi(2);
    let mut sum = 0.0;
    for (a, i) in windows.iter().enumerate() {
        let [own, previous] = schedule.overlap[*i];
        sum += own * own * new(*i) + previous * previous * new(i.saturating_sub(1));
        sum += activity[*i].powi(2) * short + oscillating(*i, *i, 0.0);
        for j in &windows[a + 1..] {
            let apart = schedule.clock_s[*j] - schedule.clock_s[*i];
            let shared = if *j == i + 1 { schedule.overlap[*j][1] * own * new(*i) } else { 0.0 };
            let short = short * (-apart / noise.short_tau_s).exp();
            sum += 2.0 * (shared + activity[*i] * activity[*j] * short + oscillating(*i, *j, apart));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn means_scatter_as_their_variances_say_and_gaps_and_bursts_are_left_out() {
        let clock: Vec<f64> = (0..40_000).filter(|i| i % 190 > 20).map(|i| 25.0 * f64::from(i)).collect();
        let schedule = Schedule::new(&clock);
        let noise = AxisNoise {
            white_ng: 100.0,
            short_ng: 25.0,
            short_tau_s: 90.0,
            slow_ng: 0.0,
            slow_tau_s: 3000.0,
            resonance: None,
        };
        let mut loudness = Loudness::even((0..clock.len()).map(|i| if i > 15_000 { 0.6 } else { 1.2 }).collect());
        loudness.burst.iter_mut().step_by(50).for_each(|b| *b = 300.0);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let x = simulate(&noise, &schedule, &loudness, || StandardNormal.sample(&mut rng));
        let binned = Binned::new(&x, &noise, &schedule, &loudness);
        let seen: Vec<f64> = binned
            .mean_ng
            .iter()
            .zip(&binned.variance_ng2)
            .filter(|(_, v)| v.is_finite())
            .map(|(m, v)| m * m / v)
            .collect();
        assert!(seen.len() > 2000 && seen.len() < binned.mean_ng.len());
        let n = seen.len() as f64;
        let variance = seen.iter().sum::<f64>() / n;
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{variance}");
        // Noise without a slow part is likeliest as such.
        let likelihood = |slow_ng| binned.log_likelihood_of_slow_noise(slow_ng, 3000.0);
        assert!(likelihood(0.3) > likelihood(20.0) + 10.0);
    }
}
