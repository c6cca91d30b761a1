//! Where the craft is at every grid point, as angles: along its orbit, from the Sun, over the Earth.

use super::Scene;
use crate::physics::{Vec3, sun, time};

impl Scene<'_> {
    /// Unix time, s.
    pub fn unix_s(&self) -> Vec<f64> {
        self.grid_s.iter().map(|t| self.case.header.unix_s(*t)).collect()
    }

    /// Hour angle of the Sun, rad: local solar time from noon on.
    pub fn hour_angle_rad(&self) -> Vec<f64> {
        self.ascension_from(sun::right_ascension_rad)
    }

    /// Longitude, rad.
    pub fn longitude_rad(&self) -> Vec<f64> {
        self.ascension_from(time::gmst_rad)
    }

    /// Right ascension from a meridian's, which it has at every unix time.
    fn ascension_from(&self, meridian_rad: impl Fn(f64) -> f64) -> Vec<f64> {
        self.r_m.iter().zip(self.unix_s()).map(|(r, t)| r.y.atan2(r.x) - meridian_rad(t)).collect()
    }

    /// Argument of latitude, and the angle past orbital noon, rad.
    pub fn orbit_angles_rad(&self) -> (Vec<f64>, Vec<f64>) {
        (0..self.grid_s.len())
            .map(|g| {
                let normal = self.r_m[g].cross(&self.v_m_s[g]).normalize();
                let node = Vec3::new(-normal.y, normal.x, 0.0).normalize();
                let u = self.r_m[g].dot(&normal.cross(&node)).atan2(self.r_m[g].dot(&node));
                let noon = (self.sun[g] - normal * normal.dot(&self.sun[g])).normalize();
                (u, self.r_m[g].dot(&normal.cross(&noon)).atan2(self.r_m[g].dot(&noon)))
            })
            .unzip()
    }
}
