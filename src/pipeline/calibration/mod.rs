//! The calibration models: bias, scale factor, time correlation, and the faults of the instrument.
//!
//! A calibration has two times: the span it is valid for, and the instrument clock since which it can be known. The timeline
//! of versions is a function of the archive and the settings; the arrival of the telemetry plays no part in it.

mod anomaly;
mod apply;
mod known;
mod two_position;

pub use anomaly::{Anomaly, AnomalyKind, RangeCorrection};
pub use apply::{Bias, BiasLaw, Calibrated, Calibration, Measured, Provenance, Scale};
pub use known::{KnownCalibration, KnownCalibrationError};
pub use two_position::{BiasMeasurement, measure};

use super::archive::Archive;
use super::settings::Settings;
use crate::units::Clock;

/// Everything that calibration and its checks derive from an archive.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Derived {
    /// Bias measurements, in order of time.
    pub measurements: Vec<BiasMeasurement>,
    /// One version per completed calibration, in the order in which they became known.
    pub timeline: Vec<Calibration>,
    /// What went wrong, in order of time.
    pub anomalies: Vec<Anomaly>,
    /// Spans in which the records name a wrong range.
    pub range_corrections: Vec<RangeCorrection>,
}

impl Derived {
    /// The latest version.
    pub fn current(&self) -> Option<&Calibration> {
        self.timeline.last()
    }

    /// The version that was known at an instrument clock.
    pub fn as_of(&self, clock: Clock) -> Option<&Calibration> {
        self.timeline.iter().rev().find(|version| version.known_since <= clock)
    }
}

/// Derives calibration and anomalies. With a known calibration, that one is used for every window instead.
pub fn derive(archive: &Archive, settings: &Settings, known: Option<&KnownCalibration>) -> Derived {
    let measurements = measure(archive, settings);
    let timeline = match known {
        Some(known) => vec![known.calibration(settings)],
        None => two_position::timeline(&measurements, settings),
    };
    Derived { measurements, timeline, anomalies: Vec::new(), range_corrections: Vec::new() }
}
