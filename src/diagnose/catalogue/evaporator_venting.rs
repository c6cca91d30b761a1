//! A push while a logged event of kind `evaporator` lasts.

use super::{Effect, SELDOM_LARGE, Shape, lasting, no_density, one_point, push};
use crate::diagnose::scene::Scene;

/// Entries of the log that it lasts as long as.
pub const KIND: &str = "evaporator";

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "evaporator_venting",
    name: "Evaporator venting",
    equation: "a x (share of the window inside logged events)",
    source: "flash evaporator: 5-15 min cycles of 50-150 ng",
    covariate: "time_since_event",
    mistaken_for: &["nearly nothing"],
    linear: &push(60.0, 1000.0),
    scales: SELDOM_LARGE,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is a push fixed in the body that begins and ends with the logged cycles of the evaporator.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    lasting(scene, KIND).map(Shape::scalar)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_there_in_every_logged_cycle_and_between_them_not() {
        made::has_shares(
            &EFFECT,
            [0.0; 2],
            &[(102_000.0, 0.5), (102_150.0, 1.0), (102_300.0, 0.5), (108_000.0, 0.0), (115_150.0, 1.0)],
        );
    }
}
