//! What the positions themselves say of their error: how much they scatter from one to the next, and which single ones the fitted orbit and
//! their neighbours contradict. Beside an orbit what is left is smooth, whatever the model
//! lacks, so that decimetres show which the positions themselves hide between a quarter of an hour and the next.

use nalgebra::Vector3;

use super::finer::fullest;
use super::search::Problem;
use crate::diagnose::measured::spread::median;
use crate::physics::earth_orientation::lagrange_weights;

/// Standard errors of a position that a blunder is off the polynomial through its neighbours.
const TIMES: f64 = 12.0;
/// Neighbours on either side.
const SIDE: usize = 4;
/// Usual steps within which a position is a neighbour.
const NEAR_STEPS: f64 = 5.5;
/// Error of what an epoch is off the polynomial through four even neighbours on either side, over that of a position.
const IN_THE_MIDDLE: f64 = 1.63;
/// Times the stated accuracy from which on the scatter that positions show is believed instead.
const BELIEVED: f64 = 1.5;
/// White noise scatters about polynomials through six neighbours and through eight by the same error, but for this factor; what is smooth does
/// not.
const ALIKE: f64 = 1.2;
/// Fewest positions that say what they scatter by: to a tenth.
const FEWEST: usize = 60;
/// Median length of a vector of three normal deviates.
const MEDIAN_LENGTH: f64 = 1.538;

/// Takes the positions' own scatter for their accuracy where it is more than stated, and leaves blunders out of all arcs, counted as masked.
pub fn leave_out(problem: &mut Problem) {
    let model = fullest();
    let fit = |problem: &Problem, i: usize| {
        problem.arcs[i].fit(&problem.environment, &model, &model.estimated, &[], None).residuals_m
    };
    let left: Vec<Vec<Vector3<f64>>> = (0..problem.arcs.len()).map(|i| fit(problem, i)).collect();
    let of_arcs = problem.arcs.iter().zip(&left).map(|(arc, left)| (arc.t_s.as_slice(), left.as_slice()));
    problem.scatter_m = scatter_m(of_arcs);
    if let Some(sigma_m) = problem.scatter_m.filter(|sigma_m| *sigma_m > BELIEVED * problem.sigma_m) {
        problem.sigma_m = sigma_m;
    }
    let least_m = TIMES * 3f64.sqrt() * problem.sigma_m;
    for (i, left) in left.iter().enumerate() {
        let out = found(&problem.arcs[i].t_s, left, least_m);
        if !out.is_empty() {
            problem.arcs[i].leave_out(&out);
        }
    }
}

/// Error of a coordinate by what positions are off the polynomials through their neighbours, m; none where that is not noise, or there are
/// too few.
fn scatter_m<'a>(arcs: impl Iterator<Item = (&'a [f64], &'a [Vector3<f64>])>) -> Option<f64> {
    let mut misses: [Vec<f64>; 2] = [Vec::new(), Vec::new()];
    for (t_s, left_m) in arcs {
        let usual_s = median(t_s.windows(2).map(|pair| pair[1] - pair[0]));
        for i in SIDE..left_m.len().saturating_sub(SIDE) {
            let is_even = (1..=SIDE).all(|k| {
                [t_s[i + k] - t_s[i], t_s[i] - t_s[i - k]].iter().all(|s| (s - k as f64 * usual_s).abs() < 0.5)
            });
            for (side, misses) in [SIDE - 1, SIDE].into_iter().zip(&mut misses).filter(|_| is_even) {
                let near: Vec<usize> = (i - side..=i + side).filter(|j| *j != i).collect();
                let [off_m, error] = off_polynomial(t_s, left_m, i, &near);
                misses.push(off_m / error / MEDIAN_LENGTH);
            }
        }
    }
    if misses[0].len() < FEWEST {
        return None;
    }
    let [fewer, more] = misses.map(median);
    (fewer < ALIKE * more && more < ALIKE * fewer).then_some(more)
}

/// Epochs of what is left of an arc that are off by more than so much, each alone: without it nothing about it is. A step of velocity is a
/// bend, and what is beside it is off without it as well.
fn found(t_s: &[f64], left: &[Vector3<f64>], least_m: f64) -> Vec<usize> {
    let usual_s = median(t_s.windows(2).map(|pair| pair[1] - pair[0]));
    let miss = |i: usize, without: Option<usize>| miss(t_s, left, (i, without), usual_s).unwrap_or(0.0);
    let around = |i: usize| (i.saturating_sub(SIDE)..(i + SIDE + 1).min(left.len())).filter(move |j| *j != i);
    let is_alone = |i: &usize| miss(*i, None) > least_m && around(*i).all(|j| miss(j, Some(*i)) <= least_m);
    let alone: Vec<usize> = (0..left.len()).filter(is_alone).collect();
    // Near an end one without its neighbour may be told by too little.
    let is_worst = |i: &usize| around(*i).all(|j| !alone.contains(&j) || miss(j, None) <= miss(*i, None));
    alone.iter().copied().filter(is_worst).collect()
}

/// What an epoch is off the polynomial through its neighbours, m: by as much less as the polynomial is worse known than in the middle of all of
/// them, near an end or a hole. None where there are too few.
fn miss(t_s: &[f64], left_m: &[Vector3<f64>], (i, without): (usize, Option<usize>), usual_s: f64) -> Option<f64> {
    let is_near = |j: &usize| Some(*j) != without && (t_s[*j] - t_s[i]).abs() < NEAR_STEPS * usual_s;
    let before: Vec<usize> = (0..i).rev().take(SIDE + 1).filter(is_near).take(SIDE).collect();
    let after: Vec<usize> = (i + 1..left_m.len()).take(SIDE + 1).filter(is_near).take(SIDE).collect();
    if before.len().max(after.len()) < SIDE {
        return None;
    }
    let around = [before, after].concat();
    let [off_m, error] = off_polynomial(t_s, left_m, i, &around);
    Some(off_m * (IN_THE_MIDDLE / error).min(1.0))
}

/// What an epoch is off the polynomial through some others, m, and the error of that over the error of a position.
fn off_polynomial(t_s: &[f64], left_m: &[Vector3<f64>], i: usize, others: &[usize]) -> [f64; 2] {
    let nodes: Vec<f64> = others.iter().map(|j| t_s[*j] - t_s[i]).collect();
    let weights = lagrange_weights(&nodes, 0.0);
    let through: Vector3<f64> = others.iter().zip(&weights).map(|(j, w)| left_m[*j] * *w).sum();
    let error = (1.0 + weights.iter().map(|w| w * w).sum::<f64>()).sqrt();
    [(through - left_m[i]).norm(), error]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise is found beside what comes and goes in hours; that alone is none.
    #[test]
    fn scatter_is_that_of_the_noise_and_what_is_smooth_has_none() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(11);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let t_s: Vec<f64> = (0..192).map(|i| 900.0 * f64::from(i)).collect();
        let smooth = |t: f64, m: f64| Vector3::new((t / 6800.0).sin(), (t / 9000.0).cos(), 0.0) * m;
        let mut made = |sigma_m: f64, m: f64| -> Vec<Vector3<f64>> {
            t_s.iter().map(|t| smooth(*t, m) + Vector3::new(normal(), normal(), normal()) * sigma_m).collect()
        };
        let noisy = made(0.1, 3.0);
        let found = scatter_m(std::iter::once((t_s.as_slice(), noisy.as_slice()))).expect("white");
        assert!((found / 0.1 - 1.0).abs() < 0.15, "{found}");
        let bare = made(0.0, 3.0);
        assert_eq!(scatter_m(std::iter::once((t_s.as_slice(), bare.as_slice()))), None);
    }

    /// What is left of a missing pull, metres that come and go, with one position off by half a metre; and a bend.
    #[test]
    fn a_position_that_is_off_alone_is_a_blunder_and_a_bend_is_none() {
        let t_s: Vec<f64> = (0..96).map(|i| 900.0 * f64::from(i)).collect();
        let smooth = |t: f64| Vector3::new(3.0 * (t / 6800.0).sin(), (t / 9000.0).cos(), 2e-4 * t);
        let off = |at: usize, m: f64| -> Vec<Vector3<f64>> {
            t_s.iter().enumerate().map(|(i, t)| smooth(*t) + Vector3::x() * if i == at { m } else { 0.0 }).collect()
        };
        let in_a_hole = |mut left: Vec<Vector3<f64>>| {
            let mut t_s = t_s.clone();
            t_s.drain(50..60);
            left.drain(50..60);
            super::found(&t_s, &left, 0.3)
        };
        assert!(in_a_hole(off(40, 0.0)).is_empty());
        for at in [46, 49, 60, 62] {
            assert_eq!(in_a_hole(off(at, 3.0)), [if at < 50 { at } else { at - 10 }]);
        }
        let found = |left: Vec<Vector3<f64>>| found(&t_s, &left, 0.3);
        assert!(found(off(40, 0.0)).is_empty());
        assert_eq!(found(off(40, 0.8)), [40]);
        // At the ends less is known of where it should be.
        for at in [0, 1, 2, 3, 4, 91, 92, 93, 94, 95] {
            assert_eq!(found(off(at, 3.0)), [at]);
        }
        let bent = t_s.iter().map(|t| smooth(*t) + Vector3::y() * 2e-3 * (t - 36_300.0).max(0.0)).collect();
        assert!(found(bent).is_empty());
    }
}
