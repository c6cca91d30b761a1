//! Gravity gradient of a point-mass Earth: what a proof mass away from the centre of gravity feels.
//!
//! G = (mu/R^3)(3 e e^T - I), e the unit radius vector (Earth to vehicle), all in body axes; the tidal acceleration at
//! `r` is G r, the specific force of a sensor held there is **-G r**. Oblateness changes G by a part in a thousand
//! (3/2 J2 times a few), 0.5 ng at two metres, and is left out. Source: any text; the numbers are of the flight report.

use super::{MU_M3_S2, Mat3, Vec3};

/// The tensor G in the axes in which `r_m`, the vehicle's position from the Earth's centre, is given, 1/s^2.
pub fn tensor_s2(r_m: &Vec3) -> Mat3 {
    let radius_m = r_m.norm();
    let e = r_m / radius_m;
    (3.0 * e * e.transpose() - Mat3::identity()) * (MU_M3_S2 / radius_m.powi(3))
}

/// Specific force -G r at an offset from the centre of gravity, m/s^2; both vectors in body axes.
pub fn specific_force_m_s2(r_body_m: &Vec3, offset_m: &Vec3) -> Vec3 {
    -(tensor_s2(r_body_m) * offset_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tensor_is_the_derivative_of_gravity() {
        let gravity = |r: Vec3| -r * (MU_M3_S2 / r.norm().powi(3));
        let r = Vec3::new(3e6, -4e6, 4.4e6);
        let g = tensor_s2(&r);
        let h = 10.0;
        for (j, u) in [Vec3::x(), Vec3::y(), Vec3::z()].iter().enumerate() {
            let numeric = (gravity(r + u * h) - gravity(r - u * h)) / (2.0 * h);
            assert!((numeric - g.column(j)).norm() < 1e-9 * g.norm());
        }
        assert!(g.trace().abs() < 1e-20, "Laplace");
    }
}
