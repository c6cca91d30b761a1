//! Sunlight's push, none in shadow: a = -nu coefficient P (sum |s_i| area_i) / m s.

use super::{Effect, Linear, Shape, USUAL_OR_SMALL, full, no_density, one_point};
use crate::diagnose::scene::Scene;
use crate::physics::solar_radiation;
use crate::units::NANO_G_M_S2;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "solar_radiation_pressure",
    name: "Solar radiation pressure",
    equation: "-nu coefficient P (sum |s_i| area_i) / m s, P = 4.56e-6 N/m2",
    source: "standard; 0.4-2 ng for the Orbiter, more with large panels",
    covariate: "sun_angle",
    mistaken_for: &["temperature_bias, which lags", "diurnal_bulge"],
    linear: &[Linear { name: "coefficient", unit: "1", size: 4.0, size_max: 40.0, whole: false }],
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual points away from the Sun and switches at the edges of the shadow, without lag.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let push = |i: usize| {
        solar_radiation::acceleration_per_coefficient_m_s2(
            &scene.vehicle,
            scene.sunlit[i],
            &(scene.body[i] * scene.sun[i]),
        ) / NANO_G_M_S2
    };
    Some(Shape::Columns(vec![full(scene.measure(push))]))
}
