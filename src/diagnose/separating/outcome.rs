//! What could be done, and what its simulation shows.

use super::Rival;
use crate::diagnose::answer::SeparatingObservation;

/// Log evidence at which an observation decides: odds of twenty to one.
const DECISIVE: f64 = 3.0;
/// What a turn of the vehicle costs beside the hours, in hours.
const MANOEUVRE_COST_H: f64 = 3.0;

/// What could be done.
#[derive(Clone, Copy)]
pub(super) enum Action {
    Turn,
    Hold([f64; 3], &'static str),
    Freeze,
    /// An act that the log has, again and alone: of the kind, how long, s.
    Again(&'static str, f64),
    /// The sensor warmer by [`WARMER_C`], the attitude held as it is.
    Warm,
}

/// Acts of the log follow one another so, s: what remembers one for a while has an hour to forget it.
pub(super) const ACT_EVERY_S: f64 = 5400.0;
/// By how much a sensor is made warmer: the gain is told for so much.
pub(super) const WARMER_C: f64 = 2.0;

/// An action for so many hours.
#[derive(Clone, Copy)]
pub(super) struct Candidate {
    pub(super) action: Action,
    pub(super) hours: f64,
}

impl Candidate {
    /// Acts of the log in it.
    pub(super) fn acts(&self) -> usize {
        (self.hours * 3600.0 / ACT_EVERY_S).round().max(1.0) as usize
    }

    /// What it costs, in hours.
    pub(super) fn cost_h(&self) -> f64 {
        self.hours + if matches!(self.action, Action::Turn) { 0.0 } else { MANOEUVRE_COST_H }
    }
}

/// What the simulation of a candidate shows of two sets.
pub(super) struct Pair {
    pub(super) sets: [usize; 2],
    /// Log evidence that the true one is expected to gain on the other, whichever it is.
    pub(super) gain: f64,
    /// How far they then differ from what they agree on now, ng rms.
    pub(super) differ_ng: [f64; 3],
}

/// What the simulation of a candidate shows.
pub(super) struct Outcome {
    pub(super) candidate: Candidate,
    pub(super) pairs: Vec<Pair>,
}

impl Outcome {
    /// How many pairs it decides.
    pub(super) fn parted(&self) -> usize {
        self.pairs.iter().filter(|pair| pair.gain >= DECISIVE).count()
    }

    /// The least decided of the pairs that it decides, or the most of those that it does not.
    pub(super) fn telling(&self) -> Option<&Pair> {
        let decided = self.pairs.iter().filter(|pair| pair.gain >= DECISIVE);
        let by_gain = |a: &&Pair, b: &&Pair| a.gain.total_cmp(&b.gain);
        decided.min_by(by_gain).or_else(|| self.pairs.iter().max_by(by_gain))
    }

    pub(super) fn gain(&self) -> f64 {
        self.telling().map_or(0.0, |pair| pair.gain)
    }

    /// Whether it is to be preferred to another that costs no more.
    pub(super) fn beats(&self, cheaper: &Outcome) -> bool {
        let (mine, its) = (self.parted(), cheaper.parted());
        let as_cheap = self.candidate.cost_h() == cheaper.candidate.cost_h();
        mine > its || (mine == its && (as_cheap || its == 0) && self.gain() > cheaper.gain())
    }

    /// Sets that it leaves together, of all of them.
    pub(super) fn together(&self, sets: usize) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = (0..sets).map(|set| vec![set]).collect();
        for pair in self.pairs.iter().filter(|pair| pair.gain < DECISIVE) {
            let [a, b] = pair.sets.map(|set| groups.iter().position(|group| group.contains(&set)));
            let (Some(a), Some(b)) = (a, b) else { continue };
            if a != b {
                let joined = groups.swap_remove(a.max(b));
                groups[a.min(b)].extend(joined);
            }
        }
        groups.iter_mut().for_each(|group| group.sort_unstable());
        groups.sort();
        groups
    }

    pub(super) fn told(&self, rivals: &[Rival]) -> SeparatingObservation {
        let differ_ng = self.telling().map_or([0.0; 3], |pair| pair.differ_ng);
        let [x, y, z] = differ_ng.map(|ng| format!("{ng:.0}"));
        let (kind, what) = match self.candidate.action {
            Action::Turn => (
                "table_flip",
                "Measure with the sensor's table turned by 180 degrees, the attitude held as it is,".to_string(),
            ),
            Action::Hold([roll, pitch, yaw], words) => (
                "attitude",
                format!("Hold {words} (local vertical, roll {roll:.0}, pitch {pitch:.0}, yaw {yaw:.0} degrees)"),
            ),
            Action::Freeze => ("attitude", "Hold the present attitude fixed to the stars".to_string()),
            Action::Again(kind, duration_s) => (
                "log",
                format!(
                    "Have {} of kind {kind}, of {duration_s:.0} s, and no other act of the log within half an hour of it, the attitude held \
                     as it is,",
                    match self.candidate.acts() {
                        1 => "one act".to_string(),
                        n => format!("{n} acts"),
                    }
                ),
            ),
            Action::Warm => ("temperature", format!("Warm the sensor by {WARMER_C:.0} C, the attitude held as it is,")),
        };
        let gain = self.gain();
        let named = |set: &usize| {
            rivals[*set].iter().map(|part| part.effect.id.replace('_', " ")).collect::<Vec<_>>().join(" with ")
        };
        let groups: Vec<String> = self
            .together(rivals.len())
            .iter()
            .map(|group| group.iter().map(named).collect::<Vec<_>>().join(" or "))
            .collect();
        let verdict = match groups.as_slice() {
            [_] => " That does not decide; nothing flown here does.".to_string(),
            all if all.len() == rivals.len() => String::new(),
            some => format!(" It tells {}; nothing flown here tells all apart.", some.join(" from ")),
        };
        let text = format!(
            "{what} for {} h: the sets then differ by {x}, {y} and {z} ng rms along X, Y, Z from what they agree on now, and the true \
             one is expected to gain {gain:.1} in log evidence on its nearest rival.{verdict}",
            self.candidate.hours
        );
        SeparatingObservation { kind: kind.into(), text, gain: Some(round(gain)) }
    }
}

pub(super) fn round(x: f64) -> f64 {
    (x * 100.0).round() / 100.0
}
