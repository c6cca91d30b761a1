//! The sensor feels the geomagnetic field: a = K B in body axes.

use super::{ANY_SIZE, Effect, Linear, Shape, no_density, one_point};
use crate::diagnose::design::Raw;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "magnetic_sensitivity",
    name: "Sensitivity to the geomagnetic field",
    equation: "a = K B, K nine numbers",
    source: "seen on two other flights, Foton M-2 among them",
    covariate: "geomagnetic_field",
    mistaken_for: &["thermospheric_wind", "atmosphere_corotation"],
    linear: &[
        Linear { name: "kxx_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kxy_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kxz_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kyx_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kyy_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kyz_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kzx_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kzy_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
        Linear { name: "kzz_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, whole: false },
    ],
    scales: ANY_SIZE,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is linear in the geomagnetic field in body axes: it follows magnetic latitude, with the Earth turning below the orbit.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let field: [Vec<f64>; 3] = scene.measure(|i| scene.field_body_t[i]);
    let column = |n: usize| -> Raw { std::array::from_fn(|k| (k == n / 3).then(|| field[n % 3].clone())) };
    Some(Shape::Columns((0..9).map(column).collect()))
}
