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

/// Angles of the orbit at every grid point: argument of latitude, and the angle past orbital noon.
pub fn angles(scene: &Scene) -> (Vec<f64>, Vec<f64>) {
    (0..scene.grid_s.len())
        .map(|g| {
            let normal = scene.r_m[g].cross(&scene.v_m_s[g]).normalize();
            let node = Vec3::new(-normal.y, normal.x, 0.0).normalize();
            let u = scene.r_m[g].dot(&normal.cross(&node)).atan2(scene.r_m[g].dot(&node));
            let noon = (scene.sun[g] - normal * normal.dot(&scene.sun[g])).normalize();
            (u, scene.r_m[g].dot(&normal.cross(&noon)).atan2(scene.r_m[g].dot(&noon)))
        })
        .unzip()
}

pub(super) fn lvlh(scene: &Scene, g: usize) -> [Vec3; 3] {
    let normal = scene.r_m[g].cross(&scene.v_m_s[g]).normalize();
    let radial = scene.r_m[g].normalize();
    [normal.cross(&radial), normal, radial]
}

/// What follows a series late, by a relaxation of the first order from its first value on.
fn follower(grid_s: &[f64], series: &[Vec3], tau_s: f64) -> Vec<Vec3> {
    let mut state = series[0];
    let mut before_s = grid_s[0];
    let follow = |(t, x): (&f64, &Vec3)| {
        state = x + (state - x) * (-(t - before_s) / tau_s).exp();
        before_s = *t;
        state
    };
    grid_s.iter().zip(series).map(follow).collect()
}

/// Whatever follows the attitude late, as what the Earth or the Sun warms.
pub(super) fn late(c: &mut Collector) {
    let s = c.scene;
    let all = 0..s.grid_s.len();
    let radial: Vec<Vec3> = all.clone().map(|g| s.body[g] * s.r_m[g].normalize()).collect();
    let sun: Vec<Vec3> = all.map(|g| s.body[g] * s.sun[g] * s.sunlit[g]).collect();
    for (what, covariate, direction) in [("r/|r|", "attitude", &radial), ("nu s", "sun_angle", &sun)] {
        for tau_s in [1000.0, 3000.0, 10_000.0] {
            let late = follower(&s.grid_s, direction, tau_s);
            c.several(
                format!("x, y, z of {what} in the body, relaxing in {tau_s:.0} s"),
                covariate,
                "after changes of attitude",
                &[&|g| late[g].x, &|g| late[g].y, &|g| late[g].z],
            );
        }
    }
}

pub(super) fn orbit(c: &mut Collector) {
    let s = c.scene;
    let (u, noon) = angles(s);
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
    c.vectors(
        "a constant in the local vertical frame",
        "attitude",
        "changes of attitude",
        &[&|g| bodies[0][g], &|g| bodies[1][g], &|g| bodies[2][g]],
    );
    let fixed = |k: usize| move |g: usize| s.body[g].column(k).into_owned();
    c.vectors("a constant in inertial axes", "attitude", "changes of attitude", &[&fixed(0), &fixed(1), &fixed(2)]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_follower_is_at_63_percent_of_a_step_after_its_time() {
        let grid_s: Vec<f64> = (0..200).map(|i| 20.0 * f64::from(i)).collect();
        let step: Vec<Vec3> = grid_s.iter().map(|t| Vec3::new(f64::from(u8::from(*t > 1000.0)), 1.0, 0.0)).collect();
        let late = follower(&grid_s, &step, 400.0);
        let at = |t: f64| late[(t / 20.0) as usize];
        assert_eq!((at(1000.0).x, at(1000.0).y), (0.0, 1.0));
        assert!((at(1400.0).x - (1.0 - (-1.0f64).exp())).abs() < 1e-12, "{}", at(1400.0).x);
    }
}
