//! A decaying push fixed in the body from an unlogged instant.

use super::{Effect, Nonlinear, ONSET, SELDOM_LARGE, Shape, Theta, onsets, push};
use crate::diagnose::instants::of_chance;
use crate::diagnose::measure::decay;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "vent_leak",
    name: "Vent or leak, decaying push",
    equation: "a exp(-(t - onset)/tau) after the onset",
    source: "1 kg/day at 300 m/s is 3.5 ng",
    covariate: "time_since_onset",
    mistaken_for: &["bias_step", "bias_drift"],
    linear: &push(80.0, 3000.0),
    scales: SELDOM_LARGE,
    nonlinear: &[
        ONSET,
        Nonlinear { name: "tau_s", unit: "s", log: true, step: 0.25, range: [5.7, 13.5], ..Nonlinear::PLAIN },
    ],
    grid,
    log_density,
    signature,
    exact_at: None,
    assumes: Some(|scene, theta| of_chance(scene, theta[0]).or_else(|| of_a_slow_one(scene, theta))),
    why: "A push fixed in the body begins at an instant no log names and dies away exponentially, whatever the attitude does.",
};

/// Time constants tried first, s, as far as they are in the range; the spacing of the onsets for each is half of it, within limits.
const TAUS_S: [f64; 10] = [600.0, 1200.0, 2400.0, 4800.0, 9600.0, 19_200.0, 38_400.0, 76_800.0, 153_600.0, 307_200.0];

/// Closest and widest spacing of the onsets, s.
const SPACING_S: [f64; 2] = [300.0, 1800.0];
/// Onsets of slow ones that a record longer than two days has at least; that of none is spaced wider than an eighth of its time constant.
const ONSETS_MIN: f64 = 96.0;

/// Shortest and longest decay, s: faster is an event, slower is a step.
const TAU_RANGE_S: [f64; 2] = [300.0, 80_000.0];
/// A record that is longer than two days tells slower ones from a step, up to this share of it: in what is left of it after an onset half
/// way one of that decays to a third.
const TOLD_FROM_A_STEP: f64 = 0.45;
/// Share of the longest up to which one is tried first: any nearer is found from it.
const TRIED_FIRST: f64 = 0.9;
/// Logarithm of a time constant from the longest up to which it may as well be longer.
const AT_THE_LONGEST: f64 = 0.05;

fn longest_s(scene: &Scene) -> f64 {
    let [start, end] = scene.span_s();
    TAU_RANGE_S[1].max(TOLD_FROM_A_STEP * (end - start))
}

fn of_a_slow_one(scene: &Scene, theta: &Theta) -> Option<String> {
    let longest_s = longest_s(scene);
    (theta[1] > longest_s.ln() - AT_THE_LONGEST).then(|| {
        format!("tau_s is at the longest that is tried, {longest_s:.0} s, slower than which is taken for a step: it may be longer")
    })
}

fn grid(scene: &Scene) -> Vec<Theta> {
    let [start, end] = scene.span_s();
    let widest_s = |tau: f64| SPACING_S[1].max((0.125 * tau).min((end - start) / ONSETS_MIN));
    let points = |tau: &f64| {
        let spacing_s = (0.5 * tau).clamp(SPACING_S[0], widest_s(*tau));
        onsets(scene, spacing_s, 600.0).into_iter().map(|t| [t, tau.ln()]).collect::<Vec<_>>()
    };
    let longest_s = longest_s(scene);
    TAUS_S.iter().filter(|tau| **tau < TRIED_FIRST * longest_s).flat_map(points).collect()
}

fn log_density(scene: &Scene, _: &Theta) -> f64 {
    let [start, end] = scene.span_s();
    -((end - start) * (longest_s(scene) / TAU_RANGE_S[0]).ln()).ln()
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    let [start, end] = scene.span_s();
    let inside = theta[0] > start
        && theta[0] < end - 300.0
        && theta[1] > TAU_RANGE_S[0].ln()
        && theta[1] < longest_s(scene).ln();
    inside.then(|| Shape::scalar(decay(scene.clock_s(), theta[0], theta[1].exp())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_the_mean_over_each_window_of_a_decay_from_its_onset() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let (onset_s, tau_s) = (107_010.0, 600.0_f64);
        let columns = made::columns(&scene, &EFFECT, [onset_s, tau_s.ln()]);
        // The mean of exp(-t/tau) over a window, by five thousand points.
        for centre_s in [106_950.0, 107_000.0, 107_025.0, 107_400.0, 110_000.0] {
            let point = |i: i32| centre_s - 25.0 + 0.01 * (f64::from(i) + 0.5) - onset_s;
            let mean = (0..5000).map(point).filter(|t| *t > 0.0).map(|t| (-t / tau_s).exp()).sum::<f64>() / 5000.0;
            assert!((made::at(&scene, &columns[0][0], centre_s) - mean).abs() < 1e-4, "{centre_s}");
        }
    }
}
