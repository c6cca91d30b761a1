//! What the pipeline must be told: the mission's times, the instrument's nominal figures, the policies of the estimate.

use crate::ingest::wire::LinkConfig;
use crate::math::robust::TrimLaw;
use crate::telemetry::{Axis, Range};
use crate::units::MissionTime;

/// Everything the products depend on beside the frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Mission in every key, such as `sts-65`.
    pub mission: String,
    /// The link the frames come down on.
    pub link: LinkConfig,
    /// Instrument clock against mission time and UTC.
    pub time: MissionTime,
    /// The instrument.
    pub instrument: Instrument,
    /// The estimate of a window.
    pub window: WindowPolicy,
}

impl Settings {
    /// STS-65 as published.
    pub fn sts65() -> Self {
        Self {
            mission: "sts-65".into(),
            link: LinkConfig::default(),
            time: MissionTime::sts65(),
            instrument: Instrument::default(),
            window: WindowPolicy::default(),
        }
    }
}

/// Nominal figures of the instrument, per OARE axis and range (A, B, C).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Nominal resolution SF_N, ng per count.
    pub resolution_ng: [[f64; 3]; 3],
    /// Scale correction SF_C used until one is measured.
    pub scale_correction: [[f64; 3]; 3],
    /// Relative standard error of that correction.
    pub scale_correction_sigma: f64,
    /// Distance of the sensor from the table's axis, m, for each target axis.
    pub radius_m: [f64; 3],
    /// Full scale of range A, ng: a channel at the rail reads 1.5 times this.
    pub full_scale_a_ng: [f64; 3],
    /// Systematic error of the bias, ng [Rice 1996, section 6].
    pub systematic_bias_ng: f64,
    /// Systematic error of the scale factor, relative [Rice 1996: 1 to 2 %].
    pub systematic_scale: f64,
}

impl Default for Instrument {
    /// Full scales over 32768 [PIMS, Rice 1996]; range B of Y and Z from 1970 ug full scale (the report prints 58.0 ng).
    fn default() -> Self {
        let per_count = |full_scales_ug: [f64; 3]| full_scales_ug.map(|ug| ug * 1000.0 / 32_768.0);
        let (x, yz) = ([10_000.0, 1_000.0, 100.0], [25_000.0, 1_970.0, 150.0]);
        Self {
            resolution_ng: [per_count(x), per_count(yz), per_count(yz)],
            scale_correction: [[1.072, 1.06, 1.025], [1.158, 1.164, 1.172], [1.113, 1.128, 1.131]],
            scale_correction_sigma: 0.01,
            radius_m: [0.1016; 3],
            full_scale_a_ng: [1.0e7, 2.5e7, 2.5e7],
            systematic_bias_ng: 20.0,
            systematic_scale: 0.015,
        }
    }
}

impl Instrument {
    /// Nominal resolution, ng per count.
    pub fn resolution_ng(&self, axis: Axis, range: Range) -> f64 {
        self.resolution_ng[axis.index()][range.index()]
    }
}

/// How a window is estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowPolicy {
    /// The law of the adaptive trimmed mean.
    pub trim: TrimLaw,
    /// Fewer usable samples than this on an axis give no estimate: 10 s.
    pub samples_min: usize,
    /// Samples over which the noise is correlated (its integrated autocorrelation time): the instrument's filter passes DC to
    /// 1 Hz and is sampled at 10 Hz, so neighbouring samples are far from independent.
    pub correlated_samples: f64,
}

impl Default for WindowPolicy {
    fn default() -> Self {
        Self { trim: TrimLaw::default(), samples_min: 100, correlated_samples: 7.9 }
    }
}
