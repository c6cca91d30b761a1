//! Attitude: which way the body points. Quaternions are scalar first and turn inertial components into body components.
//!
//! v_body = C v_inertial with `C[0][0] = 1-2(y^2+z^2), C[0][1] = 2(xy-wz), C[1][0] = 2(xy+wz)` and so on: numerically the
//! matrix that nalgebra's `UnitQuaternion` stands for, read as *body from inertial*.
//!
//! The local vertical frame (LVLH): +x forward, in the plane, at right angles to the radius; +y opposite the orbit normal; +z
//! down. Euler angles are (roll, pitch, yaw), turned yaw first, then pitch, then roll: C = R1(roll) R2(pitch) R3(yaw).

use nalgebra::{Quaternion, Rotation3, UnitQuaternion};

use super::orbit::State;
use super::{Mat3, Vec3};

/// Body from inertial.
pub type Attitude = UnitQuaternion<f64>;

/// From the four numbers of a file, scalar first; their length is put right. `None` if they are not finite or all zero.
pub fn from_scalar_first(w: f64, x: f64, y: f64, z: f64) -> Option<Attitude> {
    let q = Quaternion::new(w, x, y, z);
    (q.norm().is_finite() && q.norm() > 1e-6).then(|| UnitQuaternion::from_quaternion(q))
}

/// The four numbers of a file, scalar first.
pub fn to_scalar_first(q: &Attitude) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

/// The matrix C of v_body = C v_inertial.
pub fn body_from_inertial(q: &Attitude) -> Mat3 {
    *q.to_rotation_matrix().matrix()
}

/// Body from a reference frame by Euler angles (roll, pitch, yaw), rad: C = R1(roll) R2(pitch) R3(yaw).
pub fn from_euler(roll_rad: f64, pitch_rad: f64, yaw_rad: f64) -> Attitude {
    // R(angle) turns the axes: the opposite of turning a vector.
    UnitQuaternion::from_axis_angle(&Vec3::x_axis(), -roll_rad)
        * UnitQuaternion::from_axis_angle(&Vec3::y_axis(), -pitch_rad)
        * UnitQuaternion::from_axis_angle(&Vec3::z_axis(), -yaw_rad)
}

/// The local vertical frame from inertial, as an attitude.
pub fn lvlh_from_inertial(state: &State) -> Attitude {
    let down = -state.r_m.normalize();
    let right = -state.r_m.cross(&state.v_m_s).normalize();
    let forward = right.cross(&down);
    let matrix = Mat3::from_rows(&[forward.transpose(), right.transpose(), down.transpose()]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix))
}

/// Inertial rate of the local vertical frame, in its own axes, rad/s, for a plane that stands still: -|h|/r^2 about +y.
pub fn lvlh_rate_rad_s(state: &State) -> Vec3 {
    Vec3::new(0.0, -state.r_m.cross(&state.v_m_s).norm() / state.r_m.norm_squared(), 0.0)
}

/// Attitude held to the local vertical with Euler angles (roll, pitch, yaw), rad.
pub fn hold_lvlh(state: &State, euler_rad: &Vec3) -> Attitude {
    from_euler(euler_rad.x, euler_rad.y, euler_rad.z) * lvlh_from_inertial(state)
}

/// On the way from one attitude to another by the shortest turn about one axis; `fraction` 0 to 1.
pub fn between(from: &Attitude, to: &Attitude, fraction: f64) -> Attitude {
    from.slerp(to, fraction.clamp(0.0, 1.0))
}

/// A fraction of a manoeuvre that begins and ends at rest, with no jump of acceleration: 6 s^5 - 15 s^4 + 10 s^3.
pub fn smooth_fraction(elapsed: f64) -> f64 {
    let s = elapsed.clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (6.0 * s - 15.0))
}

/// Mean inertial rate between two attitudes, body axes, rad/s: C(t + dt) = exp(-[w x] dt) C(t).
pub fn rate_rad_s(before: &Attitude, after: &Attitude, dt_s: f64) -> Vec3 {
    let mut turn = after * before.inverse();
    if turn.w < 0.0 {
        turn = UnitQuaternion::new_unchecked(-turn.into_inner());
    }
    -turn.scaled_axis() / dt_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::orbit::{Elements, period_s, propagate};
    use crate::physics::{gravity_gradient, rotation};
    use crate::units::NANO_G_M_S2;

    fn orbit() -> State {
        Elements::from_heights(300e3, 300e3, 28.45_f64.to_radians(), 1.0, 0.0).state().unwrap()
    }

    fn at(state: &State, seconds: f64) -> State {
        propagate(state, seconds, 1.0, 0.0).unwrap()
    }

    /// Specific force at `offset` in nano-g, rates from finite differences of the attitude as a mission has them.
    fn force_ng(state: &State, attitude: impl Fn(&State) -> Attitude, offset: &Vec3) -> Vec3 {
        let h = 1.0;
        let [before, now, after] = [-h, 0.0, h].map(|s| attitude(&at(state, s)));
        let (early, late) = (rate_rad_s(&before, &now, h), rate_rad_s(&now, &after, h));
        let rotation = rotation::specific_force_m_s2(&((early + late) / 2.0), &((late - early) / h), offset);
        let body = body_from_inertial(&now) * state.r_m;
        (rotation + gravity_gradient::specific_force_m_s2(&body, offset)) / NANO_G_M_S2
    }

    #[test]
    fn held_to_the_local_vertical_at_300_km() {
        // Radial 409 ng/m, cross-track 136 ng/m, along-track 0 [Rice 1996].
        let state = orbit();
        let hold = |s: &State| lvlh_from_inertial(s);
        let radial = force_ng(&state, hold, &Vec3::z());
        let cross = force_ng(&state, hold, &Vec3::y());
        let along = force_ng(&state, hold, &Vec3::x());
        assert!((radial.z + 409.4).abs() < 0.5 && radial.xy().norm() < 0.1, "{radial}");
        assert!((cross.y - (-409.4 / -3.0)).abs() < 0.5 && cross.z.abs() < 0.1, "{cross}");
        assert!(along.norm() < 0.1, "{along}");
    }

    #[test]
    fn held_inertially_it_swings_to_273_ng_at_twice_the_orbital_rate() {
        let state = orbit();
        let start = lvlh_from_inertial(&state);
        let quarter = period_s(&state) / 4.0;
        let z: Vec<f64> =
            (0..4).map(|k| force_ng(&at(&state, f64::from(k) * quarter), |_| start, &Vec3::z()).z).collect();
        assert!((z[0] + 273.0).abs() < 0.5 && (z[2] - z[0]).abs() < 0.1, "{z:?}");
        assert!((z[1] - 136.5).abs() < 0.5 && (z[3] - z[1]).abs() < 0.1, "{z:?}");
    }

    #[test]
    fn the_matrix_is_that_of_the_files() {
        let q = from_scalar_first(0.5, -0.5, 0.1, 0.7).unwrap();
        let [w, x, y, z] = to_scalar_first(&q);
        let c = body_from_inertial(&q);
        assert!((c[(0, 0)] - (1.0 - 2.0 * (y * y + z * z))).abs() < 1e-15);
        assert!((c[(0, 1)] - 2.0 * (x * y - w * z)).abs() < 1e-15);
        assert!((c[(1, 0)] - 2.0 * (x * y + w * z)).abs() < 1e-15);
        assert!((c[(2, 0)] - 2.0 * (x * z - w * y)).abs() < 1e-15);
        assert!(from_scalar_first(0.0, 0.0, 0.0, 0.0).is_none());
        assert!(from_scalar_first(f64::NAN, 0.0, 0.0, 1.0).is_none());
    }

    #[test]
    fn the_local_vertical_turns_once_an_orbit_about_minus_y() {
        let state = orbit();
        let rate = rate_rad_s(&lvlh_from_inertial(&at(&state, -0.5)), &lvlh_from_inertial(&at(&state, 0.5)), 1.0);
        assert!((rate - lvlh_rate_rad_s(&state)).norm() < 1e-10, "{rate}");
        assert!((rate.y + std::f64::consts::TAU / period_s(&state)).abs() < 1e-9);
    }

    #[test]
    fn yaw_then_pitch_then_roll() {
        let quarter = std::f64::consts::FRAC_PI_2;
        // Roll 90, yaw 90: body x right (+y), body y down (+z), body z forward (+x).
        let c = body_from_inertial(&from_euler(quarter, 0.0, quarter));
        let expected = Mat3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
        assert!((c - expected).norm() < 1e-15, "{c}");
        // Pitch 90: the nose up.
        assert!((from_euler(0.0, quarter, 0.0).inverse() * Vec3::x() + Vec3::z()).norm() < 1e-15);
    }

    #[test]
    fn a_manoeuvre_starts_and_ends_at_rest() {
        let (from, to) = (from_euler(0.1, 0.2, 0.3), from_euler(-1.0, 0.4, 2.0));
        assert!(between(&from, &to, smooth_fraction(0.0)).angle_to(&from) < 1e-12);
        assert!(between(&from, &to, smooth_fraction(1.0)).angle_to(&to) < 1e-12);
        assert!(smooth_fraction(1e-3) < 1e-8 && smooth_fraction(0.5) == 0.5);
    }

    #[test]
    fn a_rate_is_found_again() {
        let w = Vec3::new(1e-3, -2e-3, 5e-4);
        let start = from_euler(0.3, -0.2, 2.9);
        let later = UnitQuaternion::from_scaled_axis(-w * 3.0) * start;
        assert!((rate_rad_s(&start, &later, 3.0) - w).norm() < 1e-15);
    }
}
