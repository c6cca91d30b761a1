//! A calibration known beforehand, in the form of the samples' `.instrument.json`.

use serde::Deserialize;

use super::apply::{Bias, BiasLaw, Calibration, Provenance, Scale};
use crate::pipeline::settings::Settings;
use crate::units::Clock;

/// Why a calibration file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum KnownCalibrationError {
    /// Not the JSON expected.
    #[error("the calibration file is not of the expected form: {0}")]
    Form(#[from] serde_json::Error),
    /// A figure that cannot be.
    #[error("the calibration file has {what} = {found} at axis {axis}, range {range}; {expected}")]
    Value {
        /// Which figure.
        what: &'static str,
        /// Its value.
        found: f64,
        /// Axis letter.
        axis: &'static str,
        /// Range letter.
        range: &'static str,
        /// What it must be.
        expected: &'static str,
    },
}

/// Known bias laws and scale corrections, by axis (X, Y, Z) and range (A, B, C).
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct KnownCalibration {
    scale_correction: [[f64; 3]; 3],
    bias_law_coefficients: [[[f64; 6]; 3]; 3],
    resolution_ng: Option<[[f64; 3]; 3]>,
}

impl KnownCalibration {
    /// Reads and checks the file's text.
    ///
    /// # Errors
    /// When the text is not of the form, or a figure cannot be.
    pub fn parse(text: &str) -> Result<Self, KnownCalibrationError> {
        let known: KnownCalibration = serde_json::from_str(text)?;
        known.check()?;
        Ok(known)
    }

    fn check(&self) -> Result<(), KnownCalibrationError> {
        use crate::telemetry::{Axis, Range};
        for axis in Axis::ALL {
            for range in Range::ALL {
                let (i, j) = (axis.index(), range.index());
                let refuse = |what, found, expected| {
                    Err(KnownCalibrationError::Value {
                        what,
                        found,
                        axis: axis.letter(),
                        range: range.letter(),
                        expected,
                    })
                };
                let scale = self.scale_correction[i][j];
                if !(0.1..10.0).contains(&scale) {
                    return refuse("scale_correction", scale, "it is a ratio near 1");
                }
                for time_h in &self.bias_law_coefficients[i][j][4..] {
                    if *time_h <= 0.0 {
                        return refuse("a time constant of the bias law", *time_h, "it is positive, in hours");
                    }
                }
            }
        }
        Ok(())
    }

    /// The one version it makes, valid always.
    pub fn calibration(&self, settings: &Settings) -> Calibration {
        let law = |c: &[f64; 6]| Some(Bias::Known(BiasLaw { a: [c[0], c[1], c[2], c[3]], t_h: [c[4], c[5]] }));
        let scale =
            |correction: &f64| Scale { correction: *correction, sigma: 0.0, provenance: Provenance::Configured };
        Calibration {
            version: 0,
            known_since: Clock::from_tenths(0),
            time: settings.time,
            bias: [0, 1, 2].map(|axis| [0, 1, 2].map(|range| law(&self.bias_law_coefficients[axis][range]))),
            scale: [0, 1, 2].map(|axis| [0, 1, 2].map(|range| scale(&self.scale_correction[axis][range]))),
            resolution_ng: self.resolution_ng.unwrap_or(settings.instrument.resolution_ng),
            systematic_bias_ng: settings.instrument.systematic_bias_ng,
            systematic_scale: settings.instrument.systematic_scale,
            noise: None,
            settling: None,
        }
    }
}
