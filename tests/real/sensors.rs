//! A triad turned over by hand.

use super::{diagnose, ids};

#[test]
fn a_triad_gives_its_bias_angles_and_scales() {
    let Some(answer) = diagnose("xsens-poses", &[]) else { return };
    assert_eq!(ids(&answer), ["bias", "non_orthogonality", "scale_factor"]);
    // Published: 0.037 with bias and one scale, 0.00098 with everything.
    let rms: Vec<f64> = answer.steps.iter().map(|s| s.rms).collect();
    assert!((rms[1] - 0.037).abs() < 0.001 && rms[3] < 0.001, "{rms:?}");
    assert!(answer.fit.held_out.as_ref().is_some_and(|h| h.after_rms[0] < 0.01 * h.before_rms[0]));
}
