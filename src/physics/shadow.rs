//! The Earth's shadow: what part of the Sun's disc is seen from a point near the Earth.
//!
//! A round Earth without air: refraction and reddening at the terminator last seconds and are left out.

use std::f64::consts::PI;

use super::sun::{ASTRONOMICAL_UNIT_M, SUN_RADIUS_M};
use super::{EARTH_RADIUS_M, Vec3};

/// Seen part of the Sun's disc, 0 in umbra to 1 in full light: overlap of two discs, the Earth's and the Sun's
/// (Montenbruck and Gill, Satellite Orbits, 3.4.2). `r_m` from the Earth's centre, `sun_unit` towards the Sun.
pub fn sunlit_fraction(r_m: &Vec3, sun_unit: &Vec3) -> f64 {
    let to_sun_m = sun_unit * ASTRONOMICAL_UNIT_M - r_m;
    let sun_distance_m = to_sun_m.norm();
    let distance_m = r_m.norm();
    let a = (SUN_RADIUS_M / sun_distance_m).asin();
    let b = (EARTH_RADIUS_M / distance_m).min(1.0).asin();
    let c = (-r_m.dot(&to_sun_m) / (distance_m * sun_distance_m)).clamp(-1.0, 1.0).acos();
    if c >= a + b {
        return 1.0;
    }
    if c <= b - a {
        return 0.0;
    }
    if c <= a - b {
        return 1.0 - (b / a).powi(2);
    }
    let x = (c * c + a * a - b * b) / (2.0 * c);
    let y = (a * a - x * x).max(0.0).sqrt();
    let area = a * a * (x / a).clamp(-1.0, 1.0).acos() + b * b * ((c - x) / b).clamp(-1.0, 1.0).acos() - c * y;
    (1.0 - area / (PI * a * a)).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the point lies outside a cylinder of the Earth's radius behind the Earth: no penumbra.
    fn is_sunlit_cylinder(r_m: &Vec3, sun_unit: &Vec3) -> bool {
        let along_m = r_m.dot(sun_unit);
        along_m >= 0.0 || (r_m - sun_unit * along_m).norm() >= EARTH_RADIUS_M
    }

    const RADIUS_M: f64 = EARTH_RADIUS_M + 300e3;

    fn at(angle_from_sun_rad: f64) -> Vec3 {
        Vec3::new(angle_from_sun_rad.cos(), angle_from_sun_rad.sin(), 0.0) * RADIUS_M
    }

    #[test]
    fn noon_is_lit_and_midnight_dark() {
        for sunlit in [sunlit_fraction, |r: &Vec3, s: &Vec3| f64::from(u8::from(is_sunlit_cylinder(r, s)))] {
            assert_eq!(sunlit(&at(0.0), &Vec3::x()), 1.0);
            assert_eq!(sunlit(&at(PI), &Vec3::x()), 0.0);
        }
    }

    #[test]
    fn shadow_begins_where_the_cylinder_says_and_the_penumbra_lasts_eight_seconds() {
        let edge_rad = PI - (EARTH_RADIUS_M / RADIUS_M).asin();
        assert!(is_sunlit_cylinder(&at(edge_rad - 1e-6), &Vec3::x()));
        assert!(!is_sunlit_cylinder(&at(edge_rad + 1e-6), &Vec3::x()));
        assert!((sunlit_fraction(&at(edge_rad), &Vec3::x()) - 0.5).abs() < 0.01);
        // The disc is 0.533 deg wide and the orbit turns 360 deg in 90.5 min: 8 s from first to last light.
        let (mut first, mut last) = (f64::NAN, f64::NAN);
        for k in -2000..2000 {
            let angle = edge_rad + f64::from(k) * 1e-5;
            let nu = sunlit_fraction(&at(angle), &Vec3::x());
            assert!((0.0..=1.0).contains(&nu));
            if nu < 1.0 && first.is_nan() {
                first = angle;
            }
            if nu == 0.0 && last.is_nan() {
                last = angle;
            }
        }
        let seconds = (last - first) / (2.0 * PI) * 90.5 * 60.0;
        assert!((seconds - 8.04).abs() < 0.1, "{seconds}");
    }

    #[test]
    fn the_overlap_is_the_area_counted_on_a_grid() {
        let edge_rad = PI - (EARTH_RADIUS_M / RADIUS_M).asin();
        let r = at(edge_rad + 1.5e-3);
        let a = (SUN_RADIUS_M / ASTRONOMICAL_UNIT_M).asin();
        let b = (EARTH_RADIUS_M / RADIUS_M).asin();
        let c = (-r).angle(&(Vec3::x() * ASTRONOMICAL_UNIT_M - r));
        let (mut seen, mut all) = (0u32, 0u32);
        for i in -300..=300 {
            for j in -300..=300 {
                let (x, y) = (f64::from(i) / 300.0 * a, f64::from(j) / 300.0 * a);
                if x.hypot(y) <= a {
                    all += 1;
                    seen += u32::from((x + c).hypot(y) > b);
                }
            }
        }
        let counted = f64::from(seen) / f64::from(all);
        assert!((sunlit_fraction(&r, &Vec3::x()) - counted).abs() < 5e-3, "{counted}");
    }
}
