//! The bias steps at an instant and stays.

use super::{Effect, ONSET, SELDOM_LARGE, Shape, Theta, anywhere, in_sensor, is_inside, onsets, push};
use crate::diagnose::instants::of_chance;
use crate::diagnose::measure::decay;
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "bias_step",
    name: "Bias step",
    equation: "a after the onset",
    source: "electronic bias shifts were seen between calibrations",
    covariate: "time_since_onset",
    mistaken_for: &["vent_leak", "a trend of density"],
    linear: &push(60.0, 2000.0),
    scales: SELDOM_LARGE,
    nonlinear: &[ONSET],
    grid,
    log_density: anywhere,
    signature,
    exact_at: None,
    assumes: Some(|scene, theta| of_chance(scene, theta[0])),
    why: "Each sensor axis jumps once, at one instant, and stays there whatever the attitude does.",
};

fn grid(scene: &Scene) -> Vec<Theta> {
    onsets(scene, 900.0, 900.0).into_iter().map(|t| [t, 0.0]).collect()
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    is_inside(scene, theta[0]).then(|| in_sensor(scene, |clock_s| decay(clock_s, theta[0], f64::INFINITY)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_nothing_before_its_onset_and_one_after() {
        // Windows of 50 s about these centres see none, three tenths, eight tenths and all of it.
        let shares = [(106_975.0, 0.0), (107_000.0, 0.3), (107_025.0, 0.8), (107_050.0, 1.0)];
        made::has_shares(&EFFECT, [107_010.0, 0.0], &shares);
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        assert!((EFFECT.signature)(&scene, &[made::START_S, 0.0]).is_none(), "an onset at the edge is none");
    }
}
