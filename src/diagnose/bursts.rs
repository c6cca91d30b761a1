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
/// Whitened residual of the other sign, of the window after one out of the ordinary, that tells that nothing of that was in it.
const CONTRADICTED: f64 = 2.5;
/// Windows for which one out of the ordinary may put others out: seventeen in the test below.
const REACH: usize = 20;
/// Stretches of them that are many: fewer may be of one oscillation that dies away.
const MANY: usize = 5;
/// Looks at what is left, each beside the bursts of the one before: as many of such a stretch are found.
const LOOKS: usize = 24;
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
        let whitened = best.left(scene, &library.entries).whitened;
        let found = if stretches(&out(&whitened)) < MANY {
            // What goes up and down for a while is one burst from its beginning to its end.
            let each = |k: usize| burst_each(&mut scene.loudness[k], &whitened[k], &best.noise[k], &scene.schedule);
            [0, 1, 2].map(each).contains(&true)
        } else {
            settle(scene, &best.noise, |scene| best.left(scene, &library.entries).whitened)
        };
        if !found {
            break;
        }
        solution = solve_unless(scene, library, null_noise(scene, Some(&solution.null.noise)), stop)?;
    }
    Some(solution)
}

/// Whether the best hypothesis explains windows that are out of the ordinary beside nothing, and leaves at least as many, and many at that:
/// stretches of them, for what goes up and down for an hour is one.
fn explains_some_of_many(scene: &Scene, library: &Library, solution: &Solution) -> bool {
    let [before, left] = [&solution.null, solution.best()].map(|w| out(&w.left(scene, &library.entries).whitened));
    let explained: Vec<usize> = before.into_iter().filter(|i| !left.contains(i)).collect();
    let [explained, left] = [explained, left].map(|windows| stretches(&windows));
    explained > 0 && left >= explained.max(MANY)
}

/// Windows that are out of the ordinary on any axis.
fn out(whitened: &Axes) -> Vec<usize> {
    let windows = 0..whitened[0].len();
    windows.filter(|i| whitened.iter().any(|axis| axis[*i].abs() > OUT)).collect()
}

/// How many stretches of windows that are near to each other.
fn stretches(windows: &[usize]) -> usize {
    windows.chunk_by(|a, b| b - a < REACH).count()
}

/// Gives every window that is out of the ordinary beside nothing its burst; the noise beside them.
fn all_taken_for_bursts(scene: &mut Scene, library: &Library, noise_null: &[AxisNoise; 3]) -> [AxisNoise; 3] {
    let mut noise = *noise_null;
    for _ in 0..ROUNDS {
        let null = search::weigh_with_own_noise(scene, &library.entries, &Set::default(), &noise, 0, 0);
        if !settle(scene, &noise, |scene| null.left(scene, &library.entries).whitened) {
            break;
        }
        noise = null_noise(scene, Some(&noise));
    }
    noise
}

/// Gives windows their bursts, and looks again at what is then left, until there are no more; whether there are any.
fn settle(scene: &mut Scene, noise: &[AxisNoise; 3], left: impl Fn(&Scene) -> Axes) -> bool {
    for look in 0..LOOKS {
        let whitened = left(scene);
        let marked = |k: usize| weigh_less(&mut scene.loudness[k], &whitened[k], &noise[k], &scene.schedule);
        if ![0, 1, 2].map(marked).contains(&true) {
            return look > 0;
        }
    }
    true
}

/// How much more variance the innovation has that Student's t gives it, over what it has.
fn more(z: f64) -> f64 {
    (DEGREES + z * z) / (DEGREES + 1.0) - 1.0
}

/// Gives every window its burst of samples where the whitened residual is out of the ordinary; whether there is any.
fn burst_each(loudness: &mut Loudness, whitened: &[f64], noise: &AxisNoise, schedule: &Schedule) -> bool {
    let out: Vec<usize> = (0..whitened.len()).filter(|i| whitened[*i].abs() > OUT).collect();
    if out.is_empty() {
        return false;
    }
    let whitener = Whitener::new(noise, schedule, loudness);
    for i in out {
        loudness.burst[i] += more(whitened[i]) / whitener.new_share(i, noise, schedule, loudness);
    }
    true
}

/// Gives windows their bursts where the whitened residual is out of the ordinary, but for those that the filter may put out for the sake of one
/// before; whether there are any new ones.
///
/// A burst is in the samples that are new to a window, and in the next window as much. One that is in a window alone, since the trimmed mean
/// of the next threw it out, or by another share in the next, is of the window itself: as a burst of samples it would be looked for in the next
/// one, and what that lacks of it in the one after, and so on.
fn weigh_less(loudness: &mut Loudness, whitened: &[f64], noise: &AxisNoise, schedule: &Schedule) -> bool {
    let shares = |i: usize| i < schedule.len() && schedule.shares_of_samples(i)[1] > 0.0;
    let is_out = |i: &usize| whitened[*i].abs() > OUT;
    let mut out: Vec<usize> = Vec::new();
    for i in (0..whitened.len()).filter(is_out) {
        // What the filter looks for in vain comes in turns of sign; a gap ends it.
        let is_echo = |before: &usize| {
            let turned = if (i - before).is_multiple_of(2) { 1.0 } else { -1.0 };
            i - before < REACH && turned * whitened[i] * whitened[*before] > 0.0 && (before + 1..=i).all(shares)
        };
        if !out.last().is_some_and(is_echo) {
            out.push(i);
        }
    }
    if out.is_empty() {
        return false;
    }
    let whitener = Whitener::new(noise, schedule, loudness);
    let was_odd: Vec<bool> = (0..whitened.len()).map(|i| loudness.is_odd(i)).collect();
    for i in out {
        let z = whitened[i];
        let of_new = more(z) / whitener.new_share(i, noise, schedule, loudness);
        let own = schedule.shares_of_samples(i)[0].powi(2);
        // The filter expects of the next window what was in this one.
        let contradicted = shares(i + 1) && z * whitened[i + 1] < 0.0 && whitened[i + 1].abs() > CONTRADICTED;
        let contradicts = shares(i) && was_odd[i - 1];
        if contradicts && loudness.burst[i - 1] > 1.0 {
            loudness.alone[i - 1] += schedule.shares_of_samples(i - 1)[0].powi(2) * (loudness.burst[i - 1] - 1.0);
            loudness.burst[i - 1] = 1.0;
        }
        if contradicted || contradicts {
            loudness.alone[i] += own * of_new;
        } else {
            // All of it in the samples that are new to the window.
            loudness.burst[i] += of_new;
        }
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

    /// A window that is off for itself, and one of which the next has a third: neither runs on.
    #[test]
    fn what_is_in_one_window_alone_is_of_that_window() {
        for shared in [0.0, 0.3] {
            let (schedule, mut loudness, mut x) = record(&[]);
            for i in [500, 1700, 3100] {
                x[i] += 1500.0;
                x[i + 1] += shared * 1500.0;
            }
            let whitened = |loudness: &Loudness| Whitener::new(&NOISE, &schedule, loudness).whiten(&x);
            let mut left = whitened(&loudness);
            for _ in 0..LOOKS {
                if !weigh_less(&mut loudness, &left, &NOISE, &schedule) {
                    break;
                }
                left = whitened(&loudness);
            }
            let odd: Vec<usize> = (0..schedule.len()).filter(|i| loudness.is_odd(*i)).collect();
            assert!(
                odd.len() <= 6 && odd.iter().all(|i| [500, 501, 1700, 1701, 3100, 3101].contains(i)),
                "{shared}: {odd:?}"
            );
            assert!(left.iter().all(|w| w.abs() < OUT));
        }
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
