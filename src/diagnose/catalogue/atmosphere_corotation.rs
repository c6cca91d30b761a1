//! The atmosphere turns with the Earth: drag with co-rotation less drag without.

use super::{Effect, Linear, Shape, WHOLE_OR_PART, full, no_density, one_point};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "atmosphere_corotation",
    name: "Co-rotation of the atmosphere",
    equation: "fraction x (a_d(v - w_e x r) - a_d(v))",
    source: "standard; 5-30 ng cross-track",
    covariate: "latitude",
    mistaken_for: &["thermospheric_wind", "a yaw misalignment", "aerodynamic_drag"],
    linear: &[Linear { name: "fraction", unit: "1", size: 0.7, size_max: 2.0, ..Linear::WHOLE }],
    scales: WHOLE_OR_PART,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual has the cross-track part that a turning atmosphere gives, changing sign between ascending and descending passes, with a small loss of drag along the track.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    Some(Shape::Columns(vec![full(scene.measure(|i| scene.drag_ng[i] - scene.drag_at_rest(i)))]))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_drag_in_turning_air_less_drag_in_air_at_rest() {
        let drag = |t, turns| made::drag_ng(t, turns, Vector3::zeros());
        made::gives(&EFFECT, [0.0; 2], 0, |t| drag(t, 1.0) - drag(t, 0.0));
    }
}
