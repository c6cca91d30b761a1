//! Specific force of a turning body: centripetal and Euler terms at an offset from the centre of gravity.
//!
//! f = w x (w x r) + dw/dt x r; `w` the inertial rate in body axes. A sensor forward of a turning centre reads
//! towards the centre: that is the force which holds it on its circle.

use super::{Mat3, Vec3};

/// The matrix [w x] with [w x] r = w x r.
pub fn cross_matrix(w: &Vec3) -> Mat3 {
    w.cross_matrix()
}

/// [w x][w x] + [dw/dt x], 1/s^2: times the offset in metres it is the specific force.
pub fn tensor_s2(rate_rad_s: &Vec3, acceleration_rad_s2: &Vec3) -> Mat3 {
    let w = rate_rad_s.cross_matrix();
    w * w + acceleration_rad_s2.cross_matrix()
}

/// Specific force w x (w x r) + dw/dt x r, m/s^2, body axes.
pub fn specific_force_m_s2(rate_rad_s: &Vec3, acceleration_rad_s2: &Vec3, offset_m: &Vec3) -> Vec3 {
    rate_rad_s.cross(&rate_rad_s.cross(offset_m)) + acceleration_rad_s2.cross(offset_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_matrix_and_the_products_are_the_same_thing() {
        let (w, dw, r) = (Vec3::new(1e-3, -2e-3, 5e-4), Vec3::new(2e-6, 1e-6, -3e-6), Vec3::new(-1.5, 0.2, 1.4));
        let difference = tensor_s2(&w, &dw) * r - specific_force_m_s2(&w, &dw, &r);
        assert!(difference.norm() < 1e-20);
        let outward = specific_force_m_s2(&Vec3::z(), &Vec3::zeros(), &Vec3::x());
        assert_eq!(outward, -Vec3::x());
    }

    #[test]
    fn a_point_on_a_turning_body_is_accelerated_so() {
        // Inertial position of a body-fixed point under C(t) = turn by -angle about Z: second difference.
        let (rate, acceleration) = (0.01, 1e-4);
        let r = Vec3::new(0.7, -1.1, 0.4);
        let angle = |t: f64| rate * t + 0.5 * acceleration * t * t;
        let inertial = |t: f64| {
            let (s, c) = angle(t).sin_cos();
            Vec3::new(c * r.x - s * r.y, s * r.x + c * r.y, r.z)
        };
        let h = 0.1;
        let numeric = (inertial(h) - 2.0 * inertial(0.0) + inertial(-h)) / (h * h);
        let expected = specific_force_m_s2(&(Vec3::z() * rate), &(Vec3::z() * acceleration), &r);
        assert!((numeric - expected).norm() < 1e-8, "{numeric} {expected}");
    }
}
