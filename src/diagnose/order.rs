//! How windows see the slow part of the noise and how many autoregressions it has, chosen on what the best hypothesis leaves, and the
//! search again where that is not as it was.
//!
//! A hypothesis that leaves the noise louder about some period than the filter of two autoregressions expects may have missed a line, or
//! the noise resonates there. A resonance is taken where, at the price of a criterion, all that is said with it is likelier than all that
//! is said without: the best hypothesis of each, and what remains beside it. So a line stays a line, and what rings once no noise.

use super::bursts::solve_beside_bursts;
use super::instants::recurring;
use super::noise::{self, AxisNoise};
use super::remains;
use super::scene::Scene;
use super::search;
use super::solve::{Library, Solution, Stop, null_noise, solve_unless};

/// Log odds, of twenty, by which a resonance must be the likelier: a finding is not given up for noise that is as likely.
const MARGIN: f64 = 3.0;

/// Searches and weighs as [`solve_beside_bursts`], with noise of the order that the record asks for.
pub fn solve_at_its_order(
    scene: &mut Scene,
    library: &Library,
    noise_null: [AxisNoise; 3],
    stop: Stop,
) -> Option<Solution> {
    let plain = solve_as_seen(scene, library, noise_null, stop)?;
    let best = plain.best();
    let about_s = remains::loud_about_s(&best.left(scene, &library.entries), &scene.schedule, noise::PERIODS_S);
    if about_s.iter().all(Option::is_none) {
        return Some(plain);
    }
    let (frame, set) = best.framed(scene, &library.entries);
    let left = search::residual(scene, &frame, &library.entries, &set);
    let resonant = noise::with_resonances(&best.noise, &left, &scene.schedule, &scene.loudness, about_s);
    let Some((noise_resonant, price)) = resonant else { return Some(plain) };
    let resonant = solve_unless(scene, library, null_noise(scene, Some(&noise_resonant)), stop)?;
    let likelier = height(scene, library, &resonant) - price > height(scene, library, &plain) + MARGIN;
    Some(if likelier { resonant } else { plain })
}

/// Searches and weighs as [`solve_beside_bursts`], the slow part seen as what the best hypothesis leaves has it: an effect that is still
/// there looks like slow noise without anything quick.
fn solve_as_seen(scene: &mut Scene, library: &Library, noise_null: [AxisNoise; 3], stop: Stop) -> Option<Solution> {
    let solution = solve_beside_bursts(scene, library, noise_null, stop)?;
    let left = solution.best().left(scene, &library.entries).residual_ng;
    let left = left.each_ref().map(|x| &x[..]);
    let seen = noise::slow_part_seen(left, &scene.schedule, scene.loudness.each_ref());
    if seen == scene.schedule.slow_seen {
        return Some(solution);
    }
    scene.schedule.slow_seen = seen;
    solve_beside_bursts(scene, library, null_noise(scene, None), stop)
}

/// Log posterior of the best hypothesis and of what it leaves.
fn height(scene: &Scene, library: &Library, solution: &Solution) -> f64 {
    let best = solution.best();
    let left = best.left(scene, &library.entries);
    let recurring = recurring(scene);
    let strongest = remains::strongest(&left, &best.noise, &scene.schedule, &scene.loudness, &recurring)
        .map_or(1.0, |r| r.probability);
    let oscillation = remains::probability_of_an_oscillation(&left, &best.noise, &scene.schedule, &recurring);
    best.log_posterior - strongest.min(oscillation).max(f64::MIN_POSITIVE).ln()
}
