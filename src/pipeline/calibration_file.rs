//! `calibration.json`: measurements, laws, scale factors, corrections, accuracy, and the times all that is valid for.

use serde_json::{Map, Value, json};

use super::calibration::accuracy::{AxisAccuracy, published};
use super::calibration::bias_law::BiasFit;
use super::calibration::scale_factor::{ScaleMeasurement, ScaleSequence};
use super::calibration::settling::Transient;
use super::calibration::{Bias, BiasMeasurement, Calibration, Derived, RangeCorrection, Scale};
use super::files::rounded;
use super::station::Station;
use crate::telemetry::{Axis, Range};
use crate::units::Clock;

/// `calibration.json`.
pub fn calibration_json(station: &Station) -> Value {
    let derived = station.derived();
    let versions: Vec<Value> = derived
        .timeline
        .iter()
        .enumerate()
        .map(|(n, calibration)| {
            let next = derived.timeline.get(n + 1).map(|next| next.known_since.seconds());
            json!({
                "version": calibration.version,
                "known_since_clock_s": calibration.known_since.seconds(),
                "superseded_clock_s": next,
            })
        })
        .collect();
    json!({
        "measurements": derived.measurements.iter().map(measurement_json).collect::<Vec<_>>(),
        "scale_measurements": derived.scales.iter().map(|(s, m)| scale_measurement_json(s, m.as_ref())).collect::<Vec<_>>(),
        "current": derived.current().map(version_json),
        "versions": versions,
        "corrections": corrections_json(derived),
        "time_correlation": time_correlation_json(derived),
        "accuracy": accuracy_json(derived),
    })
}

fn measurement_json(measurement: &BiasMeasurement) -> Value {
    json!({
        "axis": measurement.axis.letter(),
        "range": measurement.range.letter(),
        "target": measurement.target,
        "clock_s": rounded(measurement.clock_s, 1),
        "counts": rounded(measurement.counts, 4),
        "sigma_counts": rounded(measurement.sigma_counts, 4),
        "temperature_c": rounded(measurement.temperature_c, 4),
        "settling_removed_counts": rounded(measurement.settling_counts, 4),
        "trim": measurement.trim.map(|trim| rounded(trim, 4)),
        "quiet": measurement.quiet,
        "unsteady": measurement.unsteady,
        "use": measurement.use_word(),
        "weight": rounded(measurement.weight, 3),
        "deviation_sigma": rounded(measurement.deleted_sigma, 3),
        "known_since_clock_s": measurement.known_since.seconds(),
    })
}

fn scale_measurement_json(sequence: &ScaleSequence, measured: Option<&ScaleMeasurement>) -> Value {
    json!({
        "axis": sequence.axis.letter(),
        "range": sequence.range.letter(),
        "calibration_id": sequence.calibration_id,
        "clock_s": rounded(sequence.clock_s, 1),
        "pre_counts": rounded(sequence.pre[0], 3),
        "rate_counts": rounded(sequence.rate[0], 3),
        "post_counts": rounded(sequence.post[0], 3),
        "rate_rad_s": rounded(sequence.rate_rad_s[0], 8),
        "half_travel_rad": rounded(sequence.half_travel_rad, 6),
        "correction": measured.map(|m| rounded(m.correction, 6)),
        "sigma": measured.map(|m| rounded(m.sigma, 6)),
        "use": sequence.refusal.map_or(if measured.is_some() { "used" } else { "no bias" }, |refusal| refusal.word()),
    })
}

fn fit_json(fit: &BiasFit) -> Value {
    let names = ["a1", "a2", "a3", "a4", "ln_t0", "ln_t1"];
    let carried: Map<String, Value> = names.iter().zip(fit.carried).map(|(n, c)| ((*n).into(), json!(c))).collect();
    json!({
        "form": fit.form(),
        "reason": fit.reason(),
        "a": fit.law.a,
        "t_h": fit.law.t_h,
        "covariance_of": names,
        "covariance": fit.covariance,
        "carried_by_measurements": carried,
        "figures_carried": fit.figures_carried,
        "residual_rms_counts": fit.residual_rms,
        "r_squared": fit.r_squared,
        "degrees_of_freedom": fit.degrees_of_freedom,
        "chi2_reduced": fit.chi2_reduced,
        "drift_sigma_counts": fit.drift_variance.sqrt(),
        "measurements": fit.weights.len(),
        "outliers": fit.weights.iter().filter(|weight| **weight == 0.0).count(),
        "supported_met_h": fit.span_h,
    })
}

fn bias_json(bias: Option<&Bias>) -> Value {
    match bias {
        None => Value::Null,
        Some(Bias::Known(law)) => json!({"form": "known law", "a": law.a, "t_h": law.t_h}),
        Some(Bias::Fitted(fit)) => fit_json(fit),
    }
}

fn scale_json(scale: &Scale) -> Value {
    json!({"correction": scale.correction, "sigma": scale.sigma, "provenance": scale.provenance.word()})
}

/// The calibration in use or the one known at an instrument clock, and the ranges that were corrected with it; none where none was known.
pub fn known_json(station: &Station, known_at: Option<Clock>) -> Option<Value> {
    let derived = station.derived();
    let (version, corrections) = match known_at {
        None => (derived.current()?, derived.range_corrections.clone()),
        Some(clock) => (derived.as_of(clock)?, station.range_corrections_as_of(clock)),
    };
    let mut json = version_json(version);
    json["range_corrections"] = range_corrections_json(&corrections).into();
    Some(json)
}

/// One version of the calibration.
pub fn version_json(calibration: &Calibration) -> Value {
    let mut axes = Map::new();
    for axis in Axis::ALL {
        let mut ranges = Map::new();
        for range in Range::ALL {
            let (i, j) = (axis.index(), range.index());
            let bias = bias_json(calibration.bias[i][j].as_ref());
            ranges.insert(range.letter().into(), json!({"bias": bias, "scale": scale_json(&calibration.scale[i][j])}));
        }
        axes.insert(axis.letter().into(), Value::Object(ranges));
    }
    let noise = calibration.noise.map(
        |noise| json!({"factor": noise.factor, "half_drift_75_s_ng": noise.half_drift_variance_ng2.map(f64::sqrt)}),
    );
    json!({
        "version": calibration.version,
        "known_since_clock_s": calibration.known_since.seconds(),
        "axes": axes,
        "noise": noise,
        "settling": calibration.settling.as_ref().map(|both| both.iter().map(transient_json).collect::<Vec<_>>()),
        "systematic_bias_ng": calibration.systematic_bias_ng,
        "systematic_scale": calibration.systematic_scale,
    })
}

fn transient_json(transient: &Transient) -> Value {
    json!({
        "amplitude_counts": transient.amplitude_counts,
        "amplitude_sigma_counts": transient.amplitude_sigma,
        "tau_s": transient.tau_s,
        "skew_counts": transient.skew_counts[0],
        "skew_sigma_counts": transient.skew_counts[1],
        "positions": transient.positions,
    })
}

fn corrections_json(derived: &Derived) -> Value {
    let one_sided = &derived.one_sided;
    let convention = "biases are measured on the ground from raw telemetry with the two-sided estimator: A1 is raised by nothing; an \
                      A1 for use on board is lower by offset_counts when the one-sided estimator flew";
    json!({
        "one_sided_trim": {
            "flew": one_sided.flew(),
            "compared": one_sided.compared,
            "flight_exact": one_sided.flight_exact,
            "right_exact": one_sided.right_exact,
            "offset_counts": one_sided.offset_counts.map(|o| o[0]),
            "offset_sigma_counts": one_sided.offset_counts.map(|o| o[1]),
            "a1_convention": convention,
        },
        "settling": derived.estimated.as_ref().and_then(|c| c.settling.as_ref()).is_some(),
        "ranges": range_corrections_json(&derived.range_corrections),
    })
}

fn range_corrections_json(corrections: &[RangeCorrection]) -> Vec<Value> {
    let correction = |c: &RangeCorrection| {
        json!({
            "from_clock_s": c.from.seconds(), "to_clock_s": c.to.seconds(), "axis": c.axis.letter(),
            "reported": c.reported.letter(), "actual": c.actual.letter(),
        })
    };
    corrections.iter().map(correction).collect()
}

fn time_correlation_json(derived: &Derived) -> Value {
    let correlation = &derived.time_correlation;
    json!({
        "pieces": correlation.pieces.iter().map(|p| json!({
            "from_clock_s": p.span[0].seconds(),
            "to_clock_s": p.span[1].seconds(),
            "reference_clock_s": rounded(p.reference_s, 3),
            "unix_less_clock_s": rounded(p.offset_s, 6),
            "sigma_s": p.offset_sigma_s,
            "drift_ppm": p.drift_ppm,
            "drift_sigma_ppm": p.drift_sigma_ppm,
            "residual_s": p.residual_s,
            "records": p.records,
        })).collect::<Vec<_>>(),
        "jumps": correlation.jumps.iter().map(|j| json!({
            "at_clock_s": j.at.seconds(), "jump_s": j.jump_s, "sigma_s": j.sigma_s,
        })).collect::<Vec<_>>(),
    })
}

/// The accuracy analysis, with what was published beside it.
pub(super) fn accuracy_json(derived: &Derived) -> Value {
    let mut axes = Map::new();
    for axis in Axis::ALL {
        let i = axis.index();
        let published = json!({
            "signal_difference_rms_counts": published::SIGNAL_DIFFERENCE_COUNTS[i],
            "bias_fit_rms_counts": published::BIAS_FIT_COUNTS[i][0],
            "bias_fit_rms_ng": published::BIAS_FIT_NG[i][0],
            "statistical_ng": published::STS65_STATISTICAL_NG[i],
        });
        let here = derived.accuracy[i].as_ref().map(axis_accuracy_json);
        axes.insert(axis.letter().into(), json!({"mission": here, "published_sts65": published}));
    }
    Value::Object(axes)
}

fn axis_accuracy_json(a: &AxisAccuracy) -> Value {
    json!({
        "signal_difference_rms_counts": a.signal_difference_rms_counts,
        "signal_difference_mean_counts": a.signal_difference_mean_counts,
        "signal_differences": a.signal_differences,
        "bias_fit_rms_counts": a.bias_fit_rms_counts,
        "bias_fit_rms_without_outliers_counts": a.bias_fit_rms_used_counts,
        "bias_fit_rms_ng": a.bias_fit_rms_ng,
        "bias_fit_rms_without_outliers_ng": a.bias_fit_rms_used_ng,
        "measurements": a.measurements,
        "quiet_measurements": a.quiet_measurements,
        "quiet_bias_fit_rms_counts": a.quiet_fit_rms.map(|[counts, _]| counts),
        "quiet_bias_fit_rms_ng": a.quiet_fit_rms.map(|[_, ng]| ng),
        "degrees_of_freedom": a.degrees_of_freedom,
        "statistical_ng": a.statistical_ng,
        "fitted_sigma_ng": a.fitted_sigma_ng,
        "statistical_and_systematic_ng": a.total_ng,
    })
}
