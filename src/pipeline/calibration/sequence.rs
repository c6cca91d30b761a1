//! The steps of the calibration sequences, cut out of the records: runs of seconds in one mode, target, step and range.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::math::robust::{TrimLaw, TrimmedMean, spread_counts, trimmed_mean_of_values};
use crate::pipeline::archive::{Archive, RECORD_TENTHS};
use crate::pipeline::window::{Windows, cells_of};
use crate::telemetry::{AccRecord, Axis, Mode, Quality, Range, Step};
use crate::units::Clock;

/// Two records of one step are no further apart than this, tenths of a second: lost seconds do not end a step.
const STEP_TENTHS_MAX: i64 = 500;
/// The next step of a sequence starts within this of the end of the one before, tenths of a second.
const NEXT_TENTHS_MAX: i64 = 600;

/// Length of a position of the two-position sequence, and of the turn before the second, tenths of a second.
pub const POSITION_TENTHS: i64 = 500;
const TURN_TENTHS: i64 = 250;

/// Seconds in which the table rests, or turns at its constant rate.
#[derive(Debug, Clone)]
pub struct Hold<'a> {
    /// Its seconds, in order.
    pub records: Vec<&'a AccRecord>,
    /// When the step began, where what is recorded tells, also of a step whose first seconds are lost.
    pub began: Option<Clock>,
    /// When it ended, where the second after it is recorded.
    pub ended: Option<Clock>,
    /// Hash of them.
    pub digest: u64,
    /// Adaptive trimmed means of the axes, counts spread over their width; None without a sample.
    pub means: Means,
}

/// Means of X, Y, Z.
pub type Means = [Option<TrimmedMean>; 3];

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

    /// Samples of an axis that are not at the rail, each with its tenths of a second since the start of the step, or since its first second
    /// where nothing tells that.
    pub fn samples(&self, axis: Axis) -> impl Iterator<Item = (u16, i16)> + '_ {
        let start = self.began.unwrap_or_else(|| self.start()).tenths();
        self.records.iter().flat_map(move |record| {
            record.counts.iter().enumerate().filter_map(move |(n, sample)| {
                let count = sample[axis.index()];
                let tenths = record.clock.tenths() - start + n as i64;
                (!AccRecord::is_at_rail(count)).then_some((tenths as u16, count))
            })
        })
    }

    /// The adaptive trimmed mean of an axis; None of fewer than `samples_min` samples.
    pub fn mean(&self, axis: Axis, samples_min: usize) -> Option<TrimmedMean> {
        self.means[axis.index()].filter(|mean| mean.points >= samples_min)
    }

    /// The same after taking a transient away, or nothing.
    pub fn mean_without(
        &self,
        axis: Axis,
        law: &TrimLaw,
        samples_min: usize,
        transient: Option<&dyn Fn(f64) -> f64>,
    ) -> Option<TrimmedMean> {
        let mut samples: Vec<(i16, u16)> = Vec::with_capacity(500);
        samples.extend(self.samples(axis).map(|(tenths, count)| (count, tenths)));
        if samples.len() < samples_min {
            return None;
        }
        samples.sort_unstable();
        let counts: Vec<i16> = samples.iter().map(|(count, _)| *count).collect();
        let mut values = spread_counts(&counts);
        if let Some(transient) = transient {
            let after = |tenths: u16| transient(f64::from(tenths) / 10.0);
            values.iter_mut().zip(&samples).for_each(|(value, (_, tenths))| *value -= after(*tenths));
            values.sort_unstable_by(f64::total_cmp);
        }
        trimmed_mean_of_values(&values, law)
    }

    fn digest(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.began.hash(&mut hasher);
        for record in &self.records {
            (record.clock, record.counts.as_flattened(), record.temperature_c.to_bits(), record.ranges, record.quiet)
                .hash(&mut hasher);
        }
        hasher.finish()
    }
}

/// All holds in the archive in order of time. Only windows in which the table was at work are looked at. `kept` holds means by
/// digest and saves their making.
pub fn holds<'a>(
    archive: &'a Archive,
    windows: &Windows,
    law: &TrimLaw,
    kept: Option<&HashMap<u64, Means>>,
) -> Vec<Hold<'a>> {
    let cells = cells_of(windows, |window| window.quality.contains(Quality::TABLE_MOVING));
    let mut holds: Vec<Hold<'a>> = Vec::new();
    let mut open = false;
    let mut before: Option<Clock> = None;
    for record in cells.flat_map(|cell| archive.cell(cell)) {
        let is_next = before.is_some_and(|clock| record.clock == clock.plus_tenths(RECORD_TENTHS));
        before = Some(record.clock);
        let of_a_hold = is_of_a_hold(record);
        match holds.last_mut() {
            Some(hold) if open && of_a_hold && continues(hold, record) => {
                hold.records.push(record);
                continue;
            }
            Some(hold) if open && is_next => hold.ended = Some(record.clock),
            _ => {}
        }
        open = of_a_hold;
        if of_a_hold {
            let began = is_next.then_some(record.clock);
            holds.push(Hold { records: vec![record], began, ended: None, digest: 0, means: [None; 3] });
        }
    }
    time_positions(&mut holds);
    for hold in &mut holds {
        hold.digest = hold.digest();
        let known = kept.and_then(|kept| kept.get(&hold.digest));
        hold.means = match known {
            Some(means) => *means,
            None => Axis::ALL.map(|axis| hold.mean_without(axis, law, 1, None)),
        };
    }
    holds
}

/// When a position began whose first second is lost, by its end or by the position before it: each is as long as the sequence has it.
fn time_positions(holds: &mut [Hold<'_>]) {
    for place in 0..holds.len() {
        if holds[place].began.is_some() || holds[place].mode() != Mode::Bias {
            continue;
        }
        let by_its_end = holds[place].ended.map(|ended| ended.plus_tenths(-POSITION_TENTHS));
        let by_the_one_before = || {
            let normal = holds.get(place.checked_sub(1)?)?;
            let is_pair = normal.step() == Step::Normal && next_step(holds, place - 1, Step::Opposite).is_some();
            let ended = normal.ended.or_else(|| normal.began.map(|began| began.plus_tenths(POSITION_TENTHS)));
            ended.filter(|_| is_pair).map(|ended| ended.plus_tenths(TURN_TENTHS))
        };
        let (start, last) = (holds[place].start(), holds[place].last());
        // A sequence of other lengths is not timed by these.
        let holds_all = |began: &Clock| *began <= start && last < began.plus_tenths(POSITION_TENTHS);
        holds[place].began = by_its_end.filter(holds_all).or_else(|| by_the_one_before().filter(holds_all));
    }
}

/// Whether a second belongs to a hold: the table rests, or turns at its constant rate.
pub fn is_of_a_hold(record: &AccRecord) -> bool {
    matches!(record.mode, Mode::Bias | Mode::Scale)
        && !matches!(record.step, Step::None | Step::Moving)
        && (!record.table_moving || record.step == Step::Rate)
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
