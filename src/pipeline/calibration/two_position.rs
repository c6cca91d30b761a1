//! The bias by the two-position sequence: (mean at 0 deg + mean at 180 deg) / 2, each an adaptive trimmed mean.

use super::apply::{Bias, Calibration, Provenance, Scale};
use crate::math::robust::{TrimmedMean, trimmed_mean};
use crate::pipeline::archive::{Archive, RECORD_TENTHS};
use crate::pipeline::settings::Settings;
use crate::telemetry::{AccRecord, Axis, Mode, Range, Step};
use crate::units::Clock;

/// Seconds after the table stops that the sensor is given to settle.
const SETTLING_S: i64 = 30;
/// Tenths of a second within which both positions of one sequence lie.
const SEQUENCE_TENTHS_MAX: i64 = 2000;

/// One two-position measurement of one axis in one range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasMeasurement {
    /// OARE axis.
    pub axis: Axis,
    /// Range.
    pub range: Range,
    /// Middle of the sequence, s.
    pub clock_s: f64,
    /// Bias, counts.
    pub counts: f64,
    /// Its standard error, counts.
    pub sigma_counts: f64,
    /// Mean sensor temperature, C.
    pub temperature_c: f64,
    /// Instrument clock of the last record used.
    pub known_since: Clock,
}

/// A run of records in one step of one sequence.
struct Hold<'a> {
    target: u8,
    step: Step,
    ranges: [Range; 3],
    records: Vec<&'a AccRecord>,
}

/// Every two-position measurement in the archive, in order of time, axis and range.
pub fn measure(archive: &Archive, settings: &Settings) -> Vec<BiasMeasurement> {
    let holds = holds(archive);
    let mut measurements = Vec::new();
    for (place, normal) in holds.iter().enumerate().filter(|(_, hold)| hold.step == Step::Normal) {
        let opposite = holds[place + 1..]
            .iter()
            .take(1)
            .find(|hold| hold.step == Step::Opposite && hold.target == normal.target && hold.ranges == normal.ranges);
        let Some(opposite) = opposite else { continue };
        let axes: &[Axis] = if normal.target == 1 { &[Axis::X] } else { &[Axis::Y, Axis::Z] };
        measurements.extend(axes.iter().filter_map(|axis| pair(*axis, normal, opposite, settings)));
    }
    measurements.sort_by(|a, b| a.clock_s.total_cmp(&b.clock_s).then(a.axis.cmp(&b.axis)).then(a.range.cmp(&b.range)));
    measurements
}

fn holds(archive: &Archive) -> Vec<Hold<'_>> {
    let mut holds: Vec<Hold<'_>> = Vec::new();
    let still = |record: &&AccRecord| {
        record.mode == Mode::Bias && !record.table_moving && matches!(record.step, Step::Normal | Step::Opposite)
    };
    for record in archive.calibration_records().filter(still) {
        match holds.last_mut() {
            Some(hold)
                if hold.target == record.target
                    && hold.step == record.step
                    && hold.ranges == record.ranges
                    && record.clock.tenths() - hold.records[0].clock.tenths() < 500 =>
            {
                hold.records.push(record);
            }
            _ => holds.push(Hold {
                target: record.target,
                step: record.step,
                ranges: record.ranges,
                records: vec![record],
            }),
        }
    }
    holds
}

fn pair(axis: Axis, normal: &Hold<'_>, opposite: &Hold<'_>, settings: &Settings) -> Option<BiasMeasurement> {
    let start = opposite.records[0].clock;
    if start.tenths() - normal.records[0].clock.tenths() > SEQUENCE_TENTHS_MAX {
        return None;
    }
    let at_zero = mean_of(axis, normal.records.iter().copied(), settings)?;
    let settled = opposite
        .records
        .iter()
        .copied()
        .filter(|record| record.clock.tenths() >= start.tenths() + SETTLING_S * RECORD_TENTHS);
    let at_half_turn = mean_of(axis, settled, settings)?;
    let all = || normal.records.iter().chain(&opposite.records);
    let error = |mean: &TrimmedMean| mean.independent_standard_error() * settings.window.correlated_samples.sqrt();
    let last = opposite.records.last()?.clock;
    Some(BiasMeasurement {
        axis,
        range: normal.ranges[axis.index()],
        clock_s: 0.5 * (normal.records[0].clock.seconds() + last.seconds()),
        counts: 0.5 * (at_zero.mean + at_half_turn.mean),
        sigma_counts: 0.5 * error(&at_zero).hypot(error(&at_half_turn)),
        temperature_c: all().map(|record| f64::from(record.temperature_c)).sum::<f64>() / all().count() as f64,
        known_since: last,
    })
}

fn mean_of<'a>(axis: Axis, records: impl Iterator<Item = &'a AccRecord>, settings: &Settings) -> Option<TrimmedMean> {
    let mut counts: Vec<i16> = records
        .flat_map(|record| record.counts.iter().map(|sample| sample[axis.index()]))
        .filter(|count| !AccRecord::is_at_rail(*count))
        .collect();
    if counts.len() < settings.window.samples_min {
        return None;
    }
    counts.sort_unstable();
    trimmed_mean(&counts, &settings.window.trim)
}

/// One version each time a measurement becomes known.
pub fn timeline(measurements: &[BiasMeasurement], settings: &Settings) -> Vec<Calibration> {
    let mut known: Vec<Clock> = measurements.iter().map(|measurement| measurement.known_since).collect();
    known.sort_unstable();
    known.dedup();
    known
        .into_iter()
        .enumerate()
        .map(|(n, known_since)| version(n as u32 + 1, known_since, measurements, settings))
        .collect()
}

fn version(version: u32, known_since: Clock, measurements: &[BiasMeasurement], settings: &Settings) -> Calibration {
    let points = |axis: usize, range: usize| {
        let points: Vec<[f64; 3]> = measurements
            .iter()
            .filter(|m| m.axis.index() == axis && m.range.index() == range && m.known_since <= known_since)
            .map(|m| [m.clock_s, m.counts, m.sigma_counts])
            .collect();
        (!points.is_empty()).then_some(Bias::Interpolated(points))
    };
    let instrument = &settings.instrument;
    let scale = |correction: f64| Scale {
        correction,
        sigma: correction * instrument.scale_correction_sigma,
        provenance: Provenance::Configured,
    };
    Calibration {
        version,
        known_since,
        time: settings.time,
        bias: [0, 1, 2].map(|axis| [0, 1, 2].map(|range| points(axis, range))),
        scale: instrument.scale_correction.map(|by_range| by_range.map(scale)),
        resolution_ng: instrument.resolution_ng,
        systematic_bias_ng: instrument.systematic_bias_ng,
        systematic_scale: instrument.systematic_scale,
    }
}
