//! Whitened residuals on an even grid, and their spectra.

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

use crate::diagnose::case::{WINDOW_STRIDE_S, WINDOWS_MIN};
use crate::diagnose::scene::Axes;

/// The residuals on an even grid, zero where there is no window.
pub(super) struct Grid {
    series: [Vec<Complex64>; 3],
    /// Mean square of each series over its windows.
    variance: [f64; 3],
    /// How many windows.
    pub windows: f64,
    /// Places from the first window to the last.
    pub record: f64,
    fft: std::sync::Arc<dyn Fft<f64>>,
}

impl Grid {
    /// `None` where there are too few windows, or too many.
    pub fn new(clock_s: &[f64], whitened: &Axes) -> Option<Self> {
        let (first, last) = (*clock_s.first()?, *clock_s.last()?);
        let place = |t: &f64| ((t - first) / WINDOW_STRIDE_S).round() as usize;
        let record = place(&last) as f64;
        let length = (place(&last) + 1).next_power_of_two();
        // A record of a few minutes has no bands; one of years is not of this kind.
        if clock_s.len() < WINDOWS_MIN || length > 1 << 20 {
            return None;
        }
        let mut variance = [0.0; 3];
        let series = std::array::from_fn(|k| {
            let mut out = vec![Complex64::ZERO; length];
            for (t, x) in clock_s.iter().zip(&whitened[k]) {
                out[place(t)] += x;
            }
            variance[k] = whitened[k].iter().map(|x| x * x).sum::<f64>() / clock_s.len() as f64;
            out
        });
        let fft = FftPlanner::new().plan_fft_forward(length);
        variance.iter().all(|v| *v > 0.0).then_some(Self {
            series,
            variance,
            windows: clock_s.len() as f64,
            record,
            fft,
        })
    }

    /// Places in all.
    pub fn length(&self) -> usize {
        self.series[0].len()
    }

    /// Seconds in all.
    pub fn span_s(&self) -> f64 {
        self.length() as f64 * WINDOW_STRIDE_S
    }

    /// Spectra of the series, their phase turned back by that of a line that drifts by so many cycles; unit mean square.
    pub fn spectra(&self, drift_cycles: f64) -> [Vec<Complex64>; 3] {
        let turn = |i: usize| Complex64::cis(-std::f64::consts::TAU * drift_cycles * (i as f64 / self.record).powi(2));
        let turns: Vec<Complex64> = (0..self.length()).map(turn).collect();
        std::array::from_fn(|k| {
            let norm = (self.windows * self.variance[k]).sqrt().recip();
            let mut out: Vec<Complex64> = self.series[k].iter().zip(&turns).map(|(x, t)| x * t * norm).collect();
            self.fft.process(&mut out);
            out
        })
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    pub fn white(seed: u64, n: usize) -> Axes {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        std::array::from_fn(|_| (0..n).map(|_| StandardNormal.sample(&mut rng)).collect())
    }

    pub fn clock(n: usize) -> Vec<f64> {
        (0..n).filter(|i| i % 170 > 4).map(|i| 1000.0 + WINDOW_STRIDE_S * i as f64).collect()
    }
}
