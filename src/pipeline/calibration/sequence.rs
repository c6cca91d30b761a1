//! The steps of the calibration sequences, cut out of the records: runs of seconds in one mode, target, step and range.

use std::cell::OnceCell;

use crate::math::robust::{TrimLaw, TrimmedMean, trimmed_mean_of};
use crate::pipeline::archive::{Archive, RECORD_TENTHS};
use crate::pipeline::window::Window;
use crate::telemetry::{AccRecord, Axis, Mode, Quality, Range, SAMPLES_PER_RECORD, Step};
use crate::units::Clock;

/// Two records of one step are no further apart than this, tenths of a second: lost seconds do not end a step.
const STEP_TENTHS_MAX: i64 = 500;
/// The next step of a sequence starts within this of the end of the one before, tenths of a second.
const NEXT_TENTHS_MAX: i64 = 600;

/// Seconds in which the table rests, or turns at its constant rate.
#[derive(Debug, Clone)]
pub struct Hold<'a> {
    /// Its seconds, in order.
    pub records: Vec<&'a AccRecord>,
    /// The estimates of its samples as they are, made once: every version of the calibration asks for them.
    plain: [OnceCell<Option<TrimmedMean>>; 3],
}

impl Hold<'_> {
    fn first(&self) -> &AccRecord {
        self.records[0]
    }

    /// Bias or scale calibration.
    pub fn mode(&self) -> Mode {
        self.first().mode
    }

    /// Step.
    pub fn step(&self) -> Step {
        self.first().step
    }

    /// Target.
    pub fn target(&self) -> u8 {
        self.first().target
    }

    /// Range of an axis, as reported.
    pub fn range(&self, axis: Axis) -> Range {
        self.first().ranges[axis.index()]
    }

    /// Clock of the first second.
    pub fn start(&self) -> Clock {
        self.first().clock
    }

    /// Clock of the last second: since then it can be known.
    pub fn last(&self) -> Clock {
        self.records[self.records.len() - 1].clock
    }

    /// Its middle, s.
    pub fn centre_s(&self) -> f64 {
        0.5 * (self.start().seconds() + self.last().plus_tenths(RECORD_TENTHS).seconds())
    }

    /// Mean sensor temperature, C.
    pub fn temperature_c(&self) -> f64 {
        self.records.iter().map(|r| f64::from(r.temperature_c)).sum::<f64>() / self.records.len() as f64
    }

    /// Samples of an axis that are not at the rail, each with its seconds since the start of the step.
    pub fn samples(&self, axis: Axis) -> impl Iterator<Item = (f64, i16)> + '_ {
        let start = self.start().tenths();
        self.records.iter().flat_map(move |record| {
            record.counts.iter().enumerate().filter_map(move |(n, sample)| {
                let count = sample[axis.index()];
                let tenths = record.clock.tenths() - start + n as i64;
                (!AccRecord::is_at_rail(count)).then_some((tenths as f64 / 10.0, count))
            })
        })
    }

    /// The adaptive trimmed mean of an axis after taking a transient away; None of fewer than `samples_min` samples.
    pub fn mean(
        &self,
        axis: Axis,
        law: &TrimLaw,
        samples_min: usize,
        transient: impl Fn(f64) -> f64,
    ) -> Option<TrimmedMean> {
        let counts: Vec<i16> =
            self.samples(axis).map(|(t_s, count)| (f64::from(count) - transient(t_s)).round() as i16).collect();
        if counts.len() < samples_min {
            return None;
        }
        trimmed_mean_of(counts, law)
    }

    /// As [`Hold::mean`], of the samples as they are. All calls must use the same law.
    pub fn plain_mean(&self, axis: Axis, law: &TrimLaw, samples_min: usize) -> Option<TrimmedMean> {
        let estimate = self.plain[axis.index()].get_or_init(|| self.mean(axis, law, 1, |_| 0.0));
        estimate.filter(|estimate| estimate.points >= samples_min)
    }

    /// Whether seconds or samples are missing that the step should have.
    pub fn is_cut(&self, seconds: usize) -> bool {
        self.records.len() < seconds || self.records.len() * SAMPLES_PER_RECORD < seconds * SAMPLES_PER_RECORD
    }
}

/// All holds in the archive in order of time. Only windows in which the table was at work are looked at.
pub fn holds<'a>(archive: &'a Archive, windows: &std::collections::BTreeMap<i64, Window>) -> Vec<Hold<'a>> {
    let mut cells: Vec<i64> = windows
        .iter()
        .filter(|(_, window)| window.quality.contains(Quality::TABLE_MOVING))
        .flat_map(|(cell, _)| [*cell, *cell + 1])
        .collect();
    cells.sort_unstable();
    cells.dedup();
    let mut holds: Vec<Hold<'a>> = Vec::new();
    let mut open = false;
    for record in cells.into_iter().flat_map(|cell| archive.cell(cell)) {
        let still = matches!(record.mode, Mode::Bias | Mode::Scale)
            && !matches!(record.step, Step::None | Step::Moving)
            && (!record.table_moving || record.step == Step::Rate);
        if !still {
            open = false;
            continue;
        }
        match holds.last_mut() {
            Some(hold) if open && continues(hold, record) => hold.records.push(record),
            _ => holds.push(Hold { records: vec![record], plain: Default::default() }),
        }
        open = true;
    }
    holds
}

fn continues(hold: &Hold<'_>, record: &AccRecord) -> bool {
    let first = hold.first();
    first.mode == record.mode
        && first.step == record.step
        && first.target == record.target
        && first.ranges == record.ranges
        && record.clock.tenths() - first.clock.tenths() < STEP_TENTHS_MAX
}

/// The hold after `place`, when it is the given step of the same sequence.
pub fn next_step<'h, 'a>(holds: &'h [Hold<'a>], place: usize, step: Step) -> Option<&'h Hold<'a>> {
    let (this, next) = (&holds[place], holds.get(place + 1)?);
    let same = next.step() == step
        && next.mode() == this.mode()
        && next.target() == this.target()
        && next.first().ranges == this.first().ranges
        && next.start().tenths() - this.last().tenths() < NEXT_TENTHS_MAX;
    same.then_some(next)
}
