//! A push while a logged event of kind `thruster` lasts.

use super::{Effect, SELDOM_LARGE, Shape, added, no_density, one_point, push};
use crate::diagnose::scene::Scene;

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "thruster_residual",
    name: "Thruster residual",
    equation: "a x (share of the window inside logged events)",
    source: "1-400 ng after the trimmed mean",
    covariate: "time_since_event",
    mistaken_for: &["attitude deadband: jets fire at its edges"],
    linear: &push(150.0, 3000.0),
    scales: SELDOM_LARGE,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is a push fixed in the body that is there only while logged firings last.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    added(scene, "thruster").map(Shape::scalar)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// Two jets that fire at once push twice.
    #[test]
    fn firings_that_overlap_add_up() {
        // From 104000 s to 104080 s and from 104040 s to 104120 s: of the window from 104025 s to 104075 s all and 35 s.
        made::has_shares(&EFFECT, [0.0; 2], &[(103_975.0, 0.0), (104_050.0, 1.7), (104_125.0, 0.4)]);
    }
}
