//! Where the Sun is: apparent direction and distance from the Earth's centre, true equator and equinox of date.
//!
//! Low-precision theory: 0.01 deg in direction, 1e-4 in distance, 1950-2050; enough for light pressure, shadow and bulge.
//! Source: Meeus, Astronomical Algorithms, 2nd ed., chapter 25. Not here: what orbits of metres need.

use super::Vec3;
use super::time::{centuries_tt, nutation};

/// Astronomical unit, m (IAU 2012, exact).
pub const ASTRONOMICAL_UNIT_M: f64 = 149_597_870_700.0;
/// Radius of the Sun, m (IAU 2015 nominal).
pub const SUN_RADIUS_M: f64 = 6.957e8;

/// Unit vector from the Earth to the Sun, inertial (true equator of date), as seen (aberration included).
pub fn direction(unix_s: f64) -> Vec3 {
    let (longitude_rad, _) = ecliptic(unix_s);
    let (dpsi_rad, eps_rad) = nutation(unix_s);
    // Constant of aberration over the mean distance: -20.4898 arcsec.
    let apparent_rad = longitude_rad + dpsi_rad - (20.4898_f64 / 3600.0).to_radians();
    let (sin_l, cos_l) = apparent_rad.sin_cos();
    Vec3::new(cos_l, sin_l * eps_rad.cos(), sin_l * eps_rad.sin())
}

/// Distance from the Earth's centre to the Sun's, m.
pub fn distance_m(unix_s: f64) -> f64 {
    ecliptic(unix_s).1
}

/// Right ascension of the Sun, rad in -pi..pi.
pub fn right_ascension_rad(unix_s: f64) -> f64 {
    let s = direction(unix_s);
    s.y.atan2(s.x)
}

/// True geometric longitude (mean equinox of date), rad, and distance, m.
fn ecliptic(unix_s: f64) -> (f64, f64) {
    let t = centuries_tt(unix_s);
    let mean_longitude_deg = 280.466_46 + (36_000.769_83 + 0.000_303_2 * t) * t;
    let anomaly_deg = 357.529_11 + (35_999.050_29 - 0.000_153_7 * t) * t;
    let eccentricity = 0.016_708_634 - (0.000_042_037 + 0.000_000_126_7 * t) * t;
    let m = anomaly_deg.to_radians();
    let centre_deg = (1.914_602 - (0.004_817 + 0.000_014 * t) * t) * m.sin()
        + (0.019_993 - 0.000_101 * t) * (2.0 * m).sin()
        + 0.000_289 * (3.0 * m).sin();
    let true_anomaly = m + centre_deg.to_radians();
    let radius_au = 1.000_001_018 * (1.0 - eccentricity * eccentricity) / (1.0 + eccentricity * true_anomaly.cos());
    ((mean_longitude_deg + centre_deg).to_radians(), radius_au * ASTRONOMICAL_UNIT_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::time::{S_PER_DAY, julian_date, leap_seconds};

    #[test]
    fn the_example_of_meeus() {
        // Example 25.a, 1992 October 13, 0 h TD: right ascension 198.38083 deg, declination -7.78507 deg, 0.99766 au.
        let unix_s = 718_934_400.0 - 32.184 - 27.0;
        let s = direction(unix_s);
        // The book takes one term of nutation where four are taken here: 1.5 arcsec.
        assert!((s.y.atan2(s.x).to_degrees().rem_euclid(360.0) - 198.380_83).abs() < 5e-4);
        assert!((s.z.asin().to_degrees() + 7.785_07).abs() < 5e-4);
        assert!((distance_m(unix_s) / ASTRONOMICAL_UNIT_M - 0.997_66).abs() < 1e-5);
    }

    #[test]
    fn direction_and_distance_agree_with_sofa() {
        for k in 0..60 {
            let unix_s = 600_000_000.0 + f64::from(k) * 23.7 * S_PER_DAY;
            let (day, part) = julian_date(unix_s);
            let part = part + (leap_seconds(unix_s) + 32.184) / S_PER_DAY;
            let (heliocentric, _) = sofars::eph::epv00(day, part).unwrap();
            let of_date = sofars::pnp::pnm06a(day, part);
            let earth = crate::physics::Mat3::from_fn(|i, j| of_date[i][j]) * Vec3::from(heliocentric[0]);
            let angle_deg = direction(unix_s).angle(&-earth).to_degrees();
            // The theory is good to 0.01 deg; aberration, 0.0057 deg, is not in the geometric direction.
            assert!(angle_deg < 0.01 + 0.0057, "{angle_deg} at {unix_s}");
            let au = distance_m(unix_s) / ASTRONOMICAL_UNIT_M;
            assert!((au - earth.norm()).abs() < 1e-4, "{au} against {}", earth.norm());
        }
    }
}
