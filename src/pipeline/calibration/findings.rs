//! What the calibration's parts found wrong, in words for operators.

use std::ops::RangeInclusive;

use super::anomaly::{Anomaly, AnomalyKind};
use super::one_sided::OneSided;
use super::scale_factor::{Refusal, ScaleMeasurement, ScaleSequence, combine};
use super::settling::Transient;
use super::time_correlation::{ClockJump, TimeCorrelation};
use super::two_position::BiasMeasurement;
use super::version::Shift;
use crate::paper::page::with_error;
use crate::telemetry::{Axis, Range};
use crate::units::MissionTime;

/// Scale factors of the three axes in flight and on the ground, the extremes [Rice 1996, Table 3], and what is beyond them all by as much
/// as ground calibrations were by the capacitance of their cables, twice over.
const PUBLISHED_FACTORS: RangeInclusive<f64> = 1.025..=1.172;
const PLAUSIBLE_FACTORS: RangeInclusive<f64> = 0.75..=1.5;
/// Standard errors beyond which a factor is outside.
const FACTOR_SIGMA: f64 = 6.0;

fn capital(axis: Axis) -> String {
    axis.letter().to_uppercase()
}

/// The settling transients that are there.
pub(super) fn settling(transients: &[Transient; 2]) -> Vec<Anomaly> {
    [Axis::Y, Axis::Z]
        .into_iter()
        .zip(transients)
        .filter(|(_, transient)| transient.is_real())
        .map(|(axis, t)| Anomaly {
            kind: AnomalyKind::SettlingTransient,
            from: t.span[0],
            to: t.span[1],
            axes: vec![axis],
            value: t.skew_counts[0],
            sigma: t.skew_counts[1],
            unit: "counts",
            sentence: format!(
                "After the turn of the Y-Z bias calibration in range C, {} settles by {:.0} +- {:.0} counts with {:.1} s; left in, it \
                 would skew the bias by {:.1} +- {:.1} counts. It was taken away in {} positions.",
                capital(axis),
                t.amplitude_counts,
                t.amplitude_sigma,
                t.tau_s,
                t.skew_counts[0],
                t.skew_counts[1],
                t.positions
            ),
        })
        .collect()
}

/// The one-sided estimator, when it flew.
pub(super) fn one_sided(found: &OneSided) -> Option<Anomaly> {
    let [from, to] = found.span.filter(|_| found.flew() == Some(true))?;
    let largest = found.offset_counts[0];
    let [x, y, z] = found.offset_counts.map(|[value, sigma]| {
        let (value, sigma) = with_error(value, sigma);
        format!("{value} +- {sigma}")
    });
    Some(Anomaly {
        kind: AnomalyKind::OneSidedTrim,
        from,
        to,
        axes: Axis::ALL.to_vec(),
        value: largest[0],
        sigma: largest[1],
        unit: "counts",
        sentence: format!(
            "The on-board trimmed mean drops one point more at the high end: {} of {} estimates agree bit for bit with that \
             estimator, {} with the right one. It lowers range C by {}, {} and {} counts (X, Y, Z); the biases \
             here are measured on the ground and need no correction.",
            found.flight_exact, found.compared, found.right_exact, x, y, z
        ),
    })
}

/// Jumps between the clocks.
pub(super) fn clock_jump(jump: &ClockJump) -> Anomaly {
    Anomaly {
        kind: AnomalyKind::ClockJump,
        from: jump.before,
        to: jump.at,
        axes: Vec::new(),
        value: jump.jump_s,
        sigma: jump.sigma_s,
        unit: "s",
        sentence: format!(
            "The Orbiter's clock jumped by {:+.3} s against the instrument's; instrument time goes on, and the correlation of both is fitted anew from here.",
            jump.jump_s
        ),
    }
}

/// The Orbiter's clock is set to UTC: by more it is another epoch, s.
const EPOCH_OFF_S: f64 = 60.0;

/// Records read with an epoch that is not theirs.
pub(super) fn epoch(correlation: &TimeCorrelation, time: &MissionTime) -> Option<Anomaly> {
    let piece = correlation.pieces.first()?;
    let off_s = piece.offset_s - time.epoch_utc.as_duration().as_secs_f64();
    (off_s.abs() > EPOCH_OFF_S).then(|| Anomaly {
        kind: AnomalyKind::EpochMismatch,
        from: piece.span[0],
        to: piece.span[1],
        axes: Vec::new(),
        value: off_s,
        sigma: piece.offset_sigma_s,
        unit: "s",
        sentence: format!(
            "The records' own UTC is {off_s:+.0} s from that of `epoch_utc` ({}): all UTC told here, and Sun, shadow and geomagnetic field, \
             are by the latter.",
            time.epoch_utc
        ),
    })
}

/// Scale sequences that cannot be used, but for lost telemetry.
pub(super) fn scale(sequence: &ScaleSequence) -> Option<Anomaly> {
    let (axis, range) = (capital(sequence.axis), sequence.range.letter());
    let refusal = sequence.refusal?;
    let (kind, value, sigma, unit, sentence) = match refusal {
        Refusal::Gap | Refusal::Outlier => return None,
        Refusal::Aborted => (
            AnomalyKind::ScaleRecordDefect,
            1.0,
            0.0,
            "sequences",
            format!(
                "The scale calibration of {axis} in range {range} was aborted; it is skipped and the last good factor is carried over."
            ),
        ),
        Refusal::TablePackets => (
            AnomalyKind::ScaleRecordDefect,
            1.0,
            0.0,
            "sequences",
            format!(
                "The scale calibration of {axis} in range {range} has science records but no usable table packets; it is skipped, and \
                 reading goes on."
            ),
        ),
        Refusal::Jitter => (
            AnomalyKind::TableJitter,
            100.0 * sequence.jitter_rad_s / sequence.rate_rad_s[0].max(1e-9),
            100.0 * super::scale_factor::JITTER_RAD_S / 10.0 / sequence.rate_rad_s[0].max(1e-9),
            "%",
            format!(
                "The table's rate was unsteady by {:.2} % in the scale calibration of {axis} in range {range}; its factor is not used.",
                100.0 * sequence.jitter_rad_s / sequence.rate_rad_s[0].max(1e-9)
            ),
        ),
    };
    Some(Anomaly {
        kind,
        from: sequence.span[0],
        to: sequence.span[1],
        axes: vec![sequence.axis],
        value,
        sigma,
        unit,
        sentence,
    })
}

/// Measured scale factors that no sensor of this make has: what they are made with is wrong.
pub(super) fn no_scale_factor(axis: Axis, scales: &[(ScaleSequence, Option<ScaleMeasurement>)]) -> Option<Anomaly> {
    let of_axis: Vec<_> =
        scales.iter().filter_map(|(s, m)| m.filter(|_| s.axis == axis).map(|m| (s.span, m))).collect();
    let measured: Vec<ScaleMeasurement> = of_axis.iter().map(|(_, m)| *m).collect();
    let ScaleMeasurement { correction, sigma } = combine(&measured)?;
    let told = with_error(correction, sigma);
    let off = (PLAUSIBLE_FACTORS.start() - correction).max(correction - PLAUSIBLE_FACTORS.end());
    (off > FACTOR_SIGMA * sigma).then(|| Anomaly {
        kind: AnomalyKind::ScaleRecordDefect,
        from: of_axis[0].0[0],
        to: of_axis[of_axis.len() - 1].0[1],
        axes: vec![axis],
        value: correction,
        sigma,
        unit: "ratio",
        sentence: format!(
            "The scale calibrations of {axis} give a factor of {} +- {}; those published are {} to {}. `instrument.radius_m` or \
             `instrument.resolution_{}_ng` is wrong, or the table's packets are; the values in ng are by the measured factor.",
            told.0,
            told.1,
            PUBLISHED_FACTORS.start(),
            PUBLISHED_FACTORS.end(),
            axis.letter(),
            axis = capital(axis),
        ),
    })
}

/// Levels that differ before and after the rate.
pub(super) fn shift(axis: Axis, shift: &Shift, sequences: &[ScaleSequence]) -> Option<Anomaly> {
    let mut of_axis = sequences.iter().filter(|s| s.axis == axis && s.range == Range::C && s.post[1] > 0.0);
    let first = of_axis.next().filter(|_| shift.is_real())?;
    let last = of_axis.next_back().unwrap_or(first);
    Some(Anomaly {
        kind: AnomalyKind::ElectronicShift,
        from: first.span[0],
        to: last.span[1],
        axes: vec![axis],
        value: shift.counts,
        sigma: shift.sigma_counts,
        unit: "counts",
        sentence: format!(
            "In the scale calibration of {} in range C the level after the rate differs from the level before by {:+.0} +- {:.0} counts over \
             {} sequences: an electronic shift. Only the level before is used.",
            capital(axis),
            shift.counts,
            shift.sigma_counts,
            shift.sequences
        ),
    })
}

/// Bias measurements far from the law of all others.
pub(super) fn outlier(measurement: &BiasMeasurement) -> Option<Anomaly> {
    if measurement.weight > 0.0 {
        return None;
    }
    let sigma = measurement.sigma_counts;
    let value = measurement.deleted_sigma * sigma;
    Some(Anomaly {
        kind: AnomalyKind::BiasOutlier,
        from: measurement.known_since.plus_tenths(-1240),
        to: measurement.known_since.plus_tenths(10),
        axes: vec![measurement.axis],
        value,
        sigma,
        unit: "counts",
        sentence: format!(
            "A bias of {} in range {} lies {value:+.1} counts ({:.1} standard errors) off the law of all others; it is not used.",
            capital(measurement.axis),
            measurement.range.letter(),
            measurement.deleted_sigma.abs()
        ),
    })
}
