//! A unit that lay still for days, and a triad turned over by hand.

use oare_ground::diagnose::answer::Verdict;

use super::{contributions_add_up, diagnose, ids};

#[test]
fn a_triad_gives_its_bias_angles_and_scales() {
    let Some(answer) = diagnose("xsens-poses", &[]) else { return };
    assert_eq!(ids(&answer), ["bias", "scale_factor", "non_orthogonality"]);
    // Published: 0.037 with bias and one scale, 0.00098 with everything.
    let rms: Vec<f64> = answer.steps.iter().map(|s| s.rms).collect();
    assert!((rms[1] - 0.037).abs() < 0.001 && rms[3] < 0.001, "{rms:?}");
    contributions_add_up(&answer, 0.01);
    let held = answer.fit.held_out.expect("poses to predict");
    assert!(held.after_rms[0] < 0.01 * held.before_rms[0]);
    assert!(held.log_score_gain.unwrap() > 5.0 * held.log_score_gain_se.unwrap(), "{held:?}");
}

#[test]
fn the_bias_follows_temperature_and_the_gyro_does_not() {
    let Some(answer) = diagnose("astro-pi-2015", &[]) else { return };
    for arc in &answer.arcs {
        println!("{} {:?} {:.4e} -> {:.4e} {:?}", arc.id, arc.verdict, arc.rms_before, arc.rms_after, arc.note);
        for e in &arc.effects {
            println!("   {} {:?} {}", e.id, e.parameters, e.why);
        }
    }
    contributions_add_up(&answer, 0.01);
    // Published slopes, mg/C.
    for (column, slope) in [("accel_x", 0.57e-3), ("accel_y", 0.41e-3), ("accel_z", -0.41e-3)] {
        let arc = answer.arcs.iter().find(|a| a.id == column).expect("an axis");
        let effect = arc.effects.iter().find(|e| e.id == "temperature_bias").expect(column);
        let found = &effect.parameters[0];
        assert!((found.value - slope).abs() < 2.0 * found.sigma, "{column} {found:?}");
    }
    let gyro = answer.arcs.iter().filter(|a| a.id.starts_with("gyro"));
    assert!(gyro.clone().count() == 3 && gyro.clone().all(|a| a.verdict == Verdict::Consistent));
    assert!(answer.notes.iter().any(|n| n.starts_with("accel_z")), "what is left in z: {:?}", answer.notes);
}
