//! Sets grown in a beam: every entry at every point beside every set that may have it.

use super::{BEAM, Entry, FINALISTS, Family, Member, Seen, Set, distinct};
use crate::diagnose::catalogue::{Scale, Shape};
use crate::diagnose::design::{Choices, Chosen, Frame, Normal};
use crate::math::shared_work;

/// Points of an entry that are tried at once beside every set of a beam, while what they have in common is near at hand.
const POINTS_AT_ONCE: usize = 16;
/// Sizes of a smaller share of the prior than this are tried where the usual size gains at least so much: below it a size of eight times
/// the usual one costs more than it can gain.
const RARE: f64 = 0.1;
const LARGE_FROM: f64 = 10.0;

/// One way to add an entry to a set.
#[derive(Clone, Copy)]
struct Way {
    /// Log evidence gained.
    gain: f64,
    /// Log share of the prior.
    log_share: f64,
    point: usize,
    axis: Option<usize>,
    scale: f64,
}

/// The ways to add an entry at one of its points, from the normal equations there.
fn ways_at(entry: &Entry, point: usize, fixed: bool, normal: &Normal, ways: &mut Vec<Way>) {
    let all_axes = Way { gain: 0.0, log_share: entry.log_shares[point], point, axis: None, scale: 1.0 };
    if fixed {
        ways.push(Way { gain: normal.gain_at_one(), ..all_axes });
        return;
    }
    // An open form of one series acts on all axes or on one of them: a quarter each.
    let narrow = matches!((entry.family, &entry.points[0].1), (Family::Open(_), Shape::Scalar { .. }));
    let of_axes = if narrow { 4.0_f64 } else { 1.0 };
    let usual = normal.gain(1.0);
    for &Scale { factor: scale, share } in entry.scales() {
        if share < RARE && usual < LARGE_FROM {
            continue;
        }
        let log_share = entry.log_shares[point] + (share / of_axes).ln();
        ways.push(Way { gain: normal.gain(scale), log_share, scale, ..all_axes });
        if narrow {
            let on = |axis| Way { gain: normal.gain_of(axis, scale), log_share, point, axis: Some(axis), scale };
            ways.extend((0..3).map(on));
        }
    }
}

/// The best way to add one entry to a chosen set: the score gained with priors, and the member.
pub fn best_of_entry(seen: &Seen, index: usize, chosen: &Chosen) -> (f64, Member) {
    let entry = &seen.bank.entries[index];
    let mut ways: Vec<Way> = Vec::with_capacity(entry.points.len() * 8);
    for (i, (p, alone)) in seen.bank.points[index].iter().zip(&seen.alone[index]).enumerate() {
        ways_at(entry, i, p.fixed, &chosen.beside(&p.columns, alone), &mut ways);
    }
    best_way(seen, index, &ways)
}

/// The best of all the ways to add an entry: the score gained with priors, and the member.
fn best_way(seen: &Seen, index: usize, ways: &[Way]) -> (f64, Member) {
    let Some(&best) = ways.iter().max_by(|a, b| a.gain.total_cmp(&b.gain)) else {
        unreachable!("an entry has a point")
    };
    let Way { gain: top, axis, scale, .. } = best;
    let marginal = top + ways.iter().map(|w| (w.gain + w.log_share - top).exp()).sum::<f64>().ln();
    let mut point = seen.bank.points[index][best.point].clone();
    if let Some(axis) = axis {
        point.columns = vec![point.columns.swap_remove(axis)];
    }
    if !point.fixed {
        point.columns = point.columns.iter().map(|c| c.times(scale)).collect();
    }
    let theta_sigma = [0.0; 2];
    let member =
        Member { entry: index, axis, scale, theta: point.theta, log_occam: marginal - top, theta_sigma, point };
    (marginal + seen.bank.entries[index].log_prior, member)
}

/// Grow sets from `seeds` by one member each at a time, over the entries of `allowed`.
pub fn grow(frame: &Frame, seen: &Seen, allowed: &[usize], seeds: Vec<Set>, size_max: usize) -> Vec<Set> {
    let mut found: Vec<Set> = seeds.clone();
    let mut layer = seeds;
    for _ in 0..size_max {
        let beam = &layer[..BEAM.min(layer.len())];
        let mut next = grown(frame, seen, allowed, beam, size_max);
        distinct(&mut next);
        let best = found.iter().map(|s| s.score).fold(f64::NEG_INFINITY, f64::max);
        next.truncate(FINALISTS.max(BEAM) * 2);
        let alive = next.first().is_some_and(|s| s.score > best - 2.0);
        found.extend(next.iter().cloned());
        if !alive {
            break;
        }
        layer = next;
    }
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
    found
}

/// Every set of a beam with every entry of `allowed` that it may have, in that order.
fn grown(frame: &Frame, seen: &Seen, allowed: &[usize], beam: &[Set], size_max: usize) -> Vec<Set> {
    let choices = Choices::new(shared_work::map(beam, |set| set.chosen(frame)));
    let may_have =
        |set: &Set, index: usize| set.members.len() < size_max && set.members.iter().all(|m| m.entry != index);
    let tasks: Vec<(usize, usize)> = allowed
        .iter()
        .flat_map(|index| (0..seen.alone[*index].len()).step_by(POINTS_AT_ONCE).map(move |first| (*index, first)))
        .collect();
    let ways_of = |&(index, first): &(usize, usize)| -> Vec<Vec<Way>> {
        let which: Vec<usize> = (0..beam.len()).filter(|i| may_have(&beam[*i], index)).collect();
        let mut ways = vec![Vec::new(); beam.len()];
        let (points, alone) = (&seen.bank.points[index], &seen.alone[index]);
        for i in first..points.len().min(first + POINTS_AT_ONCE) {
            let normals = choices.beside(&which, &points[i].columns, &alone[i]);
            for (choice, normal) in which.iter().zip(&normals) {
                ways_at(&seen.bank.entries[index], i, points[i].fixed, normal, &mut ways[*choice]);
            }
        }
        ways
    };
    let ways = shared_work::map(&tasks, ways_of);
    let of_entries: Vec<&[(usize, usize)]> = tasks.chunk_by(|a, b| a.0 == b.0).collect();
    let mut sets = Vec::new();
    for (choice, set) in beam.iter().enumerate() {
        let mut next = 0;
        for tasks in &of_entries {
            let (index, all) = (tasks[0].0, &ways[next..next + tasks.len()]);
            next += tasks.len();
            if !may_have(set, index) {
                continue;
            }
            let all: Vec<Way> = all.iter().flat_map(|ways| ways[choice].iter().copied()).collect();
            let (gain, member) = best_way(seen, index, &all);
            sets.push(Set::clone(set).joined_by(member, gain));
        }
    }
    sets
}
