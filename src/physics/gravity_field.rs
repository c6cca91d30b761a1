//! The Earth's gravity as spherical harmonics: an ICGEM `.gfc` model brought to its epoch, evaluated in the Earth-fixed
//! frame by Cunningham's recursion (Montenbruck and Gill 2000, section 3.2), which has no pole.
//!
//! The file is read by `geopotential`; time-variable records (gfct, trnd, acos, asin) are applied at one epoch.
//! Not here: tides.

use geopotential::{Coefficients, GfcError, read_gfc};
use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

/// Fields above this degree are cut: at any orbit the products are smaller than the measurement.
pub const DEGREE_MAX: usize = 120;

/// A gravity field that cannot be used.
#[derive(Debug, Error)]
pub enum GravityFieldError {
    /// The file is not a usable `.gfc`.
    #[error("{0}")]
    File(#[from] GfcError),
    /// A coefficient is not a number.
    #[error("the coefficients of degree {degree} and order {order} are not finite")]
    NotFinite {
        /// Degree.
        degree: usize,
        /// Order.
        order: usize,
    },
    /// The records end inside a degree, or there are none.
    #[error("the records end inside degree {degree}: order {degree} is missing")]
    CutShort {
        /// The highest degree found.
        degree: usize,
    },
}

/// A gravity field at one epoch.
#[derive(Debug, Clone)]
pub struct GravityField {
    gm: f64,
    radius_m: f64,
    degree: usize,
    /// Unnormalised C and S, `c[n * (n + 1) / 2 + m]`.
    c: Vec<f64>,
    s: Vec<f64>,
}

/// Degree and order of a record.
fn record(line: &str) -> Option<(usize, usize)> {
    let mut words = line.split_whitespace();
    words.next().filter(|key| matches!(*key, "gfc" | "gfct"))?;
    Some((words.next()?.parse().ok()?, words.next()?.parse().ok()?))
}

fn index(n: usize, m: usize) -> usize {
    n * (n + 1) / 2 + m
}

impl GravityField {
    /// Read a `.gfc` and bring its time-variable terms to a modified Julian date.
    pub fn from_gfc(text: &str, mjd: f64) -> Result<Self, GravityFieldError> {
        let years = 2000.0 + (mjd - 51_544.5) / 365.25;
        let model = read_gfc(text)?.model.at(years);
        // A field is often cut to fewer degrees than its header announces; whole degrees they must be.
        let places: Vec<(usize, usize)> = text.lines().filter_map(record).collect();
        let degree = places.iter().map(|(n, _)| *n).max().unwrap_or(0);
        if !places.contains(&(degree, degree)) {
            return Err(GravityFieldError::CutShort { degree });
        }
        let not_finite = |&&(n, m): &&(usize, usize)| !(model.c(n, m).is_finite() && model.s(n, m).is_finite());
        if let Some(&(degree, order)) = places.iter().find(not_finite) {
            return Err(GravityFieldError::NotFinite { degree, order });
        }
        Ok(Self::up_to(degree, &model))
    }

    fn up_to(degree: usize, normalised: &Coefficients) -> Self {
        let degree = degree.min(DEGREE_MAX);
        let (mut c, mut s) = (vec![0.0; index(degree, degree) + 1], vec![0.0; index(degree, degree) + 1]);
        for n in 0..=degree {
            // N_nm^2 = (2 - delta_0m) (2n + 1) (n - m)! / (n + m)!
            let mut ratio = 1.0;
            for m in 0..=n {
                if m > 0 {
                    ratio /= ((n - m + 1) * (n + m)) as f64;
                }
                let norm = (if m == 0 { 1.0 } else { 2.0 } * (2 * n + 1) as f64 * ratio).sqrt();
                c[index(n, m)] = norm * normalised.c(n, m);
                s[index(n, m)] = norm * normalised.s(n, m);
            }
        }
        Self { gm: normalised.gm, radius_m: normalised.radius, degree, c, s }
    }

    /// GM, m^3/s^2.
    pub fn gm_m3_s2(&self) -> f64 {
        self.gm
    }

    /// Reference radius, m.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The highest degree held.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// J2, positive.
    pub fn j2(&self) -> f64 {
        if self.degree < 2 { 0.0 } else { -self.c[index(2, 0)] }
    }

    /// Acceleration in the Earth-fixed frame from degrees 0 to `degree`, m/s^2.
    pub fn acceleration(&self, fixed_m: &Vector3<f64>, degree: usize) -> Vector3<f64> {
        self.acceleration_of_degrees(fixed_m, 0, degree)
    }

    /// Acceleration in the Earth-fixed frame from degrees `from` to `to`, both included, m/s^2.
    pub fn acceleration_of_degrees(&self, fixed_m: &Vector3<f64>, from: usize, to: usize) -> Vector3<f64> {
        let to = to.min(self.degree);
        if from > to {
            return Vector3::zeros();
        }
        let (v, w) = self.solid_harmonics(fixed_m, to + 1);
        let mut sum = Vector3::zeros();
        for n in from..=to {
            for m in 0..=n {
                let (c, s) = (self.c[index(n, m)], self.s[index(n, m)]);
                let (up, z_factor) = (index(n + 1, m + 1), (n - m + 1) as f64);
                if m == 0 {
                    sum.x -= c * v[up];
                    sum.y -= c * w[up];
                } else {
                    let (down, factor) = (index(n + 1, m - 1), 0.5 * ((n - m + 1) * (n - m + 2)) as f64);
                    sum.x += 0.5 * (-c * v[up] - s * w[up]) + factor * (c * v[down] + s * w[down]);
                    sum.y += 0.5 * (-c * w[up] + s * v[up]) + factor * (-c * w[down] + s * v[down]);
                }
                let same = index(n + 1, m);
                sum.z -= z_factor * (c * v[same] + s * w[same]);
            }
        }
        sum * (self.gm / (self.radius_m * self.radius_m))
    }

    fn solid_harmonics(&self, r: &Vector3<f64>, to: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut v, mut w) = (vec![0.0; index(to, to) + 1], vec![0.0; index(to, to) + 1]);
        let r2 = r.norm_squared();
        let rho = self.radius_m * self.radius_m / r2;
        let scaled = r * (self.radius_m / r2);
        v[0] = self.radius_m / r2.sqrt();
        for m in 0..=to {
            if m > 0 {
                let (k, odd) = (index(m - 1, m - 1), (2 * m - 1) as f64);
                v[index(m, m)] = odd * (scaled.x * v[k] - scaled.y * w[k]);
                w[index(m, m)] = odd * (scaled.x * w[k] + scaled.y * v[k]);
            }
            for n in m + 1..=to {
                let (a, b) = ((2 * n - 1) as f64 / (n - m) as f64, (n + m - 1) as f64 / (n - m) as f64);
                let one = index(n - 1, m);
                let two = |array: &[f64]| if n > m + 1 { array[index(n - 2, m)] } else { 0.0 };
                v[index(n, m)] = a * scaled.z * v[one] - b * rho * two(&v);
                w[index(n, m)] = a * scaled.z * w[one] - b * rho * two(&w);
            }
        }
        (v, w)
    }

    /// Gradient of the point mass and J2 along the axis `pole` (any frame), 1/s^2: enough for variational equations,
    /// where what is left out is 1e-6 of the whole.
    pub fn gradient(&self, r: &Vector3<f64>, pole: &Vector3<f64>) -> Matrix3<f64> {
        let (r2, z) = (r.norm_squared(), r.dot(pole));
        let (r3, r5) = (r2 * r2.sqrt(), r2 * r2 * r2.sqrt());
        let rr = r * r.transpose();
        let central = (Matrix3::identity() - rr * (3.0 / r2)) * (-self.gm / r3);
        let rp = r * pole.transpose() + pole * r.transpose();
        let oblate = Matrix3::identity() * (1.0 - 5.0 * z * z / r2)
            + rr * ((35.0 * z * z / r2 - 5.0) / r2)
            + pole * pole.transpose() * 2.0
            - rp * (10.0 * z / r2);
        central + oblate * (-1.5 * self.j2() * self.gm * self.radius_m * self.radius_m / r5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field() -> (GravityField, Coefficients) {
        let mut text =
            String::from("earth_gravity_constant 3.986004415e14\nradius 6378136.46\nmax_degree 9\nend_of_head\n");
        text.push_str("gfc 0 0 1 0\ngfct 2 0 -4.84165e-4 0 20050101\ntrnd 2 0 -1.2e-11 0\nacos 2 0 4e-11 0 1.0\n");
        for n in 2..=9_usize {
            for m in 0..=n {
                if (n, m) != (2, 0) {
                    let (c, s) = ((n * 7 + m * 3) % 11, (n * 5 + m) % 13);
                    text.push_str(&format!(
                        "gfc {n} {m} {}e-7 {}e-7\n",
                        c as f64 - 5.0,
                        if m == 0 { 0.0 } else { s as f64 - 6.0 }
                    ));
                }
            }
        }
        let model = read_gfc(&text).unwrap().model.at(2010.5);
        (GravityField::from_gfc(&text, 51_544.5 + 10.5 * 365.25).unwrap(), model)
    }

    #[test]
    fn the_recursion_agrees_with_an_independent_code() {
        let (field, model) = field();
        for (r, lat, lon) in [(6.7e6_f64, 0.3_f64, 1.0_f64), (7.2e6, -1.2, 4.0), (26.6e6, 0.9, -2.5)] {
            let point = Vector3::new(r * lat.cos() * lon.cos(), r * lat.cos() * lon.sin(), r * lat.sin());
            let [n, e, u] = model.partials(r, lat, lon).acceleration_neu(r, lat);
            let north = Vector3::new(-lat.sin() * lon.cos(), -lat.sin() * lon.sin(), lat.cos());
            let east = Vector3::new(-lon.sin(), lon.cos(), 0.0);
            let expected = north * n + east * e + point / r * u;
            let found = field.acceleration(&point, 9);
            assert!((found - expected).norm() < 1e-12 * expected.norm(), "{found} {expected}");
        }
    }

    #[test]
    fn degrees_add_up() {
        let (field, _) = field();
        let r = Vector3::new(5.0e6, -4.0e6, 3.0e6);
        let parts = field.acceleration_of_degrees(&r, 0, 4) + field.acceleration_of_degrees(&r, 5, 9);
        assert!((parts - field.acceleration(&r, 9)).norm() < 1e-14);
    }

    #[test]
    fn the_gradient_is_the_slope_of_the_oblate_field() {
        let (field, _) = field();
        let (r, h) = (Vector3::new(2.0e7, -1.1e7, 0.9e7), 10.0);
        let flat = |r: &Vector3<f64>| {
            let (r2, z) = (r.norm_squared(), r.z);
            let k = -1.5 * field.j2() * field.gm * field.radius_m.powi(2) / (r2 * r2 * r2.sqrt());
            r * (-field.gm / (r2 * r2.sqrt())) + (r * (1.0 - 5.0 * z * z / r2) + Vector3::z() * (2.0 * z)) * k
        };
        let gradient = field.gradient(&r, &Vector3::z());
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = h;
            let slope = (flat(&(r + step)) - flat(&(r - step))) / (2.0 * h);
            assert!((slope - gradient.column(axis)).norm() < 1e-8 * gradient.norm());
        }
    }
}
