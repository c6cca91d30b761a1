//! The estimate computed on board: Hogg's adaptive trimmed mean over 500 samples, in the flight's form or the right one.
//!
//! U(f), L(f) are the means of the largest and smallest fraction f; Q = (U(0.2) - L(0.2))/(U(0.5) - L(0.5)). The share trimmed
//! from each end is 0.05 up to Q = 1.75, rises by 0.35 to Q = 2 and is 0.40 above. The flight code drops one point more at the
//! high end. Written here apart from the ground's own estimator, on whole counts: the two check each other.

use crate::telemetry::{OnBoardEstimate, PrcAxis, Range};
use crate::units::Clock;

/// Samples in a window.
pub const WINDOW: usize = 500;

/// Collects samples and gives an estimate every 25 s of unbroken normal mode, on the mission's own phase.
pub struct OnBoard {
    one_sided: bool,
    phase_s: u32,
    /// Counts of the last seconds, oldest first, ten to a second.
    counts: [Vec<i16>; 3],
    ranges: Vec<[Range; 3]>,
    first_s: Option<u32>,
}

impl OnBoard {
    /// With windows that start at clocks congruent to `phase_s` modulo 25.
    pub fn new(one_sided: bool, phase_s: u32) -> Self {
        Self { one_sided, phase_s, counts: Default::default(), ranges: Vec::new(), first_s: None }
    }

    /// A second of normal mode; the estimate of the window that it completes, if it does.
    pub fn take(&mut self, clock_s: u32, counts: &[[i16; 3]; 10], ranges: [Range; 3]) -> Option<OnBoardEstimate> {
        if self.first_s.is_none() {
            if clock_s % 25 != self.phase_s % 25 {
                return None;
            }
            self.first_s = Some(clock_s);
        }
        for sample in counts {
            for (kept, count) in self.counts.iter_mut().zip(sample) {
                kept.push(*count);
            }
        }
        self.ranges.push(ranges);
        if self.ranges.len() < 50 {
            return None;
        }
        let start_s = self.first_s.unwrap_or(clock_s);
        let last = self.ranges[49];
        let axes = std::array::from_fn(|axis| estimate(&self.counts[axis], last[axis], self.one_sided));
        for kept in &mut self.counts {
            kept.drain(..WINDOW / 2);
        }
        self.ranges.drain(..25);
        self.first_s = Some(start_s + 25);
        Some(OnBoardEstimate { clock: Clock::from_tenths(i64::from(start_s) * 10), axes })
    }

    /// Normal mode was left: what was collected is dropped.
    pub fn interrupt(&mut self) {
        self.first_s = None;
        self.ranges.clear();
        for kept in &mut self.counts {
            kept.clear();
        }
    }
}

/// The estimate of one axis over its counts, at least five of them.
pub fn estimate(counts: &[i16], range: Range, one_sided: bool) -> PrcAxis {
    let mut sorted = counts.to_vec();
    sorted.sort_unstable();
    let n = sorted.len();
    let (q, trim) = trimming(&sorted);
    let low = (trim * n as f64 + 1e-9).floor() as usize;
    let high = n - low - usize::from(one_sided);
    let kept = &sorted[low..high];
    let mean = sum(kept) as f64 / kept.len() as f64;
    let deviation = kept.iter().map(|c| (f64::from(*c) - mean).abs()).sum::<f64>() / kept.len() as f64;
    PrcAxis {
        range,
        mean_sixteenths: (mean * 16.0).round_ties_even() as i32,
        deviation_sixteenths: (deviation * 16.0).round_ties_even() as u32,
        q_thousandths: (q * 1000.0).round_ties_even() as u16,
        trim_ten_thousandths: (trim * 10_000.0).round_ties_even() as u16,
        points_kept: kept.len() as u16,
    }
}

fn sum(counts: &[i16]) -> i64 {
    counts.iter().map(|c| i64::from(*c)).sum()
}

/// Q and the share trimmed from each end; a window without spread has Q 0 and the least trim.
fn trimming(sorted: &[i16]) -> (f64, f64) {
    let n = sorted.len();
    let (fifth, half) = (n / 5, n / 2);
    // Each mean rounded by itself, as on board: at a tie of the last digit sent it decides.
    let mean = |counts: &[i16]| sum(counts) as f64 / counts.len() as f64;
    let spread = |k: usize| mean(&sorted[n - k..]) - mean(&sorted[..k]);
    let wide = spread(half);
    if wide == 0.0 {
        return (0.0, 0.05);
    }
    let q = spread(fifth) / wide;
    (q, (0.05 + 0.35 * (q - 1.75) / 0.25).clamp(0.05, 0.40))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn a_normal_sample_has_the_published_q_and_the_one_sided_mean_its_bias() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let normal = Normal::new(0.0, 3000.0).unwrap();
        let (mut q, mut skew) = (0.0, 0.0);
        let windows = 2000;
        for _ in 0..windows {
            let counts: Vec<i16> = (0..WINDOW).map(|_| normal.sample(&mut random) as i16).collect();
            let flight = estimate(&counts, Range::C, true);
            let right = estimate(&counts, Range::C, false);
            q += f64::from(right.q_thousandths) / 1000.0 / f64::from(windows);
            skew += f64::from(right.mean_sixteenths - flight.mean_sixteenths) / 16.0 / 3000.0 / f64::from(windows);
            assert_eq!(right.points_kept, flight.points_kept + 1);
        }
        // Q of a normal sample 1.754; 0.0035 sigma of one-sidedness [domain; derived from Rice 1996].
        assert!((q - 1.754).abs() < 0.005, "{q}");
        assert!((skew - 0.0035).abs() < 0.0003, "{skew}");
    }

    #[test]
    fn a_constant_window_is_trimmed_least() {
        let axis = estimate(&[7; WINDOW], Range::A, true);
        assert_eq!((axis.mean_sixteenths, axis.trim_ten_thousandths, axis.points_kept), (112, 500, 449));
    }

    #[test]
    fn windows_start_every_25_seconds_on_their_phase() {
        let mut onboard = OnBoard::new(true, 226_280);
        let starts: Vec<i64> = (226_283..226_500)
            .filter_map(|s| onboard.take(s, &[[1, 2, 3]; 10], [Range::C; 3]))
            .map(|e| e.clock.tenths() / 10)
            .collect();
        assert_eq!(starts[..3], [226_305, 226_330, 226_355]);
    }
}
