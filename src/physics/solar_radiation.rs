//! Sunlight's push on the vehicle.
//!
//! a = -nu C P (sum |s_i| area_i)/m s, with `s` the unit vector to the Sun in body axes, `nu` the seen part of the Sun and
//! P = 4.56e-6 N/m^2. The yearly change of the Sun's distance (3.4 % of P each way) and the Earth's own light are left out,
//! as the simulations leave them out.

use super::Vec3;
use super::vehicle::Vehicle;

/// Pressure of sunlight on a black surface at 1 au, N/m^2.
pub const SOLAR_PRESSURE_N_M2: f64 = 4.56e-6;

/// Radiation-pressure acceleration per unit of coefficient, m/s^2, body axes.
pub fn acceleration_per_coefficient_m_s2(vehicle: &Vehicle, sunlit_fraction: f64, sun_body: &Vec3) -> Vec3 {
    let push = sunlit_fraction * SOLAR_PRESSURE_N_M2 * vehicle.projected_area_m2(sun_body) / vehicle.mass_kg;
    sun_body * -push
}

/// Radiation-pressure acceleration with the vehicle's own coefficient, m/s^2, body axes.
pub fn acceleration_m_s2(vehicle: &Vehicle, sunlit_fraction: f64, sun_body: &Vec3) -> Vec3 {
    acceleration_per_coefficient_m_s2(vehicle, sunlit_fraction, sun_body) * vehicle.srp_coefficient
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::NANO_G_M_S2;

    #[test]
    fn the_pressure_is_the_solar_constant_over_the_speed_of_light() {
        assert!((1367.0 / 299_792_458.0 - SOLAR_PRESSURE_N_M2).abs() < 1e-8);
    }

    #[test]
    fn the_orbiter_belly_to_the_sun_is_pushed_by_two_nano_g() {
        let a = acceleration_m_s2(&Vehicle::sts65(), 1.0, &Vec3::z());
        assert!(a.z < 0.0);
        let ng = -a.z / NANO_G_M_S2;
        assert!((ng - 1.3 * 4.56e-6 * 367.0 / 104_000.0 / 9.80665e-9).abs() < 1e-9 && ng > 2.0 && ng < 2.3);
        assert_eq!(acceleration_m_s2(&Vehicle::sts65(), 0.0, &Vec3::z()), Vec3::zeros());
    }
}
