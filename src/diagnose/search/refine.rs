//! The nonlinear parameters of a set: their best values; and where columns that are only nearly linear are taken.

use super::peaks::Peak;
use super::volume::volume;
use super::{Entry, Member, Set, Whitened, point_at, whiten, whiten_all};
use crate::diagnose::case::HALF_WINDOW_S;
use crate::diagnose::catalogue::{ONSET, Shape, Theta};
use crate::diagnose::design::{Chosen, Frame};
use crate::diagnose::optimise::nelder_mead;
use crate::diagnose::scene::Scene;

/// Refine the nonlinear parameters of a set at one noise, and weigh it with the volume of their posterior.
pub fn refine(scene: &Scene, frame: &Frame, entries: &[Entry], set: &mut Set) {
    for i in 0..set.members.len() {
        let entry = &entries[set.members[i].entry];
        let Some(effect) = entry.effect() else { continue };
        if let Some(exact_at) = effect.exact_at {
            follow(scene, frame, entries, set, i, exact_at);
            continue;
        }
        let free: Vec<usize> = (0..effect.nonlinear.len()).filter(|j| effect.nonlinear[*j].step > 0.0).collect();
        if free.is_empty() {
            continue;
        }
        let others = set.without(i);
        let chosen = others.chosen(frame);
        let theta = set.members[i].theta;
        let scale = set.members[i].scale;
        let gain = |theta: &Theta| -> f64 {
            let Some(shape) = (effect.signature)(scene, theta) else { return f64::NEG_INFINITY };
            let point = whiten(frame, *theta, &shape, entry, scale);
            let normal = chosen.normal(&point.columns);
            if point.fixed { normal.gain_at_one() } else { normal.gain(1.0) }
        };
        let start: Vec<f64> = free.iter().map(|j| theta[*j]).collect();
        let steps: Vec<f64> = free.iter().map(|j| effect.nonlinear[*j].step).collect();
        let place = |p: &[f64]| {
            let mut t = theta;
            free.iter().zip(p).for_each(|(j, x)| t[*j] = *x);
            t
        };
        let from = |start: &[f64], steps: &[f64]| nelder_mead(start, steps, 60, |p| -gain(&place(p)));
        let refined = from(&start, &steps);
        // What begins in a hole of the record is the same wherever it does; downhill from there nobody comes to its near side.
        let mut beyond_holes = Vec::new();
        if let Some(j) = free.iter().position(|j| effect.nonlinear[*j].name == ONSET.name) {
            for before_s in before_holes(scene.clock_s(), refined[j]) {
                let (mut start, mut steps) = (refined.clone(), steps.clone());
                (start[j], steps[j]) = (before_s, HALF_WINDOW_S);
                beyond_holes.push(place(&from(&start, &steps)));
            }
        }
        let atom = entry.atom();
        let known = [Some(theta), Some(place(&refined)), atom].into_iter().flatten();
        let places = known.chain(beyond_holes).map(|theta| (gain(&theta), theta));
        let best = places.filter(|(gain, _)| gain.is_finite()).max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((peak, theta)) = best else { continue };
        let (log_share, sigma) = volume(&gain, &theta, &free, effect, (effect.log_density)(scene, &theta), peak);
        let mut told = Peak { theta, gain: peak, log_share, sigma };
        if let Some(atom) = atom {
            told = told.among(&atom, &starts(frame, entry, &chosen, scale));
        }
        if let Some(point) = point_at(scene, frame, entry, &set.members[i], &told.theta) {
            let m = &mut set.members[i];
            let log_occam = told.log_share + entry.log_share_of(scale);
            (m.theta, m.log_occam, m.theta_sigma, m.point) = (told.theta, log_occam, told.sigma, point);
        }
    }
    set.weigh(frame, entries);
}

/// Without a window for so long the record has a hole, s; and how far from one an onset may have been drawn into it.
const HOLE_S: f64 = 120.0;
const NEAR_S: f64 = 1800.0;

/// Onsets just before the holes that are near one: of the last window before a hole half is behind it.
fn before_holes(clock_s: &[f64], onset_s: f64) -> Vec<f64> {
    let from = clock_s.partition_point(|t| *t < onset_s - NEAR_S);
    let to = clock_s.partition_point(|t| *t < onset_s + NEAR_S);
    let steps = clock_s[from..(to + 1).min(clock_s.len())].windows(2);
    steps.filter(|step| step[1] - step[0] > HOLE_S).map(|step| step[0]).collect()
}

/// What the starting points of an entry explain beside a chosen set.
fn starts(frame: &Frame, entry: &Entry, chosen: &Chosen, scale: f64) -> Vec<Peak> {
    let points: Vec<(Theta, &Shape, &Entry)> =
        entry.points.iter().map(|(theta, shape)| (*theta, shape, entry)).collect();
    let start =
        |(point, share): (&Whitened, &f64)| Peak::start(point.theta, chosen.normal(&point.columns).gain(scale), *share);
    whiten_all(frame, &points).iter().zip(&entry.log_shares).map(start).collect()
}

/// Times the columns of a member are taken anew at most, the first ones without half of the way back, which ends a swing between
/// two points; and the change of their point that is none, of its prior size.
const FOLLOWED: usize = 6;
const FREE: usize = 2;
const ARRIVED: f64 = 0.02;

/// Takes the columns of member `i` where they are exact at the coefficients fitted, whether or not others explain more: those are not
/// the effect.
fn follow(scene: &Scene, frame: &Frame, entries: &[Entry], set: &mut Set, i: usize, exact_at: fn(&[f64]) -> Theta) {
    let entry = &entries[set.members[i].entry];
    set.members[i].log_occam = entry.log_share_of(set.members[i].scale);
    set.weigh(frame, entries);
    for round in 0..FOLLOWED {
        let first: usize = set.members[..i].iter().map(Member::linear).sum();
        let m = &set.members[i];
        let mut theta = exact_at(&set.coefficients(frame, entries).0.as_slice()[first..first + m.linear()]);
        if round >= FREE {
            theta = std::array::from_fn(|j| 0.5 * (theta[j] + m.theta[j]));
        }
        let moved = theta.iter().zip(&m.theta).zip(&entry.sizes).any(|((a, b), size)| (a - b).abs() > ARRIVED * size);
        let Some(point) = point_at(scene, frame, entry, m, &theta).filter(|_| moved) else { return };
        (set.members[i].theta, set.members[i].point) = (theta, point);
        set.weigh(frame, entries);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_onset_is_tried_before_the_holes_that_are_near_it_alone() {
        let clock_s: Vec<f64> =
            (0..400).map(|i| 25.0 * f64::from(i)).filter(|t| !(2000.0..3000.0).contains(t) && *t != 5000.0).collect();
        assert_eq!(before_holes(&clock_s, 3000.0), [1975.0]);
        assert_eq!(before_holes(&clock_s, 1500.0), [1975.0]);
        assert_eq!(before_holes(&clock_s, 6000.0), [0.0; 0]);
        assert_eq!(before_holes(&clock_s, 1e6), [0.0; 0]);
        assert_eq!(before_holes(&[], 0.0), [0.0; 0]);
    }
}
