//! A set and the noise, fitted to what the set leaves and its slow part then marginalised: slow noise and a slow effect compete on
//! equal terms.

use super::{Entry, Set, refine};
use crate::diagnose::axes;
use crate::diagnose::design::Frame;
use crate::diagnose::noise::{self, AxisNoise};
use crate::diagnose::scene::{Axes, Scene};

/// A set with the noise fitted to what it leaves.
pub struct Weighed {
    /// The set, refined at its own noise.
    pub set: Set,
    /// Noise of its residual.
    pub noise: [AxisNoise; 3],
    /// Log posterior, up to a constant common to all sets of a case.
    pub log_posterior: f64,
    /// Log likelihood of slow noise in its residual above that of hardly any.
    pub slow_evidence: f64,
    /// What of the log posterior flips of the table gave it, and no window did.
    pub of_flips: f64,
}

/// What a set leaves at the windows.
pub struct Left {
    /// In ng, less the likeliest of the errors that all windows share.
    pub residual_ng: Axes,
    /// Whitened, and what is nuisance removed.
    pub whitened: Axes,
}

impl Weighed {
    /// The residual of the scene, behind the filters of this noise.
    pub fn frame(&self, scene: &Scene) -> Frame {
        Frame::new(&self.noise, &scene.schedule, &scene.loudness, &scene.residual_ng)
    }

    /// The same, and the set whitened for it.
    pub fn framed(&self, scene: &Scene, entries: &[Entry]) -> (Frame, Set) {
        let frame = self.frame(scene);
        let mut set = self.set.clone();
        set.rewhiten(scene, &frame, entries);
        (frame, set)
    }

    /// What the set leaves.
    pub fn left(&self, scene: &Scene, entries: &[Entry]) -> Left {
        let (frame, set) = self.framed(scene, entries);
        let residual_ng = residual(scene, &frame, entries, &set);
        let after = frame.with_data(&residual_ng);
        Left {
            residual_ng: frame.less_shared_errors(&residual_ng, &scene.schedule.shared_ng),
            whitened: std::array::from_fn(|k| after.data.projected(k, &after)),
        }
    }
}

/// Residual of a set at the noise of a frame.
pub fn residual(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set) -> Axes {
    let mut left = scene.residual_ng.clone();
    set.contributions(scene, frame, entries).iter().for_each(|part| axes::add(&mut left, part, -1.0));
    left
}

/// Fit the noise of all axes to a residual.
pub fn fit_noise(
    scene: &Scene,
    residual_ng: &Axes,
    start: Option<&[AxisNoise; 3]>,
    evaluations: usize,
) -> [AxisNoise; 3] {
    let residual = residual_ng.each_ref().map(|x| &x[..]);
    let shared = scene.schedule.shared_ng.each_ref().map(|x| &x[..]);
    noise::fit(residual, shared, &scene.schedule, scene.loudness.each_ref(), start.map(|s| s.each_ref()), evaluations)
}

/// Weigh a set with its own noise: alternately noise and coefficients, `rounds` times.
pub fn weigh_with_own_noise(
    scene: &Scene,
    entries: &[Entry],
    set: &Set,
    start: &[AxisNoise; 3],
    rounds: usize,
    evaluations: usize,
) -> Weighed {
    let mut noise = *start;
    let mut set = set.clone();
    let mut frame = Frame::new(&noise, &scene.schedule, &scene.loudness, &scene.residual_ng);
    set.rewhiten(scene, &frame, entries);
    for _ in 0..rounds {
        noise = fit_noise(scene, &residual(scene, &frame, entries, &set), Some(&noise), evaluations);
        frame = Frame::new(&noise, &scene.schedule, &scene.loudness, &scene.residual_ng);
        set.rewhiten(scene, &frame, entries);
    }
    refine(scene, &frame, entries, &mut set);
    let left = residual(scene, &frame, entries, &set);
    let (height, slow_evidence) = height(scene, &frame, &noise, &left);
    let log_posterior = height + set.score;
    let has_flips = scene.schedule.flips.iter().any(|flips| !flips.rest.is_empty());
    let of_flips = if has_flips { set.chosen(&frame).gain_at_flips().max(0.0) } else { 0.0 };
    Weighed { set, noise, log_posterior, slow_evidence, of_flips }
}

/// Log posterior of noise in a frame, with what a hypothesis leaves there and but for its own score; and the evidence of a slow part.
pub fn height(scene: &Scene, frame: &Frame, noise: &[AxisNoise; 3], left_ng: &Axes) -> (f64, f64) {
    let slow = noise::slow_part_marginalised(noise, left_ng, &scene.schedule, &scene.loudness);
    let flicker = noise::where_it_may_be_flicker(noise, left_ng, &scene.schedule, &scene.loudness);
    let priors = noise.iter().map(noise::log_prior_but_slow).sum::<f64>();
    (frame.log_null + priors + slow.above_fit + flicker, slow.above_none)
}
