//! Forms of what surrounds the vehicle: sunlight, the geomagnetic field, the air and the place.

use super::{AXIS, Collector};
use crate::physics::Vec3;

pub(super) fn sunlight(c: &mut Collector) {
    let s = c.scene;
    let body_sun: Vec<Vec3> = (0..s.grid_s.len()).map(|g| s.body[g] * s.sun[g]).collect();
    let place = "the side towards the Sun";
    for i in 0..3 {
        c.grid(format!("s{}", AXIS[i]), "sun_angle", place, |g| body_sun[g][i]);
        c.grid(format!("nu s{}", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * body_sun[g][i]);
        c.grid(format!("nu |s{}|", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * body_sun[g][i].abs());
        c.grid(format!("nu max(0, s{})", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * body_sun[g][i].max(0.0));
        c.grid(format!("nu max(0, -s{})", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * (-body_sun[g][i]).max(0.0));
        for j in i..3 {
            c.grid(format!("s{} s{}", AXIS[i], AXIS[j]), "sun_angle", place, |g| body_sun[g][i] * body_sun[g][j]);
        }
    }
    c.grid("cos(Sun zenith angle)", "sun_angle", place, |g| s.sun[g].dot(&s.r_m[g].normalize()));
    c.grid("max(0, cos(Sun zenith angle))", "sun_angle", place, |g| s.sun[g].dot(&s.r_m[g].normalize()).max(0.0));
    c.vectors(
        "radial, day side",
        "sun_angle",
        place,
        &[&|g| s.body[g] * s.r_m[g].normalize() * s.sun[g].dot(&s.r_m[g].normalize()).max(0.0)],
    );
    c.grid("nu", "shadow", "sunlit parts of the orbit", |g| s.sunlit[g]);
    c.grid(
        "penumbra",
        "shadow",
        "edges of the shadow",
        |g| if s.sunlit[g] > 0.0 && s.sunlit[g] < 1.0 { 1.0 } else { 0.0 },
    );
}

pub(super) fn field(c: &mut Collector) {
    let s = c.scene;
    let place = "strong parts of the geomagnetic field";
    c.grid("|B|", "geomagnetic_field", place, |g| s.field_body_t[g].norm());
    c.grid("B.B", "geomagnetic_field", place, |g| s.field_body_t[g].norm_squared());
    for i in 0..3 {
        c.grid(format!("|B{}|", AXIS[i]), "geomagnetic_field", place, |g| s.field_body_t[g][i].abs());
        for j in i..3 {
            c.grid(format!("B{} B{}", AXIS[i], AXIS[j]), "geomagnetic_field", place, |g| {
                s.field_body_t[g][i] * s.field_body_t[g][j]
            });
        }
        let last = s.grid_s.len() - 1;
        c.grid(format!("dB{}/dt", AXIS[i]), "geomagnetic_field", place, |g| {
            let [a, b] = [g.saturating_sub(1), (g + 1).min(last)];
            (s.field_body_t[b][i] - s.field_body_t[a][i]) / (s.grid_s[b] - s.grid_s[a])
        });
    }
    c.vectors("v x B", "geomagnetic_field", place, &[&|g| (s.body[g] * s.v_m_s[g]).cross(&s.field_body_t[g])]);
    c.vectors("w x B", "geomagnetic_field", place, &[&|g| s.w_rad_s[g].cross(&s.field_body_t[g])]);
}

pub(super) fn surroundings(c: &mut Collector) {
    let s = c.scene;
    let rho = &s.case.ancillary.density_kg_m3;
    let height: Vec<f64> = s.r_m.iter().map(|r| r.norm()).collect();
    let mean_height = height.iter().sum::<f64>() / height.len() as f64;
    let mean_rho = rho.iter().sum::<f64>() / rho.len() as f64;
    let latitude: Vec<f64> = s.r_m.iter().map(|r| r.z / r.norm()).collect();
    let longitude = s.longitude_rad();
    // Twelve hours where the Sun is overhead.
    let local: Vec<f64> = s.hour_angle_rad().iter().map(|angle| angle + std::f64::consts::PI).collect();
    let mean_s = s.grid_s.iter().sum::<f64>() / s.grid_s.len() as f64;
    let place = "a height, latitude or local time";
    c.grid("rho", "density", place, |g| rho[g]);
    c.grid("rho^2", "density", place, |g| rho[g] * rho[g]);
    c.grid("h - <h>", "altitude", place, |g| height[g] - mean_height);
    c.grid("(h - <h>)^2", "altitude", place, |g| (height[g] - mean_height).powi(2));
    c.grid("sin(latitude)", "latitude", place, |g| latitude[g]);
    c.grid("sin^2(latitude)", "latitude", place, |g| latitude[g] * latitude[g]);
    c.grid("|sin(latitude)|", "latitude", place, |g| latitude[g].abs());
    for k in 1..=4 {
        let n = f64::from(k);
        c.several(
            format!("sin {k} longitude, cos {k} longitude"),
            "longitude",
            place,
            &[&|g| (n * longitude[g]).sin(), &|g| (n * longitude[g]).cos()],
        );
    }
    for k in 1..=3 {
        let n = k as f64;
        c.several(
            format!("sin {k}LT, cos {k}LT"),
            "local_time",
            place,
            &[&|g| (n * local[g]).sin(), &|g| (n * local[g]).cos()],
        );
    }
    c.grid("tanh(4 sin(LT))", "local_time", place, |g| (4.0 * local[g].sin()).tanh());
    c.grid("tanh(4 cos(LT))", "local_time", place, |g| (4.0 * local[g].cos()).tanh());
    let along = "along the drag";
    c.vectors("a_d rho/<rho>", "density", along, &[&|g| s.drag_ng[g] * (rho[g] / mean_rho)]);
    c.vectors("a_d (h - <h>)", "altitude", along, &[&|g| s.drag_ng[g] * (height[g] - mean_height)]);
    c.vectors("a_d (t - <t>)", "time", along, &[&|g| s.drag_ng[g] * (s.grid_s[g] - mean_s)]);
    c.vectors("a_d sin^2(latitude)", "latitude", along, &[&|g| s.drag_ng[g] * latitude[g] * latitude[g]]);
    c.vectors(
        "a_d sin 2LT, a_d cos 2LT",
        "local_time",
        along,
        &[&|g| s.drag_ng[g] * (2.0 * local[g]).sin(), &|g| s.drag_ng[g] * (2.0 * local[g]).cos()],
    );
    for delay_s in [600.0, 1800.0] {
        let before = |g: usize| s.grid_s.partition_point(|t| *t < s.grid_s[g] - delay_s);
        c.vectors(
            format!("a_d of {delay_s:.0} s before, less a_d"),
            "density",
            "a changing drag",
            &[&|g| s.drag_ng[before(g)] - s.drag_ng[g]],
        );
    }
    for (power, said) in [(0.5, "rho^(1/2)"), (1.5, "rho^(3/2)")] {
        let push = |g: usize| s.body[g] * s.v_m_s[g].normalize() * (rho[g] / mean_rho).powf(power);
        c.vectors(format!("{said} v/|v|"), "density", "along the velocity", &[&push]);
    }
    c.vectors("a_d nu", "shadow", along, &[&|g| s.drag_ng[g] * s.sunlit[g]]);
}
