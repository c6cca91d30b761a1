//! The sensor's axes are turned by a small right-handed angle r: recorded = a + a x r.

use super::{Effect, Linear, Shape, USUAL_OR_SMALL, no_density, one_point};
use crate::diagnose::design::Raw;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "misalignment",
    name: "Misaligned sensor axes",
    equation: "a x r, r three small angles",
    source: "one class with a constant attitude error: never separable from acceleration alone",
    covariate: "modelled_signal",
    mistaken_for: &["atmosphere_corotation"],
    linear: &[
        Linear { name: "rx_rad", unit: "rad", size: 0.08, size_max: 0.6, ..Linear::PLAIN },
        Linear { name: "ry_rad", unit: "rad", size: 0.08, size_max: 0.6, ..Linear::PLAIN },
        Linear { name: "rz_rad", unit: "rad", size: 0.08, size_max: 0.6, ..Linear::PLAIN },
    ],
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "What one axis should read leaks into the others with fixed small angles.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let m = &scene.simulated_ng;
    let minus = |k: usize| Some(m[k].iter().map(|x| -x).collect::<Vec<f64>>());
    let plus = |k: usize| Some(m[k].clone());
    // a x r: x = ay rz - az ry, y = az rx - ax rz, z = ax ry - ay rx.
    let columns: Vec<Raw> = vec![[None, plus(2), minus(1)], [minus(2), None, plus(0)], [plus(1), minus(0), None]];
    Some(Shape::Columns(columns))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_what_is_modelled_crossed_with_the_turn() {
        for axis in 0..3 {
            made::gives(&EFFECT, [0.0; 2], axis, |t| made::simulated_ng(t).cross(&Vector3::ith(axis, 1.0)));
        }
    }
}
