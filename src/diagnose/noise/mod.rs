//! The noise of the windows, and the filter that whitens it.
//!
//! Per axis three parts: white noise of the samples, seen through windows that overlap by half (a moving average, exactly
//! as the stride has it), a short autoregression (tens of seconds to minutes), both following the crew's activity, and
//! a slow autoregression (minutes to hours) that does not. One autoregression alone either misses the slow part or takes the overlap
//! for it; one of the second order, a resonance, is beside them where an information criterion asks for it (see `order`). State space,
//! so that gaps are simply longer steps. Samples out of the ordinary have a variance of their own (see [`Loudness`]).
//!
//! Windows may see the slow part at their middle or as a mean (see [`SlowSeen`]): that decides what they have at a period of two strides, where
//! white noise of overlapping windows has nothing, and so what of the slow part can be believed.
//!
//! The amplitude of the slow part is estimated on a logarithmic scale with a prior: it never reaches zero, and a
//! record too short to exclude slow noise is treated as having some. That is what keeps false leaks away. A hypothesis is weighed
//! with its slow part marginalised, and with the possibility that it is no autoregression but flicker noise (see `flicker`).

mod binned;
mod filter;
mod fit;
mod flicker;
mod flips;
mod kalman;
mod levels;
mod likelihood;
mod loudness;
mod marginal;
mod order;
mod resonance;
mod seen;

pub use binned::{BIN_S, Binned};
pub use filter::Whitener;
pub use fit::{fit, log_prior_but_slow};
pub use flicker::where_it_may_be_flicker;
pub use flips::{Flip, Flips};
pub use levels::{Contradicted, settled};
pub use loudness::Loudness;
pub use marginal::{SlowPart, slow_part_marginalised};
pub use order::{FORGOTTEN_S, PERIODS_S, with_resonances};
pub use resonance::Resonance;
pub use seen::{SlowSeen, slow_part_seen};

use fit::{EVALUATIONS, fit_and_likelihoods};

use multiversion::multiversion;

/// Noise of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisNoise {
    /// White noise of a window, ng, at activity 1.
    pub white_ng: f64,
    /// Short autoregression, ng, at activity 1.
    pub short_ng: f64,
    /// Its correlation time.
    pub short_tau_s: f64,
    /// Slow autoregression, ng.
    pub slow_ng: f64,
    /// Its correlation time.
    pub slow_tau_s: f64,
    /// A resonance beside them, where there is one.
    pub resonance: Option<Resonance>,
}

impl AxisNoise {
    /// RMS of a window at activity 1.
    pub fn rms_ng(&self) -> f64 {
        let resonance_ng = self.resonance.map_or(0.0, |r| r.rms_ng);
        (self.white_ng.powi(2) + self.short_ng.powi(2) + self.slow_ng.powi(2) + resonance_ng.powi(2)).sqrt()
    }
}

/// When the windows are and how active the crew was: what the noise depends on beside its parameters.
#[derive(Debug, Clone)]
pub struct Schedule {
    /// Window centres.
    pub clock_s: Vec<f64>,
    /// Step to the window before, s; infinite for the first.
    pub step_s: Vec<f64>,
    /// Coefficients of the window's own and of the previous sample noise.
    overlap: Vec<[f64; 2]>,
    /// How they see the slow part of the noise.
    pub slow_seen: SlowSeen,
    /// Errors that all windows share, per axis: series whose sizes are independent and standard normal, ng.
    pub shared_ng: [Vec<Vec<f64>>; 3],
    /// What was measured of the bias beside the windows, per axis.
    pub flips: [Flips; 3],
}

/// A series at the windows from the first that is not zero to the last.
#[derive(Debug, Clone, Copy)]
pub struct Stretch<'a> {
    /// Its first window.
    pub first: usize,
    /// Its values; outside them it is zero.
    pub values: &'a [f64],
}

impl<'a> Stretch<'a> {
    /// Of a whole series.
    pub fn of(series: &'a [f64]) -> Self {
        let first = series.iter().position(|x| *x != 0.0).unwrap_or(series.len());
        let end = series.iter().rposition(|x| *x != 0.0).map_or(first, |i| i + 1);
        Self { first, values: &series[first..end] }
    }

    /// Its values up to so many, and those behind them, from there on.
    pub fn split_at(self, windows: usize) -> (Self, Self) {
        let behind_from = windows.saturating_sub(self.first).min(self.values.len());
        let (values, behind) = self.values.split_at(behind_from);
        let first = self.first.min(windows);
        (Self { first, values }, Self { first: self.first.max(windows) - windows, values: behind })
    }

    /// One past its last window.
    fn end(&self) -> usize {
        self.first + self.values.len()
    }
}

/// Window length, s: two windows closer than this share samples.
const WINDOW_S: f64 = 50.0;
/// Most that a window shares with the one before: with more it would share with the second before as well, and no moving average of
/// two has such a correlation.
const SHARED_MAX: f64 = 0.5;

impl Schedule {
    /// From window centres.
    pub fn new(clock_s: &[f64]) -> Self {
        let mut step_s = vec![f64::INFINITY];
        step_s.extend(clock_s.windows(2).map(|w| w[1] - w[0]));
        let mut own = 1.0_f64;
        let overlap = step_s
            .iter()
            .map(|step| {
                let shared = (1.0 - step / WINDOW_S).clamp(0.0, SHARED_MAX);
                let previous = (shared / own).min(0.999);
                own = (1.0 - previous * previous).sqrt();
                [own, previous]
            })
            .collect();
        Self {
            clock_s: clock_s.to_vec(),
            step_s,
            overlap,
            slow_seen: SlowSeen::default(),
            shared_ng: Default::default(),
            flips: Default::default(),
        }
    }

    /// The same with errors that all windows share.
    pub fn with_shared(self, shared_ng: [Vec<Vec<f64>>; 3]) -> Self {
        debug_assert!(shared_ng.iter().flatten().all(|series| series.len() == self.len()), "a value for every window");
        Self { shared_ng, ..self }
    }

    /// The same with measurements of the bias beside the windows.
    pub fn with_flips(self, flips: [Flips; 3]) -> Self {
        Self { flips, ..self }
    }

    /// Coefficients, in a window, of the noise of the samples that are new to it and of those that the window before had.
    pub fn shares_of_samples(&self, i: usize) -> [f64; 2] {
        self.overlap[i]
    }

    /// Number of windows.
    pub fn len(&self) -> usize {
        self.clock_s.len()
    }

    /// No windows at all.
    pub fn is_empty(&self) -> bool {
        self.clock_s.is_empty()
    }
}

/// Dot product.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx+avx2", "x86_64+avx+avx2"))]
pub fn dot<A: Copy + Into<f64>, B: Copy + Into<f64>>(a: &[A], b: &[B]) -> f64 {
    let mut lanes = [0.0; 8];
    let (ca, cb) = (a.chunks_exact(8), b.chunks_exact(8));
    let tail: f64 = ca.remainder().iter().zip(cb.remainder()).map(|(x, y)| (*x).into() * (*y).into()).sum();
    for (x, y) in ca.zip(cb) {
        for j in 0..8 {
            lanes[j] += x[j].into() * y[j].into();
        }
    }
    lanes.iter().sum::<f64>() + tail
}

/// A record of noise alone: `normal` gives independent standard normal numbers.
pub fn simulate(
    noise: &AxisNoise,
    schedule: &Schedule,
    loudness: &Loudness,
    mut normal: impl FnMut() -> f64,
) -> Vec<f64> {
    let mut previous = noise.white_ng * normal();
    let mut short = noise.short_ng * normal();
    let mut slow = noise.slow_ng * normal();
    let mut resonance = noise.resonance.map(|r| (r, [r.rms_ng * normal(), r.rms_ng * normal()]));
    (0..schedule.len())
        .map(|i| {
            let step = schedule.step_s[i];
            let f1 = (-step / noise.short_tau_s).exp();
            short = f1 * short + (1.0 - f1 * f1).sqrt() * noise.short_ng * normal();
            let between = schedule.slow_seen.between_halves_s(step);
            let mut to_half = |after_s: f64| {
                let kept = (-after_s / noise.slow_tau_s).exp();
                slow = kept * slow + (1.0 - kept * kept).sqrt() * noise.slow_ng * normal();
                slow
            };
            let former = to_half(step - between);
            let slow = if between > 0.0 { 0.5 * (former + to_half(between)) } else { former };
            let oscillating = resonance.as_mut().map_or(0.0, |(r, state)| {
                *state = r.next(*state, step, [normal(), normal()]);
                r.loudness(loudness.activity[i]) * state[0]
            });
            let own = noise.white_ng * loudness.activity[i] * loudness.burst[i].sqrt() * normal();
            let [a, b] = schedule.overlap[i];
            let value = a * own + b * previous + loudness.activity[i] * short + oscillating + slow;
            previous = own;
            let alone = loudness.alone[i];
            // Nothing is drawn where a window has nothing for itself.
            let of_itself =
                if alone > 0.0 { noise.white_ng * loudness.activity[i] * alone.sqrt() * normal() } else { 0.0 };
            value + of_itself
        })
        .collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::filter::tests::NOISE;
    use super::*;

    /// A cheap source of nearly normal numbers: twelve uniform ones (a linear congruence, Knuth's MMIX constants).
    pub(super) fn normals(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0
    }

    pub(super) fn gappy() -> Schedule {
        let clock: Vec<f64> = (0..4000).filter(|i| i % 190 > 3).map(|i| 25.0 * f64::from(i)).collect();
        Schedule::new(&clock)
    }

    #[test]
    fn what_the_filter_leaves_of_its_own_noise_is_white_and_of_unit_size_across_gaps_levels_and_bursts() {
        let noise = NOISE;
        let schedule = Schedule { slow_seen: SlowSeen::Mean, ..gappy() };
        let mut loudness = Loudness::even((0..schedule.len()).map(|i| if i > 1500 { 0.6 } else { 1.2 }).collect());
        loudness.burst.iter_mut().step_by(40).for_each(|burst| *burst = 30.0);
        loudness.alone.iter_mut().skip(20).step_by(40).for_each(|alone| *alone = 30.0);
        let x = simulate(&noise, &schedule, &loudness, normals(3));
        let w = Whitener::new(&noise, &schedule, &loudness).whiten(&x);
        let n = w.len() as f64;
        let variance = dot(&w, &w) / n;
        // Five standard errors of a variance and of an autocorrelation.
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{variance}");
        for lag in 1..5 {
            let r = w.iter().zip(&w[lag..]).map(|(a, b)| a * b).sum::<f64>() / n;
            assert!(r.abs() < 5.0 / n.sqrt(), "lag {lag}: {r}");
        }
    }

    /// Windows that are means of the same white samples, 2 s early or late as it happens.
    #[test]
    fn windows_at_uneven_steps_are_whitened_as_their_samples_overlap() {
        let mut normal = normals(7);
        let samples: Vec<f64> = (0..501_000).map(|_| normal()).collect();
        let centres: Vec<usize> =
            (0..4000).map(|i| (30 + 25 * i) * 5 + ((normal() + 6.0) * 1e6) as usize % 21).collect();
        let x: Vec<f64> =
            centres.iter().map(|c| samples[c - 125..c + 125].iter().sum::<f64>() / 250.0_f64.sqrt()).collect();
        let schedule = Schedule::new(&centres.iter().map(|c| *c as f64 / 5.0).collect::<Vec<f64>>());
        let noise = AxisNoise {
            white_ng: 1.0,
            short_ng: 1e-3,
            short_tau_s: 100.0,
            slow_ng: 1e-6,
            slow_tau_s: 3000.0,
            resonance: None,
        };
        let loudness = Loudness::even(vec![1.0; schedule.len()]);
        let w = Whitener::new(&noise, &schedule, &loudness).whiten(&x);
        let n = w.len() as f64;
        let variance = dot(&w, &w) / n;
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
        for lag in 1..5 {
            let r = w.iter().zip(&w[lag..]).map(|(a, b)| a * b).sum::<f64>() / n;
            assert!(r.abs() < 0.1, "lag {lag}: {r}");
        }
    }

    /// Halves of windows three times as loud for some minutes as for the next: both windows that have a half have it as loud as it is.
    #[test]
    fn samples_are_as_loud_in_the_window_after_theirs_as_in_their_own() {
        let mut normal = normals(9);
        let n = 4000;
        let levels: Vec<f64> = (0..=n).map(|half| if half / 35 % 2 == 0 { 3.0 } else { 1.0 }).collect();
        let halves: Vec<f64> = levels.iter().map(|level| level * normal() / 2f64.sqrt()).collect();
        let x: Vec<f64> = halves.windows(2).map(|pair| pair[0] + pair[1]).collect();
        let schedule = Schedule::new(&(0..n).map(|i| 25.0 * i as f64).collect::<Vec<f64>>());
        let noise = AxisNoise { white_ng: 1.0, short_ng: 1e-3, slow_ng: 1e-6, ..NOISE };
        let w = Whitener::new(&noise, &schedule, &Loudness::even(levels[1..].to_vec())).whiten(&x);
        let behind_a_change = (0..n).filter(|i| levels[i + 1] != levels[*i]).flat_map(|i| i..(i + 20).min(n));
        let squares: Vec<f64> = behind_a_change.map(|i| w[i] * w[i]).collect();
        let (variance, count) = (squares.iter().sum::<f64>() / squares.len() as f64, squares.len() as f64);
        assert!(count > 2000.0 && (variance - 1.0).abs() < 5.0 * (2.0 / count).sqrt(), "{variance} of {count}");
    }

    #[test]
    fn the_fit_recovers_white_and_slow_noise() {
        let noise = AxisNoise {
            white_ng: 100.0,
            short_ng: 25.0,
            short_tau_s: 110.0,
            slow_ng: 30.0,
            slow_tau_s: 3000.0,
            resonance: None,
        };
        let schedule = gappy();
        let loudness = Loudness::even(vec![1.0; schedule.len()]);
        let x = simulate(&noise, &schedule, &loudness, normals(11));
        let twice: Vec<f64> = x.iter().map(|x| 2.0 * x).collect();
        let [found, again, other] = fit([&x, &x, &twice], [&[]; 3], &schedule, [&loudness; 3], None, 150);
        assert_eq!(found, again);
        assert!((other.white_ng / found.white_ng - 2.0).abs() < 0.05, "{found:?} {other:?}");
        assert!((found.white_ng / 100.0 - 1.0).abs() < 0.1, "{found:?}");
        assert!((found.slow_ng / 30.0).ln().abs() < 0.5, "{found:?}");
    }

    #[test]
    fn noise_with_a_memory_and_hardly_a_white_part_is_found_and_is_not_taken_for_slow() {
        let schedule = gappy();
        let loudness = Loudness::even(vec![1.0; schedule.len()]);
        for short_tau_s in [70.0, 110.0] {
            let noise = AxisNoise {
                white_ng: 5.0,
                short_ng: 100.0,
                short_tau_s,
                slow_ng: 0.01,
                slow_tau_s: 3000.0,
                resonance: None,
            };
            let x = simulate(&noise, &schedule, &loudness, normals(5));
            let [found, ..] = fit([&x, &x, &x], [&[]; 3], &schedule, [&loudness; 3], None, 110);
            assert!((found.short_ng / 100.0 - 1.0).abs() < 0.1, "{found:?}");
            assert!((found.short_tau_s / short_tau_s - 1.0).abs() < 0.15 && found.slow_ng < 20.0, "{found:?}");
        }
    }
}
