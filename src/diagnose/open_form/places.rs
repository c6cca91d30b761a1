//! Forms that live in one place: within a bump or beyond a threshold of any covariate, and over one region or spot of the Earth.

use super::{AXIS, Collector};
use crate::physics::Vec3;

/// Centres of the bumps round a circle.
const CENTRES: usize = 16;
/// Widths of the bumps, standard deviation, deg.
const WIDTHS_DEG: [f64; 3] = [10.0, 20.0, 40.0];
/// Shares of the record beyond the thresholds.
const QUANTILES: [f64; 9] = [0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95];

pub(super) fn places(c: &mut Collector) {
    circles(c);
    regions(c);
    spots(c);
    thresholds(c);
}

/// A bump at one phase of the orbit, at one angle from orbital noon, at one local time.
fn circles(c: &mut Collector) {
    let s = c.scene;
    let (u, noon) = s.orbit_angles_rad();
    let local = s.hour_angle_rad();
    for (name, covariate, angle) in [
        ("u", "argument_of_latitude", &u),
        ("u - u_noon", "sun_phase", &noon),
        ("local time - 12 h", "local_time", &local),
    ] {
        let directions: Vec<(f64, f64)> = angle.iter().map(|angle| angle.sin_cos()).collect();
        let members: Vec<(String, Vec<f64>)> = WIDTHS_DEG
            .iter()
            .flat_map(|width| (0..CENTRES).map(move |i| (*width, 360.0 * i as f64 / CENTRES as f64)))
            .map(|(width, centre)| {
                // Von Mises: a bump on a circle.
                let narrow = width.to_radians().powi(-2);
                let (sine, cosine) = centre.to_radians().sin_cos();
                let along = |(sin, cos): (f64, f64)| sin * sine + cos * cosine;
                let series = s.measure_scalar(|g| (narrow * (along(directions[g]) - 1.0)).exp());
                (format!("a bump of {width:.0} deg at {name} = {centre:.0} deg"), series)
            })
            .collect();
        c.family(covariate, "one part of a circle", members);
    }
}

/// A push over one region of the Earth.
fn regions(c: &mut Collector) {
    let s = c.scene;
    let longitude_deg: Vec<f64> = s.longitude_rad().iter().map(|l| l.to_degrees().rem_euclid(360.0)).collect();
    let north: Vec<bool> = s.r_m.iter().map(|r| r.z > 0.0).collect();
    let mut members = Vec::new();
    for (half, wanted) in [("", None), (" of the northern half", Some(true)), (" of the southern half", Some(false))] {
        for width in [15.0_f64, 30.0, 50.0] {
            for i in 0..18 {
                let centre = 20.0 * f64::from(i);
                let inside = |g: usize| {
                    let away = (longitude_deg[g] - centre).abs();
                    let near = away.min(360.0 - away) < width;
                    f64::from(u8::from(near && wanted.is_none_or(|n| n == north[g])))
                };
                let formula = format!("within {width:.0} deg of longitude {centre:.0} deg{half}");
                members.push((formula, s.measure_scalar(inside)));
            }
        }
    }
    c.family("longitude", "over one region of the Earth", members);
}

/// Radii of the spots, deg: what sees a ground station, and what is as wide as an anomaly of the field.
const RADII_DEG: [f64; 2] = [15.0, 25.0];
/// Spacing of their centres, deg.
const SPACING_DEG: i32 = 20;

/// A push over one spot of the Earth, such as a transmitter makes that is switched on there.
fn spots(c: &mut Collector) {
    let s = c.scene;
    let below: Vec<Vec3> = s
        .longitude_rad()
        .iter()
        .zip(&s.r_m)
        .map(|(longitude, r)| {
            let (sin, cos) = longitude.sin_cos();
            let up = r.z / r.norm();
            let out = (1.0 - up * up).max(0.0).sqrt();
            Vec3::new(out * cos, out * sin, up)
        })
        .collect();
    let farthest_deg = below.iter().map(|r| r.z.abs()).fold(0.0, f64::max).asin().to_degrees();
    let rows = (farthest_deg / f64::from(SPACING_DEG)).round() as i32;
    let mut members = Vec::new();
    for radius_deg in RADII_DEG {
        for latitude_deg in (-rows..=rows).map(|row| row * SPACING_DEG) {
            // As many round a circle of latitude as keep their distance.
            let around = (360.0 / f64::from(SPACING_DEG) * f64::from(latitude_deg).to_radians().cos()).round() as i32;
            for longitude_deg in (0..around).map(|i| 360.0 * f64::from(i) / f64::from(around)) {
                let (sin, cos) = f64::from(latitude_deg).to_radians().sin_cos();
                let (east, ahead) = longitude_deg.to_radians().sin_cos();
                let centre = Vec3::new(cos * ahead, cos * east, sin);
                let least = radius_deg.to_radians().cos();
                let inside = |g: usize| f64::from(u8::from(below[g].dot(&centre) > least));
                let formula = format!(
                    "within {radius_deg:.0} deg of latitude {latitude_deg} deg, longitude {longitude_deg:.0} deg"
                );
                members.push((formula, s.measure_scalar(inside)));
            }
        }
    }
    c.family("longitude", "over one spot of the Earth", members);
}

/// Beyond a threshold of one covariate: a gate, and a ramp that starts there.
fn thresholds(c: &mut Collector) {
    let s = c.scene;
    let grid = |f: &dyn Fn(usize) -> f64| s.measure_scalar(f);
    let mut covariates: Vec<(String, &'static str, Vec<f64>)> = vec![
        ("h".into(), "altitude", grid(&|g| s.r_m[g].norm())),
        ("rho".into(), "density", grid(&|g| s.case.ancillary.density_kg_m3[g])),
        ("T".into(), "temperature", grid(&|g| s.temperature_c[g])),
        ("|B|".into(), "geomagnetic_field", grid(&|g| s.field_body_t[g].norm())),
        ("latitude".into(), "latitude", grid(&|g| s.r_m[g].z / s.r_m[g].norm())),
        ("cos(Sun zenith angle)".into(), "sun_angle", grid(&|g| s.sun[g].dot(&s.r_m[g].normalize()))),
        ("|dw/dt|".into(), "body_rate", grid(&|g| s.wdot_rad_s2[g].norm())),
    ];
    for k in 0..3 {
        covariates.push((format!("m{}", AXIS[k]), "modelled_signal", s.simulated_ng[k].clone()));
        // What the Sun reaches within a cone about an axis of the body.
        for (sign, name) in [(1.0, ""), (-1.0, "-")] {
            let towards = |g: usize| sign * (s.body[g] * s.sun[g])[k] * s.sunlit[g];
            covariates.push((format!("nu ({name}s{})", AXIS[k]), "sun_angle", grid(&towards)));
        }
    }
    for (name, covariate, series) in covariates {
        let mut sorted = series.clone();
        sorted.sort_by(f64::total_cmp);
        let mut members = Vec::new();
        for q in QUANTILES {
            let level = sorted[((sorted.len() - 1) as f64 * (1.0 - q)) as usize];
            let share = format!("{name} beyond what {:.0} % of the windows have", 100.0 * (1.0 - q));
            members.push((share.clone(), series.iter().map(|x| f64::from(u8::from(*x > level))).collect()));
            if covariate == "modelled_signal" {
                members.push((format!("excess of {share}"), series.iter().map(|x| (x - level).max(0.0)).collect()));
                members.push((format!("shortfall of {share}"), series.iter().map(|x| (level - x).max(0.0)).collect()));
            }
        }
        c.family(covariate, "beyond a threshold", members);
    }
}
