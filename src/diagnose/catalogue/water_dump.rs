//! A push while a logged event of kind `water_dump` lasts.

use super::{Effect, Shape, USUAL_OR_SMALL, lasting, no_density, one_point, push};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "water_dump",
    name: "Water dump",
    equation: "a x (share of the window inside logged events)",
    source: "about 1 ug in body Y was seen; 250-1000 ng",
    covariate: "time_since_event",
    mistaken_for: &["nearly nothing"],
    linear: &push(300.0, 5000.0),
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is a push fixed in the body that begins and ends with the logged water dumps.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    lasting(scene, "water_dump").map(|series| Shape::scalar(&series))
}
