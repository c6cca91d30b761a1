//! From a furnished case to what the figures show.

use std::f64::consts::TAU;

use super::{Axes, CovariatePlate, Plates};
use crate::diagnose::scene::Scene;
use crate::physics::{EARTH_RADIUS_M, EARTH_RATE_RAD_S, Vec3};

impl Plates {
    /// Of a scene, the part of its residual that is claimed, and the sets that were weighed.
    pub fn of(scene: &Scene, model_ng: &Axes, ladder: Vec<(String, f64)>) -> Self {
        let case = scene.case;
        let centred = |series: &Vec<f64>| {
            let mean = series.iter().sum::<f64>() / series.len().max(1) as f64;
            series.iter().map(|x| x - mean).collect::<Vec<f64>>()
        };
        Self {
            clock_s: scene.clock_s().to_vec(),
            liftoff_clock_s: case.header.liftoff_clock_s,
            before_ng: scene.residual_ng.each_ref().map(centred),
            model_ng: model_ng.each_ref().map(centred),
            sunlit: scene.measure_scalar(|i| scene.sunlit[i]),
            events: case.events.iter().map(|e| (e.clock_s, e.clock_s + e.duration_s, e.kind.clone())).collect(),
            covariates: covariates(scene),
            period_s: scene.period_s,
            ladder,
        }
    }
}

/// What a residual may follow, at the windows. Angles are taken at the nearest instant: a mean over their wrap says nothing.
fn covariates(scene: &Scene) -> Vec<CovariatePlate> {
    let nearest: Vec<usize> = scene
        .clock_s()
        .iter()
        .map(|t| scene.grid_s.partition_point(|g| g < t).min(scene.grid_s.len() - 1))
        .collect();
    let plate = |name: &str, unit: &str, of: &dyn Fn(usize) -> f64| CovariatePlate {
        name: name.into(),
        unit: unit.into(),
        values: nearest.iter().map(|i| of(*i)).collect(),
    };
    let degrees = |angle: f64| angle.rem_euclid(TAU).to_degrees();
    let right_ascension = |v: &Vec3| v.y.atan2(v.x);
    vec![
        plate("argument of latitude", "deg", &|i| degrees(argument_of_latitude(&scene.r_m[i], &scene.v_m_s[i]))),
        plate("local time", "h", &|i| {
            degrees(right_ascension(&scene.r_m[i]) - right_ascension(&scene.sun[i]) + TAU / 2.0) / 15.0
        }),
        plate("angle from the Sun", "deg", &|i| scene.r_m[i].angle(&scene.sun[i]).to_degrees()),
        plate("height above 6378 km", "km", &|i| (scene.r_m[i].norm() - EARTH_RADIUS_M) / 1e3),
        plate("density of the simulation", "1e-12 kg/m³", &|i| scene.case.ancillary.density_kg_m3[i] * 1e12),
        plate("geomagnetic field", "µT", &|i| scene.field_body_t[i].norm() * 1e6),
        plate("sensor temperature", "°C", &|i| scene.temperature_c[i]),
        plate("body rate", "mdeg/s", &|i| scene.w_rad_s[i].norm().to_degrees() * 1e3),
        plate("longitude (from the start)", "deg", &|i| {
            degrees(right_ascension(&scene.r_m[i]) - EARTH_RATE_RAD_S * (scene.grid_s[i] - scene.grid_s[0]))
        }),
    ]
}

/// Angle from the ascending node along the orbit.
fn argument_of_latitude(r: &Vec3, v: &Vec3) -> f64 {
    let h = r.cross(v);
    let node = Vec3::new(-h.y, h.x, 0.0);
    let across = h.cross(&node).normalize() * node.norm();
    r.dot(&across).atan2(r.dot(&node))
}
