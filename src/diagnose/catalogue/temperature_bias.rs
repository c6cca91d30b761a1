//! Bias follows the sensor temperature, perhaps late: by a delay, or as what is warmed through a resistance, with a time constant.
//!
//! What it followed before the log of the temperature begins is one of two, as likely: what the log begins with, or the cycles of the
//! orbit and the day.

use std::borrow::Cow;

use super::{Effect, Linear, Nonlinear, SELDOM_LARGE, Shape, Theta, in_sensor};
use crate::diagnose::case::HALF_WINDOW_S;
use crate::diagnose::earlier::REACH_S;
use crate::diagnose::measure::{relaxing, window_means};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "temperature_bias",
    name: "Bias follows temperature",
    equation: "slope x T(t - lag), or slope x T relaxing in the lag",
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
    why: "The residual follows the sensor temperature on every axis, at the lag stated.",
};

/// Longest lag, s.
const LAG_S_MAX: f64 = REACH_S;

/// The second number of a theta: a delay or a time constant, and before the log there was what it begins with, or what its cycles tell.
const AS_IT_BEGINS: f64 = 0.0;
const AS_ITS_CYCLES: f64 = 1.0;
const RELAXING_AS_IT_BEGINS: f64 = 2.0;
const RELAXING_AS_ITS_CYCLES: f64 = 3.0;

/// Time constants tried first, s.
const TAUS_S: [f64; 12] =
    [200.0, 400.0, 700.0, 1200.0, 2000.0, 3300.0, 5400.0, 8400.0, 12_000.0, 16_500.0, 22_000.0, 28_800.0];

/// Lag up to which the log says all that is felt, s.
fn logged(scene: &Scene) -> f64 {
    scene.clock_s()[0] - scene.grid_s[0] - HALF_WINDOW_S
}

/// A temperature that is off its mean by no more than this part of it does not change.
const ROUNDING: f64 = 1e-9;

fn grid(scene: &Scene) -> Vec<Theta> {
    // The cycle of the orbit has a peak of the likelihood at every one of its periods: six to each.
    let lags = || [0.0, 300.0, 600.0].into_iter().chain((1..=32).map(|k| 900.0 * f64::from(k)));
    let beyond = lags().filter(|lag| *lag > logged(scene));
    let delayed = lags().map(|lag| [lag, AS_IT_BEGINS]).chain(beyond.map(|lag| [lag, AS_ITS_CYCLES]));
    let relaxing =
        [RELAXING_AS_IT_BEGINS, RELAXING_AS_ITS_CYCLES].into_iter().flat_map(|way| TAUS_S.map(|tau| [tau, way]));
    delayed.chain(relaxing).collect()
}

fn log_density(scene: &Scene, theta: &Theta) -> f64 {
    let ways: f64 = if theta[0] > logged(scene) { 4.0 } else { 3.0 };
    -(ways * LAG_S_MAX).ln()
}

fn is_relaxing(way: f64) -> bool {
    way >= RELAXING_AS_IT_BEGINS
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    let mean_c = scene.temperature_c.iter().sum::<f64>() / scene.temperature_c.len() as f64;
    let changes = scene.temperature_c.iter().any(|t| (t - mean_c).abs() > ROUNDING * mean_c.abs());
    if !changes || !(0.0..=LAG_S_MAX).contains(&theta[0]) {
        return None;
    }
    let [lag_s, way] = *theta;
    let longer = &scene.temperature_and_earlier;
    let (grid_s, temperature_c) = match way {
        AS_IT_BEGINS | RELAXING_AS_IT_BEGINS => (&scene.grid_s, &scene.temperature_c),
        _ => (&longer.grid_s, &longer.values),
    };
    let (followed_c, delay_s) = match is_relaxing(way) {
        true => (Cow::Owned(relaxing(grid_s, temperature_c, lag_s)), 0.0),
        false => (Cow::Borrowed(temperature_c), lag_s),
    };
    // About its mean: a constant is nuisance, and where the mismatch is largest must not hang on the zero of the scale.
    let about_mean =
        |clock_s: &[f64]| window_means(grid_s, &followed_c, clock_s, delay_s).into_iter().map(|t| t - mean_c).collect();
    Some(in_sensor(scene, about_mean))
}

fn assumes(scene: &Scene, theta: &Theta) -> Option<String> {
    if is_relaxing(theta[1]) {
        return Some(format!(
            "the lag of {:.0} s is a time constant with which the temperature is followed, and no delay",
            theta[0]
        ));
    }
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
        let mean_c = scene.temperature_c.iter().sum::<f64>() / scene.temperature_c.len() as f64;
        for lag_s in [0.0, 500.0] {
            for (axis, column) in made::columns(&scene, &EFFECT, [lag_s, AS_IT_BEGINS]).iter().enumerate() {
                let about_mean = |t: f64| made::temperature_c(t - lag_s) - mean_c;
                made::is_everywhere(&scene, column, |t| Vector3::ith(axis, about_mean(t)));
            }
        }
        // A swing of one period that is relaxed to: smaller by the root of 1 + (w tau)^2, and later by atan(w tau), hours after it began.
        let (tau_s, w) = (2000.0, std::f64::consts::TAU / made::TEMPERATURE_PERIOD_S);
        let relaxed = |t: f64| {
            let size = (1.0 + (w * tau_s).powi(2)).sqrt().recip();
            20.0 + size * (made::temperature_c(t - (w * tau_s).atan() / w) - 20.0)
        };
        let columns = made::columns(&scene, &EFFECT, [tau_s, RELAXING_AS_IT_BEGINS]);
        for t in [110_000.0, 113_000.0, 116_000.0] {
            let found = made::at(&scene, &columns[1][1], t);
            assert!((found - (relaxed(t) - mean_c)).abs() < 0.02, "{found} at {t}, {} expected", relaxed(t) - mean_c);
        }
        assert!(assumes(&scene, &[500.0, RELAXING_AS_ITS_CYCLES]).is_some_and(|said| said.contains("time constant")));
        assert!(assumes(&scene, &[500.0, AS_IT_BEGINS]).is_none(), "the log begins ten minutes before the record");
        assert!(assumes(&scene, &[2000.0, AS_IT_BEGINS]).is_some_and(|said| said.contains("2000 s late")));
    }
}
