//! Wind beside co-rotation, steady along and across the track: the derivative of drag by wind.

use super::{Effect, Linear, Shape, full, no_volume, one_point};
use crate::diagnose::scene::Scene;
use crate::physics::{Vec3, drag};

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "thermospheric_wind",
    name: "Thermospheric wind",
    equation: "a_d(v - wind) - a_d(v), linear in the wind",
    source: "200 m/s change drag by 2.6 %; several hundred in storms",
    mistaken_for: &["atmosphere_corotation", "aerodynamic_drag"],
    linear: &[
        Linear { name: "along_m_s", unit: "m/s", size: 300.0, size_max: 800.0, whole: false },
        Linear { name: "cross_m_s", unit: "m/s", size: 300.0, size_max: 800.0, whole: false },
    ],
    nonlinear: &[],
    grid: one_point,
    log_volume: no_volume,
    signature,
    why: "The residual is what a steady wind along and across the track does to the drag, of a speed that the thermosphere has.",
};

/// Step of the derivative, m/s: small against the orbital speed, large against rounding.
const STEP_M_S: f64 = 10.0;

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let column = |along: f64, cross: f64| {
        full(scene.measure(|i| {
            let wind: Vec3 = drag::wind_m_s(&scene.r_m[i], &scene.v_m_s[i], along * STEP_M_S, cross * STEP_M_S);
            (scene.drag_with(i, 1.0, &wind) - scene.drag_ng[i]) / STEP_M_S
        }))
    };
    Some(Shape::Columns(vec![column(1.0, 0.0), column(0.0, 1.0)]))
}
