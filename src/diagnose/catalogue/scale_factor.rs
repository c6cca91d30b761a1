//! One axis reads (1 + fraction) times the truth.

use super::{Effect, Linear, Nonlinear, Shape, Theta, USUAL_OR_SMALL, no_density};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "scale_factor",
    name: "Scale factor of one axis",
    equation: "fraction x m on one axis, m the modelled signal",
    source: "ground and flight calibrations differed by 3-14 %",
    covariate: "modelled_signal",
    mistaken_for: &["aerodynamic_drag"],
    // Three times the largest that was ever seen of such a sensor, 25 %; an axis that reads nothing is no scale factor.
    linear: &[Linear { name: "fraction", unit: "1", size: 0.15, size_max: 0.75, ..Linear::PLAIN }],
    scales: USUAL_OR_SMALL,
    nonlinear: &[Nonlinear { name: "axis", range: [0.0, 2.0], ..Nonlinear::PLAIN }],
    grid,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "All the modelled physics of one axis is off by the same factor, gravity gradient and drag alike, and the other axes are not.",
};

fn grid(_: &Scene) -> Vec<Theta> {
    vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    let axis = theta[0] as usize;
    Some(Shape::Columns(vec![std::array::from_fn(|k| (k == axis).then(|| scene.simulated_ng[k].clone()))]))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_what_is_modelled_on_one_axis_and_nothing_on_the_others() {
        for axis in 0..3 {
            made::gives(&EFFECT, [axis as f64, 0.0], 0, |t| Vector3::ith(axis, made::simulated_ng(t)[axis]));
        }
    }
}
