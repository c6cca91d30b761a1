//! What the figures of an answer show, window by window. Not here: how it is drawn (`report`).

use super::answer::Diagnosis;
use super::report::{CovariatePlate, Plates};
use super::scene::{Axes, Scene};
use crate::math::rms::{about_mean, rms_about_mean};
use crate::physics::orbit;

/// Panels of covariates, at most.
const PANELS: usize = 12;
/// An hour of local time, rad.
const HOUR_RAD: f64 = std::f64::consts::TAU / 24.0;

/// The figures' numbers: the panels of what the mismatch follows come first, in the order of the answer.
pub fn plates(scene: &Scene, diagnosis: &Diagnosis, model_ng: &Axes, ladder: Vec<(String, f64)>) -> Plates {
    let followed = |panel: &Panel| {
        let is = |name: &str| panel.covariates.contains(&name);
        diagnosis.located.covariates.iter().position(|c| is(&c.name)).unwrap_or(usize::MAX)
    };
    let mut panels = panels(scene, model_ng);
    panels.sort_by_key(followed);
    panels.truncate(PANELS);
    Plates {
        clock_s: scene.clock_s().to_vec(),
        liftoff_clock_s: scene.case.header.liftoff_clock_s,
        before_ng: std::array::from_fn(|k| about_mean(&scene.residual_ng[k])),
        model_ng: std::array::from_fn(|k| about_mean(&model_ng[k])),
        sunlit: at_windows(scene, |g| scene.sunlit[g]),
        events: scene.case.events.iter().map(|e| (e.clock_s, e.clock_s + e.duration_s, e.kind.clone())).collect(),
        covariates: panels.into_iter().map(|panel| panel.plate).collect(),
        period_s: scene.period_s,
        ladder,
    }
}

/// A panel, and the covariates of an answer that it shows.
struct Panel {
    covariates: &'static [&'static str],
    plate: CovariatePlate,
}

fn panels(scene: &Scene, model_ng: &Axes) -> Vec<Panel> {
    let panel = |covariates, name: &str, unit: &str, values: Vec<f64>| Panel {
        covariates,
        plate: CovariatePlate { name: name.into(), unit: unit.into(), values },
    };
    let grid = |covariates, name: &str, unit: &str, f: &dyn Fn(usize) -> f64| {
        panel(covariates, name, unit, at_windows(scene, f))
    };
    let (_, past_noon) = scene.orbit_angles_rad();
    let zenith = |g: usize| scene.sun[g].dot(&scene.r_m[g].normalize()).clamp(-1.0, 1.0).acos().to_degrees();
    let (hour_angle, longitude) = (scene.hour_angle_rad(), scene.longitude_rad());
    let local_h = |g: usize| 12.0 + hour_angle[g] / HOUR_RAD;
    let radius = |g: usize| scene.r_m[g].norm();
    let state = |g: usize| orbit::State { r_m: scene.r_m[g], v_m_s: scene.v_m_s[g] };
    let pitch = |g: usize| (scene.body[g] * scene.v_m_s[g].normalize()).x.clamp(-1.0, 1.0).acos().to_degrees();
    let loudest = |axes: &Axes| (0..3).max_by(|a, b| rms_about_mean(&axes[*a]).total_cmp(&rms_about_mean(&axes[*b])));
    let claimed = model_ng.iter().any(|axis| rms_about_mean(axis) > 0.0);
    let axis = loudest(if claimed { model_ng } else { &scene.simulated_ng }).unwrap_or(0);
    let simulated = format!("simulated {}", ["x", "y", "z"][axis]);
    let liftoff_s = scene.case.header.liftoff_clock_s;
    let met_h = scene.clock_s().iter().map(|t| (t - liftoff_s) / 3600.0).collect();
    let mut panels = vec![
        grid(&["argument_of_latitude"], "argument of latitude", "deg", &|g| {
            orbit::argument_of_latitude_rad(&state(g)).to_degrees()
        }),
        grid(&["sun_angle", "shadow"], "Sun zenith angle", "deg", &zenith),
        panel(&["temperature"], "sensor temperature", "C", at_windows(scene, |g| scene.temperature_c[g])),
        grid(&["density"], "modelled drag", "ng", &|g| scene.drag_ng[g].norm()),
        panel(&["modelled_signal"], &simulated, "ng", scene.simulated_ng[axis].clone()),
        grid(&["local_time"], "local solar time", "h", &|g| local_h(g).rem_euclid(24.0)),
        panel(&["time", "time_since_onset"], "time since lift-off", "h", met_h),
        grid(&["body_rate"], "body rate", "mrad/s", &|g| 1e3 * scene.w_rad_s[g].norm()),
        grid(&["geomagnetic_field"], "geomagnetic field", "uT", &|g| 1e6 * scene.field_body_t[g].norm()),
        grid(&["attitude"], "nose from the velocity", "deg", &pitch),
        grid(&["altitude"], "radius of the orbit", "km", &|g| radius(g) / 1e3),
        grid(&["longitude"], "longitude", "deg", &|g| longitude[g].to_degrees().rem_euclid(360.0)),
        grid(&["latitude"], "latitude", "deg", &|g| (scene.r_m[g].z / radius(g)).clamp(-1.0, 1.0).asin().to_degrees()),
        grid(&["sun_phase"], "angle past orbital noon", "deg", &|g| past_noon[g].to_degrees()),
        panel(&["activity"], &deviation_name(axis), "ng", scene.case.recording.dev_ng[axis].clone()),
    ];
    panels.extend(since_event_h(scene).map(|h| panel(&["time_since_event"], "time since a logged event", "h", h)));
    panels
}

fn deviation_name(axis: usize) -> String {
    format!("average deviation {}", ["x", "y", "z"][axis])
}

/// Time since the last logged event began; before the first, until it. None without a log.
fn since_event_h(scene: &Scene) -> Option<Vec<f64>> {
    let starts: Vec<f64> = scene.case.events.iter().map(|event| event.clock_s).collect();
    let first = *starts.first()?;
    let last = |t: f64| starts[..starts.partition_point(|start| *start <= t)].last().copied().unwrap_or(first);
    Some(scene.clock_s().iter().map(|t| (t - last(*t)) / 3600.0).collect())
}

fn at_windows(scene: &Scene, on_grid: impl Fn(usize) -> f64) -> Vec<f64> {
    let nearest = |t: &f64| scene.grid_s.partition_point(|g| g < t).min(scene.grid_s.len() - 1);
    scene.clock_s().iter().map(|t| on_grid(nearest(t))).collect()
}
