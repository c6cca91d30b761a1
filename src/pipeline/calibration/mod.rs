//! The calibration models: bias, scale factor, time correlation, and the faults of the instrument.
//!
//! A calibration has two times: the span it is valid for, and the instrument clock since which it can be known. The timeline
//! of versions is a function of the archive and the settings; the arrival of the telemetry plays no part in it.

pub mod accuracy;
mod anomaly;
mod apply;
pub mod bias_law;
mod findings;
mod known;
mod mean_error;
pub mod misreport;
pub mod noise;
pub mod one_sided;
pub mod saturation;
pub mod scale_factor;
pub mod sequence;
pub mod settling;
pub mod time_correlation;
mod two_position;
mod unsteady;
mod version;

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

pub use anomaly::{Anomaly, AnomalyKind, FALSE_PER_MISSION, RangeCorrection};
pub use apply::{Bias, BiasLaw, Calibrated, Calibration, Measured, Provenance, Scale};
pub use known::{KnownCalibration, KnownCalibrationError};
pub use mean_error::MeanError;
pub use two_position::BiasMeasurement;
pub use version::Shift;

use self::accuracy::AxisAccuracy;
use self::noise::{NoiseFactors, NoiseHistory};
use self::one_sided::OneSided;
use self::scale_factor::{ScaleMeasurement, ScaleSequence};
use self::sequence::{Hold, Means};
use self::time_correlation::TimeCorrelation;
use self::two_position::Pair;
use self::unsteady::Walks;
use self::version::{Material, version};
use super::archive::{Archive, RECORD_TENTHS};
use super::settings::Settings;
use super::window::{Window, Windows};
use crate::math::shared_work::both;
use crate::telemetry::{Axis, Range};
use crate::units::Clock;

/// Tenths of a second without a step of the table after which a calibration is over: its steps follow each other faster, and the
/// levels around it that tell whether it was disturbed are known by then. A version is known since then and not before, so that
/// whoever asked at any instant was given what is given later as of that instant.
pub const CALIBRATION_OVER_TENTHS: i64 = (unsteady::AROUND_S * 10.0) as i64;

/// Everything that calibration and its checks derive from an archive.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Derived {
    /// Bias measurements as the latest version sees them, in order of time.
    pub measurements: Vec<BiasMeasurement>,
    /// Scale sequences in order of time, and what the latest version makes of each.
    pub scales: Vec<(ScaleSequence, Option<ScaleMeasurement>)>,
    /// Level shifts in the scale calibrations of range C, by axis.
    pub shifts: [Shift; 3],
    /// One version per completed calibration, in the order in which they became known.
    pub timeline: Vec<Calibration>,
    /// The latest version estimated from the telemetry, also where a known calibration is used instead.
    pub estimated: Option<Calibration>,
    /// What went wrong, in order of time.
    pub anomalies: Vec<Anomaly>,
    /// Spans in which the records name a wrong range.
    pub range_corrections: Vec<RangeCorrection>,
    /// On-board estimates against the samples.
    pub one_sided: OneSided,
    /// Instrument clock against UTC.
    pub time_correlation: TimeCorrelation,
    /// The accuracy analysis in range C.
    pub accuracy: [Option<AxisAccuracy>; 3],
    /// What each version of the estimated timeline was made from, so that it need not be made again.
    signatures: Vec<u64>,
    estimates: Vec<Calibration>,
    /// Usual scatter of a window, ng, per axis.
    usual_ng: Option<[f64; 3]>,
    /// Means of the holds and walks of the calibrations, which depend on nothing but their samples.
    means: HashMap<u64, Means>,
    walks: Walks,
}

impl Derived {
    /// The latest version.
    pub fn current(&self) -> Option<&Calibration> {
        self.timeline.last()
    }

    /// Whether a window says that the records name a wrong range, and that is not told yet.
    pub fn is_news(&self, window: &Window) -> bool {
        let known = self.usual_ng.zip(self.current());
        known.is_some_and(|(usual_ng, current)| misreport::is_news(window, usual_ng, current, &self.range_corrections))
    }

    /// The version that was known at an instrument clock.
    pub fn as_of(&self, clock: Clock) -> Option<&Calibration> {
        self.timeline.iter().rev().find(|version| version.known_since <= clock)
    }
}

/// The spans of wrongly reported ranges as they were known at an instrument clock, by the calibration known then.
pub fn range_corrections_as_of(
    archive: &Archive,
    windows: &Windows,
    derived: &Derived,
    known_at: Clock,
) -> Vec<RangeCorrection> {
    let found = derived.as_of(known_at).map(|calibration| misreport::find(archive, windows, calibration, known_at));
    found.into_iter().flatten().flat_map(|(_, corrections)| corrections).collect()
}

/// Derives calibration and anomalies. With a known calibration, that one is used for every window instead. `previous` only saves
/// work: versions whose material did not change are taken from it.
pub fn derive(
    archive: &Archive,
    windows: &Windows,
    settings: &Settings,
    known: Option<&KnownCalibration>,
    previous: Option<&Derived>,
) -> Derived {
    let (mut derived, (one_sided, time_correlation)) = both(
        || estimate(archive, windows, settings, known, previous),
        || (one_sided::compare(archive, &settings.window.trim), time_correlation::correlate(archive)),
    );
    derived.one_sided = one_sided;
    derived.time_correlation = time_correlation;
    derived.accuracy = Axis::ALL.map(|axis| analyse(axis, &derived));
    find_anomalies(archive, windows, settings, &mut derived);
    derived
}

/// Bias laws and scale factors, version by version.
fn estimate(
    archive: &Archive,
    windows: &Windows,
    settings: &Settings,
    known: Option<&KnownCalibration>,
    previous: Option<&Derived>,
) -> Derived {
    let (holds, history) = both(
        || sequence::holds(archive, windows, &settings.window.trim, previous.map(|previous| &previous.means)),
        || NoiseHistory::new(windows, &settings.instrument.resolution_ng),
    );
    let mut walks = Walks::default();
    let walked = previous.map(|previous| &previous.walks);
    let mut pairs = two_position::pairs(&holds);
    let excess = unsteady::excess(&holds, &pairs, windows, settings, (&mut walks, walked));
    pairs.iter_mut().zip(excess).for_each(|(pair, excess)| pair.excess_ng2 = excess);
    let mut scales = scale_factor::sequences(archive, &holds);
    unsteady::of_scales(&holds, &mut scales, windows, settings, (&mut walks, walked));
    let configured = settings.window.correlated_samples.sqrt();
    let material = Material { pairs: &pairs, scales: &scales, settings };
    let mut derived = Derived {
        scales: scales.iter().map(|s| (s.clone(), None)).collect(),
        means: holds.iter().map(|hold| (hold.digest, hold.means)).collect(),
        walks,
        ..Derived::default()
    };
    let ends = ends(archive, &holds, &pairs, &scales);
    for (n, known_since) in ends.iter().enumerate() {
        let noise = history.at(*known_since, configured);
        let signature = signature(&holds, &pairs, &scales, *known_since, &noise, settings);
        let held = previous.filter(|p| p.signatures.get(n) == Some(&signature));
        derived.signatures.push(signature);
        let is_last = n + 1 == ends.len();
        match held {
            Some(previous) if !is_last => derived.estimates.push(previous.estimates[n].clone()),
            Some(previous) if previous.signatures.len() == ends.len() => {
                derived.estimates.push(previous.estimates[n].clone());
                derived.measurements = previous.measurements.clone();
                derived.shifts = previous.shifts;
                derived.scales = previous.scales.clone();
            }
            _ => {
                let made = version(n as u32 + 1, *known_since, noise, &material);
                derived.estimates.push(made.calibration);
                if is_last {
                    derived.measurements = made.measurements;
                    derived.shifts = made.shifts;
                    derived.scales.iter_mut().zip(made.scales).for_each(|(held, made)| held.1 = made);
                }
            }
        }
    }
    derived.estimated = derived.estimates.last().cloned();
    derived.timeline = match known {
        // What is known beforehand does not change with the windows: its noise factor is the configured one.
        Some(known) => vec![known.calibration(settings)],
        None => derived.estimates.clone(),
    };
    derived
}

/// Clocks at which a calibration with anything to measure was over.
fn ends(archive: &Archive, holds: &[Hold<'_>], pairs: &[Pair<'_, '_>], scales: &[ScaleSequence]) -> Vec<Clock> {
    let Some((_, behind_latest)) = archive.span() else { return Vec::new() };
    let apart = |pair: &[Hold<'_>]| pair[1].start().tenths() - pair[0].last().tenths() > CALIBRATION_OVER_TENTHS;
    let measured = |from: Clock, to: Clock| {
        let inside = |clock: Clock| from <= clock && clock <= to;
        pairs.iter().any(|p| inside(p.opposite.last())) || scales.iter().any(|s| inside(s.span[1]))
    };
    let mut ends = Vec::new();
    let mut first = 0;
    for last in 0..holds.len() {
        if last + 1 < holds.len() && !apart(&holds[last..last + 2]) {
            continue;
        }
        let (from, to) = (holds[first].start(), holds[last].last());
        let over = to.plus_tenths(CALIBRATION_OVER_TENTHS);
        if over < behind_latest && measured(from, to) {
            ends.push(over);
        }
        first = last + 1;
    }
    ends
}

/// Hash of everything a version is made from.
fn signature(
    holds: &[Hold<'_>],
    pairs: &[Pair<'_, '_>],
    scales: &[ScaleSequence],
    known_since: Clock,
    noise: &NoiseFactors,
    settings: &Settings,
) -> u64 {
    let mut hasher = DefaultHasher::new();
    known_since.hash(&mut hasher);
    for hold in holds.iter().take_while(|hold| hold.start() <= known_since) {
        hold.digest.hash(&mut hasher);
    }
    for pair in pairs.iter().take_while(|pair| pair.normal.start() <= known_since) {
        pair.excess_ng2.map(f64::to_bits).hash(&mut hasher);
    }
    for scale in scales.iter().filter(|scale| scale.span[1] <= known_since) {
        scale.rate_rad_s.map(f64::to_bits).hash(&mut hasher);
        (scale.refusal, scale.excess_counts2.to_bits()).hash(&mut hasher);
    }
    noise.factor.map(f64::to_bits).hash(&mut hasher);
    noise.half_drift_variance_ng2.map(f64::to_bits).hash(&mut hasher);
    settings.time.liftoff_clock_s.to_bits().hash(&mut hasher);
    hasher.finish()
}

fn find_anomalies(archive: &Archive, windows: &Windows, settings: &Settings, derived: &mut Derived) {
    let mut anomalies = Vec::new();
    let latest = archive.span().map_or(Clock::from_tenths(0), |(_, behind)| behind.plus_tenths(-RECORD_TENTHS));
    let (misreported, at_rail) = both(
        || derived.current().map(|calibration| misreport::find(archive, windows, calibration, latest)),
        || saturation::runs(archive, windows),
    );
    derived.usual_ng = derived.current().and_then(|calibration| misreport::usual_ng(windows, calibration, latest));
    for (anomaly, corrections) in misreported.into_iter().flatten() {
        anomalies.push(anomaly);
        derived.range_corrections.extend(corrections);
    }
    if let Some(settling) = derived.estimated.as_ref().and_then(|c| c.settling.as_ref()) {
        anomalies.extend(findings::settling(settling));
    }
    anomalies.extend(findings::one_sided(&derived.one_sided));
    anomalies.extend(derived.time_correlation.jumps.iter().map(findings::clock_jump));
    anomalies.extend(findings::epoch(&derived.time_correlation, &settings.time));
    let sequences: Vec<ScaleSequence> = derived.scales.iter().map(|(sequence, _)| sequence.clone()).collect();
    anomalies.extend(sequences.iter().filter_map(findings::scale));
    anomalies.extend(Axis::ALL.iter().filter_map(|axis| findings::no_scale_factor(*axis, &derived.scales)));
    anomalies
        .extend(Axis::ALL.iter().filter_map(|axis| findings::shift(*axis, &derived.shifts[axis.index()], &sequences)));
    anomalies.extend(derived.measurements.iter().filter_map(findings::outlier));
    anomalies.extend(saturation::told(&at_rail, &derived.range_corrections));
    anomalies.sort_by(|a, b| a.from.cmp(&b.from).then(a.kind.cmp(&b.kind)).then(a.axes.cmp(&b.axes)));
    derived.anomalies = anomalies;
}

/// The counterparts of Tables 4 to 6 for one axis in range C.
fn analyse(axis: Axis, derived: &Derived) -> Option<AxisAccuracy> {
    let calibration = derived.estimated.as_ref()?;
    let Some(Bias::Fitted(fit)) = &calibration.bias[axis.index()][Range::C.index()] else { return None };
    let resolution = calibration.resolution_ng[axis.index()][Range::C.index()];
    let count = fit.residuals.len();
    let of_law = || derived.measurements.iter().filter(|m| m.axis == axis && m.range == Range::C);
    let rms = |squares: &[f64]| (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
    let squares: Vec<f64> = fit.residuals.iter().map(|r| r * r).collect();
    let used: Vec<f64> =
        of_law().zip(&squares).filter(|(m, _)| m.weight > 0.0 && !m.unsteady).map(|(_, square)| *square).collect();
    let (all, rms_used) = (rms(&squares), rms(&used));
    let degrees_of_freedom = used.len() as f64 - fit.figures_carried;
    let quiet: Vec<f64> =
        of_law().zip(&squares).filter(|(m, _)| m.quiet && m.weight > 0.0 && !m.unsteady).map(|(_, s)| *s).collect();
    let quiet_rms = rms(&quiet);
    let sigmas: Vec<f64> = of_law()
        .filter_map(|m| calibration.bias_and_error(axis, Range::C, m.clock_s, m.temperature_c).map(|[_, sigma]| sigma))
        .collect();
    let [difference_rms, mean, differences] = calibration.noise?.signal_differences[axis.index()];
    let statistical_ng = accuracy::statistical_error(rms_used * resolution, degrees_of_freedom);
    Some(AxisAccuracy {
        signal_difference_rms_counts: (differences > 0.0).then_some(difference_rms),
        signal_difference_mean_counts: mean,
        signal_differences: differences,
        bias_fit_rms_counts: all,
        bias_fit_rms_used_counts: rms_used,
        bias_fit_rms_ng: all * resolution,
        bias_fit_rms_used_ng: rms_used * resolution,
        measurements: count,
        quiet_measurements: quiet.len(),
        quiet_fit_rms: (!quiet.is_empty()).then_some([quiet_rms, quiet_rms * resolution]),
        degrees_of_freedom,
        statistical_ng,
        fitted_sigma_ng: sigmas.iter().sum::<f64>() / sigmas.len().max(1) as f64 * resolution,
        total_ng: accuracy::quadrature(&[statistical_ng, calibration.systematic_bias_ng]),
    })
}
