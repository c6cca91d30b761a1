//! Bias follows the sensor temperature, perhaps late.
//!
//! What it follows before the log of the temperature begins is one of two, as likely: what the log begins with, or the cycles of the
//! orbit and the day.

use super::{Effect, Linear, Nonlinear, SELDOM_LARGE, Shape, Theta, in_sensor};
use crate::diagnose::case::HALF_WINDOW_S;
use crate::diagnose::earlier::REACH_S;
use crate::diagnose::measure::window_means;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "temperature_bias",
    name: "Bias follows temperature",
    equation: "slope x T(t - lag)",
    source: "4-30 counts per C, lagged 0-8 h",
    covariate: "temperature",
    mistaken_for: &["solar_radiation_pressure", "crew_activity", "bias_drift"],
    linear: &[
        Linear { name: "slope_x_ng_per_c", unit: "ng/C", size: 60.0, size_max: 2000.0, ..Linear::PLAIN },
        Linear { name: "slope_y_ng_per_c", unit: "ng/C", size: 60.0, size_max: 2000.0, ..Linear::PLAIN },
        Linear { name: "slope_z_ng_per_c", unit: "ng/C", size: 60.0, size_max: 2000.0, ..Linear::PLAIN },
    ],
    scales: SELDOM_LARGE,
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
    assumes: Some(assumes),
    why: "The residual is proportional to the sensor temperature on every axis, swings with the daily and orbital cycle and lags as stated.",
};

/// Longest lag, s.
const LAG_S_MAX: f64 = REACH_S;

/// Before the log there was what it begins with, or what its cycles tell: the second number of a theta.
const AS_IT_BEGINS: f64 = 0.0;
const AS_ITS_CYCLES: f64 = 1.0;

/// Lag up to which the log says all that is felt, s.
fn logged(scene: &Scene) -> f64 {
    scene.clock_s()[0] - scene.grid_s[0] - HALF_WINDOW_S
}

fn grid(scene: &Scene) -> Vec<Theta> {
    // The cycle of the orbit has a peak of the likelihood at every one of its periods: six to each.
    let lags = || [0.0, 300.0, 600.0].into_iter().chain((1..=32).map(|k| 900.0 * f64::from(k)));
    let beyond = lags().filter(|lag| *lag > logged(scene));
    lags().map(|lag| [lag, AS_IT_BEGINS]).chain(beyond.map(|lag| [lag, AS_ITS_CYCLES])).collect()
}

fn log_density(scene: &Scene, theta: &Theta) -> f64 {
    let ways: f64 = if theta[0] > logged(scene) { 2.0 } else { 1.0 };
    -(ways * LAG_S_MAX).ln()
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    if !(0.0..=LAG_S_MAX).contains(&theta[0]) {
        return None;
    }
    let (grid_s, temperature_c) = if theta[1] == AS_ITS_CYCLES {
        let longer = &scene.temperature_and_earlier;
        (&longer.grid_s, &longer.values)
    } else {
        (&scene.grid_s, &scene.temperature_c)
    };
    Some(in_sensor(scene, |clock_s| window_means(grid_s, temperature_c, clock_s, theta[0])))
}

fn assumes(scene: &Scene, theta: &Theta) -> Option<String> {
    let begins_s = scene.grid_s[0] + theta[0] + HALF_WINDOW_S;
    let before = scene.clock_s().iter().filter(|t| **t < begins_s).count();
    let taken_for =
        if theta[1] == AS_ITS_CYCLES { "what its cycles of orbit and day were" } else { "what its log begins with" };
    (before > 0).then(|| {
        format!(
            "a temperature felt {:.0} s late is from before its log in {before} of {} windows, and taken there for {taken_for}",
            theta[0],
            scene.schedule.len()
        )
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_the_temperature_as_late_as_its_lag() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        for lag_s in [0.0, 500.0] {
            for (axis, column) in made::columns(&scene, &EFFECT, [lag_s, AS_IT_BEGINS]).iter().enumerate() {
                made::is_everywhere(&scene, column, |t| Vector3::ith(axis, made::temperature_c(t - lag_s)));
            }
        }
        assert!(assumes(&scene, &[500.0, AS_IT_BEGINS]).is_none(), "the log begins ten minutes before the record");
        assert!(assumes(&scene, &[2000.0, AS_IT_BEGINS]).is_some_and(|said| said.contains("2000 s late")));
    }
}
