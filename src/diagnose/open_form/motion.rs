//! Forms of the vehicle's motion: body rates, and phases of the orbit.

use super::{AXIS, Collector};
use crate::diagnose::scene::Scene;
use crate::physics::Vec3;

pub(super) fn rates(c: &mut Collector) {
    let s = c.scene;
    let place = "manoeuvres and deadband motion";
    for i in 0..3 {
        c.grid(format!("w{}", AXIS[i]), "body_rate", place, |g| s.w_rad_s[g][i]);
        c.grid(format!("|w{}|", AXIS[i]), "body_rate", place, |g| s.w_rad_s[g][i].abs());
        c.grid(format!("w{0} |w{0}|", AXIS[i]), "body_rate", place, |g| s.w_rad_s[g][i] * s.w_rad_s[g][i].abs());
        c.grid(format!("dw{}/dt", AXIS[i]), "body_rate", place, |g| s.wdot_rad_s2[g][i]);
        for j in i..3 {
            c.grid(format!("w{} w{}", AXIS[i], AXIS[j]), "body_rate", place, |g| s.w_rad_s[g][i] * s.w_rad_s[g][j]);
        }
    }
    for i in 0..3 {
        let size: Vec<f64> = s.wdot_rad_s2.iter().map(|w| w[i].abs()).collect();
        let mut sorted = size.clone();
        sorted.sort_by(f64::total_cmp);
        let caps = [0.5, 0.8, 0.9, 0.97, 1.0].map(|q| sorted[((sorted.len() - 1) as f64 * q) as usize]);
        let members = caps.map(|cap| {
            (format!("|dw{}/dt|, at most {cap:.1e} rad/s2", AXIS[i]), s.measure_scalar(|g| size[g].min(cap)))
        });
        c.family("body_rate", place, members);
    }
    c.grid("|w|", "body_rate", place, |g| s.w_rad_s[g].norm());
    c.grid("w.w", "body_rate", place, |g| s.w_rad_s[g].norm_squared());
}

pub(super) fn lvlh(scene: &Scene, g: usize) -> [Vec3; 3] {
    let normal = scene.r_m[g].cross(&scene.v_m_s[g]).normalize();
    let radial = scene.r_m[g].normalize();
    [normal.cross(&radial), normal, radial]
}

pub(super) fn orbit(c: &mut Collector) {
    let s = c.scene;
    let (u, noon) = s.orbit_angles_rad();
    let bodies: [Vec<Vec3>; 3] =
        std::array::from_fn(|k| (0..s.grid_s.len()).map(|g| s.body[g] * lvlh(s, g)[k]).collect());
    let place = "a phase of the orbit";
    for k in 1..=6 {
        let n = k as f64;
        c.several(
            format!("sin {k}u, cos {k}u"),
            "argument_of_latitude",
            place,
            &[&|g| (n * u[g]).sin(), &|g| (n * u[g]).cos()],
        );
        c.several(
            format!("sin {k}(u - u_noon), cos {k}(u - u_noon)"),
            "sun_phase",
            place,
            &[&|g| (n * noon[g]).sin(), &|g| (n * noon[g]).cos()],
        );
        if k <= 3 {
            for (name, b) in ["along-track", "cross-track", "radial"].into_iter().zip(&bodies) {
                c.vectors(
                    format!("sin {k}u, cos {k}u {name}"),
                    "argument_of_latitude",
                    place,
                    &[&|g| b[g] * (n * u[g]).sin(), &|g| b[g] * (n * u[g]).cos()],
                );
                c.vectors(
                    format!("sin {k}(u - u_noon), cos {k}(u - u_noon) {name}"),
                    "sun_phase",
                    place,
                    &[&|g| b[g] * (n * noon[g]).sin(), &|g| b[g] * (n * noon[g]).cos()],
                );
            }
        }
    }
    changing_lines(c, &u);
    c.vectors(
        "a constant in the local vertical frame",
        "attitude",
        "changes of attitude",
        &[&|g| bodies[0][g], &|g| bodies[1][g], &|g| bodies[2][g]],
    );
    let fixed = |k: usize| move |g: usize| s.body[g].column(k).into_owned();
    c.vectors("a constant in inertial axes", "attitude", "changes of attitude", &[&fixed(0), &fixed(1), &fixed(2)]);
}

/// The line of the orbit from an instant of no log on: what changes the temperature or the air about the sensor changes its line.
fn changing_lines(c: &mut Collector, u: &[f64]) {
    const ONSETS: usize = 16;
    let s = c.scene;
    let [start, end] = s.span_s();
    let line = [s.measure_scalar(|g| u[g].sin()), s.measure_scalar(|g| u[g].cos())];
    let members = (2..=ONSETS - 2).map(|i| {
        let onset_s = start + (end - start) * i as f64 / ONSETS as f64;
        let from = |series: &Vec<f64>| {
            let windows = series.iter().zip(s.clock_s());
            windows.map(|(x, t)| if *t >= onset_s { *x } else { 0.0 }).collect()
        };
        (format!("sin u, cos u from {onset_s:.0} s on"), line.iter().map(from).collect())
    });
    c.several_family("argument_of_latitude", "from an instant of no log on", members);
}
