//! Aerodynamic drag in free-molecular flow, with a projected area.
//!
//! F = -1/2 rho Cd A |v| v, with `v` relative to an atmosphere turning with the Earth, `A = sum |u_i| area_i`, `u = v/|v|`
//! in body axes. No lift, no accommodation: they hide in Cd.

use super::vehicle::Vehicle;
use super::{EARTH_RATE_RAD_S, Vec3};

/// Velocity relative to the air, inertial axes, m/s: v - w_earth x r - wind. `corotation` is 1 for an atmosphere that turns
/// with the Earth, 0 for one at rest; `wind_m_s` is the air's motion beside that.
pub fn relative_velocity_m_s(r_m: &Vec3, v_m_s: &Vec3, corotation: f64, wind_m_s: &Vec3) -> Vec3 {
    v_m_s - Vec3::new(0.0, 0.0, EARTH_RATE_RAD_S * corotation).cross(r_m) - wind_m_s
}

/// A horizontal wind, inertial axes, from its part along the flight and across it (towards the orbit normal r x v), m/s.
pub fn wind_m_s(r_m: &Vec3, v_m_s: &Vec3, along_m_s: f64, cross_m_s: f64) -> Vec3 {
    let normal = r_m.cross(v_m_s).normalize();
    let along = normal.cross(&r_m.normalize());
    along * along_m_s + normal * cross_m_s
}

/// Drag, m/s^2, body axes, for a velocity relative to the air in body axes.
pub fn acceleration_m_s2(vehicle: &Vehicle, density_kg_m3: f64, relative_velocity_body_m_s: &Vec3) -> Vec3 {
    let speed_m_s = relative_velocity_body_m_s.norm();
    if speed_m_s == 0.0 {
        return Vec3::zeros();
    }
    let area_m2 = vehicle.projected_area_m2(&(relative_velocity_body_m_s / speed_m_s));
    let factor = -0.5 * density_kg_m3 * vehicle.drag_coefficient * area_m2 * speed_m_s / vehicle.mass_kg;
    relative_velocity_body_m_s * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::NANO_G_M_S2;

    #[test]
    fn at_300_km_it_is_tens_to_hundreds_of_nano_g_by_attitude() {
        // "30 to 470 ng at 300 km depending on attitude" [Rice 1996, by way of the flight's files].
        let vehicle = Vehicle::sts65();
        let v = 7_726.0 - 490.0;
        let nose = acceleration_m_s2(&vehicle, 1.2e-11, &(Vec3::x() * v)).norm() / NANO_G_M_S2;
        let belly = acceleration_m_s2(&vehicle, 2.5e-11, &(Vec3::z() * v)).norm() / NANO_G_M_S2;
        assert!((30.0..120.0).contains(&nose), "{nose}");
        assert!((400.0..560.0).contains(&belly), "{belly}");
    }

    #[test]
    fn drag_opposes_the_relative_wind_and_corotation_lessens_it() {
        let r = Vec3::new(6.678e6, 0.0, 0.0);
        let v = Vec3::new(0.0, 7726.0, 0.0);
        let still = relative_velocity_m_s(&r, &v, 0.0, &Vec3::zeros());
        let turning = relative_velocity_m_s(&r, &v, 1.0, &Vec3::zeros());
        assert_eq!(still, v);
        // 7.2921159e-5 rad/s x 6678 km = 487 m/s.
        assert!((v.y - turning.y - 486.967).abs() < 1e-2, "{turning}");
        let a = acceleration_m_s2(&Vehicle::sts65(), 2e-11, &turning);
        assert!(a.y < 0.0 && a.cross(&turning).norm() < 1e-12);
    }

    #[test]
    fn a_tail_wind_lies_along_the_flight_and_a_cross_wind_along_the_normal() {
        let (r, v) = (Vec3::new(6.678e6, 0.0, 0.0), Vec3::new(30.0, 7726.0, 0.0));
        assert!((wind_m_s(&r, &v, 100.0, 0.0) - Vec3::y() * 100.0).norm() < 1e-9);
        assert!((wind_m_s(&r, &v, 0.0, 100.0) - Vec3::z() * 100.0).norm() < 1e-9);
    }
}
