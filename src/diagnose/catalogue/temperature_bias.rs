//! Bias follows the sensor temperature, perhaps late.

use super::{Effect, Linear, Nonlinear, Shape, Theta};
use crate::diagnose::measure::window_means;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "temperature_bias",
    name: "Bias follows temperature",
    equation: "slope x T(t - lag)",
    source: "4-30 counts per C, lagged 0-8 h",
    mistaken_for: &["solar_radiation_pressure", "crew_activity", "bias_drift"],
    linear: &[
        Linear { name: "slope_x_ng_per_c", unit: "ng/C", size: 60.0, size_max: 2000.0, whole: false },
        Linear { name: "slope_y_ng_per_c", unit: "ng/C", size: 60.0, size_max: 2000.0, whole: false },
        Linear { name: "slope_z_ng_per_c", unit: "ng/C", size: 60.0, size_max: 2000.0, whole: false },
    ],
    nonlinear: &[Nonlinear {
        name: "lag_s",
        unit: "s",
        step: 200.0,
        // A sensor in the open follows at once, one behind insulation late: either as likely.
        atom: Some(0.0),
        range: [0.0, LAG_S_MAX],
        ..Nonlinear::PLAIN
    }],
    grid,
    log_density,
    signature,
    exact_at: None,
    why: "The residual is proportional to the sensor temperature on every axis, swings with the daily and orbital cycle and lags as stated.",
};

/// Longest lag, s.
const LAG_S_MAX: f64 = 28_800.0;

fn grid(_: &Scene) -> Vec<Theta> {
    [0.0, 300.0, 600.0, 1200.0, 1800.0, 2700.0, 3600.0, 5400.0, 7200.0, 10_800.0, 14_400.0, 21_600.0, LAG_S_MAX]
        .map(|lag| [lag, 0.0])
        .to_vec()
}

fn log_density(_: &Scene, _: &Theta) -> f64 {
    -LAG_S_MAX.ln()
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    if !(0.0..=LAG_S_MAX).contains(&theta[0]) {
        return None;
    }
    Some(Shape::scalar(&window_means(&scene.grid_s, &scene.temperature_c, scene.clock_s(), theta[0])))
}
