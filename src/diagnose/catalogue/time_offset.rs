//! The recording's clock runs ahead: what happened at t is labelled t + offset.

use super::{Effect, Nonlinear, ONE_SIZE, Shape, Theta};
use crate::diagnose::measure::window_means;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "time_offset",
    name: "Clock offset",
    equation: "m(t - offset) - m(t), m the modelled signal",
    source: "under 1 ng per second in a hold, large in manoeuvres",
    covariate: "modelled_signal",
    mistaken_for: &["an attitude latency (the same)"],
    linear: &[],
    scales: ONE_SIZE,
    nonlinear: &[Nonlinear {
        name: "offset_s",
        unit: "s",
        step: 3.0,
        range: [-OFFSET_S_MAX, OFFSET_S_MAX],
        ..Nonlinear::PLAIN
    }],
    grid,
    log_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The recording shows the modelled signal late or early: the difference follows its time derivative, manoeuvres above all.",
};

/// Largest offset, s.
const OFFSET_S_MAX: f64 = 600.0;

/// From half a second on, which a fast manoeuvre shows, each so near the next that an offset between them is a few standard errors away at most.
fn grid(_: &Scene) -> Vec<Theta> {
    let steps = [
        0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0, 11.0, 15.0, 20.0, 30.0, 40.0, 50.0, 60.0, 75.0, 90.0, 105.0,
        120.0, 150.0, 180.0, 240.0, 300.0, 400.0, 500.0,
    ];
    steps.iter().flat_map(|s| [[*s, 0.0], [-s, 0.0]]).collect()
}

/// Clocks are out by seconds, seldom by minutes: half of them by less than this, s.
const OFFSET_S_USUAL: f64 = 20.0;

fn log_density(_: &Scene, theta: &Theta) -> f64 {
    -(std::f64::consts::PI * OFFSET_S_USUAL * (1.0 + (theta[0] / OFFSET_S_USUAL).powi(2))).ln()
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    if theta[0].abs() > OFFSET_S_MAX {
        return None;
    }
    let simulation = &scene.case.simulation;
    Some(Shape::Fixed(std::array::from_fn(|k| {
        let late = window_means(&simulation.clock_s, &simulation.a_ng[k], scene.clock_s(), theta[0]);
        late.iter().zip(&scene.simulated_ng[k]).map(|(a, b)| a - b).collect()
    })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// A clock that runs ahead labels late.
    #[test]
    fn it_is_what_was_modelled_before_less_what_is_modelled_now() {
        for offset_s in [120.0, -45.0] {
            made::gives(&EFFECT, [offset_s, 0.0], 0, |t| made::simulated_ng(t - offset_s) - made::simulated_ng(t));
        }
    }
}
