//! The Sun and the Moon: where they are, how they pull, and what the Earth's shadow leaves of the sunlight.
//!
//! Positions from `sofars` (VSOP2000 for the Sun, good to 11 km; Meeus' Moon, a few arc seconds), tabulated once over a
//! stretch. Not here: planets (Venus pulls a GPS satellite by 1e-10 of what the Sun does).

use nalgebra::Vector3;

use crate::physics::earth_orientation::{GpsInstant, lagrange_weights};

/// GM of the Sun, m^3/s^2 (IAU 2009).
pub const GM_SUN_M3_S2: f64 = 1.327_124_42e20;
/// GM of the Moon, m^3/s^2 (DE421).
pub const GM_MOON_M3_S2: f64 = 4.902_800_1e12;
/// Radius of the Sun, m.
pub const SUN_RADIUS_M: f64 = 6.957e8;
/// Radius of the Earth that casts the shadow (equatorial), m.
pub const EARTH_RADIUS_M: f64 = 6_378_137.0;
/// Radius of the Moon, m.
pub const MOON_RADIUS_M: f64 = 1_737_400.0;
/// Love number of the solid Earth, degree 2 (IERS Conventions 2010, nominal).
const LOVE_K2: f64 = 0.30;
const AU_M: f64 = 149_597_870_700.0;
const TABLE_STEP_S: f64 = 3_600.0;
const TABLE_MARGIN: usize = 4;

/// Geocentric Sun and Moon in the inertial frame (GCRS axes), m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunMoon {
    /// Earth to Sun, m.
    pub sun_m: Vector3<f64>,
    /// Earth to Moon, m.
    pub moon_m: Vector3<f64>,
}

impl SunMoon {
    /// At one instant, computed in full.
    pub fn at(instant: GpsInstant) -> Self {
        let (jd1, jd2) = instant.tt_jd();
        // Outside 1900-2100 the series only loses accuracy; sofars then returns nothing, and the Sun is far off in any case.
        let earth = sofars::eph::epv00(jd1, jd2).map_or([0.0, 0.0, 0.0], |(heliocentric, _)| heliocentric[0]);
        let moon = sofars::eph::moon98(jd1, jd2)[0];
        Self { sun_m: -Vector3::from(earth) * AU_M, moon_m: Vector3::from(moon) * AU_M }
    }
}

/// Sun and Moon over one stretch of time, by interpolation.
#[derive(Debug, Clone)]
pub struct SunMoonTable {
    table: Vec<SunMoon>,
}

impl SunMoonTable {
    /// For `span_s` seconds from `origin`.
    pub fn new(origin: GpsInstant, span_s: f64) -> Self {
        let points = (span_s / TABLE_STEP_S).ceil() as usize + 2 * TABLE_MARGIN + 1;
        let at = |i: usize| SunMoon::at(origin.plus_s((i as f64 - TABLE_MARGIN as f64) * TABLE_STEP_S));
        Self { table: (0..points).map(at).collect() }
    }

    /// At so many seconds after the origin.
    pub fn at(&self, t_s: f64) -> SunMoon {
        let u = t_s / TABLE_STEP_S + TABLE_MARGIN as f64;
        let start = (u.floor() as isize - 3).clamp(0, self.table.len() as isize - 8) as usize;
        let weights = lagrange_weights(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], u - start as f64);
        let mut out = SunMoon { sun_m: Vector3::zeros(), moon_m: Vector3::zeros() };
        for (w, entry) in weights.iter().zip(&self.table[start..]) {
            out.sun_m += entry.sun_m * *w;
            out.moon_m += entry.moon_m * *w;
        }
        out
    }
}

/// Pull of a distant body on a satellite less its pull on the Earth's centre, m/s^2:
/// a = GM ((b - r)/|b - r|^3 - b/|b|^3).
pub fn third_body_acceleration(r_m: &Vector3<f64>, body_m: &Vector3<f64>, gm_m3_s2: f64) -> Vector3<f64> {
    let to_body = body_m - r_m;
    (to_body / to_body.norm().powi(3) - body_m / body_m.norm().powi(3)) * gm_m3_s2
}

/// Pull of the tide that a distant body raises in the solid Earth, m/s^2 (Montenbruck and Gill 2000, section 3.7.2,
/// degree 2, no phase lag): a = (k2/2) (GM_b/d^3) (R^5/r^4) ((3 - 15 cos^2 c) r^ + 6 cos c b^).
pub fn solid_tide_acceleration(r_m: &Vector3<f64>, body_m: &Vector3<f64>, gm_m3_s2: f64) -> Vector3<f64> {
    let (r, d) = (r_m.norm(), body_m.norm());
    let (r_unit, b_unit) = (r_m / r, body_m / d);
    let cos = r_unit.dot(&b_unit);
    let size = 0.5 * LOVE_K2 * gm_m3_s2 / d.powi(3) * EARTH_RADIUS_M.powi(5) / r.powi(4);
    (r_unit * (3.0 - 15.0 * cos * cos) + b_unit * (6.0 * cos)) * size
}

/// The part of the Sun's disc that is seen past a sphere, 0 in full shadow and 1 in full light (Montenbruck and Gill
/// 2000, section 3.4.2: overlap of two discs).
pub fn sunlit_fraction(r_m: &Vector3<f64>, sun_m: &Vector3<f64>, body_m: &Vector3<f64>, body_radius_m: f64) -> f64 {
    let (to_sun, to_body) = (sun_m - r_m, body_m - r_m);
    let (sun_distance, body_distance) = (to_sun.norm(), to_body.norm());
    if body_distance >= sun_distance {
        return 1.0;
    }
    let a = (SUN_RADIUS_M / sun_distance).asin();
    let b = (body_radius_m / body_distance).min(1.0).asin();
    let c = (to_sun.dot(&to_body) / (sun_distance * body_distance)).clamp(-1.0, 1.0).acos();
    if c >= a + b {
        1.0
    } else if c <= b - a {
        0.0
    } else if c <= a - b {
        1.0 - (b / a).powi(2)
    } else {
        let x = (c * c + a * a - b * b) / (2.0 * c);
        let y = (a * a - x * x).max(0.0).sqrt();
        let covered = a * a * (x / a).clamp(-1.0, 1.0).acos() + b * b * ((c - x) / b).clamp(-1.0, 1.0).acos() - c * y;
        (1.0 - covered / (std::f64::consts::PI * a * a)).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moon_is_where_meeus_puts_it() {
        // Meeus, Astronomical Algorithms, example 47.a: 1992 April 12, 0 h TD: distance 368,409.7 km, apparent right
        // ascension 134.688 deg and declination 13.768 deg, equinox of date: the length is free of the frame.
        let instant = GpsInstant { mjd: 48_724.0, s: -51.184 };
        let distance_km = SunMoon::at(instant).moon_m.norm() / 1000.0;
        assert!((distance_km - 368_409.7).abs() < 1.0, "{distance_km}");
    }

    #[test]
    fn the_table_returns_what_it_was_made_from() {
        let origin = GpsInstant { mjd: 55_378.0, s: 0.0 };
        let table = SunMoonTable::new(origin, 172_800.0);
        for t_s in [0.0, 1_234.5, 86_399.0, 172_800.0] {
            let (exact, read) = (SunMoon::at(origin.plus_s(t_s)), table.at(t_s));
            assert!((exact.moon_m - read.moon_m).norm() < 0.1 && (exact.sun_m - read.sun_m).norm() < 1.0);
        }
    }

    #[test]
    fn light_fades_from_one_to_nothing_behind_the_earth() {
        let (sun, earth) = (Vector3::new(1.5e11, 0.0, 0.0), Vector3::zeros());
        let at = |y: f64| sunlit_fraction(&Vector3::new(-2.6e7, y, 0.0), &sun, &earth, EARTH_RADIUS_M);
        assert_eq!((at(0.0), at(1e7)), (0.0, 1.0));
        let half = at(EARTH_RADIUS_M);
        assert!((0.4..0.6).contains(&half), "{half}");
        assert!(at(6.30e6) < half && half < at(6.45e6));
    }
}
