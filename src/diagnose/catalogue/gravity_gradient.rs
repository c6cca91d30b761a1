//! Gravity gradient left out of the simulation: -G r at the sensor, G = (mu/R^3)(3 e e^T - I).

use crate::units::NANO_G_M_S2;

use super::{Effect, Linear, Shape, WHOLE_OR_PART, full, no_density, one_point};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "gravity_gradient",
    name: "Gravity gradient left out",
    equation: "-G r, r the assumed offset of the sensor",
    source: "standard mechanics; 409 ng per metre radial at 300 km",
    covariate: "attitude",
    mistaken_for: &["cg_offset"],
    linear: &[Linear { name: "fraction", unit: "1", size: 1.0, size_max: 3.0, ..Linear::WHOLE }],
    scales: WHOLE_OR_PART,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is the gravity gradient at the assumed sensor position: it turns with the local vertical in body axes and follows the attitude.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let offset = scene.vehicle.sensor_offset_m;
    Some(Shape::Columns(vec![full(scene.measure(|i| scene.gradient_s2(i) * offset * (-1.0 / NANO_G_M_S2)))]))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    /// n^2 (x, y, -2 z) r fixed to the vertical, taken from what is felt: (x, y, -2 z) with z down.
    #[test]
    fn it_pulls_apart_along_the_vertical_and_together_across_it() {
        let per_m = made::rate_rad_s().powi(2) / made::NG_M_S2;
        let [x, y, z] = made::OFFSET_M;
        made::gives(&EFFECT, [0.0; 2], 0, |_| Vector3::new(x, y, -2.0 * z) * per_m);
    }
}
