//! How well it fits: before, after, on data held out, and how white what is left is.

use crate::diagnose::answer::{Fit, FitLevel};
use crate::diagnose::design::Frame;
use crate::diagnose::scene::{Axes, Scene};
use crate::diagnose::search::{self, Set, Weighed};
use crate::diagnose::solve::Library;
use crate::diagnose::trial::Tried;
use crate::diagnose::whiteness::{Coloured, coloured};
use crate::math::rms::rms_about_mean;

/// Errors that all windows share are told from this share of the noise on: less does not show in a figure.
const SHARED_TOLD: f64 = 0.25;

/// Before and after, and by how much the errors must be widened.
pub fn fit(
    scene: &Scene,
    library: &Library,
    frame: &Frame,
    weighed: &Weighed,
    set: &Set,
    tried: Tried,
    notes: &mut Vec<String>,
) -> (Fit, f64) {
    let entries = &library.entries;
    let left = search::residual(scene, frame, entries, set);
    let after = frame.with_data(&left);
    let dof = 3.0 * (scene.schedule.len() as f64 - 1.0);
    let before = frame.with_data(&scene.residual_ng);
    let level = |axes: &Axes, f: &Frame, used: f64| FitLevel {
        rms_ng: std::array::from_fn(|k| rms_about_mean(&axes[k])),
        whitened_chi2_per_dof: f.data.dot(&f.data) / (dof - used),
    };
    let used: f64 = set.members.iter().map(|m| m.linear() as f64).sum();
    let mut inflation = 1.0_f64;
    for (axis, coloured) in ["x", "y", "z"].iter().zip([0, 1, 2].map(|k| coloured(&after.data.projected(k, &after)))) {
        if let Some(Coloured { p, widening }) = coloured {
            inflation = inflation.max(widening);
            notes.push(format!(
                "the whitened residual of axis {axis} is not white (p = {p:.1e}): errors are widened by {widening:.2}, and evidence on it \
                 counts for as much less"
            ));
        }
    }
    if !set.members.is_empty() && tried.confirmed.is_none() {
        notes.push(format!(
            "of {} none can foretell another: each has what is found for itself, and held_out.excess_removed = {:.3} speaks neither for it \
             nor against",
            tried.blocks.scheme, tried.blocks.excess_removed
        ));
    }
    notes.extend(of_shared_errors(scene, frame, weighed, &left));
    let fit = Fit {
        noise_floor_ng: std::array::from_fn(|k| weighed.noise[k].rms_ng()),
        before: level(&scene.residual_ng, &before, 0.0),
        after: level(&left, &after, used),
        held_out: tried.blocks,
        confirmed: tried.confirmed,
        left_out_attitudes: tried.attitudes,
        above_placebo: tried.above_placebo,
    };
    (fit, inflation)
}

/// Says how much of what is left the calibration's own errors account for, which all windows share: it shows in the plots, and is no physics.
fn of_shared_errors(scene: &Scene, frame: &Frame, weighed: &Weighed, left_ng: &Axes) -> Vec<String> {
    let without = frame.less_shared_errors(left_ng, &scene.schedule.shared_ng);
    let told = |k: usize| {
        let shared: Vec<f64> = left_ng[k].iter().zip(&without[k]).map(|(left, without)| left - without).collect();
        let rms_ng = rms_about_mean(&shared);
        (rms_ng > SHARED_TOLD * weighed.noise[k].rms_ng()).then(|| {
            format!(
                "of what remains of axis {}, {rms_ng:.0} ng rms is taken for errors of the calibration that all windows share, as large as its \
                 covariance allows, and for no physics",
                ["x", "y", "z"][k]
            )
        })
    };
    (0..3).filter_map(told).collect()
}
