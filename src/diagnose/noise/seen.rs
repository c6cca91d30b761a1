//! How windows see the slow part of the noise: at their middle, or as a mean.

use super::{EVALUATIONS, Loudness, Schedule, WINDOW_S, fit_and_likelihoods};
use crate::math::shared_work;

/// From the middle of its former half to that of its latter.
const HALF_S: f64 = 0.5 * WINDOW_S;
/// Log likelihood by which a mean must be the likelier way: windows in which a short part is beside the slow one hardly tell the two
/// apart, and are left as they are.
const BY_MUCH: f64 = 10.0;

/// How windows see the slow part of the noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SlowSeen {
    /// As it is at their middle: what is slow has come to the windows, and not to the samples.
    #[default]
    AtMiddle,
    /// As a mean, like everything that samples have: it takes away what is quickest in it, and all at a period of two strides.
    Mean,
}

impl SlowSeen {
    /// Between the halves of a window that it sees, s, after a step.
    pub(super) fn between_halves_s(self, step_s: f64) -> f64 {
        match self {
            Self::AtMiddle => 0.0,
            Self::Mean => step_s.min(HALF_S),
        }
    }
}

/// How the windows of three axes see the slow part of their noise: as a mean where that makes it likelier by more than ten log units.
pub fn slow_part_seen(residual_ng: [&[f64]; 3], schedule: &Schedule, loudness: [&Loudness; 3]) -> SlowSeen {
    let likelihood = |slow_seen: SlowSeen| -> f64 {
        let schedule = Schedule { slow_seen, ..schedule.clone() };
        let shared = schedule.shared_ng.each_ref().map(|errors| &errors[..]);
        fit_and_likelihoods(residual_ng, shared, &schedule, loudness, None, EVALUATIONS).iter().map(|(_, l)| l).sum()
    };
    let (at_middle, mean) = shared_work::both(|| likelihood(SlowSeen::AtMiddle), || likelihood(SlowSeen::Mean));
    if mean > at_middle + BY_MUCH { SlowSeen::Mean } else { SlowSeen::AtMiddle }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{gappy, normals};
    use super::super::{AxisNoise, filter::tests::NOISE, simulate};
    use super::*;

    /// Slow noise of ten minutes, a third as loud as the windows, in which nothing else has a memory.
    #[test]
    fn slow_noise_of_the_samples_is_seen_as_a_mean_and_that_of_the_windows_at_their_middle() {
        let noise = AxisNoise { white_ng: 60.0, short_ng: 2.0, slow_ng: 20.0, slow_tau_s: 570.0, ..NOISE };
        let with_short = AxisNoise { short_ng: 14.0, short_tau_s: 75.0, ..noise };
        let loudness = Loudness::even(vec![1.0; gappy().len()]);
        for (seed, noise, slow_seen) in
            [(1, noise, SlowSeen::Mean), (2, noise, SlowSeen::AtMiddle), (3, with_short, SlowSeen::AtMiddle)]
        {
            let schedule = Schedule { slow_seen, ..gappy() };
            let mut normal = normals(seed);
            let axes: [Vec<f64>; 3] = std::array::from_fn(|_| simulate(&noise, &schedule, &loudness, &mut normal));
            let found = slow_part_seen(axes.each_ref().map(|x| &x[..]), &gappy(), [&loudness; 3]);
            assert_eq!(found, slow_seen, "{seed}");
        }
    }
}
