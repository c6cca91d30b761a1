//! What came down as the recording of a case: a dump through the whole pipeline, its calibration estimated from the dump itself,
//! or the windows of a station as it stands.
//!
//! Only whole windows of normal mode with a calibration around them are used; where the records named a wrong range the
//! corrected value is. The covariance of the bias law and the error of the scale factor come along: what they leave open is the same in all
//! windows, and no finding.

use nalgebra::DMatrix;
use rapidhash::v3::rapidhash_v3;

use super::case::{Case, Fault, FittedLaw, Header, Recording, Texts};
use super::error::CaseError;
use super::noise::{Flip, Flips, dot};
use crate::ingest::wire::{PlaybackPart, PlaybackReader};
use crate::math::rms::about_mean;
use crate::math::robust::rounding_error_trimmed;
use crate::pipeline::calibration::{
    Anomaly, Bias, BiasMeasurement, Calibration, Provenance, bias_law::PARAMETERS, saturation,
};
use crate::pipeline::station::{Station, replay};
use crate::pipeline::window::{AxisWindow, Window};
use crate::pipeline::{Ledger, PlaybackId, Product, Settings};
use crate::telemetry::{Mode, Quality, Range};
use crate::units::MissionTime;

/// OARE axis of each body axis, and which way it points there.
const OARE_AXIS: [usize; 3] = [0, 2, 1];
const OARE_SIGN: [f64; 3] = [1.0, 1.0, -1.0];

/// Which usable windows a station has, without what is in them: enough to know whether there is anything new.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Seen {
    /// Usable windows within the span that was asked for.
    pub windows: usize,
    /// Usable windows beyond it.
    pub beyond: usize,
    /// Digest of the revisions of the windows within: the same windows, the same digest.
    pub digest: u64,
    /// Version of their calibration; 0: none.
    pub calibration: u32,
}

/// The usable windows of a station, copied with what their errors derive from: the station is needed no longer.
#[derive(Debug, Clone, Default)]
pub struct Taken {
    recording: Recording,
    conditions: Vec<Conditions>,
    calibration: Option<Calibration>,
    measurements: Vec<BiasMeasurement>,
}

/// What may be said of a window that is used. Beyond the first and the last calibration the law of the bias is less certain, and what it
/// leaves open there is a nuisance of the fit as everywhere: four hours at either end of a day are not given away.
const FORGIVEN: Quality = Quality::RANGE_CORRECTED.with_if(Quality::EXTRAPOLATED, true);

/// A window whose mean the rounding to whole counts may have moved by more than this share of its statistical error is left out: what it
/// moves follows the signal from window to window, and would be found. It happens in range A, of which a count is 300 ng and more.
const ROUNDED_AWAY: f64 = 0.5;

/// Whether counts are fine enough for what scatters in a window, on every axis.
fn is_resolved(window: &Window) -> bool {
    let resolved = |axis: &AxisWindow| {
        let estimate = &axis.estimate;
        rounding_error_trimmed(estimate.winsorised_sd) < ROUNDED_AWAY * estimate.independent_standard_error()
    };
    window.axes.iter().flatten().all(resolved)
}

/// The windows of a station that a diagnosis may use, with their deviations on the body axes, ng.
fn usable_windows(station: &Station) -> impl Iterator<Item = (&Window, &Product, [f64; 3])> {
    let calibration = station.calibration();
    station.windows().zip(station.products()).filter_map(move |(window, product)| {
        let calibration = calibration?;
        let may = product.quality.is_good_but_for(FORGIVEN)
            && is_resolved(window)
            && product.mode == Mode::Normal
            && product.acceleration.whole().is_some();
        let deviation_ng = if may { deviation_ng(calibration, window, product) } else { None };
        Some((window, product, deviation_ng?))
    })
}

/// Which usable windows a station has, those with their centre in a span and those beyond it.
pub fn seen(station: &Station, span_s: [f64; 2]) -> Seen {
    let mut seen = Seen { calibration: station.calibration().map_or(0, |c| c.version), ..Seen::default() };
    for (window, product, _) in usable_windows(station) {
        if (span_s[0]..=span_s[1]).contains(&window.centre_s()) {
            // A revision at a time: the windows come in one order.
            seen.digest = rapidhash_v3([seen.digest, product.revision.0].map(u64::to_le_bytes).as_flattened());
            seen.windows += 1;
        } else {
            seen.beyond += 1;
        }
    }
    seen
}

/// Copies the usable windows of a station whose centres are in a span.
pub fn taken(station: &Station, span_s: [f64; 2]) -> Taken {
    let mut taken = Taken { calibration: station.calibration().cloned(), ..Taken::default() };
    for (window, product, deviation_ng) in usable_windows(station) {
        let Some(acceleration) = product.acceleration.whole() else { continue };
        if !(span_s[0]..=span_s[1]).contains(&window.centre_s()) {
            continue;
        }
        let recording = &mut taken.recording;
        recording.clock_s.push(window.centre_s());
        for k in 0..3 {
            recording.a_ng[k].push(acceleration[k].trimmed_ng);
            recording.dev_ng[k].push(deviation_ng[k]);
        }
        taken.conditions.push((window.centre_s(), window.temperature_c, product.range));
    }
    let fault = |a: &Anomaly| Fault {
        kind: a.kind,
        span_s: [a.from.seconds(), a.to.seconds()],
        sentence: a.sentence.clone(),
        answered: saturation::is_answered(station.archive(), a),
    };
    taken.recording.faults = station.derived().anomalies.iter().map(fault).collect();
    taken.recording.not_come = not_come(station.ledger());
    taken.measurements = station.derived().measurements.clone();
    taken
}

/// What was refused of frames and packets, and the seconds between the first and the last that nothing came of.
fn not_come(ledger: &Ledger) -> Option<String> {
    let total = ledger.total();
    let mut said = Vec::new();
    let frames: u64 = total.frames_refused.values().sum();
    if frames > 0 {
        let by: Vec<String> = total.frames_refused.iter().map(|(why, n)| format!("{} {n}", why.word())).collect();
        said.push(format!("{frames} of {} frames are refused ({})", total.frames_found, by.join(", ")));
    }
    if !total.packets_refused.is_empty() {
        let by: Vec<String> = total.packets_refused.iter().map(|(why, n)| format!("{why} {n}")).collect();
        said.push(format!("packets are refused ({})", by.join(", ")));
    }
    let gaps = ledger.seconds.gaps();
    if !gaps.is_empty() {
        let missing: i64 = gaps.iter().map(|(from, to)| to - from).sum();
        said.push(format!("{missing} s have no science record (gaps: {})", gaps.len()));
    }
    (!said.is_empty()).then(|| format!("of what came down {}", said.join("; ")))
}

impl Taken {
    /// The recording, with what the bias laws of its calibration leave open.
    pub fn recording(self) -> Recording {
        let Self { mut recording, conditions, calibration, measurements } = self;
        if let Some(calibration) = calibration {
            recording.bias_errors_ng = OARE_AXIS.map(|axis| bias_errors(&calibration, axis, &conditions));
            recording.scale_errors = OARE_AXIS.map(|axis| scale_errors(&calibration, axis, &conditions));
            recording.bias_laws = std::array::from_fn(|k| bias_laws(&calibration, k, &measurements, &conditions));
        }
        recording
    }
}

/// Every clock there is.
pub const ALL_TIME: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Clock at the centre of a window, its temperature, C, and the range of each axis.
type Conditions = (f64, f64, [Option<Range>; 3]);

/// An unmeasured scale factor is open by this share at least: those of the ranges of one axis differ by up to five percent, those of
/// instruments by more.
const UNMEASURED_SHARE: f64 = 0.1;

/// The relative errors of the scale factors of an OARE axis, range by range. One that this record did not measure, configured for the
/// instrument at large or taken from another range, is hardly known.
fn scale_errors(calibration: &Calibration, axis: usize, windows: &[Conditions]) -> Vec<Vec<f64>> {
    let of_range = |range: Range| {
        let scale = calibration.scale[axis][range.index()];
        let measured = matches!(scale.provenance, Provenance::Measured | Provenance::CarriedOver);
        let share = match scale.sigma / scale.correction {
            known if measured || known == 0.0 => known,
            open => open.max(UNMEASURED_SHARE),
        };
        let is_in = |(_, _, ranges): &Conditions| ranges[axis] == Some(range);
        windows.iter().map(|at| if is_in(at) { share } else { 0.0 }).collect::<Vec<f64>>()
    };
    Range::ALL.map(of_range).into_iter().filter(|series| series.iter().any(|share| *share > 0.0)).collect()
}

/// What the bias laws of an OARE axis leave open at the windows, ng: those of one range are nothing to the windows of another.
fn bias_errors(calibration: &Calibration, axis: usize, windows: &[Conditions]) -> Vec<Vec<f64>> {
    let mut errors = Vec::new();
    for range in Range::ALL {
        let Some(fit) = calibration.bias[axis][range.index()].as_ref().and_then(Bias::fit) else { continue };
        let ng_per_count = ng_per_count(calibration, axis, range);
        let open = fit.open_errors();
        let at = |(clock_s, temperature_c, ranges): &Conditions| match ranges[axis] == Some(range) {
            true => open(calibration.time.met_h(*clock_s), *temperature_c).map(|counts| counts * ng_per_count),
            false => [0.0; PARAMETERS],
        };
        let windows: Vec<[f64; PARAMETERS]> = windows.iter().map(at).collect();
        errors.extend((0..PARAMETERS).map(|j| windows.iter().map(|w| w[j]).collect::<Vec<f64>>()));
    }
    principal(&errors)
}

/// The bias laws of a body axis at the windows, each with the measurements it was fitted to. From count to count and from nanog to
/// nanog are the same shares: a law and its measurements are of one range.
fn bias_laws(
    calibration: &Calibration,
    body_axis: usize,
    measurements: &[BiasMeasurement],
    windows: &[Conditions],
) -> Vec<FittedLaw> {
    let axis = OARE_AXIS[body_axis];
    let law = |range: Range| {
        let fit = calibration.bias[axis][range.index()].as_ref().and_then(Bias::fit)?;
        if !windows.iter().any(|(_, _, ranges)| ranges[axis] == Some(range)) {
            return None;
        }
        let of_law: Vec<&BiasMeasurement> =
            measurements.iter().filter(|m| m.axis.index() == axis && m.range == range).collect();
        let gradients: Vec<[f64; PARAMETERS]> = windows
            .iter()
            .map(|(clock_s, temperature_c, ranges)| match ranges[axis] == Some(range) {
                true => fit.gradient_at(calibration.time.met_h(*clock_s), *temperature_c),
                false => [0.0; PARAMETERS],
            })
            .collect();
        let ng = OARE_SIGN[body_axis] * ng_per_count(calibration, axis, range);
        let flip = |(m, rest_counts): (&&BiasMeasurement, &f64)| Flip {
            clock_s: m.clock_s,
            rest_ng: ng * rest_counts,
            sigma_ng: ng.abs() * m.sigma_counts,
            gradient_ng: fit.gradient_at(calibration.time.met_h(m.clock_s), m.temperature_c).map(|g| ng * g),
        };
        let flips: Vec<Flip> = of_law.iter().zip(&fit.residuals).map(flip).collect();
        Some(FittedLaw {
            measured_s: of_law.iter().map(|m| m.clock_s).collect(),
            answers: by_figure(&fit.answers),
            gradients: by_figure(&gradients),
            flips: Flips::new(&flips, &fit.departures),
        })
    };
    Range::ALL.into_iter().filter_map(law).collect()
}

fn ng_per_count(calibration: &Calibration, axis: usize, range: Range) -> f64 {
    calibration.resolution_ng[axis][range.index()] * calibration.scale[axis][range.index()].correction
}

fn by_figure(rows: &[[f64; PARAMETERS]]) -> Vec<Vec<f64>> {
    (0..PARAMETERS).map(|j| rows.iter().map(|row| row[j]).collect()).collect()
}

/// The same errors by fewer series: sums of them that vary independently, without those that hardly vary. What is the same in all
/// windows is no series' business, a constant is nuisance anyway.
fn principal(errors: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let windows = errors.first().map_or(0, Vec::len);
    if windows == 0 {
        return Vec::new();
    }
    let vary: Vec<Vec<f64>> = errors.iter().map(|series| about_mean(series)).collect();
    let covariance = DMatrix::from_fn(errors.len(), errors.len(), |i, j| dot(&vary[i], &vary[j]) / windows as f64);
    let eigen = covariance.symmetric_eigen();
    let told = (0..errors.len()).filter(|j| eigen.eigenvalues[*j].max(0.0).sqrt() > NEGLIGIBLE_NG);
    told.map(|j| {
        let mut sum = vec![0.0; windows];
        for (series, share) in vary.iter().zip(&eigen.eigenvectors.column(j)) {
            sum.iter_mut().zip(series).for_each(|(sum, x)| *sum += share * x);
        }
        sum
    })
    .collect()
}

/// An error that all windows share and that varies less is left out, ng rms: over a day of the quietest windows known, 25 ng of noise, it has an SNR of
/// half a standard deviation.
pub(super) const NEGLIGIBLE_NG: f64 = 0.25;

/// A case whose files somebody has by their names, `None` where there is no such file; a dump is taken through the pipeline. `set` are
/// `key=value` overrides of `case.toml`.
///
/// # Errors
/// The first file that is missing, cannot be read or is wrong; a recording of another kind.
pub fn case(file: impl Fn(&str) -> Result<Option<Vec<u8>>, CaseError>, set: &[String]) -> Result<Case, CaseError> {
    let named = |name: &str| if name.is_empty() { Ok(None) } else { file(name) };
    let text = |name: &str| named(name)?.map(|octets| text(name, octets)).transpose();
    let header = text("case.toml")?.ok_or_else(|| CaseError::Toml("there is none".into()))?;
    let header = Header::parse(&header, set)?;
    let files = header.files.clone();
    let texts = Texts {
        recording: None,
        simulation: text(&files.simulation)?,
        ancillary: text(&files.ancillary)?,
        events: text(&files.events)?,
    };
    match header.kind.as_str() {
        "acceleration_csv" => Case::from_texts(header, &Texts { recording: text(&files.recording)?, ..texts }),
        "recorder_dump" => {
            let missing = || CaseError::MissingFile { file: files.recording.clone() };
            let dump = named(&files.recording)?.ok_or_else(missing)?;
            unpacked(&files.recording, &dump)?;
            let recording = recorded(&dump, &header);
            if recording.clock_s.is_empty() {
                return Err(CaseError::NoWindows { file: files.recording, octets: dump.len() });
            }
            Case::of(header, recording, &texts)
        }
        _ => Err(CaseError::Kind(header.kind)),
    }
}

/// Whether a file is as it is told, and not packed for its way.
fn unpacked(name: &str, octets: &[u8]) -> Result<(), CaseError> {
    const PACKED: [(&[u8], &str); 4] =
        [(b"\x1f\x8b", "gzip"), (b"PK\x03\x04", "zip"), (b"\x28\xb5\x2f\xfd", "zstd"), (b"\xfd7zXZ", "xz")];
    match PACKED.into_iter().find(|(begins, _)| octets.starts_with(begins)) {
        Some((_, by)) => Err(CaseError::Unreadable { file: name.into(), reason: format!("it is packed by {by}") }),
        None => Ok(()),
    }
}

/// The text in the octets of a file.
///
/// # Errors
/// The first octet that is none of a text.
pub fn text(name: &str, octets: Vec<u8>) -> Result<String, CaseError> {
    unpacked(name, &octets)?;
    String::from_utf8(octets).map_err(|error| CaseError::Unreadable {
        file: name.into(),
        reason: format!("octet {} is no UTF-8 text", error.utf8_error().valid_up_to() + 1),
    })
}

/// The windows of a dump.
pub fn recorded(dump: &[u8], header: &Header) -> Recording {
    let time = MissionTime { epoch_utc: header.epoch_utc, liftoff_clock_s: header.liftoff_clock_s };
    let settings = Settings { time, ..Settings::sts65() };
    let station = replay(&settings, None, |station| take(station, &settings, dump));
    taken(&station, ALL_TIME).recording()
}

fn take(station: &mut Station, settings: &Settings, dump: &[u8]) {
    let mut reader = PlaybackReader::new(settings.link);
    let mut next = 0;
    let mut file = |part: PlaybackPart| match part {
        PlaybackPart::Opened => {
            next += 1;
            station.open_playback(PlaybackId(next));
        }
        PlaybackPart::Arrival(arrival) => station.take(PlaybackId(next), &arrival),
        PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(next), bits),
    };
    reader.push(dump, &mut file);
    reader.finish(&mut file);
}

/// The deviation of a window on the body axes, when all of its axes are calibrated.
fn deviation_ng(calibration: &Calibration, window: &Window, product: &Product) -> Option<[f64; 3]> {
    let ng = OARE_AXIS.map(|axis| {
        let (window, range) = (window.axes[axis]?, product.range[axis]?);
        Some(window.estimate.deviation * ng_per_count(calibration, axis, range))
    });
    let [Some(x), Some(y), Some(z)] = ng else { return None };
    Some([x, y, z])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::wire::FrameRefusal;
    use crate::units::Clock;

    #[test]
    fn what_did_not_come_of_a_dump_is_told_and_of_a_whole_one_nothing() {
        let second = |s: i64| Clock::from_tenths(10 * s);
        let mut ledger = Ledger::default();
        (0..100).for_each(|s| ledger.seconds.add(second(s)));
        assert_eq!(not_come(&ledger), None);
        (130..150).for_each(|s| ledger.seconds.add(second(s)));
        let account = &mut ledger.playback_mut(PlaybackId(1)).account;
        account.frames_found = 40;
        account.frames_refused.insert(FrameRefusal::Fecf, 3);
        let told = "of what came down 3 of 40 frames are refused (fecf 3); 30 s have no science record (gaps: 1)";
        assert_eq!(not_come(&ledger).as_deref(), Some(told));
    }
}
