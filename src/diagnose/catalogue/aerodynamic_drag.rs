//! Drag off by a fraction: drag coefficient, area or density wrong by a factor, or the whole term absent.

use super::{Effect, Linear, Shape, USUAL_OR_SMALL, full, no_density, one_point};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "aerodynamic_drag",
    name: "Aerodynamic drag off by a fraction",
    equation: "fraction x a_d, a_d = -1/2 rho Cd A |v| v / m, v relative to co-rotating air",
    source: "density models are 15-20 % off, 50-70 % in storms",
    covariate: "density",
    mistaken_for: &["scale_factor of the ram axis", "a bias in a fixed attitude", "atmosphere_corotation"],
    linear: &[Linear { name: "fraction", unit: "1", size: 0.5, size_max: 3.0, least: -1.0, ..Linear::PLAIN }],
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual scales with the modelled drag: it points against the velocity where the fraction is positive and drag is missing, along \
          it where the fraction is negative and the simulation has too much.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    Some(Shape::Columns(vec![full(scene.measure(|i| scene.drag_ng[i]))]))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    /// Against the velocity, a half rho Cd A v^2 / m in air that turns with the Earth.
    #[test]
    fn it_is_the_drag_of_the_projected_area_in_turning_air() {
        made::gives(&EFFECT, [0.0; 2], 0, |t| made::drag_ng(t, 1.0, Vector3::zeros()));
    }
}
