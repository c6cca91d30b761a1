//! The sensor feels the geomagnetic field: a = K B in body axes.

use super::{ANY_SIZE, Effect, Linear, Shape, no_density, one_point};
use crate::diagnose::design::Raw;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "magnetic_sensitivity",
    name: "Sensitivity to the geomagnetic field",
    equation: "a = K B, K nine numbers",
    source: "seen on two other flights, Foton M-2 among them",
    covariate: "geomagnetic_field",
    mistaken_for: &["thermospheric_wind", "atmosphere_corotation"],
    linear: &[
        Linear { name: "kxx_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kxy_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kxz_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kyx_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kyy_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kyz_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kzx_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kzy_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
        Linear { name: "kzz_ng_per_t", unit: "ng/T", size: 1.0e6, size_max: 2.0e7, ..Linear::PLAIN },
    ],
    scales: ANY_SIZE,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is linear in the geomagnetic field in body axes: it follows magnetic latitude, with the Earth turning below the orbit.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let field: [Vec<f64>; 3] = scene.measure(|i| scene.field_body_t[i]);
    let column = |n: usize| -> Raw { std::array::from_fn(|k| (k == n / 3).then(|| field[n % 3].clone())) };
    Some(Shape::Columns((0..9).map(column).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// Beside a dipole tilted with the axis of 1994 (10.7 degrees towards 71.4 W, 30.2 uT; IGRF): within a third of it in the mean square, which
    /// is what the rest of the field is worth at 300 km.
    #[test]
    fn every_axis_follows_a_field_that_is_nearly_a_dipole() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let columns = made::columns(&scene, &EFFECT, [0.0; 2]);
        for (n, column) in columns.iter().enumerate() {
            assert!(
                (0..3).filter(|k| *k != n / 3).all(|k| column[k].iter().all(|b| *b == 0.0)),
                "{n} acts on one axis"
            );
            assert_eq!(column[n / 3], columns[n % 3][0], "the same field on every axis");
        }
        let (mut away, mut all) = (0.0, 0.0);
        for (i, t) in scene.clock_s().iter().enumerate() {
            let (r, _, body) = made::orbit(*t);
            let turned = crate::physics::time::gmst_rad(scene.case.header.unix_s(*t)) - 71.4_f64.to_radians();
            let (sin, cos) = 10.7_f64.to_radians().sin_cos();
            let pole = nalgebra::Vector3::new(sin * turned.cos(), sin * turned.sin(), cos);
            let up = r.normalize();
            let dipole = (pole - up * (3.0 * pole.dot(&up))) * (3.02e-5 * (6_371_200.0 / r.norm()).powi(3));
            let found = nalgebra::Vector3::from_fn(|k, _| columns[k][0][i]);
            away += (found - body.transpose() * dipole).norm_squared();
            all += dipole.norm_squared();
        }
        assert!(away / all < 0.1, "{}", away / all);
    }
}
