//! A shift between sleep and wake, wake minus sleep.

use super::{Effect, SELDOM_LARGE, Shape, lasting, no_density, one_point, push};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "crew_activity",
    name: "Crew activity shifts the mean",
    equation: "a x (1 while the crew is awake)",
    source: "1-20 ng; 16 h on, 8 h off",
    covariate: "activity",
    mistaken_for: &["a daily temperature cycle"],
    linear: &push(20.0, 500.0),
    scales: SELDOM_LARGE,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual shifts at the logged ends of the sleep periods and nowhere else.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    lasting(scene, "crew_sleep").map(|asleep| Shape::scalar(asleep.iter().map(|s| 1.0 - s).collect::<Vec<f64>>()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_there_awake_and_not_asleep() {
        // Asleep from 103600 s to 109000 s.
        made::has_shares(
            &EFFECT,
            [0.0; 2],
            &[(103_500.0, 1.0), (103_600.0, 0.5), (106_000.0, 0.0), (109_000.0, 0.5), (109_100.0, 1.0)],
        );
    }
}
