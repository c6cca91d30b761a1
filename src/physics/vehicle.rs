//! What the forces need to know of the vehicle. Not its attitude, nor where it is.

use super::Vec3;

/// The vehicle as its surface forces see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Vehicle {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Drag coefficient, referred to the projected area.
    pub drag_coefficient: f64,
    /// Areas projected along body X, Y, Z, m^2.
    pub area_m2: Vec3,
    /// From the centre of gravity to the sensor, body axes, m.
    pub sensor_offset_m: Vec3,
    /// Radiation-pressure coefficient (1 for full absorption).
    pub srp_coefficient: f64,
}

impl Vehicle {
    /// The Orbiter of STS-65 as the simulations take it: mass within the 104-117 t of the flight, sensor at about
    /// (-1.5, 0, +1.4) m. Configuration, no constants of nature.
    pub fn sts65() -> Self {
        Self {
            mass_kg: 104_000.0,
            drag_coefficient: 2.2,
            area_m2: Vec3::new(64.1, 255.0, 367.0),
            sensor_offset_m: Vec3::new(-1.5, 0.0, 1.4),
            srp_coefficient: 1.3,
        }
    }

    /// Area projected along a unit vector in body axes: sum |u_i| area_i, m^2.
    pub fn projected_area_m2(&self, unit_body: &Vec3) -> f64 {
        unit_body.abs().dot(&self.area_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_shows_its_own_area_from_either_side() {
        let vehicle = Vehicle::sts65();
        assert_eq!(vehicle.projected_area_m2(&-Vec3::y()), 255.0);
        let oblique = Vec3::new(0.6, 0.0, 0.8);
        assert!((vehicle.projected_area_m2(&oblique) - (0.6 * 64.1 + 0.8 * 367.0)).abs() < 1e-12);
    }
}
