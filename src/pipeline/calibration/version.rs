//! One version of the calibration: everything that the telemetry up to some instrument clock supports, and nothing later.

use super::anomaly::shift_sigma;
use super::apply::{Bias, Calibration, Provenance, Scale};
use super::bias_law::{BiasFit, Expectation, Point, fit};
use super::noise::NoiseFactors;
use super::scale_factor::{ScaleMeasurement, ScaleSequence, combine};
use super::settling::{self, Transient};
use super::two_position::{BiasMeasurement, Pair};
use crate::math::shared_work::map;
use crate::pipeline::settings::Settings;
use crate::telemetry::{Axis, Range};
use crate::units::Clock;

/// Relative error of a scale factor of range C taken from range B: the ranges of one axis differ by up to this [Rice 1996, Table 3].
const FROM_RANGE_B_SIGMA: f64 = 0.02;

/// Everything measured that a version may look at.
pub(super) struct Material<'m, 'h, 'a> {
    pub pairs: &'m [Pair<'h, 'a>],
    pub scales: &'m [ScaleSequence],
    pub settings: &'m Settings,
}

/// A version and the measurements as it sees them.
pub(super) struct Version {
    pub calibration: Calibration,
    pub measurements: Vec<BiasMeasurement>,
    pub scales: Vec<Option<ScaleMeasurement>>,
    pub shifts: [Shift; 3],
}

/// The level after less the level before, over the scale calibrations of one axis in range C.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Shift {
    /// Mean, counts.
    pub counts: f64,
    /// Its standard error.
    pub sigma_counts: f64,
    /// Sequences.
    pub sequences: usize,
    /// Errors beyond which it counts.
    threshold_sigma: f64,
}

impl Shift {
    /// Whether there is one.
    pub fn is_real(&self) -> bool {
        self.sequences > 0 && self.counts.abs() > self.threshold_sigma * self.sigma_counts
    }
}

/// The version known at a clock.
pub(super) fn version(
    number: u32,
    known_since: Clock,
    noise: NoiseFactors,
    material: &Material<'_, '_, '_>,
) -> Version {
    let settings = material.settings;
    let instrument = &settings.instrument;
    let pairs: Vec<&Pair<'_, '_>> = material.pairs.iter().filter(|p| p.opposite.last() <= known_since).collect();
    let settling = transients(&pairs, settings);
    let mut measurements = measure(&pairs, settling.as_ref(), &noise, settings);
    let mut bias: [[Option<Bias>; 3]; 3] = Default::default();
    let laws: Vec<(Axis, Range)> =
        Axis::ALL.into_iter().flat_map(|axis| Range::ALL.map(|range| (axis, range))).collect();
    let fits = map(&laws, |(axis, range)| fit_law(*axis, *range, &measurements, settling.as_ref(), settings));
    for ((axis, range), fit) in laws.into_iter().zip(fits) {
        let Some(fit) = fit else { continue };
        let of_law = measurements.iter_mut().filter(|m| m.axis == axis && m.range == range);
        for (n, measurement) in of_law.enumerate() {
            measurement.weight = fit.weights[n];
            measurement.deleted_sigma = fit.deleted_sigmas[n];
        }
        bias[axis.index()][range.index()] = Some(Bias::Fitted(Box::new(fit)));
    }
    let mut calibration = Calibration {
        version: number,
        known_since,
        time: settings.time,
        bias,
        scale: instrument.scale_correction.map(|by_range| by_range.map(|correction| configured(correction, settings))),
        resolution_ng: instrument.resolution_ng,
        systematic_bias_ng: instrument.systematic_bias_ng,
        systematic_scale: instrument.systematic_scale,
        noise: Some(noise),
        settling,
    };
    let (scales, shifts) = scale_factors(&mut calibration, material.scales, known_since, &noise, settings);
    Version { calibration, measurements, scales, shifts }
}

fn configured(correction: f64, settings: &Settings) -> Scale {
    let sigma = correction * settings.instrument.scale_correction_sigma;
    Scale { correction, sigma, provenance: Provenance::Configured }
}

/// The transients, when either axis shows one.
fn transients(pairs: &[&Pair<'_, '_>], settings: &Settings) -> Option<[Transient; 2]> {
    let opposite = pairs.iter().filter(|pair| pair.settles()).map(|pair| pair.opposite);
    let holds: Vec<_> = opposite.filter(|hold| hold.began.is_some()).collect();
    let found = settling::find(&holds, &settings.window.trim, settings.window.samples_min)?;
    found.iter().any(Transient::is_real).then_some(found)
}

fn transient_of(settling: Option<&[Transient; 2]>, axis: Axis) -> Option<&Transient> {
    settling.and_then(|both| match axis {
        Axis::X => None,
        Axis::Y => Some(&both[0]),
        Axis::Z => Some(&both[1]),
    })
}

fn measure(
    pairs: &[&Pair<'_, '_>],
    settling: Option<&[Transient; 2]>,
    noise: &NoiseFactors,
    settings: &Settings,
) -> Vec<BiasMeasurement> {
    let mut measurements = Vec::new();
    for pair in pairs {
        for axis in pair.axes() {
            let transient = if pair.settles() { transient_of(settling, *axis) } else { None };
            let resolution = settings.instrument.resolution_ng(*axis, pair.normal.range(*axis));
            let half_drift = noise.half_drift_variance_ng2[axis.index()] / (resolution * resolution);
            measurements.extend(pair.measure(*axis, transient, noise.factor[axis.index()], half_drift, settings));
        }
    }
    measurements.sort_by(|a, b| a.clock_s.total_cmp(&b.clock_s).then(a.axis.cmp(&b.axis)).then(a.range.cmp(&b.range)));
    measurements
}

fn fit_law(
    axis: Axis,
    range: Range,
    measurements: &[BiasMeasurement],
    settling: Option<&[Transient; 2]>,
    settings: &Settings,
) -> Option<BiasFit> {
    let of_law: Vec<&BiasMeasurement> = measurements.iter().filter(|m| m.axis == axis && m.range == range).collect();
    let points: Vec<Point> = of_law
        .iter()
        .map(|m| Point {
            met_h: settings.time.met_h(m.clock_s),
            temperature_c: m.temperature_c,
            counts: m.counts,
            sigma_counts: m.sigma_counts,
        })
        .collect();
    let mut fit = fit(&points, &Expectation::published(axis.index(), range.index()))?;
    if let (Range::C, Some(transient)) = (range, transient_of(settling, axis)) {
        // What is wrong with the transient is wrong in every measurement that it was taken from: half of those of Y.
        let share = of_law.iter().filter(|m| m.target == 2).count() as f64 / of_law.len() as f64;
        fit.covariance[0][0] += (share * transient.bias_sigma()).powi(2);
    }
    Some(fit)
}

/// Measures the scale factors with the fitted biases and puts them into the calibration.
fn scale_factors(
    calibration: &mut Calibration,
    sequences: &[ScaleSequence],
    known_since: Clock,
    noise: &NoiseFactors,
    settings: &Settings,
) -> (Vec<Option<ScaleMeasurement>>, [Shift; 3]) {
    let known: Vec<&ScaleSequence> = sequences.iter().filter(|s| s.span[1] <= known_since).collect();
    let shifts = Axis::ALL.map(|axis| shift(&known, axis, noise, settings));
    let measured: Vec<Option<ScaleMeasurement>> = known
        .iter()
        .map(|sequence| {
            let (i, j) = (sequence.axis.index(), sequence.range.index());
            let bias =
                calibration.bias_and_error(sequence.axis, sequence.range, sequence.clock_s, sequence.temperature_c)?;
            let instrument = &settings.instrument;
            let use_post = !(sequence.range == Range::C && shifts[i].is_real());
            sequence.measure(bias, instrument.resolution_ng[i][j], instrument.radius_m[i], noise.factor[i], use_post)
        })
        .collect();
    for axis in Axis::ALL {
        for range in Range::ALL {
            let here = || known.iter().zip(&measured).filter(|(s, _)| s.axis == axis && s.range == range);
            let values: Vec<ScaleMeasurement> = here().filter_map(|(_, m)| *m).collect();
            let Some(mean) = combine(&values) else { continue };
            let last_counts = here().next_back().is_some_and(|(_, m)| m.is_some());
            let provenance = if last_counts { Provenance::Measured } else { Provenance::CarriedOver };
            calibration.scale[axis.index()][range.index()] =
                Scale { correction: mean.correction, sigma: mean.sigma, provenance };
        }
        let [_, b, c] = calibration.scale[axis.index()];
        if c.provenance == Provenance::Configured && b.provenance != Provenance::Configured {
            calibration.scale[axis.index()][2] = Scale {
                correction: b.correction,
                sigma: b.sigma.hypot(FROM_RANGE_B_SIGMA * b.correction),
                provenance: Provenance::FromRangeB,
            };
        }
    }
    (measured, shifts)
}

fn shift(known: &[&ScaleSequence], axis: Axis, noise: &NoiseFactors, settings: &Settings) -> Shift {
    let resolution = settings.instrument.resolution_ng(axis, Range::C);
    let half_drift = noise.half_drift_variance_ng2[axis.index()] / (resolution * resolution);
    let shifts: Vec<[f64; 2]> = known
        .iter()
        .filter(|s| s.axis == axis && s.range == Range::C)
        .filter(|s| matches!(s.refusal, None | Some(super::scale_factor::Refusal::Jitter)))
        .filter(|s| s.post[1] > 0.0)
        .map(|s| s.shift(noise.factor[axis.index()], half_drift))
        .collect();
    let weight: f64 = shifts.iter().map(|[_, sigma]| sigma.powi(-2)).sum();
    if shifts.is_empty() {
        return Shift::default();
    }
    let counts = shifts.iter().map(|[d, sigma]| d * sigma.powi(-2)).sum::<f64>() / weight;
    Shift {
        counts,
        sigma_counts: weight.powf(-0.5),
        sequences: shifts.len(),
        threshold_sigma: shift_sigma(shifts.len()),
    }
}
