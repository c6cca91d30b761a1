//! What one packet of each kind says, decoded: counts with their sign restored, temperatures in degrees Celsius.

use super::{Mode, Range, Step};
use crate::units::Clock;

/// Samples in one ACC record, 0.1 s apart.
pub const SAMPLES_PER_RECORD: usize = 10;

/// One second of science data (APID 0x010).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AccRecord {
    /// Instrument clock of the first sample.
    pub clock: Clock,
    /// Packet sequence count, part of the packet's identity.
    pub sequence: u16,
    /// The Orbiter's clock as the record states it: milliseconds since 1970-01-01 UTC.
    pub orbiter_unix_ms: i64,
    /// Ten samples of X, Y, Z (OARE axes), in counts = 32768 - raw, held at +32767 for raw 0.
    pub counts: [[i16; 3]; SAMPLES_PER_RECORD],
    /// Sensor temperature, C.
    pub temperature_c: f32,
    /// What the instrument was doing.
    pub mode: Mode,
    /// Quiet asserted.
    pub quiet: bool,
    /// The table was moving.
    pub table_moving: bool,
    /// The instrument says that a sample of this record is at the rail.
    pub at_rail: bool,
    /// Range of X, Y, Z as reported.
    pub ranges: [Range; 3],
    /// Target of the calibration sequence (0 none).
    pub target: u8,
    /// Step of the calibration sequence.
    pub step: Step,
}

impl AccRecord {
    /// A count that stands for saturation, in any range.
    pub const RAIL_COUNTS: i16 = 32_767;

    /// Whether this count is at either rail.
    pub const fn is_at_rail(count: i16) -> bool {
        count.unsigned_abs() >= Self::RAIL_COUNTS.unsigned_abs()
    }
}

/// Housekeeping (APID 0x011), every 10 s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Housekeeping {
    /// Time of the packet.
    pub clock: Clock,
    /// Sensor temperature, C.
    pub sensor_temperature_c: f64,
    /// Electronics temperature, C.
    pub electronics_temperature_c: f64,
    /// Bus voltage, V.
    pub bus_v: f64,
    /// The data status octet, as in the ACC record.
    pub data_status: u8,
    /// Range of X, Y, Z.
    pub ranges: [Range; 3],
    /// Bias calibrations done since power-on.
    pub bias_calibrations: u16,
    /// Scale calibrations done since power-on.
    pub scale_calibrations: u16,
}

/// The calibration table (APID 0x012), every second of a calibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableReport {
    /// Time of the packet.
    pub clock: Clock,
    /// What the instrument was doing.
    pub mode: Mode,
    /// Step of the sequence.
    pub step: Step,
    /// Target of the sequence.
    pub target: u8,
    /// Range of X, Y, Z.
    pub ranges: [Range; 3],
    /// Number of the calibration.
    pub calibration_id: u16,
    /// Table angle, rad.
    pub angle_rad: f64,
    /// Table rate, rad/s.
    pub rate_rad_s: f64,
}

/// What an event packet tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EventCode {
    /// Power on.
    PowerOn,
    /// Lift-off.
    LiftOff,
    /// Quiet asserted.
    QuietOn,
    /// Quiet no longer asserted.
    QuietOff,
    /// Reentry asserted.
    ReentryAsserted,
    /// Reentry cancelled.
    ReentryCancelled,
    /// Bias calibration start; argument: its id.
    BiasStart,
    /// Bias calibration end.
    BiasEnd,
    /// Scale calibration start.
    ScaleStart,
    /// Scale calibration end.
    ScaleEnd,
    /// Scale calibration aborted; argument: sequence, 1 to 9.
    ScaleAborted,
    /// Range change; argument: axis 0..2 x 256 + new range.
    RangeChange,
    /// Shutdown.
    Shutdown,
    /// Any other, kept as it is.
    Other(u16),
}

impl EventCode {
    /// From the code on the wire.
    pub const fn from_code(code: u16) -> Self {
        match code {
            1 => Self::PowerOn,
            2 => Self::LiftOff,
            3 => Self::QuietOn,
            4 => Self::QuietOff,
            5 => Self::ReentryAsserted,
            6 => Self::ReentryCancelled,
            7 => Self::BiasStart,
            8 => Self::BiasEnd,
            9 => Self::ScaleStart,
            10 => Self::ScaleEnd,
            11 => Self::ScaleAborted,
            12 => Self::RangeChange,
            13 => Self::Shutdown,
            other => Self::Other(other),
        }
    }

    /// The code on the wire.
    pub const fn code(self) -> u16 {
        match self {
            Self::PowerOn => 1,
            Self::LiftOff => 2,
            Self::QuietOn => 3,
            Self::QuietOff => 4,
            Self::ReentryAsserted => 5,
            Self::ReentryCancelled => 6,
            Self::BiasStart => 7,
            Self::BiasEnd => 8,
            Self::ScaleStart => 9,
            Self::ScaleEnd => 10,
            Self::ScaleAborted => 11,
            Self::RangeChange => 12,
            Self::Shutdown => 13,
            Self::Other(code) => code,
        }
    }
}

/// An event (APID 0x013).
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Time of the packet.
    pub clock: Clock,
    /// What happened.
    pub code: EventCode,
    /// Its argument.
    pub argument: u32,
    /// Its text.
    pub text: String,
}

/// The on-board estimate of one 50 s window (APID 0x014), every 25 s in normal mode, on a phase of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnBoardEstimate {
    /// Start of its window.
    pub clock: Clock,
    /// X, Y, Z (OARE axes).
    pub axes: [PrcAxis; 3],
}

/// One axis of an on-board estimate, in the fixed-point units of the packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PrcAxis {
    /// Range.
    pub range: Range,
    /// Trimmed mean by the flight estimator, 1/16 count.
    pub mean_sixteenths: i32,
    /// Average deviation of the kept points, 1/16 count.
    pub deviation_sixteenths: u32,
    /// Q x 1000.
    pub q_thousandths: u16,
    /// Trim fraction per end x 10,000.
    pub trim_ten_thousandths: u16,
    /// Points kept.
    pub points_kept: u16,
}
