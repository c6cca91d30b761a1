//! Single positions that the fitted orbit and their neighbours contradict. Beside an orbit what is left is smooth, whatever the model
//! lacks, so that decimetres show which the positions themselves hide between a quarter of an hour and the next.

use nalgebra::Vector3;

use super::finer::fullest;
use super::search::Problem;
use crate::physics::earth_orientation::lagrange_weights;

/// Standard errors of a position that a blunder is off the polynomial through its neighbours.
const TIMES: f64 = 12.0;
/// Neighbours on either side.
const SIDE: usize = 4;

/// Leaves blunders out of all arcs, and counts them as masked.
pub fn leave_out(problem: &mut Problem) {
    let model = fullest();
    let least_m = TIMES * 3f64.sqrt() * problem.sigma_m;
    for i in 0..problem.arcs.len() {
        let fit = problem.arcs[i].fit(&problem.environment, &model, &model.estimated, &[], None);
        let out = found(&problem.arcs[i].t_s, &fit.residuals_m, least_m);
        if !out.is_empty() {
            problem.arcs[i].leave_out(&out);
        }
    }
}

/// Epochs of what is left of an arc that are off by more than so much, each alone.
fn found(t_s: &[f64], left: &[Vector3<f64>], least_m: f64) -> Vec<usize> {
    let miss = |i: usize, without: Option<usize>| miss(t_s, left, i, without);
    let misses: Vec<f64> = (0..left.len()).map(|i| miss(i, None).unwrap_or(0.0)).collect();
    let around = |i: usize| (i.saturating_sub(SIDE)..(i + SIDE + 1).min(left.len())).filter(move |j| *j != i);
    let is_worst = |i: usize| misses[i] > least_m && around(i).all(|j| misses[j] <= misses[i]);
    // A step of velocity is a bend: its neighbours contradict each other without it as well.
    let is_alone = |i: usize| around(i).all(|j| miss(j, Some(i)).is_none_or(|miss_m| miss_m <= least_m));
    (0..left.len()).filter(|i| is_worst(*i) && is_alone(*i)).collect()
}

/// What an epoch is off the polynomial through its neighbours, m; none near an end.
fn miss(t_s: &[f64], left_m: &[Vector3<f64>], i: usize, without: Option<usize>) -> Option<f64> {
    let other = |j: &usize| Some(*j) != without;
    let before: Vec<usize> = (0..i).rev().filter(other).take(SIDE).collect();
    let after: Vec<usize> = (i + 1..left_m.len()).filter(other).take(SIDE).collect();
    if before.len() < SIDE || after.len() < SIDE {
        return None;
    }
    let around = [before, after].concat();
    let nodes: Vec<f64> = around.iter().map(|j| t_s[*j] - t_s[i]).collect();
    let weights = lagrange_weights(&nodes, 0.0);
    let through: Vector3<f64> = around.iter().zip(&weights).map(|(j, w)| left_m[*j] * *w).sum();
    Some((through - left_m[i]).norm())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left of a missing pull, metres that come and go, with one position off by half a metre; and a bend.
    #[test]
    fn a_position_that_is_off_alone_is_a_blunder_and_a_bend_is_none() {
        let t_s: Vec<f64> = (0..96).map(|i| 900.0 * f64::from(i)).collect();
        let smooth = |t: f64| Vector3::new(3.0 * (t / 6800.0).sin(), (t / 9000.0).cos(), 2e-4 * t);
        let off = |at: usize, m: f64| -> Vec<Vector3<f64>> {
            t_s.iter().enumerate().map(|(i, t)| smooth(*t) + Vector3::x() * if i == at { m } else { 0.0 }).collect()
        };
        let found = |left: Vec<Vector3<f64>>| found(&t_s, &left, 0.3);
        assert!(found(off(40, 0.0)).is_empty());
        assert_eq!(found(off(40, 0.8)), [40]);
        let bent = t_s.iter().map(|t| smooth(*t) + Vector3::y() * 2e-3 * (t - 36_300.0).max(0.0)).collect();
        assert!(found(bent).is_empty());
    }
}
