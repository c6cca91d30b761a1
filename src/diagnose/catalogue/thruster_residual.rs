//! A push while a logged event of kind `thruster` lasts.

use super::{Effect, Shape, USUAL_OR_SMALL, added, no_density, one_point, push};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "thruster_residual",
    name: "Thruster residual",
    equation: "a x (share of the window inside logged events)",
    source: "1-400 ng after the trimmed mean",
    covariate: "time_since_event",
    mistaken_for: &["attitude deadband: jets fire at its edges"],
    linear: &push(150.0, 3000.0),
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is a push fixed in the body that is there only while logged firings last.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    added(scene, "thruster").map(|series| Shape::scalar(&series))
}
