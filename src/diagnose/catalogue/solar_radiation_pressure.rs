//! Sunlight's push, none in shadow: a = -nu coefficient P (sum |s_i| area_i) / m s.

use super::{Effect, Linear, Shape, USUAL_OR_SMALL, full, no_density, one_point};
use crate::diagnose::scene::Scene;
use crate::physics::solar_radiation;
use crate::units::NANO_G_M_S2;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "solar_radiation_pressure",
    name: "Solar radiation pressure",
    equation: "-nu coefficient P (sum |s_i| area_i) / m s, P = 4.56e-6 N/m2",
    source: "standard; 0.4-2 ng for the Orbiter, more with large panels",
    covariate: "sun_angle",
    mistaken_for: &["temperature_bias, which lags", "diurnal_bulge"],
    // A simulation may have what the vehicle has not: a coefficient of two is that of a mirror.
    linear: &[Linear { name: "coefficient", unit: "1", size: 4.0, size_max: 40.0, least: -2.0, ..Linear::PLAIN }],
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual points away from the Sun (towards it where the coefficient is negative: there is more of it in the simulation) and \
          switches at the edges of the shadow, without lag.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    let push = |i: usize| {
        solar_radiation::acceleration_per_coefficient_m_s2(
            &scene.vehicle,
            scene.sunlit[i],
            &(scene.body[i] * scene.sun[i]),
        ) / NANO_G_M_S2
    };
    Some(Shape::Columns(vec![full(scene.measure(push))]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// P A / m per unit of coefficient, away from the Sun, and none behind the Earth's disc.
    #[test]
    fn it_pushes_away_from_the_sun_and_not_in_the_shadow() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let [column] = &made::columns(&scene, &EFFECT, [0.0; 2])[..] else { panic!("one column") };
        // The Sun moves by a thousandth of a radian in an hour and a half.
        let sun_at = |t: f64| scene.sun[scene.grid_s.partition_point(|g| *g < t)];
        let (mut sunlit, mut dark) = (0, 0);
        for (i, t) in scene.clock_s().iter().enumerate() {
            let ((r, ..), sun) = (made::orbit(*t), sun_at(*t));
            let found = nalgebra::Vector3::from_fn(|k, _| column[k][i]);
            let (behind, beside) = (r.dot(&sun), r.cross(&sun).norm());
            // Away from the edges of the shadow, which windows of 50 s cross at 8 km/s.
            if behind < 0.0 && beside < 6_150_000.0 {
                dark += 1;
                assert_eq!(found.norm(), 0.0, "{t}");
            } else if behind > 0.0 || beside > 6_600_000.0 {
                sunlit += 1;
                let expected = made::mean_ng(*t, |t| {
                    let s = made::orbit(t).2.transpose() * sun;
                    let area: f64 = (0..3).map(|k| s[k].abs() * made::AREA_M2[k]).sum();
                    -s * (4.56e-6 * area / made::MASS_KG / made::NG_M_S2)
                });
                // Between points 20 s apart a cosine changes by 0.023; where it goes through nothing its modulus is out by a quarter
                // of that at most, and 370 m^2 of it are 2 m^2 of 200.
                assert!((found - expected).norm() < 0.011 * expected.norm(), "{t}: {found} {expected}");
            }
        }
        assert!(sunlit > 300 && dark > 200, "{sunlit} {dark}");
    }
}
