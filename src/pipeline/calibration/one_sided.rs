//! Which trimmed mean flew: the right one, or the one that drops a point more at the high end [Rice 1996, section 3.3].
//!
//! The on-board estimates are recomputed from the samples with both estimators and compared in their own 1/16 counts,
//! rounded to nearest, ties to even. They agree bit for bit or they do not; no threshold is needed.

use crate::math::ranked::{Pair, Ranked};
use crate::math::robust::{TrimLaw, flight_trimmed_mean, trimmed_mean};
use crate::pipeline::archive::Archive;
use crate::telemetry::{AccRecord, OnBoardEstimate, Range};
use crate::units::Clock;

/// Samples of an on-board window.
const SAMPLES: usize = 500;
/// Estimates looked at in all, evenly over those that came down: more tell nothing new.
const ESTIMATES_MAX: usize = 240;

/// What the comparison showed.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct OneSided {
    /// Axis estimates compared in which the two estimators differ.
    pub compared: usize,
    /// Of those, equal to the flight estimator bit for bit.
    pub flight_exact: usize,
    /// Of those, equal to the right one.
    pub right_exact: usize,
    /// Mean shift of the flight estimator in range C, counts, and the standard error of that mean, per axis: how much higher
    /// an A1 measured from ground-filtered telemetry is than one measured on board.
    pub offset_counts: [[f64; 2]; 3],
    /// First and last estimate compared.
    pub span: Option<[Clock; 2]>,
}

impl OneSided {
    /// Whether the flight estimator flew: most comparisons agree with it and not with the right one.
    pub fn flew(&self) -> Option<bool> {
        (self.compared >= 12)
            .then_some(2 * self.flight_exact > self.compared && self.flight_exact > 10 * self.right_exact)
    }
}

/// Rounded to 1/16 count, ties to even.
pub fn sixteenths(counts: f64) -> i32 {
    (counts * 16.0).round_ties_even() as i32
}

/// The 500 samples of an on-board window per axis; None when a second is missing or at the rail.
pub fn samples_of(archive: &Archive, estimate: &OnBoardEstimate) -> Option<([Vec<i16>; 3], [Range; 3])> {
    let (from, to) = (estimate.clock, estimate.clock.plus_tenths(SAMPLES as i64));
    let mut counts: [Vec<i16>; 3] = Default::default();
    let mut ranges = None;
    for record in archive.records_between(from, to) {
        for (n, sample) in record.counts.iter().enumerate() {
            let clock = record.clock.plus_tenths(n as i64);
            if clock < from || clock >= to {
                continue;
            }
            if *ranges.get_or_insert(record.ranges) != record.ranges || sample.iter().any(|c| AccRecord::is_at_rail(*c))
            {
                return None;
            }
            counts.iter_mut().zip(sample).for_each(|(axis, count)| axis.push(*count));
        }
    }
    if counts[0].len() != SAMPLES {
        return None;
    }
    Some((counts, ranges?))
}

/// Compares the on-board estimates known at a clock with both estimators.
pub fn compare(archive: &Archive, law: &TrimLaw) -> OneSided {
    let total = archive.estimates().count();
    let stride = total.div_ceil(ESTIMATES_MAX).max(1);
    let mut found = OneSided::default();
    let mut offsets: [Vec<f64>; 3] = Default::default();
    for estimate in archive.estimates().step_by(stride) {
        let Some((counts, ranges)) = samples_of(archive, estimate) else { continue };
        let first = found.span.map_or(estimate.clock, |span| span[0]);
        found.span = Some([first, estimate.clock.plus_tenths(SAMPLES as i64)]);
        for (axis, counts) in counts.into_iter().map(Ranked::of).enumerate() {
            let all = Pair([&counts, &Ranked::default()]);
            let (Some(right), Some((flight, ..))) = (trimmed_mean(all, law), flight_trimmed_mean(all, law)) else {
                continue;
            };
            if ranges[axis] == Range::C {
                offsets[axis].push(right.mean - flight);
            }
            let told = estimate.axes[axis].mean_sixteenths;
            if sixteenths(right.mean) != sixteenths(flight) {
                found.compared += 1;
                found.flight_exact += usize::from(told == sixteenths(flight));
                found.right_exact += usize::from(told == sixteenths(right.mean));
            }
        }
    }
    found.offset_counts = offsets.map(|of_axis| {
        let count = of_axis.len() as f64;
        if of_axis.len() < 2 {
            return [0.0, 0.0];
        }
        let mean = of_axis.iter().sum::<f64>() / count;
        let variance = of_axis.iter().map(|o| (o - mean).powi(2)).sum::<f64>() / (count * (count - 1.0));
        [mean, variance.sqrt()]
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteenths_round_to_even() {
        assert_eq!([0.03125, 0.09375, -0.03125, 1.5].map(sixteenths), [0, 2, 0, 24]);
    }
}
