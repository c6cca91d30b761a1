//! Spectra of the parts of a record under a taper that decays as what is looked for does, and what most of them say of the noise.
//!
//! Noise that resonates oscillates too, and may be louder at one period than at those about it; but it does so in every part of the record
//! alike. So what oscillates in some parts is measured by what most others have at the same period, whatever the spectrum.

use std::ops::Range;
use std::sync::Arc;

use rustfft::{Fft, FftPlanner};

use super::grid::{Grid, Tapered};
use super::line::{LINE_S, tail};
use super::{Remains, mostly, sharing};
use crate::diagnose::answer::Interval;
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::math::shared_work;

/// Times, in half windows, in which what is looked for decays: 7 min to 3.6 h.
const DECAYS: [usize; 6] = [16, 32, 64, 128, 256, 512];
/// Decay times that a part is long, and parts that begin in a decay time.
pub(super) const LENGTH: usize = 4;
pub(super) const STEPS: usize = 4;
/// Decay times after which a part has nothing of another.
pub(super) const APART: usize = 2;
/// Shortest period that is looked for, s, and longest: below that of the orbit, which any effect leaves in one attitude and not in another.
/// Half an oscillation at least fits in a decay time.
const PERIODS_S: [f64; 2] = [LINE_S, 4000.0];
/// Share of a part's weight that must have been recorded, for its lines to be as narrow as those of the others.
const RECORDED: f64 = 0.5;
/// Share of the parts, the least loud, that say how loud the noise is: what rings several times may fill a quarter of the record.
const LEAST_LOUD: f64 = 0.75;
/// Fewest of those that are independent, which begin a decay time after one another: of fewer, nothing that happens is improbable enough.
const SURE: f64 = 3.0;

/// What an oscillation is measured by.
#[derive(Clone, Copy)]
pub(super) enum Beside {
    /// White noise.
    White,
    /// What most parts of the record have at its period, the noise of each axis forgetting its phase in so many seconds.
    Usual { memory_s: [f64; 3] },
}

/// Parts of a record, under a taper of one decay time.
pub(super) struct Parts<'a> {
    grid: &'a Grid,
    /// In half windows.
    pub decay: usize,
    taper: Vec<f64>,
    transform: Arc<dyn Fft<f64>>,
    /// Lines of their spectra that are looked at.
    pub lines: Range<usize>,
    /// All over the record.
    pub all: Vec<Tapered>,
}

/// Parts of a record, under tapers of all decay times.
pub(super) fn of_all_decays(grid: &Grid) -> Vec<Parts<'_>> {
    shared_work::map(&DECAYS, |decay| Parts::new(grid, *decay))
}

impl<'a> Parts<'a> {
    /// Of a decay time in half windows.
    fn new(grid: &'a Grid, decay: usize) -> Self {
        let length = LENGTH * decay;
        let taper: Vec<f64> = (0..length).map(|i| (-(i as f64) / decay as f64).exp()).collect();
        // A grid longer than the part, so that no oscillation falls between two lines.
        let transform = FftPlanner::new().plan_fft_forward(2 * length);
        let [last, first] = PERIODS_S.map(|period| ((2 * length) as f64 * WINDOW_STRIDE_S / period) as usize);
        let mut parts = Self { grid, decay, taper, transform, lines: first.max(LENGTH)..last + 1, all: Vec::new() };
        let begins = (0..=grid.record as usize).step_by(decay / STEPS);
        parts.all = begins.filter_map(|from| parts.at(from)).collect();
        parts
    }

    /// The part that begins at a place; `None` where too little of it was recorded.
    pub fn at(&self, from: usize) -> Option<Tapered> {
        let part = self.grid.tapered(from, &self.taper, &*self.transform, self.lines.clone());
        part.filter(|part| part.recorded > RECORDED)
    }

    pub fn decay_s(&self) -> f64 {
        self.decay as f64 * WINDOW_STRIDE_S
    }

    /// Period of a line, the first of those looked at or a later one.
    pub fn period_s(&self, i: usize) -> f64 {
        self.transform.len() as f64 * WINDOW_STRIDE_S / (self.lines.start + i) as f64
    }

    /// How many independent ones the least loud of so many others are as sure as; `None` where they are too few.
    pub fn sure_as(others: usize) -> Option<f64> {
        let independent = LEAST_LOUD * others as f64 / STEPS as f64;
        (independent >= SURE).then_some(independent)
    }

    /// An oscillation in a line, the first of those looked at or a later one: its power on each axis, and that beside white noise as loud as
    /// there. `others` are without it, and so sure.
    pub fn oscillation(
        &self,
        i: usize,
        (power, alone): ([f64; 3], [f64; 3]),
        (others, sure_as): (&[&Tapered], f64),
        noise: Beside,
    ) -> Oscillation {
        let (beside, log_tail) = match noise {
            Beside::White => (alone, -alone.iter().sum::<f64>()),
            Beside::Usual { memory_s } => {
                let usual = |k: usize| mean(others.iter().map(|part| part.power(k, i)).collect());
                let beside: [f64; 3] = std::array::from_fn(|k| alone[k] / usual(k));
                // An exponential number beside the mean of others, of which none is independent while the noise still knows its phase: an F
                // distribution with two degrees and twice as many as are.
                let as_sure_as = memory_s.map(|m| sure_as * self.decay_s() / (self.decay_s() + m));
                let log_tail = |k: usize| -as_sure_as[k] * (beside[k] / as_sure_as[k]).ln_1p();
                (beside, (0..3).map(log_tail).sum())
            }
        };
        Oscillation { log_tail, power, beside, period_s: self.period_s(i) }
    }
}

/// An oscillation: logarithm of its probability, all axes together, power on each, alone and beside the noise there, and period.
pub(super) struct Oscillation {
    pub log_tail: f64,
    power: [f64; 3],
    beside: [f64; 3],
    pub period_s: f64,
}

impl Oscillation {
    /// As what remains, of so many that were looked at.
    pub fn remains(
        &self,
        trials: usize,
        scale_ng: [f64; 3],
        (form, location): (String, String),
        intervals: Vec<Interval>,
    ) -> Remains {
        // Minus twice the logarithm of three probabilities: a chi square of six degrees (R. A. Fisher).
        let of_one = tail(6.0, -2.0 * self.log_tail);
        let amplitude: [f64; 3] = std::array::from_fn(|k| self.power[k].sqrt() * scale_ng[k]);
        Remains {
            probability: (of_one * trials as f64).min(1.0),
            energy: 2.0 * self.beside.iter().sum::<f64>(),
            form,
            axis: mostly(amplitude),
            axes: sharing(amplitude),
            location,
            intervals,
            period_s: Some(self.period_s),
        }
    }
}

/// Mean of exponential numbers from the least of them, the others being known to be no less: as sure as that of so many.
fn mean(mut all: Vec<f64>) -> f64 {
    all.sort_unstable_by(f64::total_cmp);
    let least = ((LEAST_LOUD * all.len() as f64) as usize).max(1);
    (all[..least].iter().sum::<f64>() + (all.len() - least) as f64 * all[least - 1]) / least as f64
}
