//! The bias by the two-position sequence: (mean at 0 deg + mean at 180 deg) / 2, each an adaptive trimmed mean of 50 s.
//!
//! The turn about Z (target 1) reverses X and Y, the one about X (target 2) Y and Z: Y is measured twice, the first time
//! without the settling that follows the second turn.

use super::sequence::{Hold, next_step};
use super::settling::Transient;
use crate::math::robust::{TrimmedMean, rounding_error_spread};
use crate::pipeline::settings::Settings;
use crate::telemetry::{Axis, Mode, Range, Step};
use crate::units::Clock;

/// Tenths of a second within which both positions of one sequence start.
const SEQUENCE_TENTHS_MAX: i64 = 2000;

/// One two-position measurement of one axis in one range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasMeasurement {
    /// OARE axis.
    pub axis: Axis,
    /// Range.
    pub range: Range,
    /// Target of the sequence.
    pub target: u8,
    /// Middle of the sequence, s.
    pub clock_s: f64,
    /// Bias, counts, free of the settling transient.
    pub counts: f64,
    /// Its standard error, counts.
    pub sigma_counts: f64,
    /// Mean sensor temperature, C.
    pub temperature_c: f64,
    /// Instrument clock of the last record used.
    pub known_since: Clock,
    /// What the settling transient would have added, counts.
    pub settling_counts: f64,
    /// Trim fraction per end at 0 and at 180 deg: large where the crew is active.
    pub trim: [f64; 2],
    /// Quiet was asserted throughout.
    pub quiet: bool,
    /// The signal changed between the positions by more than the noise: a manoeuvre, as a rule.
    pub unsteady: bool,
    /// Whether the law uses it; a weight of 0 is an outlier.
    pub weight: f64,
    /// Measured less fitted, in its own error, by the law of all others.
    pub deleted_sigma: f64,
}

impl BiasMeasurement {
    /// Why it is not used, or `used`.
    pub fn use_word(&self) -> &'static str {
        if self.weight > 0.0 { "used" } else { "outlier" }
    }
}

/// Both positions of one sequence.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'h, 'a> {
    /// At 0 deg.
    pub normal: &'h Hold<'a>,
    /// At 180 deg.
    pub opposite: &'h Hold<'a>,
    /// Variance of half the signal's change between the positions beyond the usual, ng^2, by axis: a manoeuvre.
    pub excess_ng2: [f64; 3],
}

/// All pairs in order of time.
pub fn pairs<'h, 'a>(holds: &'h [Hold<'a>]) -> Vec<Pair<'h, 'a>> {
    (0..holds.len())
        .filter(|place| holds[*place].mode() == Mode::Bias && holds[*place].step() == Step::Normal)
        .filter_map(|place| {
            let opposite = next_step(holds, place, Step::Opposite)?;
            let apart = opposite.start().tenths() - holds[place].start().tenths();
            (apart < SEQUENCE_TENTHS_MAX).then_some(Pair { normal: &holds[place], opposite, excess_ng2: [0.0; 3] })
        })
        .collect()
}

impl Pair<'_, '_> {
    /// Axes that the turn reverses.
    pub fn axes(&self) -> &'static [Axis] {
        match self.normal.target() {
            1 => &[Axis::X, Axis::Y],
            2 => &[Axis::Y, Axis::Z],
            _ => &[],
        }
    }

    /// Whether the sensor settles in its opposite position: Y and Z in range C.
    pub fn settles(&self) -> bool {
        self.normal.target() == 2 && self.normal.range(Axis::Y) == Range::C
    }

    /// The bias of an axis with the transient taken away, `None` also where nothing tells when that began; `factor` is the noise
    /// factor, `half_drift` the variance of half the signal's change between the positions, squared counts.
    pub fn measure(
        &self,
        axis: Axis,
        transient: Option<&Transient>,
        factor: f64,
        half_drift_counts2: f64,
        settings: &Settings,
    ) -> Option<BiasMeasurement> {
        let (law, least) = (&settings.window.trim, settings.window.samples_min);
        let at_zero = self.normal.mean(axis, least)?;
        let raw = self.opposite.mean(axis, least)?;
        let freed = match transient {
            Some(transient) => {
                self.opposite.began?;
                self.opposite.mean_without(axis, law, least, Some(&|t_s| transient.counts(t_s)))?
            }
            None => raw,
        };
        let error = |mean: &TrimmedMean| {
            (factor * mean.independent_standard_error_of_spread()).hypot(rounding_error_spread(mean.winsorised_sd))
        };
        let noise = 0.25 * (error(&at_zero).powi(2) + error(&freed).powi(2));
        let resolution = settings.instrument.resolution_ng(axis, self.normal.range(axis));
        let excess = self.excess_ng2[axis.index()] / (resolution * resolution);
        let count = (self.normal.records.len() + self.opposite.records.len()) as f64;
        let records = || self.normal.records.iter().chain(&self.opposite.records);
        Some(BiasMeasurement {
            axis,
            range: self.normal.range(axis),
            target: self.normal.target(),
            clock_s: 0.5 * (self.normal.start().seconds() + self.opposite.last().seconds() + 1.0),
            counts: 0.5 * (at_zero.mean + freed.mean),
            sigma_counts: (noise + half_drift_counts2 + excess).sqrt(),
            unsteady: excess > noise,
            temperature_c: records().map(|r| f64::from(r.temperature_c)).sum::<f64>() / count,
            known_since: self.opposite.last(),
            settling_counts: 0.5 * (raw.mean - freed.mean),
            trim: [at_zero.trim, freed.trim],
            quiet: records().all(|r| r.quiet),
            weight: 1.0,
            deleted_sigma: 0.0,
        })
    }
}
