//! Heavy tails: windows that no hypothesis explains and no Gaussian noise reaches weigh less.
//!
//! A bump that came through the trimmed mean, a glitch: a few windows of many sigma would pull every amplitude, and a search would
//! find them a meaning. What stands out of the whitened residual of the *best* hypothesis has the weight that a Student's t
//! of four degrees of freedom gives it (Lange, Little and Taylor 1989), as a noise that much larger, and the search is made again.
//! A law of many pulses is no tail: where more windows stand out than glitches would, none is touched.

use super::design::Frame;
use super::scene::{Axes, Scene};
use super::search::{self, Weighed};
use super::solve::{Library, Solution};

/// Whitened innovations at which a window stands out: noise alone does so in one record of a hundred.
const STANDS_OUT: f64 = 5.0;
/// Share of the windows that may.
const SHARE_MAX: f64 = 0.004;
/// Degrees of freedom of the t.
const FREEDOM: f64 = 4.0;

/// The scene with the noise of the windows that stand out made larger, `None` where none does; and how many did.
pub fn weighted<'a>(scene: &Scene<'a>, library: &Library, solution: &Solution) -> Option<(Scene<'a>, usize)> {
    let hypotheses = solution.listed.iter().chain(&solution.open).chain([&solution.null]);
    let best = hypotheses.max_by(|a, b| a.log_posterior.total_cmp(&b.log_posterior))?;
    let whitened = whitened_residual(scene, library, best);
    let mut activity = scene.activity.clone();
    let mut count = 0;
    for i in 0..scene.schedule.len() {
        if whitened.iter().all(|axis| axis[i].abs() <= STANDS_OUT) {
            continue;
        }
        count += 1;
        for (axis, activity) in whitened.iter().zip(&mut activity) {
            let weight = (FREEDOM + 1.0) / (FREEDOM + axis[i].powi(2));
            activity[i] *= weight.sqrt().recip().max(1.0);
        }
    }
    let few = count as f64 <= SHARE_MAX * scene.schedule.len() as f64;
    (count > 0 && few).then(|| (scene.with_activity(activity), count))
}

fn whitened_residual(scene: &Scene, library: &Library, weighed: &Weighed) -> Axes {
    let frame = Frame::new(&weighed.noise, &scene.schedule, &scene.activity, &scene.residual_ng);
    let mut set = weighed.set.clone();
    set.rewhiten(scene, &frame, &library.entries);
    let left = search::residual(scene, &frame, &library.entries, &set);
    let after = frame.with_data(&left);
    std::array::from_fn(|k| after.data.projected(k, &after))
}
