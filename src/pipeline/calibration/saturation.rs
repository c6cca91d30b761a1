//! Channels at the rail, beyond what autoranging explains.
//!
//! A jet or a bump drives range C to its rail for a moment, and within 5 s the instrument takes a coarser range: that is how
//! it is meant to work, and the samples are flagged anyway. It is told as a saturation when it lasts for a second and is none of
//! that: it outlasts autoranging, or happens in range A, or comes faster than the 1 Hz filter lets an overload rise. While the
//! table turns, its own acceleration may hold an axis at the rail: then only the last of these counts, and only within a step of
//! the calibration, since the next step's acceleration comes at once.

use super::anomaly::{Anomaly, AnomalyKind, RangeCorrection};
use crate::pipeline::archive::Archive;
use crate::pipeline::window::{Window, Windows, cells_of};
use crate::telemetry::{AccRecord, Axis, Mode, Quality, Range, Step};
use crate::units::Clock;

/// Shorter ones are not told, samples: a second.
const SAMPLES_MIN: usize = 10;
/// Autoranging reacts within this, tenths of a second.
const AUTORANGE_TENTHS: i64 = 50;
/// Length of a record, whose range is that of all its samples, tenths of a second.
const RECORD_TENTHS: i64 = 10;
/// A step to the rail larger than this between two samples is not the filter's output of an ordinary overload, counts.
const STEP_COUNTS: i32 = 16_384;
/// Runs closer than this are one, tenths of a second.
const APART_TENTHS: i64 = 50;
/// Y at the rail for this long in reentry mode is the shutdown, s.
const SHUTDOWN_S: f64 = 60.0;

/// One axis at the rail.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run {
    axis: Axis,
    from: Clock,
    to: Clock,
    samples: usize,
    abrupt: bool,
    range: Range,
    mode: Mode,
    turning: bool,
}

/// The axes' times at the rail.
pub(super) fn runs(archive: &Archive, windows: &Windows) -> Vec<Run> {
    // A window says so, or has samples that it did not look at.
    let may_hold_one = |window: &Window| {
        window.quality.contains(Quality::SATURATED)
            || window.quality.contains(Quality::TABLE_MOVING)
            || window.mode == Mode::Reentry
    };
    let mut runs: Vec<Run> = Vec::new();
    let mut last: [Option<Last>; 3] = [None; 3];
    for record in cells_of(windows, may_hold_one).flat_map(|cell| archive.cell(cell)) {
        for axis in Axis::ALL {
            add(&mut runs, record, axis, &mut last[axis.index()]);
        }
    }
    runs
}

/// Those of them that are saturations, in order of time.
pub(super) fn told(runs: &[Run], corrections: &[RangeCorrection]) -> Vec<Anomaly> {
    let mut found: Vec<Anomaly> = runs.iter().filter(|run| is_told(run, corrections)).map(tell).collect();
    found.sort_by(|a, b| a.from.cmp(&b.from).then(a.axes.cmp(&b.axes)));
    found
}

/// Whether the instrument answered an axis at its rail as it is meant to, by a coarser range within the time that takes.
pub fn is_answered(archive: &Archive, anomaly: &Anomaly) -> bool {
    let soon = |clock: Clock| clock.plus_tenths(AUTORANGE_TENTHS + RECORD_TENTHS);
    if anomaly.kind != AnomalyKind::Saturation || anomaly.to > soon(anomaly.from) {
        return false;
    }
    let after = || archive.records_between(anomaly.from.plus_tenths(-RECORD_TENTHS), soon(anomaly.to));
    anomaly.axes.iter().all(|axis| {
        let mut ranges = after().map(|record| record.ranges[axis.index()]);
        // A is the coarsest and the least.
        ranges.next().is_some_and(|first| ranges.any(|range| range < first))
    })
}

/// The sample before, and what the instrument was doing.
#[derive(Debug, Clone, Copy)]
struct Last {
    clock: Clock,
    count: i16,
    doing: (Mode, Step, u8, bool),
}

fn add(runs: &mut Vec<Run>, record: &AccRecord, axis: Axis, last: &mut Option<Last>) {
    let doing = (record.mode, record.step, record.target, record.table_moving);
    for (n, sample) in record.counts.iter().enumerate() {
        let count = sample[axis.index()];
        let clock = record.clock.plus_tenths(n as i64);
        if AccRecord::is_at_rail(count) {
            let step = last
                .filter(|before| clock.tenths() - before.clock.tenths() == 1 && before.doing == doing)
                .map_or(0, |before| (i32::from(count) - i32::from(before.count)).abs());
            let open = runs.iter_mut().rev().find(|run| run.axis == axis);
            match open {
                Some(run) if clock.tenths() - run.to.tenths() < APART_TENTHS && run.mode == record.mode => {
                    run.to = clock.plus_tenths(1);
                    run.samples += 1;
                    run.turning |= is_turning(record);
                }
                _ => runs.push(Run {
                    axis,
                    from: clock,
                    to: clock.plus_tenths(1),
                    samples: 1,
                    abrupt: step > STEP_COUNTS,
                    range: record.ranges[axis.index()],
                    mode: record.mode,
                    turning: is_turning(record),
                }),
            }
        }
        *last = Some(Last { clock, count, doing });
    }
}

fn is_turning(record: &AccRecord) -> bool {
    let rests = matches!(record.step, Step::Normal | Step::Opposite | Step::PreRate | Step::PostRate);
    record.table_moving || matches!(record.mode, Mode::Bias | Mode::Scale) && !rests
}

fn is_told(run: &Run, corrections: &[RangeCorrection]) -> bool {
    let corrected = corrections
        .iter()
        .find(|c| c.axis == run.axis && c.from.plus_tenths(-50) <= run.from && run.from < c.to.plus_tenths(50))
        .map_or(run.range, |c| c.actual);
    let outlasts = run.to.tenths() - run.from.tenths() > AUTORANGE_TENTHS && run.samples as i64 > AUTORANGE_TENTHS;
    run.samples >= SAMPLES_MIN && (run.abrupt || !run.turning && (outlasts || corrected == Range::A))
}

fn tell(run: &Run) -> Anomaly {
    let value = run.samples as f64 / 10.0;
    let letter = run.axis.letter().to_uppercase();
    let sentence = match run.mode {
        Mode::Reentry if value >= SHUTDOWN_S => format!(
            "{letter} was at the rail for {value:.1} s in reentry mode: the instrument shut down on its re-capture limit, its \
             normal end."
        ),
        _ => format!(
            "{letter} was at the rail for {value:.1} s in range {}: these samples enter no estimate.",
            run.range.letter()
        ),
    };
    Anomaly {
        kind: AnomalyKind::Saturation,
        from: run.from,
        to: run.to,
        axes: vec![run.axis],
        value,
        sigma: 0.1,
        unit: "s",
        sentence,
    }
}
