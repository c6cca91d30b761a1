//! A push while a logged event of kind `evaporator` lasts.

use super::{Effect, Shape, USUAL_OR_SMALL, lasting, no_density, one_point, push};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "evaporator_venting",
    name: "Evaporator venting",
    equation: "a x (share of the window inside logged events)",
    source: "flash evaporator: 5-15 min cycles of 50-150 ng",
    covariate: "time_since_event",
    mistaken_for: &["nearly nothing"],
    linear: &push(60.0, 1000.0),
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is a push fixed in the body that begins and ends with the logged cycles of the evaporator.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    lasting(scene, "evaporator").map(|series| Shape::scalar(&series))
}
