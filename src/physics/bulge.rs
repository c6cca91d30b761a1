//! The atmosphere's afternoon bulge: density follows the Sun, two hours late.
//!
//! a_d x amplitude x cos psi is the variation of drag, psi the angle from the bulge's apex, which is the Sun's direction turned
//! 30 deg eastward (about the Earth's axis). Source: Harris-Priester and its descendants; the amplitude is the caller's.

use super::Vec3;

/// Lag of the apex behind the Sun, rad.
pub const LAG_RAD: f64 = std::f64::consts::PI / 6.0;

/// Unit vector to the apex, inertial axes (true equator of date), from the unit vector to the Sun.
pub fn apex(sun_unit: &Vec3) -> Vec3 {
    let (sin, cos) = LAG_RAD.sin_cos();
    Vec3::new(cos * sun_unit.x - sin * sun_unit.y, sin * sun_unit.x + cos * sun_unit.y, sun_unit.z)
}

/// cos psi at a position: 1 under the apex, -1 opposite.
pub fn cos_psi(r_m: &Vec3, sun_unit: &Vec3) -> f64 {
    r_m.dot(&apex(sun_unit)) / r_m.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_apex_stands_at_two_in_the_afternoon() {
        use crate::physics::time::local_solar_time_h;
        let sun = crate::physics::sun::direction(773_700_000.0);
        let apex = apex(&sun);
        assert!((local_solar_time_h(apex.y.atan2(apex.x), sun.y.atan2(sun.x)) - 14.0).abs() < 1e-12);
        assert_eq!(apex.z, sun.z);
        assert!((cos_psi(&(apex * 7e6), &sun) - 1.0).abs() < 1e-12);
    }
}
