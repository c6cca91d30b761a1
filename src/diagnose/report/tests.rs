//! The report of made-up answers: what must be on the page, and that it is one well-formed file.

use super::*;
use crate::diagnose::answer::{
    Alternative, EffectAnswer, Fit, FitLevel, HeldOut, Located, ParameterAnswer, Source, UpperLimit, Verdict,
};

fn diagnosis(verdict: Verdict) -> Diagnosis {
    let explained = verdict == Verdict::Explained;
    let level = |rms_ng, whitened_chi2_per_dof| FitLevel { rms_ng, whitened_chi2_per_dof };
    Diagnosis {
        schema: "oare.diagnosis/1".into(),
        case: "a <case>".into(),
        verdict,
        false_alarm_probability: if explained { 1e-4 } else { 0.4 },
        false_alarm_from: Some(Source::NullTable),
        statistic: Some(40.0),
        slow_evidence: Some(-1.0),
        located: Located { axes: vec!["x".into(), "z".into()], frame: "body".into(), ..Located::default() },
        effects: if explained {
            vec![EffectAnswer {
                id: "vent_leak".into(),
                name: "Vent or leak, decaying push".into(),
                posterior: 0.97,
                parameters: vec![
                    ParameterAnswer { name: "tau_s".into(), value: 14_210.0, sigma: 660.0, unit: "s".into() },
                    ParameterAnswer { name: "ax_ng".into(), value: 61.4, sigma: 3.3, unit: "ng".into() },
                ],
                axis: None,
                why: "A push begins 24.1 h after lift-off and decays with a time constant of four hours.".into(),
                rms_ng: Some([19.2, 7.1, 17.5]),
            }]
        } else {
            Vec::new()
        },
        alternatives: vec![Alternative { effects: vec!["bias_step".into()], posterior: 0.02, delta_bic: 7.9 }],
        hypothesis: None,
        fit: Some(Fit {
            noise_floor_ng: [40.0, 30.0, 35.0],
            before: level([45.0, 31.0, 39.0], 1.09),
            after: level([40.1, 30.0, 35.2], 1.0),
            held_out: HeldOut {
                scheme: "alternate 6 h blocks".into(),
                before_rms_ng: [45.1, 31.0, 39.2],
                after_rms_ng: [40.3, 30.1, 35.4],
                excess_removed: 0.985,
                log_score_gain: 118.2,
                log_score_gain_se: Some(15.0),
            },
            left_out_attitudes: None,
            above_placebo: Some(12.0),
            confirmed: Some(0.98),
        }),
        upper_limits: vec![UpperLimit { id: "solar_radiation_pressure".into(), limit_ng: 3.1 }],
        separating_observation: None,
        cannot_tell_apart: Vec::new(),
        arcs: Vec::new(),
        notes: Vec::new(),
    }
}

fn plates(claimed: bool) -> Plates {
    let clock_s: Vec<f64> = (0..4000).filter(|k| k % 600 > 40).map(|k| 300_000.0 + 25.0 * f64::from(k)).collect();
    let hash = |t: f64, axis: usize| ((t * 12.9898 + axis as f64 * 78.233).sin() * 43_758.547).fract();
    let leak = |t: &f64| if *t > 340_000.0 { 61.4 * (-(t - 340_000.0) / 14_210.0).exp() } else { 0.0 };
    let model = |axis: usize| -> Vec<f64> {
        clock_s.iter().map(|t| if claimed { leak(t) * [1.0, 0.3, 0.8][axis] } else { 0.0 }).collect()
    };
    let model_ng: Axes = std::array::from_fn(model);
    let before_ng = std::array::from_fn(|axis| {
        clock_s.iter().zip(&model_ng[axis]).map(|(t, m)| m + 120.0 * hash(*t, axis)).collect()
    });
    let phase = |t: &f64| (t / 5430.0).fract();
    Plates {
        liftoff_clock_s: 13_800.0,
        before_ng,
        model_ng,
        sunlit: clock_s.iter().map(|t| f64::from(u8::from(phase(t) > 0.4))).collect(),
        events: vec![
            (310_000.0, 338_800.0, "crew_sleep".into()),
            (350_000.0, 353_000.0, "water_dump".into()),
            (360_000.0, 360_000.0, "mass_change".into()),
        ],
        covariates: ["argument of latitude", "local time", "temperature", "altitude"]
            .map(|name| CovariatePlate {
                name: name.into(),
                unit: "deg".into(),
                values: clock_s.iter().map(|t| 360.0 * phase(t)).collect(),
            })
            .to_vec(),
        period_s: 5430.0,
        ladder: vec![("vent_leak".into(), 151.2), ("bias_step".into(), 147.3), ("bias_drift".into(), 88.0)],
        clock_s,
    }
}

#[test]
fn the_page_of_a_finding_holds_its_numbers_and_all_figures() {
    let report = report(&diagnosis(Verdict::Explained), &plates(true));
    let names: Vec<&str> = report.figures.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["residual.svg", "after.svg", "covariates.svg", "spectrum.svg", "ladder.svg"]);
    for needed in
        ["a &lt;case&gt;", "14210", "660", "61.4", "alternate 6 h blocks", "bias step", "solar radiation pressure"]
    {
        assert!(report.html.contains(needed), "{needed}");
    }
    assert_eq!(report.html.matches("<svg").count(), 5);
    assert!(!report.html.contains("NaN") && !report.html.contains("<script") && !report.html.contains("src="));
}

#[test]
fn a_consistent_record_has_no_figure_of_what_is_left() {
    let report = report(&diagnosis(Verdict::Consistent), &plates(false));
    assert!(!report.figures.iter().any(|(name, _)| name == "after.svg"));
    assert!(report.html.contains("agrees with the simulation"));
    assert!(report.html.contains("below 3.10 ng rms"));
}

#[test]
fn a_report_without_plates_is_words_and_tables() {
    let report = report(&diagnosis(Verdict::Unexplained), &Plates::default());
    assert!(report.html.contains("no effect of the catalogue explains"));
    assert!(!report.html.contains("NaN"));
}
