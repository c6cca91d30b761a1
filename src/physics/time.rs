//! The Earth's clock: Julian dates, sidereal time, local solar time, from UTC in seconds since 1970.
//!
//! Takes UT1 for UTC (they differ by less than 0.9 s: 14 arcsec of the Earth's turn). Not here: precise Earth
//! orientation for orbits.

use std::f64::consts::TAU;

/// Julian date of 1970-01-01 00:00.
pub const UNIX_EPOCH_JD: f64 = 2_440_587.5;
/// Julian date of J2000.0.
pub const J2000_JD: f64 = 2_451_545.0;
/// Seconds in a day.
pub const S_PER_DAY: f64 = 86_400.0;
/// Terrestrial time less UTC without the leap seconds, s.
const TT_MINUS_TAI_S: f64 = 32.184;
/// UTC in seconds since 1970 at which TAI - UTC took each whole value from 10 s on (IERS Bulletin C).
const LEAPS: [(i64, f64); 28] = [
    (63_072_000, 10.0),
    (78_796_800, 11.0),
    (94_694_400, 12.0),
    (126_230_400, 13.0),
    (157_766_400, 14.0),
    (189_302_400, 15.0),
    (220_924_800, 16.0),
    (252_460_800, 17.0),
    (283_996_800, 18.0),
    (315_532_800, 19.0),
    (362_793_600, 20.0),
    (394_329_600, 21.0),
    (425_865_600, 22.0),
    (489_024_000, 23.0),
    (567_993_600, 24.0),
    (631_152_000, 25.0),
    (662_688_000, 26.0),
    (709_948_800, 27.0),
    (741_484_800, 28.0),
    (773_020_800, 29.0),
    (820_454_400, 30.0),
    (867_715_200, 31.0),
    (915_148_800, 32.0),
    (1_136_073_600, 33.0),
    (1_230_768_000, 34.0),
    (1_341_100_800, 35.0),
    (1_435_708_800, 36.0),
    (1_483_228_800, 37.0),
];

/// Julian date (UTC), whole and fractional part: their sum keeps microseconds.
pub fn julian_date(unix_s: f64) -> (f64, f64) {
    let days = (unix_s / S_PER_DAY).floor();
    (UNIX_EPOCH_JD + days, (unix_s - days * S_PER_DAY) / S_PER_DAY)
}

/// TAI - UTC, s. Ten before 1972.
pub fn leap_seconds(unix_s: f64) -> f64 {
    let known = LEAPS.partition_point(|&(since, _)| since as f64 <= unix_s);
    LEAPS[known.saturating_sub(1)].1
}

/// Julian centuries of terrestrial time since J2000.0.
pub fn centuries_tt(unix_s: f64) -> f64 {
    let tt_s = unix_s + leap_seconds(unix_s) + TT_MINUS_TAI_S;
    (tt_s / S_PER_DAY + (UNIX_EPOCH_JD - J2000_JD)) / 36_525.0
}

/// Greenwich mean sidereal time, rad in 0..2 pi. IAU 1982: GMST of 0 h UT1 plus the day's turn
/// (Aoki et al., A&A 105, 359, 1982).
pub fn gmst_rad(unix_s: f64) -> f64 {
    let days = (unix_s / S_PER_DAY).floor();
    let of_day_s = unix_s - days * S_PER_DAY;
    let t = (unix_s / S_PER_DAY + (UNIX_EPOCH_JD - J2000_JD)) / 36_525.0;
    // The polynomial in the running T already holds the drift of the day; of_day_s turns at the solar rate.
    let s = 24_110.548_41 + (8_640_184.812_866 + (0.093_104 - 6.2e-6 * t) * t) * t + of_day_s;
    (s / S_PER_DAY * TAU).rem_euclid(TAU)
}

/// Greenwich apparent sidereal time, rad in 0..2 pi: turns Earth-fixed into the true equator and equinox of date.
pub fn gast_rad(unix_s: f64) -> f64 {
    let (dpsi_rad, eps_rad) = nutation(unix_s);
    (gmst_rad(unix_s) + dpsi_rad * eps_rad.cos()).rem_euclid(TAU)
}

/// Nutation in longitude and true obliquity, rad: the four leading terms of IAU 1980, good to 0.5 arcsec
/// (Meeus, Astronomical Algorithms, 2nd ed., ch. 22).
pub fn nutation(unix_s: f64) -> (f64, f64) {
    let t = centuries_tt(unix_s);
    let node = (125.044_52 - 1_934.136_261 * t).to_radians();
    let sun = (280.466_5 + 36_000.769_8 * t).to_radians();
    let moon = (218.316_5 + 481_267.881_3 * t).to_radians();
    let dpsi_as =
        -17.20 * node.sin() - 1.32 * (2.0 * sun).sin() - 0.23 * (2.0 * moon).sin() + 0.21 * (2.0 * node).sin();
    let deps_as = 9.20 * node.cos() + 0.57 * (2.0 * sun).cos() + 0.10 * (2.0 * moon).cos() - 0.09 * (2.0 * node).cos();
    let mean_eps_as = 84_381.448 - (46.8150 + (0.000_59 - 0.001_813 * t) * t) * t;
    ((dpsi_as / 3600.0).to_radians(), ((mean_eps_as + deps_as) / 3600.0).to_radians())
}

/// Local solar time at a right ascension, hours in 0..24: 12 where the Sun culminates.
pub fn local_solar_time_h(right_ascension_rad: f64, sun_right_ascension_rad: f64) -> f64 {
    (12.0 + (right_ascension_rad - sun_right_ascension_rad) / TAU * 24.0).rem_euclid(24.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// UT1 and UTC are the same here: what is compared is the formula.
    fn jd(unix_s: f64) -> ((f64, f64), (f64, f64)) {
        let ut = julian_date(unix_s);
        (ut, (ut.0, ut.1 + (leap_seconds(unix_s) + TT_MINUS_TAI_S) / S_PER_DAY))
    }

    #[test]
    fn sidereal_time_of_meeus_example_12a() {
        // 1987 April 10, 0 h UT: mean 13h 10m 46.3668s, apparent 13h 10m 46.1351s.
        let unix_s = 545_011_200.0;
        let seconds = |rad: f64| rad / TAU * S_PER_DAY;
        assert!((seconds(gmst_rad(unix_s)) - 47_446.366_8).abs() < 2e-4);
        // Four terms of nutation: half an arcsecond is 0.03 s.
        assert!((seconds(gast_rad(unix_s)) - 47_446.135_1).abs() < 0.03);
    }

    #[test]
    fn sidereal_time_agrees_with_sofa() {
        for day in 0..40 {
            let unix_s = 700_000_000.0 + f64::from(day) * 17.0 * S_PER_DAY + f64::from(day) * 2000.0;
            let (ut, tt) = jd(unix_s);
            let mean = sofars::vm::anpm(gmst_rad(unix_s) - sofars::erst::gmst06(ut.0, ut.1, tt.0, tt.1));
            let apparent = sofars::vm::anpm(gast_rad(unix_s) - sofars::erst::gst06a(ut.0, ut.1, tt.0, tt.1));
            // The 1982 and 2006 conventions differ by their precession, 0.02 arcsec a year from 2000.
            assert!(mean.to_degrees().abs() * 3600.0 < 0.2, "{mean}");
            assert!(apparent.to_degrees().abs() * 3600.0 < 1.0, "{apparent}");
        }
    }

    #[test]
    fn leap_seconds_are_those_of_sofa() {
        for (year, month, unix_s) in [(1994, 6, 770_428_800.0), (1994, 7, 773_020_800.0), (2017, 1, 1_483_228_800.0)] {
            assert_eq!(leap_seconds(unix_s), sofars::ts::dat(year, month, 1, 0.0).unwrap());
        }
    }

    #[test]
    fn the_julian_date_of_lift_off() {
        // 1994-07-08 16:43:01 UTC is MJD 49541.69654...
        let (whole, part) = julian_date(773_685_781.0);
        assert_eq!(whole, 2_449_541.5);
        assert!((part - (16.0 * 3600.0 + 43.0 * 60.0 + 1.0) / S_PER_DAY).abs() < 1e-12);
    }

    #[test]
    fn noon_is_under_the_sun() {
        assert_eq!(local_solar_time_h(1.0, 1.0), 12.0);
        assert!((local_solar_time_h(1.0 + TAU / 4.0, 1.0) - 18.0).abs() < 1e-12);
    }
}
