//! What can go wrong with the instrument, as it is told to operators, and how sure one must be to tell it.

use statrs::distribution::{ContinuousCDF, Normal};

use crate::telemetry::{Axis, Range};
use crate::units::Clock;

/// Kinds of anomaly.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum AnomalyKind {
    /// Records name a range the sensor is not in.
    RangeMisreport,
    /// The sensor settles after the table stops.
    SettlingTransient,
    /// Levels before and after the rate of a scale calibration differ.
    ElectronicShift,
    /// The on-board estimator drops one point more at the high end.
    OneSidedTrim,
    /// A scale calibration cannot be used.
    ScaleRecordDefect,
    /// The Orbiter's clock and the instrument's jump against each other.
    ClockJump,
    /// A channel is at the rail.
    Saturation,
    /// The table's rate is unsteady.
    TableJitter,
    /// A bias measurement far from the law.
    BiasOutlier,
    /// The records' own UTC is not that of the epoch they are read with.
    EpochMismatch,
}

impl AnomalyKind {
    /// The word in `anomalies.json`.
    pub const fn word(self) -> &'static str {
        match self {
            Self::RangeMisreport => "range_misreport",
            Self::SettlingTransient => "settling_transient",
            Self::ElectronicShift => "electronic_shift",
            Self::OneSidedTrim => "one_sided_trim",
            Self::ScaleRecordDefect => "scale_record_defect",
            Self::ClockJump => "clock_jump",
            Self::Saturation => "saturation",
            Self::TableJitter => "table_jitter",
            Self::BiasOutlier => "bias_outlier",
            Self::EpochMismatch => "epoch_mismatch",
        }
    }
}

/// False anomalies that chance may tell, per mission, over all kinds.
pub const FALSE_PER_MISSION: f64 = 1e-3;
/// Kinds that share them: all but the estimator, which is compared bit for bit, and the epoch, which no chance moves by a minute.
const KINDS: f64 = 8.0;

/// Standard errors beyond which a level shift is told after so many scale sequences: its kind's share of the false anomalies
/// of a mission, over three axes and over the looks, of which the n-th gets 1/(n (n + 1)), so that all of them together get
/// one. 4.25 at the first, 5.4 at the twenty-eighth. (A bias outlier's bound of six errors spends 2e-6 on the thousand
/// measurements of a mission, a settling transient's six 4e-9 a look: within their shares.)
pub(super) fn shift_sigma(looks: usize) -> f64 {
    let looks = looks.max(1) as f64;
    let share = FALSE_PER_MISSION / KINDS / 3.0 / (looks * (looks + 1.0));
    -Normal::standard().inverse_cdf(0.5 * share)
}

/// Something that went wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Anomaly {
    /// What.
    pub kind: AnomalyKind,
    /// From when.
    pub from: Clock,
    /// Until when.
    pub to: Clock,
    /// OARE axes concerned.
    pub axes: Vec<Axis>,
    /// Size, in `unit`.
    pub value: f64,
    /// Its standard error.
    pub sigma: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// One sentence an operator understands.
    pub sentence: String,
}

/// A span in which the records name a wrong range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RangeCorrection {
    /// From when.
    pub from: Clock,
    /// Until when (exclusive).
    pub to: Clock,
    /// OARE axis.
    pub axis: Axis,
    /// What the records say.
    pub reported: Range,
    /// What the sensor was in.
    pub actual: Range,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looking_again_and_again_spends_no_more_than_the_share() {
        let spent: f64 = (1..2000).map(|n| 2.0 * (1.0 - Normal::standard().cdf(shift_sigma(n)))).sum();
        assert!((0.9..=1.0).contains(&(spent * 3.0 * KINDS / FALSE_PER_MISSION)), "{spent}");
        assert!((shift_sigma(1) - 4.25).abs() < 0.01, "{}", shift_sigma(1));
    }
}
