//! The noise of a drawn record, and the exact whitening that belongs to it.
//!
//! Windows of 50 s every 25 s: each is the mean of two halves of white noise, `(h_k + h_(k-1)) / sqrt 2`, each louder while the crew is
//! awake, with a little red noise in proportion, and on some records slow noise (minutes to hours) beside it. The same state
//! model draws the noise and, as a Kalman filter, whitens signatures: SNR here is the true matched filter's, not an estimate.

use rand_chacha::ChaCha12Rng;

use super::draw::{between, log_between, normal};
use super::{Manner, Wander};
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::physics::time::S_PER_DAY;

/// What the noise of one record is.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Standard deviation awake, per axis, ng, without the slow part.
    pub awake_ng: [f64; 3],
    /// Asleep over awake.
    pub asleep: f64,
    /// Share of the variance that is red.
    pub red_share: f64,
    /// Its correlation time, s.
    pub red_s: f64,
    /// Slow noise per axis, ng; zero on most records.
    pub slow_ng: [f64; 3],
    /// Its correlation time, s.
    pub slow_s: f64,
    /// Of what kind the slow noise is.
    pub wander: Wander,
    /// Whether one half window in a hundred is ten times as loud.
    pub bursts: bool,
    /// Whether windows have the mean of what has a memory, and not its value at their middle.
    pub averaged: bool,
    /// Louder hours.
    pub storms: Vec<Storm>,
}

/// A stretch that is louder, by the same on all axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Storm {
    /// When it begins and ends, s since the start of the record.
    pub span_s: [f64; 2],
    /// How many times as loud it is.
    pub louder: f64,
}

/// Storms a day, how long each lasts, s, and how many times as loud it is.
const STORMS_PER_DAY: f64 = 4.0;
const STORM_S: [f64; 2] = [1800.0, 9000.0];
const STORM_LOUDER: [f64; 2] = [1.5, 4.0];

/// Largest deviation of slow noise, ng, as the acceptance has it. Noise that shares it among octaves, and noise that resonates, which is
/// quicker, have twice as much.
const SLOW_NG: f64 = 30.0;

/// Share of half windows that are bursts, and how much louder they are.
const BURSTS: [f64; 2] = [0.01, 10.0];

impl Noise {
    /// Draws one; `slow` puts up to 30 ng of noise with 5 min to 3 h of memory beside the rest.
    pub fn draw(rng: &mut ChaCha12Rng, slow: bool, manner: Manner) -> Self {
        let x_ng = log_between(rng, 55.0, 330.0);
        let awake_ng = [x_ng, x_ng * between(rng, 0.45, 0.50), x_ng * between(rng, 0.56, 0.62)];
        let largest_ng = match manner.wander {
            Wander::Autoregression | Wander::Smooth => SLOW_NG,
            Wander::Flicker | Wander::Resonant => 2.0 * SLOW_NG,
        };
        let slow_ng = std::array::from_fn(|_| if slow { between(rng, 5.0, largest_ng) } else { 0.0 });
        let mut noise = Self {
            awake_ng,
            asleep: between(rng, 0.55, 0.68),
            red_share: between(rng, 0.0, 0.06),
            red_s: log_between(rng, 100.0, 500.0),
            slow_ng,
            slow_s: log_between(rng, 300.0, 10_800.0),
            wander: manner.wander,
            bursts: manner.bursts,
            averaged: manner.averaged,
            storms: Vec::new(),
        };
        if manner.storms {
            let length_s = 3600.0 * f64::from(manner.hours);
            let number = (STORMS_PER_DAY * length_s / S_PER_DAY).round() as usize;
            let mut storm = || {
                let from_s = between(rng, 0.0, length_s);
                let span_s = [from_s, from_s + log_between(rng, STORM_S[0], STORM_S[1])];
                Storm { span_s, louder: log_between(rng, STORM_LOUDER[0], STORM_LOUDER[1]) }
            };
            noise.storms = (0..number).map(|_| storm()).collect();
        }
        noise
    }

    /// How active the crew seems by how loud it is so many seconds into the record: 1 awake, 0 asleep, more in a storm.
    pub fn activity(&self, awake: bool, at_s: f64) -> f64 {
        let here = self.storms.iter().filter(|storm| (storm.span_s[0]..storm.span_s[1]).contains(&at_s));
        let louder = here.map(|storm| storm.louder).fold(1.0, f64::max);
        let level = if awake { 1.0 } else { self.asleep };
        (level * louder - self.asleep) / (1.0 - self.asleep)
    }

    /// One series for an axis, a value for each activity of the samples that a window is the first to have: 0 asleep, 1 awake.
    pub fn series(&self, rng: &mut ChaCha12Rng, axis: usize, activity: &[f64]) -> Vec<f64> {
        let (white, red) = ((1.0 - self.red_share).sqrt(), self.red_share.sqrt());
        let red_keep = keep(self.red_s);
        let (mut before, mut red_now) = (normal(rng), normal(rng));
        let mut slow = Slow::new(rng, self);
        let mut series = Vec::with_capacity(activity.len());
        let mut level_before = self.level_ng(axis, activity.first().copied().unwrap_or(1.0));
        let mut half_before =
            self.averaged.then(|| [level_before * red * red_now, self.slow_ng[axis] * slow.next(rng)]);
        for now in activity {
            let is_burst = self.bursts && between(rng, 0.0, 1.0) < BURSTS[0];
            let half = normal(rng) * if is_burst { BURSTS[1] } else { 1.0 };
            red_now = red_keep * red_now + (1.0 - red_keep * red_keep).sqrt() * normal(rng);
            let level = self.level_ng(axis, *now);
            let white = white * (level * half + level_before * before) / 2f64.sqrt();
            let half_now = [level * red * red_now, self.slow_ng[axis] * slow.next(rng)];
            // The former half of a window is the latter of the one before.
            let with_memory = half_before.map_or(half_now, |former| [0, 1].map(|i| 0.5 * (former[i] + half_now[i])));
            half_before = half_before.map(|_| half_now);
            series.push(white + with_memory[0] + with_memory[1]);
            (before, level_before) = (half, level);
        }
        series
    }

    /// The slow part alone, of an axis, on a grid of so many windows.
    pub fn slow_series(&self, rng: &mut ChaCha12Rng, axis: usize, windows: usize) -> Vec<f64> {
        let mut slow = Slow::new(rng, self);
        (0..windows).map(|_| self.slow_ng[axis] * slow.next(rng)).collect()
    }

    /// Standard deviation of the quick part, ng.
    pub fn level_ng(&self, axis: usize, activity: f64) -> f64 {
        self.awake_ng[axis] * (self.asleep + (1.0 - self.asleep) * activity)
    }

    /// The whitening of one axis: for the windows present (`kept`) of the whole grid.
    pub fn whitening(&self, axis: usize, activity: &[f64], kept: &[bool]) -> Whitening {
        // State: h_k, h_(k-1), red, slow, all of unit variance.
        let (white, red) = ((1.0 - self.red_share).sqrt() / 2f64.sqrt(), self.red_share.sqrt());
        let keep = [keep(self.red_s), keep(self.slow_s)];
        let mut p = [[0.0; 4]; 4];
        for (i, row) in p.iter_mut().enumerate() {
            row[i] = 1.0;
        }
        let mut level_before = self.level_ng(axis, activity.first().copied().unwrap_or(1.0));
        let steps = activity
            .iter()
            .zip(kept)
            .map(|(now, kept)| {
                p = predict(&p, keep);
                let level = self.level_ng(axis, *now);
                let h = [level * white, level_before * white, level * red, self.slow_ng[axis]];
                level_before = level;
                if !kept {
                    return Step { h, gain: [0.0; 4], sigma: f64::INFINITY };
                }
                let ph: [f64; 4] = std::array::from_fn(|i| (0..4).map(|j| p[i][j] * h[j]).sum());
                // A hundredth of the level, squared, keeps the filter well-posed where the halves' sum is known exactly.
                let variance = (0..4).map(|i| h[i] * ph[i]).sum::<f64>() + 1e-4 * level * level;
                let gain = ph.map(|x| x / variance);
                for (i, row) in p.iter_mut().enumerate() {
                    for (j, cell) in row.iter_mut().enumerate() {
                        *cell -= gain[i] * ph[j];
                    }
                }
                Step { h, gain, sigma: variance.sqrt() }
            })
            .collect();
        Whitening { steps, keep }
    }
}

/// Lags of smooth slow noise, and the lag at which its correlation is 1/e over the memory of each (a Matern correlation of order 7/2).
const LAGS: usize = 3;
const MEMORIES: f64 = 3.5;

/// Octaves of flicker noise, and the shortest correlation time, s.
const OCTAVES: usize = 10;
const SHORTEST_S: f64 = 300.0;

/// Periods of noise that resonates, s, and the time in which it forgets its phase, in periods.
const PERIODS_S: [f64; 2] = [200.0, 2000.0];
const FORGOTTEN: [f64; 2] = [0.5, 3.0];

/// Slow noise of unit variance, window by window.
enum Slow {
    /// One autoregression, perhaps through lags.
    One {
        keep: f64,
        /// The autoregression, and what each lag makes of the one before.
        states: [f64; 1 + LAGS],
        /// The last of them, and its standard deviation.
        last: usize,
        sd: f64,
    },
    /// Several of equal power.
    Flicker { keep: [f64; OCTAVES], states: [f64; OCTAVES] },
    /// Of the second order: what it keeps of its last two values, those, and the deviation of what is new.
    Resonant { keep: [f64; 2], states: [f64; 2], new: f64 },
}

impl Slow {
    fn new(rng: &mut ChaCha12Rng, noise: &Noise) -> Self {
        match noise.wander {
            Wander::Autoregression => {
                Self::One { keep: keep(noise.slow_s), states: [normal(rng), 0.0, 0.0, 0.0], last: 0, sd: 1.0 }
            }
            Wander::Flicker => Self::Flicker {
                keep: std::array::from_fn(|i| keep(SHORTEST_S * 2f64.powi(i as i32))),
                states: std::array::from_fn(|_| normal(rng)),
            },
            Wander::Resonant => {
                let [shortest, longest] = PERIODS_S;
                let period_s = log_between(rng, shortest, longest);
                let forgotten_s = period_s * log_between(rng, FORGOTTEN[0], FORGOTTEN[1]);
                let radius = keep(forgotten_s);
                let [a, b] =
                    [2.0 * radius * (std::f64::consts::TAU * WINDOW_STRIDE_S / period_s).cos(), -radius * radius];
                // Variance of an autoregression of the second order beside that of what is new (Box and Jenkins 1976, section 3.2).
                let new = ((1.0 + b) * ((1.0 - b).powi(2) - a * a) / (1.0 - b)).sqrt();
                let mut slow = Self::Resonant { keep: [a, b], states: [0.0; 2], new };
                for _ in 0..(10.0 * forgotten_s / WINDOW_STRIDE_S) as usize {
                    slow.next(rng);
                }
                slow
            }
            Wander::Smooth => {
                let memory_s = noise.slow_s / MEMORIES;
                let keep = keep(memory_s);
                let settles = (30.0 * memory_s / WINDOW_STRIDE_S) as usize;
                let mut states = [0.0; 1 + LAGS];
                let response: Vec<f64> =
                    (0..settles).map(|k| lagged(&mut states, keep, LAGS, f64::from(u8::from(k == 0)))).collect();
                let sd = response.iter().map(|x| x * x).sum::<f64>().sqrt();
                let mut slow = Self::One { keep, states, last: LAGS, sd };
                for _ in 0..settles {
                    slow.next(rng);
                }
                slow
            }
        }
    }

    fn next(&mut self, rng: &mut ChaCha12Rng) -> f64 {
        match self {
            Self::One { keep, states, last, sd } => lagged(states, *keep, *last, normal(rng)) / *sd,
            Self::Flicker { keep, states } => {
                for (x, keep) in states.iter_mut().zip(keep) {
                    *x = *keep * *x + (1.0 - *keep * *keep).sqrt() * normal(rng);
                }
                states.iter().sum::<f64>() / (OCTAVES as f64).sqrt()
            }
            Self::Resonant { keep, states, new } => {
                *states = [keep[0] * states[0] + keep[1] * states[1] + *new * normal(rng), states[0]];
                states[0]
            }
        }
    }
}

/// An autoregression goes on by one normal number, and what lags behind it follows; gives the last of them.
fn lagged(states: &mut [f64; 1 + LAGS], keep: f64, last: usize, normal: f64) -> f64 {
    states[0] = keep * states[0] + (1.0 - keep * keep).sqrt() * normal;
    for i in 1..=last {
        states[i] = keep * states[i] + (1.0 - keep) * states[i - 1];
    }
    states[last]
}

/// A linear map from a series on the window grid to one of unit variance on the kept windows.
#[derive(Debug, Clone)]
pub struct Whitening {
    steps: Vec<Step>,
    keep: [f64; 2],
}

#[derive(Debug, Clone)]
struct Step {
    h: [f64; 4],
    gain: [f64; 4],
    sigma: f64,
}

impl Whitening {
    /// Innovations over their standard deviation, kept windows only.
    pub fn apply(&self, series: &[f64]) -> Vec<f64> {
        let mut state = [0.0; 4];
        let mut out = Vec::with_capacity(series.len());
        for (step, value) in self.steps.iter().zip(series) {
            state = [0.0, state[0], self.keep[0] * state[2], self.keep[1] * state[3]];
            if step.sigma.is_finite() {
                let expected: f64 = (0..4).map(|i| step.h[i] * state[i]).sum();
                let innovation = value - expected;
                for (state, gain) in state.iter_mut().zip(step.gain) {
                    *state += gain * innovation;
                }
                out.push(innovation / step.sigma);
            }
        }
        out
    }
}

fn keep(time_s: f64) -> f64 {
    (-WINDOW_STRIDE_S / time_s).exp()
}

/// Covariance one window on: the first half becomes the one before, a fresh one arrives, the slow states relax.
fn predict(p: &[[f64; 4]; 4], keep: [f64; 2]) -> [[f64; 4]; 4] {
    let [r, s] = keep;
    let mut q = [[0.0; 4]; 4];
    q[0][0] = 1.0;
    q[1][1] = p[0][0];
    for (i, k) in [(2, r), (3, s)] {
        q[1][i] = k * p[0][i];
        q[i][1] = q[1][i];
        q[i][i] = k * k * p[i][i] + 1.0 - k * k;
    }
    q[2][3] = r * s * p[2][3];
    q[3][2] = q[2][3];
    q
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn whitened_noise_is_white_and_of_unit_variance() {
        let mut rng = ChaCha12Rng::seed_from_u64(1);
        let noise = Noise::draw(&mut rng, true, Manner { hours: 280, storms: true, ..Manner::default() });
        assert_eq!(noise.storms.len(), 47);
        let windows = 40_000;
        let activity = |k: usize| noise.activity(k % 3456 > 1152, WINDOW_STRIDE_S * k as f64);
        let awake: Vec<f64> = (0..windows).map(activity).collect();
        let kept: Vec<bool> = (0..windows).map(|k| k % 600 > 38).collect();
        let series = noise.series(&mut rng, 0, &awake);
        let white = noise.whitening(0, &awake, &kept).apply(&series);
        let n = white.len() as f64;
        let variance = white.iter().map(|x| x * x).sum::<f64>() / n;
        // The regularising 1e-4 takes its share where the filter would know a half exactly; six standard errors.
        assert!((variance - 1.0).abs() < 6.0 * (2.0 / n).sqrt() + 0.01, "{variance}");
        for lag in [1, 2, 5, 40] {
            let c = white.iter().zip(&white[lag..]).map(|(a, b)| a * b).sum::<f64>() / n;
            assert!(c.abs() < 6.0 / n.sqrt() + 0.01, "lag {lag}: {c}");
        }
    }

    /// An alternating sum of windows that are means of halves is that of the first and the last half; one of other noise grows.
    #[test]
    fn what_is_averaged_over_windows_has_nothing_at_a_period_of_two_strides() {
        let alternating = |averaged: bool| {
            let mut rng = ChaCha12Rng::seed_from_u64(3);
            let drawn = Noise::draw(&mut rng, true, Manner { averaged, ..Manner::default() });
            let noise = Noise { awake_ng: [60.0; 3], slow_ng: [30.0; 3], slow_s: 300.0, ..drawn };
            let series = noise.series(&mut rng, 0, &[1.0; 40_000]);
            series.chunks(2).map(|pair| pair[1] - pair[0]).sum::<f64>().abs()
        };
        assert!(
            alternating(true) < 400.0 && alternating(false) > 400.0,
            "{} {}",
            alternating(true),
            alternating(false)
        );
    }

    #[test]
    fn smooth_slow_noise_has_the_size_and_the_memory_that_are_said() {
        let mut rng = ChaCha12Rng::seed_from_u64(2);
        let manner = Manner { wander: Wander::Smooth, ..Manner::default() };
        let noise = Noise { slow_ng: [20.0; 3], slow_s: 1000.0, ..Noise::draw(&mut rng, true, manner) };
        let windows = 400_000;
        let series = noise.slow_series(&mut rng, 0, windows);
        let at = |lag: usize| series.iter().zip(&series[lag..]).map(|(a, b)| a * b).sum::<f64>() / windows as f64;
        // Ten thousand memories: 400 ng2 and 1/e within a few parts in a hundred; and it does not jump: an autoregression of this
        // memory is 0.975 like itself a window on.
        assert!((at(0) / 400.0 - 1.0).abs() < 0.1, "{}", at(0));
        assert!((at(40) / at(0) - (-1f64).exp()).abs() < 0.06, "{}", at(40) / at(0));
        assert!(at(1) / at(0) > 0.998, "{}", at(1) / at(0));
    }

    /// Flicker noise has half of its power in half of its octaves: what means over an hour and a half (a factor of eighteen over five
    /// minutes) keep is that of the six longest, three fifths, and a part of the next.
    #[test]
    fn flicker_noise_has_the_size_that_is_said_and_as_much_of_it_in_every_octave() {
        let mut rng = ChaCha12Rng::seed_from_u64(3);
        let manner = Manner { wander: Wander::Flicker, ..Manner::default() };
        let noise = Noise { slow_ng: [20.0; 3], ..Noise::draw(&mut rng, true, manner) };
        let series = noise.slow_series(&mut rng, 0, 1_500_000);
        let variance = |x: &[f64]| x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64;
        let means: Vec<f64> = series.chunks(216).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
        // The longest octave comes 240 times: its variance, a tenth of all, is known to a tenth.
        assert!((variance(&series) / 400.0 - 1.0).abs() < 0.1, "{}", variance(&series));
        let kept = variance(&means) / variance(&series);
        assert!((0.6..0.75).contains(&kept), "{kept}");
    }

    /// Noise that resonates crosses zero twice a period or a little oftener: of the second order, by the arc cosine of what it is like itself
    /// a window on (Rice 1944).
    #[test]
    fn noise_that_resonates_has_the_size_that_is_said_and_a_period_between_its_bounds() {
        let manner = Manner { wander: Wander::Resonant, ..Manner::default() };
        let mut periods_s = Vec::new();
        for seed in 4..20 {
            let mut rng = ChaCha12Rng::seed_from_u64(seed);
            let noise = Noise { slow_ng: [20.0; 3], ..Noise::draw(&mut rng, true, manner) };
            let series = noise.slow_series(&mut rng, 0, 200_000);
            let n = series.len() as f64;
            let variance = series.iter().map(|x| x * x).sum::<f64>() / n;
            // Eight hundred times the longest memory: within a tenth by three standard errors.
            assert!((variance / 400.0 - 1.0).abs() < 0.1, "{seed}: {variance}");
            let crossings = series.windows(2).filter(|w| w[0] * w[1] < 0.0).count() as f64;
            periods_s.push(2.0 * n * WINDOW_STRIDE_S / crossings);
        }
        assert!(periods_s.iter().all(|p| (100.0..2000.0).contains(p)), "{periods_s:?}");
        let [least, most] = [f64::min, f64::max].map(|which| periods_s.iter().copied().reduce(which).unwrap());
        assert!(most > 3.0 * least, "{periods_s:?}");
    }
}
