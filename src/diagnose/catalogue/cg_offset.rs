//! The sensor is elsewhere than assumed: a = T dr, T = -G + [w x][w x] + [dw/dt x].

use super::{Effect, Linear, Shape, USUAL_OR_SMALL, full, no_density, one_point};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "cg_offset",
    name: "Sensor offset from the centre of gravity differs",
    equation: "a = T dr, T = -G + [w x][w x] + [dw/dt x]",
    source: "standard mechanics; 409 ng per metre radial, 136 cross-track in LVLH at 300 km",
    covariate: "attitude",
    mistaken_for: &["a bias in a single LVLH attitude", "mass_shift", "rotation"],
    linear: &[
        Linear { name: "dx_m", unit: "m", size: 0.6, size_max: 3.0, ..Linear::PLAIN },
        Linear { name: "dy_m", unit: "m", size: 0.6, size_max: 3.0, ..Linear::PLAIN },
        Linear { name: "dz_m", unit: "m", size: 0.6, size_max: 3.0, ..Linear::PLAIN },
    ],
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is linear in the gravity-gradient and rotation tensor: it turns with attitude and rate as a displaced sensor must, and a bias does not.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    Some(Shape::Columns(scene.lever_arms_ng().iter().cloned().map(full).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// Fixed to the local vertical at 300 km (effects.md, domain.md): nothing along the track, 136 ng/m across it, 409 ng/m along the radius.
    #[test]
    fn a_metre_weighs_as_published() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let published_ng = [0.0, 136.0, -409.0];
        for (axis, (column, size)) in made::columns(&scene, &EFFECT, [0.0; 2]).iter().zip(published_ng).enumerate() {
            for k in 0..3 {
                let expected = if k == axis { size } else { 0.0 };
                assert!(column[k].iter().all(|a| (a - expected).abs() < 0.8), "{axis}, {k}: {}", column[k][100]);
            }
        }
    }
}
