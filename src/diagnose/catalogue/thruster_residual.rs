//! A push while a logged event of kind `thruster` lasts.
//!
//! Entries that overlap are two jets that push twice, or one that pushes once and is logged with time to spare: no log says which, and where
//! it matters the record does.

use super::{Effect, SELDOM_LARGE, Shape, Theta, added, lasting, no_density, push};
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
    grid,
    log_density: no_density,
    signature,
    exact_at: None,
    assumes: Some(assumes),
    why: "The residual is a push fixed in the body that is there only while logged firings last.",
};

/// Ways to count entries that overlap.
const EACH: f64 = 0.0;
const ONCE: f64 = 1.0;

fn grid(scene: &Scene) -> Vec<Theta> {
    let overlap = added(scene, "thruster") != lasting(scene, "thruster");
    if overlap { vec![[EACH, 0.0], [ONCE, 0.0]] } else { vec![[EACH, 0.0]] }
}

fn signature(scene: &Scene, theta: &Theta) -> Option<Shape> {
    let share = if theta[0] == ONCE { lasting } else { added };
    share(scene, "thruster").map(Shape::scalar)
}

fn assumes(_: &Scene, theta: &Theta) -> Option<String> {
    (theta[0] == ONCE).then(|| "firings of the log that overlap push once and not each".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// From 104000 s to 104080 s and from 104040 s to 104120 s: of the window from 104025 s to 104075 s all and 35 s.
    #[test]
    fn firings_that_overlap_add_up_or_push_once() {
        made::has_shares(&EFFECT, [EACH, 0.0], &[(103_975.0, 0.0), (104_050.0, 1.7), (104_125.0, 0.4)]);
        made::has_shares(&EFFECT, [ONCE, 0.0], &[(103_975.0, 0.0), (104_050.0, 1.0), (104_125.0, 0.4)]);
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        assert_eq!(grid(&scene).len(), 2);
        assert!(assumes(&scene, &[ONCE, 0.0]).is_some() && assumes(&scene, &[EACH, 0.0]).is_none());
    }
}
