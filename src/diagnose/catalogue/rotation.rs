//! Rotation left out of the simulation: w x (w x r) + dw/dt x r at the sensor.

use crate::units::NANO_G_M_S2;

use super::{Effect, Linear, Shape, WHOLE_OR_PART, full, no_density, one_point};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "rotation",
    name: "Rotation terms left out",
    equation: "w x (w x r) + dw/dt x r",
    source: "standard mechanics; 0.02 deg/s at 10 m is 124 ng",
    covariate: "body_rate",
    mistaken_for: &["cg_offset"],
    linear: &[Linear { name: "fraction", unit: "1", size: 1.0, size_max: 3.0, ..Linear::WHOLE }],
    scales: WHOLE_OR_PART,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual follows the square of the body rates and their change at the assumed sensor position, largest in manoeuvres.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let offset = scene.vehicle.sensor_offset_m;
    Some(Shape::Columns(vec![full(scene.measure(|i| scene.rotation_s2(i) * offset / NANO_G_M_S2))]))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    /// w x (w x r) of one turn an orbit about the pitch axis: towards that axis.
    #[test]
    fn it_is_centripetal_about_the_axis_of_a_steady_turn() {
        let per_m = made::rate_rad_s().powi(2) / made::NG_M_S2;
        let [x, _, z] = made::OFFSET_M;
        made::gives(&EFFECT, [0.0; 2], 0, |_| Vector3::new(-x, 0.0, -z) * per_m);
    }
}
