//! Wind beside co-rotation, steady along and across the track: drag in it less drag without it.
//!
//! The projected area has a kink where an axis is square to the flow, as across the track of a vehicle that flies nose first: a
//! cross wind then shows more area whichever way it blows. So no one derivative serves. The columns are taken about a wind, exact
//! there and to first order beside it, and the wind they are taken about follows the one fitted.

use super::{Effect, Linear, Shape, Theta, USUAL_OR_SMALL, full, no_density};
use crate::diagnose::scene::Scene;
use crate::physics::Vec3;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "thermospheric_wind",
    name: "Thermospheric wind",
    equation: "a_d(v - wind) - a_d(v)",
    source: "200 m/s change drag by 2.6 %; several hundred in storms",
    covariate: "density",
    mistaken_for: &["atmosphere_corotation", "aerodynamic_drag"],
    linear: &[
        Linear { name: "along_m_s", unit: "m/s", size: 300.0, size_max: 800.0, ..Linear::PLAIN },
        Linear { name: "cross_m_s", unit: "m/s", size: 300.0, size_max: 800.0, ..Linear::PLAIN },
    ],
    scales: USUAL_OR_SMALL,
    nonlinear: &[],
    grid: headings,
    log_density: no_density,
    signature: about,
    exact_at: Some(|wind_m_s| [wind_m_s[0], wind_m_s[1]]),
    assumes: None,
    why: "The residual is what a steady wind along and across the track (to port, along r x v) does to the drag, of a speed that the \
          thermosphere has.",
};

/// Speed of the winds the search begins about, m/s, and their number, all round.
const SPEED_M_S: f64 = 300.0;
const HEADINGS: u8 = 4;

/// Slowest wind the columns are taken about, m/s, and the step of their derivative: small against the orbital speed, large against
/// rounding.
const STEP_M_S: f64 = 10.0;

fn headings(_: &Scene) -> Vec<Theta> {
    let turn = |i: u8| std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(HEADINGS);
    (0..HEADINGS).map(|i| [SPEED_M_S * turn(i).cos(), SPEED_M_S * turn(i).sin()]).collect()
}

/// Columns by the wind along and across the track about `theta`: of a change of its speed by proportion, of a change of its
/// heading by derivative.
fn about(scene: &Scene, theta: &Theta) -> Option<Shape> {
    let heading = theta[1].atan2(theta[0]);
    let (sin, cos) = heading.sin_cos();
    let speed = theta[0].hypot(theta[1]).max(STEP_M_S);
    let grid = 0..scene.grid_s.len();
    let (mut along, mut cross) = (Vec::with_capacity(grid.len()), Vec::with_capacity(grid.len()));
    for i in grid {
        let wind = |forward: f64, sideways: f64| -> Vec3 {
            scene.drag_in_wind(i, forward * cos - sideways * sin, forward * sin + sideways * cos)
        };
        let there = wind(speed, 0.0);
        let by_speed = (there - scene.drag_ng[i]) / speed;
        let by_heading = (wind(speed, STEP_M_S) - wind(speed, -STEP_M_S)) / (2.0 * STEP_M_S);
        along.push(by_speed * cos - by_heading * sin);
        cross.push(by_speed * sin + by_heading * cos);
    }
    Some(Shape::Columns([along, cross].map(|column| full(scene.measure(|i| column[i]))).into()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// At the wind its columns are taken about they give the drag in that wind, whole.
    #[test]
    fn its_columns_give_the_drag_in_the_wind_they_are_taken_about() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        for [along, cross] in [[200.0, 0.0], [150.0, -250.0]] {
            let [by_along, by_cross] = &made::columns(&scene, &EFFECT, [along, cross])[..] else {
                panic!("two columns")
            };
            let whole = std::array::from_fn(|k| {
                by_along[k].iter().zip(&by_cross[k]).map(|(a, c)| along * a + cross * c).collect()
            });
            made::is_everywhere(&scene, &whole, |t| {
                // Along the track, and to the orbit's normal: to port.
                let (_, _, body) = made::orbit(t);
                let wind = body.column(0) * along - body.column(1) * cross;
                made::drag_ng(t, 1.0, wind) - made::drag_ng(t, 1.0, nalgebra::Vector3::zeros())
            });
        }
    }
}
