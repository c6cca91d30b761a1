//! Density of the upper atmosphere: NRLMSISE-00 by the `nrlmsise00` crate, in its form for drag.
//!
//! `gtd7d` on purpose: its total mass includes anomalous oxygen, which pushes as any other. The Sun's and the geomagnetic
//! activity are arguments, never looked up.

use super::geodetic::place;
use super::sun::right_ascension_rad;
use super::time::{S_PER_DAY, local_solar_time_h};
use super::{PhysicsError, Vec3};

/// What drives the thermosphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Activity {
    /// F10.7 of the day before, 1e-22 W/m^2/Hz.
    pub f107: f64,
    /// Its 81-day mean, centred.
    pub f107_average: f64,
    /// Daily geomagnetic index Ap.
    pub ap: f64,
}

impl Activity {
    /// About that of July 1994, two years before the minimum.
    pub fn july_1994() -> Self {
        Self { f107: 85.0, f107_average: 82.0, ap: 10.0 }
    }
}

/// The model with its tables prepared.
pub struct Atmosphere {
    model: nrlmsise00::Model,
}

impl Default for Atmosphere {
    fn default() -> Self {
        Self { model: nrlmsise00::Model::new() }
    }
}

impl Atmosphere {
    /// Mass density for drag at an inertial position (true equator of date), kg/m^3.
    ///
    /// # Errors
    /// [`PhysicsError::Position`] for a position that is no place around the Earth.
    pub fn density_kg_m3(&self, unix_s: f64, r_inertial_m: &Vec3, activity: &Activity) -> Result<f64, PhysicsError> {
        let place = place(unix_s, r_inertial_m)?;
        let right_ascension_rad_here = r_inertial_m.y.atan2(r_inertial_m.x);
        let input = nrlmsise00::Input {
            day_of_year: day_of_year(unix_s),
            seconds_of_day: unix_s.rem_euclid(S_PER_DAY),
            altitude_km: place.height_m / 1000.0,
            latitude_deg: place.latitude_rad.to_degrees(),
            longitude_deg: place.longitude_rad.to_degrees(),
            local_solar_time_h: local_solar_time_h(right_ascension_rad_here, right_ascension_rad(unix_s)),
            f107_average: activity.f107_average,
            f107: activity.f107,
            magnetic: nrlmsise00::MagneticActivity::Daily { ap: activity.ap },
        };
        Ok(self.model.gtd7d(&input).total_mass)
    }
}

/// Day of the year, 1 to 366, of a UTC instant.
fn day_of_year(unix_s: f64) -> i32 {
    let julian_day = (unix_s / S_PER_DAY).floor() as i32 + 2_440_588;
    time::Date::from_julian_day(julian_day).map_or(1, |date| i32::from(date.ordinal()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_case_one_of_the_reference_code() {
        // nrlmsise-00_test.c, case 1: day 172, 29000 s, 400 km, 60 N, 70 W, lst 16, F10.7A 150, F10.7 150, Ap 4:
        // total mass density 4.074714e-15 g/cm^3 (gtd7: without anomalous oxygen).
        let input = nrlmsise00::Input {
            day_of_year: 172,
            seconds_of_day: 29_000.0,
            altitude_km: 400.0,
            latitude_deg: 60.0,
            longitude_deg: -70.0,
            local_solar_time_h: 16.0,
            f107_average: 150.0,
            f107: 150.0,
            magnetic: nrlmsise00::MagneticActivity::Daily { ap: 4.0 },
        };
        let model = nrlmsise00::Model::new();
        let density: f64 = model.gtd7(&input).total_mass;
        assert!((density / 4.074_714e-12 - 1.0).abs() < 1e-6, "{density}");
        assert!(model.gtd7d(&input).total_mass > density);
    }

    #[test]
    fn the_afternoon_is_denser_than_the_small_hours() {
        let unix_s = 773_700_000.0;
        let sun_rad = right_ascension_rad(unix_s);
        let at = |hours: f64| {
            let angle = sun_rad + (hours - 12.0) / 24.0 * std::f64::consts::TAU;
            let r = Vec3::new(angle.cos(), angle.sin(), 0.2).normalize() * 6.678e6;
            Atmosphere::default().density_kg_m3(unix_s, &r, &Activity::july_1994()).unwrap()
        };
        let (afternoon, night) = (at(14.5), at(3.0));
        assert!(afternoon > 1.3 * night, "{afternoon} against {night}");
        // 300 km near solar minimum: 1e-11 to 3e-11 kg/m^3.
        assert!(night > 5e-12 && afternoon < 4e-11, "{night} {afternoon}");
    }

    #[test]
    fn lift_off_was_on_day_189() {
        assert_eq!(day_of_year(773_685_781.0), 189);
        assert_eq!(day_of_year(788_918_399.0), 365);
    }
}
