//! The nouns: what the instrument says, in its own terms, after the bytes are read and before anything is computed.
//!
//! Nothing here is serialisable; wire types live at the borders.

mod quality;
mod record;

pub use quality::Quality;
pub use record::{
    AccRecord, Event, EventCode, Housekeeping, OnBoardEstimate, PrcAxis, SAMPLES_PER_RECORD, TableReport,
};

/// One of the instrument's axes (OARE axes: +X tail to nose, +Y belly to top, +Z port to starboard).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Axis {
    /// Tail to nose.
    X,
    /// Belly to top.
    Y,
    /// Port to starboard.
    Z,
}

impl Axis {
    /// The three, in order.
    pub const ALL: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

    /// 0, 1, 2.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// `x`, `y`, `z`.
    pub const fn letter(self) -> &'static str {
        ["x", "y", "z"][self as usize]
    }
}

/// A measuring range of one axis; A is the coarsest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Range {
    /// 10,000 ug (X), 25,000 ug (Y, Z) full scale.
    A,
    /// 1,000 ug (X), 1,970 ug (Y, Z) full scale.
    B,
    /// 100 ug (X), 150 ug (Y, Z) full scale.
    C,
}

impl Range {
    /// The three, in order of their codes.
    pub const ALL: [Range; 3] = [Range::A, Range::B, Range::C];

    /// From the two-bit code of the records; 3 is no range.
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Range::A),
            1 => Some(Range::B),
            2 => Some(Range::C),
            _ => None,
        }
    }

    /// 0, 1, 2: the code in the records, and the index of tables by range.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// `A`, `B`, `C`.
    pub const fn letter(self) -> &'static str {
        ["A", "B", "C"][self as usize]
    }
}

/// What the instrument is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Mode {
    /// Measuring.
    Normal,
    /// Two-position bias calibration.
    Bias,
    /// Scale-factor calibration.
    Scale,
    /// Reentry.
    Reentry,
    /// A code without a meaning.
    Unknown,
}

impl Mode {
    /// From the three-bit code of the data status.
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            1 => Some(Mode::Normal),
            2 => Some(Mode::Bias),
            3 => Some(Mode::Scale),
            4 => Some(Mode::Reentry),
            _ => None,
        }
    }

    /// The three-bit code.
    pub const fn code(self) -> u8 {
        (self as u8 + 1) % 5
    }

    /// `normal`, `bias`, `scale`, `reentry`; empty for a code without a meaning.
    pub const fn word(self) -> &'static str {
        ["normal", "bias", "scale", "reentry", ""][self as usize]
    }
}

/// Step of a calibration sequence, from the table status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Step {
    /// No sequence.
    None,
    /// Bias: table in the normal position.
    Normal,
    /// Table moving between positions.
    Moving,
    /// Bias: table turned by 180 degrees.
    Opposite,
    /// Scale: still, before the rate.
    PreRate,
    /// Scale: turning at constant rate.
    Rate,
    /// Scale: still, after the rate.
    PostRate,
}

impl Step {
    /// From the three-bit code; 7 is no step.
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Step::None),
            1 => Some(Step::Normal),
            2 => Some(Step::Moving),
            3 => Some(Step::Opposite),
            4 => Some(Step::PreRate),
            5 => Some(Step::Rate),
            6 => Some(Step::PostRate),
            _ => None,
        }
    }
}
