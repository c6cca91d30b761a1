//! A push while a logged event of kind `water_dump` lasts.

use super::{Effect, SELDOM_LARGE, Shape, lasting, no_density, one_point, push};
use crate::diagnose::scene::Scene;

/// Entries of the log that it lasts as long as.
pub const KIND: &str = "water_dump";

/// The entry.
pub const EFFECT: Effect = Effect {
    id: "water_dump",
    name: "Water dump",
    equation: "a x (share of the window inside logged events)",
    source: "about 1 ug in body Y was seen; 250-1000 ng",
    covariate: "time_since_event",
    mistaken_for: &["nearly nothing"],
    linear: &push(300.0, 5000.0),
    scales: SELDOM_LARGE,
    nonlinear: &[],
    grid: one_point,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "The residual is a push fixed in the body that begins and ends with the logged water dumps.",
};

fn signature(scene: &Scene, _: &super::Theta) -> Option<Shape> {
    lasting(scene, KIND).map(Shape::scalar)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_lasts_as_long_as_the_logged_dump() {
        // From 110010 s to 110610 s; a window whose half is inside has the half of it.
        made::has_shares(
            &EFFECT,
            [0.0; 2],
            &[(109_975.0, 0.0), (110_000.0, 0.3), (110_300.0, 1.0), (110_600.0, 0.7), (110_650.0, 0.0)],
        );
    }
}
