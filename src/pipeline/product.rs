//! The product: one window's quasi-steady acceleration in Orbiter body axes, with everything needed to trust it.

use std::fmt;

use crate::telemetry::{Mode, Quality, Range};
use crate::units::Clock;

/// Hash of what a window's product was made from: samples, calibration and configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Revision(pub u64);

impl fmt::Display for Revision {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// Three components in Orbiter body axes (+X tail to nose, +Y to starboard, +Z down through the belly), in ng.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyVector(pub [f64; 3]);

/// The calibrated acceleration of one window, in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BodyAcceleration {
    /// From the adaptive trimmed mean.
    pub trimmed_ng: BodyVector,
    /// From the plain mean.
    pub mean_ng: BodyVector,
    /// One statistical standard error of `trimmed_ng`: noise, bias and scale factor.
    pub sigma_ng: BodyVector,
    /// The systematic part, to be added in quadrature.
    pub sigma_sys_ng: BodyVector,
}

/// One row of `windows.csv`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Product {
    /// Start of the 50 s window.
    pub start: Clock,
    /// None where there is no calibration, or no sample to calibrate.
    pub acceleration: Option<BodyAcceleration>,
    /// Q of the adaptive trimmed mean, per OARE axis; None when no sample was used or all were equal.
    pub q: [Option<f64>; 3],
    /// Trim fraction per end, per OARE axis.
    pub trim: [Option<f64>; 3],
    /// Range used, per OARE axis.
    pub range: [Option<Range>; 3],
    /// Samples of the window that came down (500 when whole).
    pub samples: u16,
    /// Mean sensor temperature, C.
    pub temperature_c: Option<f64>,
    /// What the instrument was doing.
    pub mode: Mode,
    /// Reasons for care.
    pub quality: Quality,
    /// Version of the calibration used.
    pub calibration: u32,
    /// Hash of what it was made from.
    pub revision: Revision,
    /// Latest instrument clock among the frames used.
    pub known_since: Clock,
}
