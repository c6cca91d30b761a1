//! The geomagnetic field: IGRF, degree 13, by the `igrf` crate.
//!
//! After the last year of its table the field of that year's end stands: it changes by less than a hundredth of itself a year
//! (tested for its last five).
//!
//! The crate knows whole days only (secular change is below 0.4 nT a day) and whole metres of height, and answers NaN
//! within 0.001 deg of a pole: there the latitude is moved by 0.002 deg (220 m, less than 1 nT).

use super::geodetic::{inertial_from_fixed, north_east_down, place};
use super::time::{J2000_JD, julian_date};
use super::{PhysicsError, Vec3};

const TESLA_PER_NT: f64 = 1e-9;
/// Highest latitude asked of the crate, degrees.
const LATITUDE_DEG_MAX: f64 = 89.998;
/// The day up to which the crate's table is used, its last but one, and the last year in which its field is near enough.
const TABLE_END: (i32, u16) = (2024, 365);
const YEAR_MAX: i32 = 2039;

/// Magnetic flux density at an inertial position, inertial axes (true equator of date), tesla.
///
/// # Errors
/// [`PhysicsError::FieldDate`] outside 1900 to 2039, [`PhysicsError::Position`] for a position that is no place.
pub fn geomagnetic_field_t(unix_s: f64, r_inertial_m: &Vec3) -> Result<Vec3, PhysicsError> {
    let mut place = place(unix_s, r_inertial_m)?;
    let latitude_deg = place.latitude_rad.to_degrees().clamp(-LATITUDE_DEG_MAX, LATITUDE_DEG_MAX);
    place.latitude_rad = latitude_deg.to_radians();
    let date = date(unix_s).ok_or(PhysicsError::FieldDate { unix_s })?;
    let height_m = place.height_m.round().clamp(0.0, f64::from(u32::MAX)) as u32;
    let field =
        igrf::declination(latitude_deg, place.longitude_rad.to_degrees(), height_m, date).map_err(
            |error| match error {
                igrf::Error::DateOutOfRange(_) => PhysicsError::FieldDate { unix_s },
                igrf::Error::LatitudeOutOfBounds | igrf::Error::LongitudeOutOfBounds => {
                    PhysicsError::Position { r_m: [r_inertial_m.x, r_inertial_m.y, r_inertial_m.z] }
                }
            },
        )?;
    let [north, east, down] = north_east_down(&place);
    let fixed_nt = north * field.x + east * field.y + down * field.z;
    Ok(inertial_from_fixed(unix_s, &fixed_nt) * TESLA_PER_NT)
}

fn date(unix_s: f64) -> Option<time::Date> {
    if !unix_s.is_finite() {
        return None;
    }
    // Julian day number at noon of the day.
    let number = julian_date(unix_s).0 + 0.5;
    if (number - J2000_JD).abs() > 100_000.0 {
        return None;
    }
    let date = time::Date::from_julian_day(number as i32).ok()?;
    let end = time::Date::from_ordinal_date(TABLE_END.0, TABLE_END.1).ok()?;
    (date.year() <= YEAR_MAX).then(|| date.min(end))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::EARTH_RADIUS_M;

    /// 1994-07-08 00:00 UTC.
    const UNIX_S: f64 = 773_625_600.0;

    fn at(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Vec3 {
        at_time(UNIX_S, latitude_deg, longitude_deg, height_m)
    }

    fn at_time(unix_s: f64, latitude_deg: f64, longitude_deg: f64, height_m: f64) -> Vec3 {
        let fixed = sofars::coords::gd2gc(1, longitude_deg.to_radians(), latitude_deg.to_radians(), height_m).unwrap();
        geomagnetic_field_t(unix_s, &inertial_from_fixed(unix_s, &Vec3::from(fixed))).unwrap()
    }

    /// From 2019-12-30 to 2024-12-30; after that it stands.
    #[test]
    fn the_field_changes_by_less_than_a_hundredth_a_year_and_stands_after_its_table() {
        let [begin, end, later] = [1_577_664_000.0, 1_735_516_800.0, 2_145_916_800.0];
        let mut most: f64 = 0.0;
        for latitude in (-80..=80).step_by(10) {
            for longitude in (-180..180).step_by(20) {
                let norm = |unix_s| at_time(unix_s, f64::from(latitude), f64::from(longitude), 3e5).norm();
                most = most.max((norm(end) / norm(begin) - 1.0).abs() / 5.0);
                assert!((norm(later) / norm(end) - 1.0).abs() < 1e-4);
            }
        }
        assert!(most > 1e-3 && most < 1e-2, "{most}");
    }

    #[test]
    fn the_field_is_near_that_of_the_tilted_dipole_of_1995() {
        // IGRF 1995 (IAGA): g10 = -29692, g11 = -1784, h11 = 5306 nT. Dipole field B = (a/r)^3 (3 (m.e) e - m), with
        // m = (g11, h11, g10) for B = -grad V; the rest of the field is about a fifth of it at 300 km.
        let m = Vec3::new(-1784.0, 5306.0, -29692.0) * 1e-9;
        let (mut difference2, mut dipole2, mut count) = (0.0, 0.0, 0.0);
        for latitude in (-80..=80).step_by(10) {
            for longitude in (-180..180).step_by(15) {
                let weight = f64::from(latitude).to_radians().cos();
                let fixed = Vec3::from(
                    sofars::coords::gd2gc(1, f64::from(longitude).to_radians(), f64::from(latitude).to_radians(), 3e5)
                        .unwrap(),
                );
                let e = fixed.normalize();
                let dipole = (3.0 * m.dot(&e) * e - m) * (6_371_200.0 / fixed.norm()).powi(3);
                let field = at(f64::from(latitude), f64::from(longitude), 3e5);
                let expected = inertial_from_fixed(UNIX_S, &dipole);
                difference2 += weight * (field - expected).norm_squared();
                dipole2 += weight * expected.norm_squared();
                count += weight;
            }
        }
        let share = (difference2 / dipole2).sqrt();
        assert!(count > 0.0 && share > 0.1 && share < 0.27, "{share}");
    }

    #[test]
    fn the_field_has_no_divergence_and_no_curl() {
        let r = Vec3::new(4.2e6, -3.9e6, 3.4e6) * ((EARTH_RADIUS_M + 300e3) / 6.655e6);
        let h = 20e3;
        let b = |d: Vec3| geomagnetic_field_t(UNIX_S, &(r + d)).unwrap();
        let gradient: Vec<Vec3> =
            [Vec3::x(), Vec3::y(), Vec3::z()].iter().map(|u| (b(u * h) - b(-u * h)) / (2.0 * h)).collect();
        let scale = gradient.iter().map(|g| g.norm()).fold(0.0, f64::max);
        let divergence = gradient[0].x + gradient[1].y + gradient[2].z;
        let curl =
            Vec3::new(gradient[1].z - gradient[2].y, gradient[2].x - gradient[0].z, gradient[0].y - gradient[1].x);
        assert!(divergence.abs() < 1e-3 * scale, "{divergence} of {scale}");
        assert!(curl.norm() < 1e-3 * scale, "{curl} of {scale}");
    }

    #[test]
    fn poles_and_out_of_range_years_have_an_answer() {
        let pole = geomagnetic_field_t(UNIX_S, &Vec3::new(0.0, 0.0, 6.7e6)).unwrap();
        assert!(pole.iter().all(|b| b.is_finite()) && pole.norm() > 4e-5, "{pole}");
        let r = Vec3::new(6.7e6, 0.0, 0.0);
        assert!(matches!(geomagnetic_field_t(4e9, &r), Err(PhysicsError::FieldDate { .. })));
        assert!(matches!(
            geomagnetic_field_t(f64::NAN, &r),
            Err(PhysicsError::FieldDate { .. } | PhysicsError::Position { .. })
        ));
    }
}
