//! What can go wrong with the instrument, as it is told to operators.

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
        }
    }
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
