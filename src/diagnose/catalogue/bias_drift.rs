//! The bias decays exponentially; amplitudes refer to the first instant of the simulation.

use super::{Effect, Nonlinear, SELDOM_LARGE, Shape, Theta, in_sensor, push};
use crate::diagnose::measure::decay;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "bias_drift",
    name: "Bias drifts",
    equation: "a exp(-(t - t0)/tau), t0 the first instant of the simulation",
    source: "bias law of the flight report: time constants of 6 to 500 h",
    covariate: "time",
    mistaken_for: &["vent_leak", "temperature_bias", "a trend of density"],
    linear: &push(150.0, 20000.0),
    scales: SELDOM_LARGE,
    nonlinear: &[Nonlinear { name: "tau_s", unit: "s", log: true, step: 0.2, range: [6.8, 13.5], ..Nonlinear::PLAIN }],
    grid,
    log_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The bias of each sensor axis relaxes from the beginning of the record with one time constant, whatever the attitude does.",
};

/// Shortest and longest time constant, s: from what settles after it is switched on to the law of the flight report.
const TAU_RANGE_S: [f64; 2] = [900.0, 500_000.0];

fn grid(_: &Scene) -> Vec<Theta> {
    [1100.0_f64, 2000.0, 4000.0, 7000.0, 12_000.0, 20_000.0, 35_000.0, 60_000.0, 120_000.0, 300_000.0]
        .map(|tau| [tau.ln(), 0.0])
        .to_vec()
}

fn log_density(_: &Scene, _: &Theta) -> f64 {
    -(TAU_RANGE_S[1] / TAU_RANGE_S[0]).ln().ln()
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    let inside = theta[0] > TAU_RANGE_S[0].ln() && theta[0] < TAU_RANGE_S[1].ln();
    let begins_s = scene.case.simulation.clock_s[0];
    inside.then(|| in_sensor(scene, |clock_s| decay(clock_s, begins_s, theta[0].exp())))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_one_decay_from_the_beginning_of_the_simulation() {
        // The simulation begins ten minutes before the record.
        let (tau_s, begins_s) = (20_000.0_f64, made::START_S - 600.0);
        for axis in 0..3 {
            let decay = |t: f64| Vector3::ith(axis, (-(t - begins_s) / tau_s).exp());
            made::gives(&EFFECT, [tau_s.ln(), 0.0], axis, decay);
        }
    }
}
