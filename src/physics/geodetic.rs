//! Geodetic place of an inertial position: longitude, latitude, height above the WGS 84 ellipsoid.
//!
//! Polar motion is left out (0.3 arcsec, 10 m on the ground).

use super::time::gast_rad;
use super::{PhysicsError, Vec3};

/// A place above the ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Longitude, east positive, rad in -pi..pi.
    pub longitude_rad: f64,
    /// Geodetic latitude, rad.
    pub latitude_rad: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

/// Inertial (true equator of date) to Earth-fixed: a turn by the apparent sidereal time about +Z.
pub fn fixed_from_inertial(unix_s: f64, v: &Vec3) -> Vec3 {
    let (sin, cos) = gast_rad(unix_s).sin_cos();
    Vec3::new(cos * v.x + sin * v.y, -sin * v.x + cos * v.y, v.z)
}

/// Earth-fixed to inertial (true equator of date).
pub fn inertial_from_fixed(unix_s: f64, v: &Vec3) -> Vec3 {
    let (sin, cos) = gast_rad(unix_s).sin_cos();
    Vec3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z)
}

/// Place of an inertial position.
///
/// # Errors
/// [`PhysicsError::Position`] for a position that is not finite or lies within 1000 km of the Earth's centre.
pub fn place(unix_s: f64, r_inertial_m: &Vec3) -> Result<Place, PhysicsError> {
    let bad = PhysicsError::Position { r_m: [r_inertial_m.x, r_inertial_m.y, r_inertial_m.z] };
    let radius_m = r_inertial_m.norm();
    if !(radius_m.is_finite() && radius_m > 1e6) {
        return Err(bad);
    }
    let fixed = fixed_from_inertial(unix_s, r_inertial_m);
    // 1: the WGS 84 ellipsoid.
    let (longitude_rad, latitude_rad, height_m) =
        sofars::coords::gc2gd(1, [fixed.x, fixed.y, fixed.z]).map_err(|_| bad)?;
    Ok(Place { longitude_rad, latitude_rad, height_m })
}

/// Unit vectors north, east, down at a place, Earth-fixed.
pub fn north_east_down(place: &Place) -> [Vec3; 3] {
    let (sin_lat, cos_lat) = place.latitude_rad.sin_cos();
    let (sin_lon, cos_lon) = place.longitude_rad.sin_cos();
    [
        Vec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
        Vec3::new(-sin_lon, cos_lon, 0.0),
        Vec3::new(-cos_lat * cos_lon, -cos_lat * sin_lon, -sin_lat),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIX_S: f64 = 773_700_000.0;

    #[test]
    fn a_place_goes_round_by_way_of_sofa() {
        let fixed = sofars::coords::gd2gc(1, 0.3, -0.49, 301_234.0).unwrap();
        let inertial = inertial_from_fixed(UNIX_S, &Vec3::from(fixed));
        let place = place(UNIX_S, &inertial).unwrap();
        assert!((place.longitude_rad - 0.3).abs() < 1e-12);
        assert!((place.latitude_rad + 0.49).abs() < 1e-12);
        assert!((place.height_m - 301_234.0).abs() < 1e-6);
    }

    #[test]
    fn down_is_down_and_the_three_are_right_handed() {
        let [north, east, down] = north_east_down(&Place { longitude_rad: 1.0, latitude_rad: 0.5, height_m: 0.0 });
        assert!((north.cross(&east) - down).norm() < 1e-15);
        let r = sofars::coords::gd2gc(1, 1.0, 0.5, 0.0).unwrap();
        assert!(Vec3::from(r).dot(&down) < -6.3e6);
    }

    #[test]
    fn a_place_inside_the_earth_is_refused() {
        assert!(matches!(place(UNIX_S, &Vec3::zeros()), Err(PhysicsError::Position { .. })));
        assert!(matches!(place(UNIX_S, &Vec3::new(f64::NAN, 0.0, 7e6)), Err(PhysicsError::Position { .. })));
    }
}
