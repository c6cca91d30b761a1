//! A calibration as it is applied: a = (counts - bias) x SF_N x SF_C, and the errors of each part.

use super::bias_law::BiasFit;
use super::noise::NoiseFactors;
use super::settling::Transient;
use crate::telemetry::{Axis, Range};
use crate::units::{Clock, MissionTime};

/// Where a figure comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Provenance {
    /// Measured in flight.
    Measured,
    /// Measured earlier and carried over.
    CarriedOver,
    /// From configuration.
    Configured,
    /// From the measurement in range B.
    FromRangeB,
}

impl Provenance {
    /// `measured`, `carried_over`, `configured`, `from_range_b`.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Measured => "measured",
            Self::CarriedOver => "carried_over",
            Self::Configured => "configured",
            Self::FromRangeB => "from_range_b",
        }
    }
}

/// bias(t, T) = A1 + A2 exp(-t/t0) + A3 exp(-t/t1) + A4 T [Rice 1996]; t in hours since lift-off, T in C, bias in counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasLaw {
    /// A1 to A4, counts (A4 counts per C).
    pub a: [f64; 4],
    /// t0 and t1, hours.
    pub t_h: [f64; 2],
}

impl BiasLaw {
    /// Bias in counts.
    pub fn counts(&self, met_h: f64, temperature_c: f64) -> f64 {
        let [a1, a2, a3, a4] = self.a;
        a1 + a2 * (-met_h / self.t_h[0]).exp() + a3 * (-met_h / self.t_h[1]).exp() + a4 * temperature_c
    }
}

/// The bias of one axis and range.
#[derive(Debug, Clone, PartialEq)]
pub enum Bias {
    /// A law known beforehand, taken as exact.
    Known(BiasLaw),
    /// Fitted to the measurements.
    Fitted(Box<BiasFit>),
}

impl Bias {
    fn law(&self) -> &BiasLaw {
        match self {
            Bias::Known(law) => law,
            Bias::Fitted(fit) => &fit.law,
        }
    }

    /// Bias and its standard error, counts; and whether the clock lies outside the measurements.
    fn at(&self, met_h: f64, temperature_c: f64) -> (f64, f64, bool) {
        match self {
            Bias::Known(law) => (law.counts(met_h, temperature_c), 0.0, false),
            Bias::Fitted(fit) => fit.at(met_h, temperature_c),
        }
    }

    /// The fit, where it is one.
    pub fn fit(&self) -> Option<&BiasFit> {
        match self {
            Self::Known(_) => None,
            Self::Fitted(fit) => Some(fit),
        }
    }
}

/// The scale correction SF_C of one axis and range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// SF_C, actual over nominal.
    pub correction: f64,
    /// Its standard error.
    pub sigma: f64,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// A calibrated value of one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibrated {
    /// Acceleration by the trimmed mean, ng.
    pub trimmed_ng: f64,
    /// Acceleration by the plain mean, ng.
    pub mean_ng: f64,
    /// Statistical standard error: noise, bias and scale factor, ng.
    pub sigma_ng: f64,
    /// Systematic error, ng.
    pub sigma_sys_ng: f64,
    /// The bias is taken from beyond the measurements that support it.
    pub extrapolated: bool,
}

/// Counts of one axis of one window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// OARE axis.
    pub axis: Axis,
    /// Range, corrected where need be.
    pub range: Range,
    /// Middle of the window, s.
    pub clock_s: f64,
    /// Sensor temperature, C.
    pub temperature_c: f64,
    /// Trimmed mean, counts.
    pub trimmed_counts: f64,
    /// Plain mean, counts.
    pub mean_counts: f64,
    /// Standard error of the trimmed mean if its samples were independent, counts.
    pub independent_counts: f64,
    /// Error of the trimmed mean by rounding to whole counts, counts.
    pub rounding_counts: f64,
    /// Factor from independent to true, where the calibration has none.
    pub noise_factor: f64,
}

/// One version of the calibration of all axes and ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// 1, 2, ...; 0 is a calibration known beforehand.
    pub version: u32,
    /// Instrument clock since which it can be known.
    pub known_since: Clock,
    /// Instrument clock against mission elapsed time.
    pub time: MissionTime,
    /// Bias by axis and range (A, B, C).
    pub bias: [[Option<Bias>; 3]; 3],
    /// Scale correction by axis and range.
    pub scale: [[Scale; 3]; 3],
    /// Nominal resolution by axis and range, ng per count.
    pub resolution_ng: [[f64; 3]; 3],
    /// Systematic error of the bias, ng.
    pub systematic_bias_ng: f64,
    /// Systematic error of the scale factor, relative.
    pub systematic_scale: f64,
    /// Noise of the windows, from the windows; None with a calibration known beforehand and nothing received.
    pub noise: Option<NoiseFactors>,
    /// Settling transients of Y and Z that were taken away from the bias measurements.
    pub settling: Option<[Transient; 2]>,
}

impl Calibration {
    /// Bias of an axis and range, counts; None when there is none yet.
    pub fn bias_at(&self, axis: Axis, range: Range, clock_s: f64, temperature_c: f64) -> Option<f64> {
        let bias = self.bias[axis.index()][range.index()].as_ref()?;
        Some(bias.law().counts(self.time.met_h(clock_s), temperature_c))
    }

    /// Bias and its standard error, counts.
    pub fn bias_and_error(&self, axis: Axis, range: Range, clock_s: f64, temperature_c: f64) -> Option<[f64; 2]> {
        let bias = self.bias[axis.index()][range.index()].as_ref()?;
        let (counts, sigma, _) = bias.at(self.time.met_h(clock_s), temperature_c);
        Some([counts, sigma])
    }

    /// Counts to acceleration; None when this axis and range has no bias yet.
    pub fn apply(&self, measured: &Measured) -> Option<Calibrated> {
        let (axis, range) = (measured.axis.index(), measured.range.index());
        let bias = self.bias[axis][range].as_ref()?;
        let met_h = self.time.met_h(measured.clock_s);
        let (bias_counts, bias_sigma, extrapolated) = bias.at(met_h, measured.temperature_c);
        let scale = self.scale[axis][range];
        let ng_per_count = self.resolution_ng[axis][range] * scale.correction;
        let trimmed_ng = (measured.trimmed_counts - bias_counts) * ng_per_count;
        let scale_ng = trimmed_ng * scale.sigma / scale.correction;
        let factor = self.noise.map_or(measured.noise_factor, |noise| noise.factor[axis]);
        let noise = (factor * measured.independent_counts).hypot(measured.rounding_counts);
        let counts_ng = ng_per_count * noise.hypot(bias_sigma);
        Some(Calibrated {
            trimmed_ng,
            mean_ng: (measured.mean_counts - bias_counts) * ng_per_count,
            sigma_ng: counts_ng.hypot(scale_ng),
            sigma_sys_ng: self.systematic_bias_ng.hypot(self.systematic_scale * trimmed_ng),
            extrapolated,
        })
    }
}
