//! Windows whose samples are out of the ordinary: where no hypothesis explains them they weigh less, as under Student's t of few
//! degrees of freedom (Lange, Little and Taylor 1989).
//!
//! The tails alone are heavy: a record whose whitened residuals all lie within [`OUT`] is weighed as Gaussian noise is.

use super::noise::{AxisNoise, Loudness, Schedule, Whitener};
use super::scene::{Axes, Scene};
use super::search::{self, Set};
use super::solve::{Library, Solution, Stop, null_noise, solve_unless};

/// Whitened residual beyond which samples are out of the ordinary: of Gaussian noise one record in a hundred has one such window.
pub const OUT: f64 = 5.0;
/// Degrees of freedom of the tails.
const DEGREES: f64 = 4.0;
/// Searches, each beside the bursts of the one before.
const ROUNDS: usize = 3;

/// Searches and weighs as [`solve_unless`], then looks for bursts in what the best hypothesis leaves, and searches again beside them
/// until there are no more.
///
/// A hypothesis that explains some windows out of the ordinary and leaves as many others may have been made of the former: among many bursts
/// some come at even distances, or some time after entries of the log. Then all of them are bursts, and what is found beside these is searched
/// for again with those windows free that it explains.
pub fn solve_beside_bursts(
    scene: &mut Scene,
    library: &Library,
    noise_null: [AxisNoise; 3],
    stop: Stop,
) -> Option<Solution> {
    let mut solution = solve_unless(scene, library, noise_null, stop)?;
    if explains_some_of_many(scene, library, &solution) {
        let free = scene.loudness.clone();
        let noise = all_taken_for_bursts(scene, library, &solution.null.noise);
        solution = solve_unless(scene, library, noise, stop)?;
        if !solution.best().set.members.is_empty() {
            scene.loudness = free;
        }
    }
    for _ in 1..ROUNDS {
        let best = solution.best();
        let (whitened, noise) = (best.left(scene, &library.entries).whitened, best.noise);
        if !mark(scene, &whitened, &noise) {
            break;
        }
        solution = solve_unless(scene, library, null_noise(scene, Some(&solution.null.noise)), stop)?;
    }
    Some(solution)
}

/// Whether the best hypothesis explains windows that are out of the ordinary beside nothing, and leaves at least as many.
fn explains_some_of_many(scene: &Scene, library: &Library, solution: &Solution) -> bool {
    let [before, left] = [&solution.null, solution.best()].map(|w| out(&w.left(scene, &library.entries).whitened));
    let explained = before.iter().filter(|i| !left.contains(i)).count();
    explained > 0 && left.len() >= explained
}

/// Windows that are out of the ordinary on any axis.
fn out(whitened: &Axes) -> Vec<usize> {
    let windows = 0..whitened[0].len();
    windows.filter(|i| whitened.iter().any(|axis| axis[*i].abs() > OUT)).collect()
}

/// Gives every window that is out of the ordinary beside nothing its burst; the noise beside them.
fn all_taken_for_bursts(scene: &mut Scene, library: &Library, noise_null: &[AxisNoise; 3]) -> [AxisNoise; 3] {
    let mut noise = *noise_null;
    for _ in 0..ROUNDS {
        let null = search::weigh_with_own_noise(scene, &library.entries, &Set::default(), &noise, 0, 0);
        let whitened = null.left(scene, &library.entries).whitened;
        if !mark(scene, &whitened, &noise) {
            break;
        }
        noise = null_noise(scene, Some(&noise));
    }
    noise
}

/// Gives the windows of all axes their bursts; whether there are any new ones.
fn mark(scene: &mut Scene, whitened: &Axes, noise: &[AxisNoise; 3]) -> bool {
    let marked = |k: usize| weigh_less(&mut scene.loudness[k], &whitened[k], &noise[k], &scene.schedule);
    (0..3).map(marked).fold(false, |any, marked| any | marked)
}

/// Gives windows their bursts where the whitened residual is out of the ordinary; whether there are any new ones.
fn weigh_less(loudness: &mut Loudness, whitened: &[f64], noise: &AxisNoise, schedule: &Schedule) -> bool {
    let out: Vec<(usize, &f64)> = whitened.iter().enumerate().filter(|(_, z)| z.abs() > OUT).collect();
    if out.is_empty() {
        return false;
    }
    let whitener = Whitener::new(noise, schedule, loudness);
    for (i, z) in out {
        // The variance of the innovation that Student's t gives it, all of it in the samples that are new to the window.
        let more = (DEGREES + z * z) / (DEGREES + 1.0) - 1.0;
        loudness.burst[i] += more / whitener.new_share(i, noise, schedule, loudness);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noise::simulate;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const NOISE: AxisNoise = AxisNoise {
        white_ng: 100.0,
        short_ng: 20.0,
        short_tau_s: 120.0,
        slow_ng: 2.0,
        slow_tau_s: 3000.0,
        resonance: None,
    };

    fn record(bursts: &[usize]) -> (Schedule, Loudness, Vec<f64>) {
        let schedule = Schedule::new(&(0..4000).map(|i| 25.0 * f64::from(i)).collect::<Vec<f64>>());
        let even = Loudness::even(vec![1.0; schedule.len()]);
        let mut loud = even.clone();
        bursts.iter().for_each(|i| loud.burst[*i] = 400.0);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let x = simulate(&NOISE, &schedule, &loud, || StandardNormal.sample(&mut rng));
        (schedule, even, x)
    }

    /// A burst is in two windows that overlap, and is one: the window after it knows of it.
    #[test]
    fn a_burst_is_found_where_it_begins_and_the_window_after_it_is_not_another() {
        let bursts = [500, 1700, 1701, 3100];
        let (schedule, mut loudness, x) = record(&bursts);
        let whitened = |loudness: &Loudness| Whitener::new(&NOISE, &schedule, loudness).whiten(&x);
        let mut left = whitened(&loudness);
        while weigh_less(&mut loudness, &left, &NOISE, &schedule) {
            left = whitened(&loudness);
        }
        let found: Vec<usize> = (0..schedule.len()).filter(|i| loudness.burst[*i] > 1.0).collect();
        assert!(!found.is_empty() && found.iter().all(|i| bursts.contains(i)), "{found:?}");
        assert!(left.iter().all(|w| w.abs() < OUT));
    }

    #[test]
    fn gaussian_noise_has_none() {
        let (schedule, mut loudness, x) = record(&[]);
        let even = loudness.clone();
        let whitened = Whitener::new(&NOISE, &schedule, &loudness).whiten(&x);
        assert!(!weigh_less(&mut loudness, &whitened, &NOISE, &schedule));
        assert_eq!(loudness, even);
    }
}
