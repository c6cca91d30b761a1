//! A push for a while: there from one instant to another, neither of which a log has. The catalogue has none, and a leak or a step that is near to
//! one; it has a place of its own in the library, with the parameters and the priors of an effect, but is never a name.

use crate::diagnose::catalogue::{Effect, Nonlinear, ONSET, SELDOM_LARGE, Shape, Theta, is_inside, onsets, push};
use crate::diagnose::measure::coverage;
use crate::diagnose::scene::Scene;

/// The entry.
pub const PUSH: Effect = Effect {
    id: "push",
    name: "A push for a while",
    equation: "a from the onset until the length is over",
    source: "no catalogue",
    covariate: "time_since_onset",
    mistaken_for: &["vent_leak", "bias_step", "slow noise"],
    linear: &push(80.0, 3000.0),
    scales: SELDOM_LARGE,
    nonlinear: &[
        ONSET,
        Nonlinear { name: "length_s", unit: "s", log: true, step: 0.2, jagged: true, ..Nonlinear::PLAIN },
    ],
    grid,
    log_density,
    signature,
    exact_at: None,
    assumes: None,
    why: "A push is there for a while.",
};

/// Lengths tried first, s, and the spacing of their onsets, as a share of the length and in s.
const LENGTHS_S: [f64; 7] = [900.0, 1800.0, 3600.0, 7200.0, 14_400.0, 28_800.0, 57_600.0];
const SPACING: f64 = 1.0 / 3.0;
const SPACING_S: f64 = 600.0;
/// Shortest push, s: a shorter one is no slow noise. And the longest, as a share of the record.
const SHORTEST_S: f64 = 600.0;
const LONGEST: f64 = 0.9;

fn longest_s(scene: &Scene) -> f64 {
    let [start, end] = scene.span_s();
    (LONGEST * (end - start)).max(2.0 * SHORTEST_S)
}

fn grid(scene: &Scene) -> Vec<Theta> {
    let points = |length_s: &f64| {
        let starts = onsets(scene, (SPACING * length_s).max(SPACING_S), SPACING_S);
        starts.into_iter().map(|start_s| [start_s, length_s.ln()]).collect::<Vec<_>>()
    };
    LENGTHS_S.iter().flat_map(points).collect()
}

fn log_density(scene: &Scene, _: &Theta) -> f64 {
    let [start, end] = scene.span_s();
    -((end - start) * (longest_s(scene) / SHORTEST_S).ln()).ln()
}

fn signature(scene: &Scene, &[start_s, log_length]: &Theta) -> Option<Shape> {
    let length_s = log_length.exp();
    let is_one = (SHORTEST_S..longest_s(scene)).contains(&length_s)
        && is_inside(scene, start_s)
        && is_inside(scene, start_s + length_s);
    is_one.then(|| Shape::scalar(coverage(scene.clock_s(), &[[start_s, start_s + length_s]])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    #[test]
    fn it_is_one_while_it_lasts_and_is_over_before_the_record_is() {
        // Windows of 50 s about these centres.
        let shares = [(106_975.0, 0.0), (107_000.0, 0.3), (107_050.0, 1.0), (107_625.0, 0.7), (107_700.0, 0.0)];
        made::has_shares(&PUSH, [107_010.0, 625.0_f64.ln()], &shares);
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let [_, end_s] = scene.span_s();
        assert!(
            (PUSH.signature)(&scene, &[end_s - 7200.0, 7000.0_f64.ln()]).is_none(),
            "one that ends with the record is a step"
        );
        assert!((PUSH.grid)(&scene).len() > 100);
    }
}
