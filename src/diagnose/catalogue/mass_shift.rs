//! The centre of gravity steps at a change of mass: a = T dr after the event, in the pattern of T only. Nearly always the log has it.

use super::{Effect, Linear, Nonlinear, ONSET, Shape, Theta, USUAL_OR_SMALL, anywhere, is_inside, no_density, onsets};
use crate::diagnose::design::Raw;
use crate::diagnose::measure::decay;
use crate::diagnose::scene::{Axes, Scene};

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "mass_shift",
    name: "Centre of gravity steps at a mass change",
    equation: "a = T dr after the event",
    source: "standard mechanics; 40-400 ng",
    covariate: "time_since_event",
    mistaken_for: &["bias_step", "cg_offset"],
    linear: &[
        Linear { name: "dx_m", unit: "m", size: 0.4, size_max: 3.0, ..Linear::PLAIN },
        Linear { name: "dy_m", unit: "m", size: 0.4, size_max: 3.0, ..Linear::PLAIN },
        Linear { name: "dz_m", unit: "m", size: 0.4, size_max: 3.0, ..Linear::PLAIN },
    ],
    scales: USUAL_OR_SMALL,
    nonlinear: &[Nonlinear { name: "onset_s", unit: "s", ..Nonlinear::PLAIN }],
    grid,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual begins at a logged change of mass and follows the gravity-gradient and rotation tensor from there on: the centre of gravity moved.",
};

/// The same at an instant that no log names.
pub const UNLOGGED: Effect = Effect {
    nonlinear: &[ONSET],
    grid: unlogged,
    log_density: anywhere,
    assumes: Some(|_, theta| {
        Some(format!(
            "the log has no change of mass at {:.0} s, where it is fitted: one is taken for forgotten",
            theta[0]
        ))
    }),
    why: "The residual begins at an instant no log names and follows the gravity-gradient and rotation tensor from there on, as it does where the centre of gravity moves.",
    ..EFFECT
};

/// The same of a logged change that takes its time: it is taken for one at the middle of it.
pub const LATE: Effect = Effect {
    nonlinear: &[ONSET],
    grid: late,
    log_density: soon_after_an_entry,
    signature: late_signature,
    assumes: Some(|scene, theta| {
        let at = before(scene, theta[0])?;
        Some(format!(
            "the change of mass that the log has at {at:.0} s is fitted {:.0} s later: one is taken that goes on for a while",
            theta[0] - at
        ))
    }),
    why: "The residual begins soon after a logged change of mass and follows the gravity-gradient and rotation tensor from there on: the centre of gravity moved, for as long as the change went on.",
    ..EFFECT
};

/// Longest time from an entry of the log to the middle of the change, s: a transfer of propellant lasts some tens of minutes.
const LATE_MAX_S: f64 = 1200.0;

/// The logged change of mass before an instant, soon enough.
fn before(scene: &Scene, onset_s: f64) -> Option<f64> {
    logged(scene).filter(|t| (0.0..LATE_MAX_S).contains(&(onset_s - t))).reduce(f64::max)
}

fn late(scene: &Scene) -> Vec<Theta> {
    let times = [0.125, 0.375, 0.625, 0.875].map(|share| share * LATE_MAX_S);
    logged(scene).flat_map(|t| times.map(|later| [t + later, 0.0])).collect()
}

fn soon_after_an_entry(scene: &Scene, _: &Theta) -> f64 {
    -(logged(scene).count().max(1) as f64 * LATE_MAX_S).ln()
}

fn late_signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    before(scene, theta[0]).and_then(|_| signature(scene, theta))
}

/// Spacing of the instants tried first, s: half an hour away the sizes fit nearly as well, and the best is refined from there. Their number
/// at most, of records of many days: each is three series as long as the record.
const UNLOGGED_SPACING_S: f64 = 3600.0;
const UNLOGGED_MAX: f64 = 100.0;

fn unlogged(scene: &Scene) -> Vec<Theta> {
    let [start, end] = scene.span_s();
    let spacing_s = UNLOGGED_SPACING_S.max((end - start) / UNLOGGED_MAX);
    onsets(scene, spacing_s, 900.0).into_iter().map(|t| [t, 0.0]).collect()
}

/// Logged changes of mass inside the record.
fn logged(scene: &Scene) -> impl Iterator<Item = f64> {
    let [start, end] = scene.span_s();
    let inside = move |t: &f64| *t > start + 600.0 && *t < end - 600.0;
    scene.case.events.iter().filter(|e| e.kind == "mass_change").map(|e| e.clock_s).filter(inside)
}

fn grid(scene: &Scene) -> Vec<Theta> {
    logged(scene).map(|t| [t, 0.0]).collect()
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    let after = decay(scene.clock_s(), theta[0], f64::INFINITY);
    let from_then_on = |arm: &Axes| -> Raw {
        arm.each_ref().map(|series| Some(series.iter().zip(&after).map(|(a, s)| a * s).collect()))
    };
    is_inside(scene, theta[0]).then(|| Shape::Columns(scene.lever_arms_ng().iter().map(from_then_on).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_a_lever_arm_from_the_logged_instant_on() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let onset_s = 112_000.0;
        assert_eq!((EFFECT.grid)(&scene), [[onset_s, 0.0]]);
        let columns = made::columns(&scene, &EFFECT, [onset_s, 0.0]);
        let [before, half, after] = [-50.0, 0.0, 50.0].map(|dt| made::at(&scene, &columns[2][2], onset_s + dt));
        assert!(
            before == 0.0 && (after + 409.0).abs() < 0.8 && (half / after - 0.5).abs() < 1e-6,
            "{before} {half} {after}"
        );
        let late = |onset_s: f64| (LATE.signature)(&scene, &[onset_s, 0.0]).is_some();
        assert!(late(onset_s + 300.0) && !late(onset_s + 1500.0) && !late(onset_s - 100.0));
    }
}
