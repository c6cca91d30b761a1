//! Whitened residuals on an even grid, and their spectra.

use std::f64::consts::LN_2;
use std::ops::Range;

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

use crate::diagnose::case::{WINDOW_STRIDE_S, WINDOWS_MIN};
use crate::diagnose::scene::Axes;
use crate::math::robust::median;

/// Fewest lines to either side that say how loud a spectrum is.
const LINES_ABOUT: usize = 16;
/// Usual logarithm of a whitened spectrum's departure from white.
const EXCESS: f64 = 0.3;
/// Lines of the spectrum below a band over which it is taken to be even, for each line of the band.
const BANDS: usize = 8;

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

/// A part of what is on the grid, under a taper.
pub(super) struct Tapered {
    /// The place it begins at.
    pub from: usize,
    /// Lines of its spectra: of white noise, of unit power in the mean.
    spectra: [Vec<Complex64>; 3],
    /// Energy of the taper where it was recorded, and its share in all of it.
    pub energy: f64,
    pub recorded: f64,
    /// Mean square of each series in it, beside that in the whole.
    mean_square: [f64; 3],
    /// Of what a line has in its spectrum, the share in the mean square.
    of_a_line: f64,
}

impl Tapered {
    /// Mean square of a series in it, beside that in the whole, without that of a line of so much power in its spectrum.
    pub fn beside(&self, axis: usize, power: f64) -> f64 {
        self.mean_square[axis] - self.of_a_line * power
    }

    /// A line of one of its spectra.
    pub fn line(&self, axis: usize, line: usize) -> Complex64 {
        self.spectra[axis][line]
    }

    /// Power in a line: of white noise, 1 in the mean.
    pub fn power(&self, axis: usize, line: usize) -> f64 {
        self.spectra[axis][line].norm_sqr()
    }
}

/// Place of an instant.
fn place(first_s: f64, clock_s: f64) -> usize {
    ((clock_s - first_s) / WINDOW_STRIDE_S).round() as usize
}

/// A series at its places, zero elsewhere.
fn laid_out(clock_s: &[f64], series: &[f64], length: usize) -> Vec<Complex64> {
    let mut out = vec![Complex64::ZERO; length];
    for (t, x) in clock_s.iter().zip(series) {
        out[place(clock_s[0], *t)] += x;
    }
    out
}

impl Grid {
    /// `None` where there are too few windows, or too many.
    pub fn new(clock_s: &[f64], whitened: &Axes) -> Option<Self> {
        let (first, last) = (*clock_s.first()?, *clock_s.last()?);
        let last = place(first, last);
        let length = (last + 1).next_power_of_two();
        // A record of a few minutes has no bands; one of years is not of this kind.
        if clock_s.len() < WINDOWS_MIN || length > 1 << 20 {
            return None;
        }
        let mut variance = [0.0; 3];
        let series = std::array::from_fn(|k| {
            variance[k] = whitened[k].iter().map(|x| x * x).sum::<f64>() / clock_s.len() as f64;
            laid_out(clock_s, &whitened[k], length)
        });
        let fft = FftPlanner::new().plan_fft_forward(length);
        variance.iter().all(|v| *v > 0.0).then_some(Self {
            series,
            variance,
            windows: clock_s.len() as f64,
            record: last as f64,
            fft,
        })
    }

    /// How loud a spectrum is about one of its lines beside that of white noise, 1 at least: from the median of the lines about it, from a
    /// half of its frequency to one and a half, which no single line moves, and as far as they are enough to say so.
    pub fn loudness(&self, spectrum: &[Complex64], m: usize) -> f64 {
        let reach = LINES_ABOUT.max(m / 2);
        let about = m.saturating_sub(reach).max(1)..(m + reach + 1).min(spectrum.len());
        let mut power: Vec<f64> = spectrum[about].iter().map(Complex64::norm_sqr).collect();
        let Some(middle) = median(&mut power) else { return 1.0 };
        let excess = (middle / LN_2).ln();
        // Variance of the logarithm of a median of exponential numbers, as many as the windows fill of the grid.
        let variance = self.length() as f64 / (self.windows * power.len() as f64 * LN_2.powi(2));
        (excess * EXCESS.powi(2) / (EXCESS.powi(2) + variance)).exp().max(1.0)
    }

    /// How loud what is on the grid is beside white noise, a mean over all lines and axes with the power that `signal` has there.
    pub fn loudness_under(&self, clock_s: &[f64], signal: &Axes) -> f64 {
        let (mut louder, mut all) = (0.0, 0.0);
        for (spectrum, series) in self.spectra(0.0).iter().zip(signal) {
            let mut transform = laid_out(clock_s, series, self.length());
            self.fft.process(&mut transform);
            let mut m = 1;
            while m < self.length() / 2 {
                let next = (m + 1 + m / BANDS).min(self.length() / 2);
                let power: f64 = transform[m..next].iter().map(Complex64::norm_sqr).sum();
                louder += power * self.loudness(spectrum, m);
                all += power;
                m = next;
            }
        }
        if all > 0.0 { louder / all } else { 1.0 }
    }

    /// The part from a place on, under a taper: such lines of its spectra, by a transform of at least the taper's length. `None` where nothing
    /// was recorded.
    pub fn tapered(
        &self,
        from: usize,
        taper: &[f64],
        transform: &dyn Fft<f64>,
        lines: Range<usize>,
    ) -> Option<Tapered> {
        let places = from..(from + taper.len()).min(self.length());
        let is_there = |i: usize| self.series.iter().any(|s| s[i] != Complex64::ZERO);
        let (mut squares, mut fourths) = (0.0, 0.0);
        for (w, _) in taper.iter().zip(places.clone()).filter(|(_, i)| is_there(*i)) {
            squares += w.powi(2);
            fourths += w.powi(4);
        }
        if squares <= 0.0 {
            return None;
        }
        let mut mean_square = [0.0; 3];
        let spectra = std::array::from_fn(|k| {
            let norm = (squares * self.variance[k]).sqrt().recip();
            let mut part: Vec<Complex64> =
                taper.iter().zip(&self.series[k][places.clone()]).map(|(w, x)| x * w * norm).collect();
            mean_square[k] = part.iter().map(Complex64::norm_sqr).sum();
            part.resize(transform.len(), Complex64::ZERO);
            transform.process(&mut part);
            part[lines.clone()].to_vec()
        });
        let recorded = squares / taper.iter().map(|w| w * w).sum::<f64>();
        Some(Tapered {
            from,
            spectra,
            energy: squares,
            recorded,
            mean_square,
            of_a_line: 2.0 * fourths / squares.powi(2),
        })
    }

    /// A series from the first window to the last.
    pub fn real(&self, axis: usize) -> Vec<f64> {
        self.series[axis][..=self.record as usize].iter().map(|x| x.re).collect()
    }

    /// 1 where there is a window, from the first to the last, and 0 elsewhere.
    pub fn recorded(&self) -> Vec<f64> {
        let is_there = |i: usize| self.series.iter().any(|s| s[i] != Complex64::ZERO);
        (0..=self.record as usize).map(|i| f64::from(is_there(i))).collect()
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

    /// White noise, and what is louder by `gain` in amplitude about periods of 1500 s.
    pub fn coloured(seed: u64, n: usize, gain: f64) -> Axes {
        resonant(seed, n, gain, 1500.0, 1500.0)
    }

    /// White noise, and what is louder by `gain` in amplitude about a period, and forgets its phase in `tau_s`: an autoregression of the
    /// second order.
    pub fn resonant(seed: u64, n: usize, gain: f64, period_s: f64, tau_s: f64) -> Axes {
        let radius = (-WINDOW_STRIDE_S / tau_s).exp();
        let turn = 2.0 * radius * (std::f64::consts::TAU * WINDOW_STRIDE_S / period_s).cos();
        let driven = white(seed + 1_000_000, n).map(|series| {
            let mut last = [0.0; 2];
            let resonant = series.iter().map(|x| {
                last = [x + turn * last[0] - radius * radius * last[1], last[0]];
                last[0]
            });
            resonant.collect::<Vec<f64>>()
        });
        let mut all = white(seed, n);
        for (axis, driven) in all.iter_mut().zip(&driven) {
            let peak = (1.0 - radius) * 2.0 * (std::f64::consts::TAU * WINDOW_STRIDE_S / period_s).sin();
            axis.iter_mut().zip(driven).for_each(|(x, d)| *x += gain * peak * d);
        }
        all
    }

    #[test]
    fn noise_is_as_loud_as_it_was_made_where_it_was_and_one_line_is_no_noise() {
        let clock = clock(5000);
        let about = |grid: &Grid, period_s: f64| {
            let m = (grid.span_s() / period_s) as usize;
            grid.spectra(0.0).iter().map(|spectrum| grid.loudness(spectrum, m)).sum::<f64>() / 3.0
        };
        let of = |axes: &Axes| Grid::new(&clock, axes).unwrap();
        let sine = |period_s: f64| -> Axes {
            std::array::from_fn(|_| clock.iter().map(|t| (std::f64::consts::TAU * t / period_s).sin()).collect())
        };
        for seed in 0..10 {
            let (even, loud) = (of(&white(seed, clock.len())), of(&coloured(seed, clock.len(), 2.0)));
            assert!(about(&even, 1500.0) < 1.3, "{seed}: {}", about(&even, 1500.0));
            assert!(about(&loud, 1500.0) > 1.6 && about(&loud, 200.0) < 1.2, "{seed}: {}", about(&loud, 1500.0));
            // What a signal sees of it depends on where the signal is.
            let [here, there] = [1500.0, 200.0].map(|period_s| loud.loudness_under(&clock, &sine(period_s)));
            assert!(here > 1.6 && there < 1.2, "{seed}: {here} {there}");
        }
        let mut axes = white(3, clock.len());
        let before = about(&of(&axes), 1500.0);
        axes.iter_mut().zip(sine(1500.0)).for_each(|(axis, s)| axis.iter_mut().zip(s).for_each(|(x, s)| *x += s));
        // It has half as much power as all the rest, which is a third less beside the whole.
        assert!(about(&of(&axes), 1500.0) < before + 0.1);
    }
}
