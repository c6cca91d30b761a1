//! Day-night variation of density: a_d cos psi, psi from the apex 30 degrees east of the Sun.

use super::{Effect, Linear, Shape, USUAL_OR_SMALL, full, no_density, one_point};
use crate::diagnose::scene::Scene;
use crate::physics::bulge;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "diurnal_bulge",
    name: "Day-night bulge of the atmosphere",
    equation: "a_d x amplitude x cos psi",
    source: "density bulge near 14 h local time; 30-50 % of drag",
    covariate: "local_time",
    mistaken_for: &["solar_radiation_pressure", "temperature_bias"],
    linear: &[Linear { name: "amplitude", unit: "1", size: 0.4, size_max: 2.0, ..Linear::PLAIN }],
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual lies along the drag, once per orbit, more drag (less where the amplitude is negative) on the afternoon side than the \
          simulation has: it follows the Sun and not the perigee.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    Some(Shape::Columns(vec![full(scene.measure(|i| scene.drag_ng[i] * bulge::cos_psi(&scene.r_m[i], &scene.sun[i])))]))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_the_drag_by_the_cosine_from_an_apex_thirty_degrees_east_of_the_sun() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let [column] = &made::columns(&scene, &EFFECT, [0.0; 2])[..] else { panic!("one column") };
        let sun = scene.sun[scene.sun.len() / 2];
        let ascension = sun.y.atan2(sun.x) + 30_f64.to_radians();
        let level = sun.x.hypot(sun.y);
        let apex = Vector3::new(level * ascension.cos(), level * ascension.sin(), sun.z);
        let cos_psi = |t| made::orbit(t).0.normalize().dot(&apex);
        made::is_everywhere(&scene, column, |t| made::drag_ng(t, 1.0, Vector3::zeros()) * cos_psi(t));
    }
}
