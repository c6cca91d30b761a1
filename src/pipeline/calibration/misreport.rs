//! Spans in which the records name a range the sensor is not in.
//!
//! Ranges differ by factors of ten and more in what a count means, so scatter and level of a window in counts tell which one
//! it was taken in: the scatter must be that of the mission, the level within a few micro-g of the bias of the range. Both are
//! weighed for the range reported against every other, axis by axis, window by window for the span, second by second for its ends.

use super::anomaly::{Anomaly, AnomalyKind, RangeCorrection};
use super::apply::Calibration;
use crate::math::shared_work::{both, map};
use crate::pipeline::archive::{Archive, RECORD_TENTHS};
use crate::pipeline::window::{AxisWindow, WINDOW_TENTHS, Window, Windows};
use crate::telemetry::{AccRecord, Axis, Mode, Range};
use crate::units::Clock;

/// Scatter of windows varies by about this factor (natural logarithm) with crew and bursts.
const LN_SCATTER_WIDTH: f64 = 1.0;
/// Quasi-steady accelerations are within this, ng: drag, gravity gradient, rotation.
const LEVEL_NG: f64 = 1500.0;
/// While the Orbiter turns they are within this, ng.
const MANOEUVRE_NG: f64 = 20_000.0;
/// Share of the time it turns: ten minutes in every seventeen hours, and half of that again to be fair.
const MANOEUVRE_SHARE: f64 = 0.015;
/// A window speaks for another range when its weight of evidence (natural logarithm) is above this.
const EVIDENCE_MIN: f64 = 20.0;
/// And hints at it when that of the axes that have any is above this: one axis alone, or neighbouring ranges, say no more. A manoeuvre
/// may do the same, for as long as it lasts: so many windows, three of four that are there, are 25 minutes; and of all together so much is
/// asked.
const HINT_MIN: f64 = 2.5;
const HINTS_MIN: usize = 60;
const HINTS_SHARE: f64 = 0.75;
const EVIDENCE_OF_HINTS: f64 = 360.0;
/// Windows that make a span, or the evidence of fewer that does: a window taken in C and named A, or the reverse, has fifty, and of those
/// named rightly none has ten.
const WINDOWS_MIN: usize = 3;
const EVIDENCE_OF_FEW: f64 = 40.0;
/// Windows without a say that do not end a span.
const CELLS_BETWEEN_MAX: i64 = 8;
/// Seconds around the ends of the span of windows in which its true ends are looked for.
const SEARCH_TENTHS: i64 = 900;
/// What one second can say at most: a burst must not move an end.
const SECOND_EVIDENCE_MAX: f64 = 15.0;
/// Smallest scatter told apart, counts.
const SCATTER_COUNTS_MIN: f64 = 0.3;

/// What is usual: scatter of each axis, ng, and where the biases lie.
struct Usual<'a> {
    scatter_ng: [f64; 3],
    calibration: &'a Calibration,
}

/// Level and scatter of one axis over some time, counts.
struct Seen {
    axis: Axis,
    level: f64,
    scatter: f64,
    clock_s: f64,
    temperature_c: f64,
}

impl Usual<'_> {
    /// Log likelihood (without what is common) of what was seen if the range were this.
    fn favour(&self, seen: &Seen, range: Range, level_ng: f64) -> Option<f64> {
        let (i, j) = (seen.axis.index(), range.index());
        let resolution = self.calibration.resolution_ng[i][j];
        let bias = self.calibration.bias_at(seen.axis, range, seen.clock_s, seen.temperature_c)?;
        let usual = (self.scatter_ng[i] / resolution).max(SCATTER_COUNTS_MIN);
        let scatter = (seen.scatter.max(SCATTER_COUNTS_MIN) / usual).ln() / LN_SCATTER_WIDTH;
        let ln_normal = |ng: f64| {
            let width = (ng / resolution).hypot(1.0);
            -0.5 * ((seen.level - bias) / width).powi(2) - width.ln()
        };
        let still = (1.0 - MANOEUVRE_SHARE).ln() + ln_normal(level_ng);
        let turning = MANOEUVRE_SHARE.ln() + ln_normal(MANOEUVRE_NG.hypot(level_ng));
        let level = still.max(turning) + (-(still - turning).abs()).exp().ln_1p();
        // In units of the narrow density's height: a level says what it says of the size of a count, and no more.
        let height = -((level_ng / resolution).hypot(1.0)).ln();
        Some(-0.5 * scatter * scatter + (level - height).max(-200.0))
    }
}

/// The middle scatter of each axis.
fn usual_scatter_ng(windows: &[(i64, &Window)], resolution_ng: &[[f64; 3]; 3]) -> Option<[f64; 3]> {
    let of_axis = |axis: usize| {
        let scatter = |a: &AxisWindow| a.estimate.winsorised_sd * resolution_ng[axis][a.range.index()];
        let mut all: Vec<f64> = windows.iter().filter_map(|(_, w)| w.axes[axis].as_ref().map(scatter)).collect();
        // The middle is enough; the mean of the two inner ones would cost a whole sort.
        let middle = all.len().checked_sub(1)? / 2;
        Some(*all.select_nth_unstable_by(middle, f64::total_cmp).1)
    };
    let (x, (y, z)) = both(|| of_axis(0), || both(|| of_axis(1), || of_axis(2)));
    Some([x?, y?, z?])
}

/// What speaks against the ranges reported, at most: no other range explains a window better than perfectly.
fn against(usual: &Usual<'_>, window: &Window) -> f64 {
    let of_axis = |axis| {
        let range = window.axes[Axis::index(axis)]?.range;
        usual.favour(&seen(window, axis)?, range, LEVEL_NG)
    };
    Axis::ALL.into_iter().filter_map(of_axis).map(|favour| (-favour).max(0.0)).sum()
}

fn seen(window: &Window, axis: Axis) -> Option<Seen> {
    let of_axis = window.axes[axis.index()]?;
    Some(Seen {
        axis,
        level: of_axis.estimate.mean,
        scatter: of_axis.estimate.winsorised_sd,
        clock_s: window.centre_s(),
        temperature_c: window.temperature_c,
    })
}

/// One window's evidence for a range: per axis, log likelihood over that of the range reported; nothing of an axis that cannot say.
fn evidence(usual: &Usual<'_>, window: &Window, actual: Range) -> [f64; 3] {
    Axis::ALL.map(|axis| {
        let reported = window.axes[axis.index()].map(|of_axis| of_axis.range).filter(|reported| *reported != actual);
        let of_axis = reported.zip(seen(window, axis)).and_then(|(reported, seen)| {
            Some(usual.favour(&seen, actual, LEVEL_NG)? - usual.favour(&seen, reported, LEVEL_NG)?)
        });
        of_axis.unwrap_or(0.0)
    })
}

/// Of the axes that speak for it: ranges are named axis by axis.
fn total(of_axes: &[f64; 3]) -> f64 {
    of_axes.iter().map(|of_axis| of_axis.max(0.0)).sum()
}

/// The range that a window hints at where it is another than the one reported, with the evidence of its axes.
fn best_other(usual: &Usual<'_>, window: &Window) -> Option<(Range, [f64; 3])> {
    if against(usual, window) <= HINT_MIN {
        return None;
    }
    Range::ALL
        .into_iter()
        .map(|range| (range, evidence(usual, window, range)))
        .max_by(|a, b| total(&a.1).total_cmp(&total(&b.1)))
        .filter(|(_, of_axes)| total(of_axes) > HINT_MIN)
}

/// A window that hints at another range.
struct Hint {
    cell: i64,
    actual: Range,
    of_axes: [f64; 3],
    ln_ratio: f64,
}

/// A run of windows that speak for another range.
struct Span {
    cells: [i64; 2],
    actual: Range,
    windows: usize,
    of_axes: [f64; 3],
    ln_ratio: Vec<f64>,
}

/// The windows of normal mode that were over at an instrument clock: one that was not said something else then than it says now.
fn normal(windows: &Windows, known_at: Clock) -> Vec<(i64, &Window)> {
    let all = windows.iter().filter(|(_, window)| window.is_over(known_at) && window.mode == Mode::Normal);
    all.map(|(cell, window)| (*cell, window.as_ref())).collect()
}

/// The middle scatter of each axis over all windows, ng.
pub fn usual_ng(windows: &Windows, calibration: &Calibration, known_at: Clock) -> Option<[f64; 3]> {
    usual_scatter_ng(&normal(windows, known_at), &calibration.resolution_ng)
}

/// Whether a window that has its last second speaks for another range than the one reported while no correction reaches it: it is time to
/// look for spans.
pub fn is_news(
    window: &Window,
    scatter_ng: [f64; 3],
    calibration: &Calibration,
    corrections: &[RangeCorrection],
) -> bool {
    let end = window.start.plus_tenths(WINDOW_TENTHS);
    let is_known = corrections.iter().any(|c| c.from < end && c.to > window.start);
    window.mode == Mode::Normal
        && window.is_over(window.known_since)
        && !is_known
        && best_other(&Usual { scatter_ng, calibration }, window).is_some()
}

/// Finds the spans, their corrections and what to tell, from what was known at an instrument clock.
pub fn find(
    archive: &Archive,
    windows: &Windows,
    calibration: &Calibration,
    known_at: Clock,
) -> Vec<(Anomaly, Vec<RangeCorrection>)> {
    let normal = normal(windows, known_at);
    let Some(scatter_ng) = usual_scatter_ng(&normal, &calibration.resolution_ng) else { return Vec::new() };
    let usual = Usual { scatter_ng, calibration };
    let hints: Vec<Hint> = map(&normal, |(cell, window)| {
        let (actual, of_axes) = best_other(&usual, window)?;
        Some(Hint { cell: *cell, actual, of_axes, ln_ratio: ln_scatter_ratio(&usual, window, &of_axes) })
    })
    .into_iter()
    .flatten()
    .collect();
    let there = |cell: i64| normal.partition_point(|(of_window, _)| *of_window < cell);
    let lasts = |span: &Span| {
        let windows = there(span.cells[1] + 1) - there(span.cells[0]);
        let is_long = span.windows >= HINTS_MIN && span.windows as f64 >= HINTS_SHARE * windows as f64;
        is_long && total(&span.of_axes) >= EVIDENCE_OF_HINTS
    };
    let mut spans = runs(hints.iter());
    spans.retain(lasts);
    let is_in_one = |hint: &Hint| spans.iter().any(|span| (span.cells[0]..=span.cells[1]).contains(&hint.cell));
    // A window half inside of a span speaks for one axis and against another: in a short one all must agree.
    let of_all = |of_axes: &[f64; 3]| of_axes.iter().sum::<f64>();
    let mut short = runs(hints.iter().filter(|hint| of_all(&hint.of_axes) > EVIDENCE_MIN && !is_in_one(hint)));
    short.retain(|span| span.windows >= WINDOWS_MIN || of_all(&span.of_axes) >= EVIDENCE_OF_FEW);
    spans.extend(short);
    spans.sort_by_key(|span| span.cells);
    spans.iter().filter_map(|span| settle_span(archive, &usual, windows, span, known_at)).collect()
}

/// Runs of windows for one range.
fn runs<'h>(hints: impl Iterator<Item = &'h Hint>) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for Hint { cell, actual, of_axes, ln_ratio } in hints {
        match spans.last_mut() {
            Some(span) if span.actual == *actual && cell - span.cells[1] <= CELLS_BETWEEN_MAX => {
                span.cells[1] = *cell;
                span.windows += 1;
                span.ln_ratio.push(*ln_ratio);
                span.of_axes.iter_mut().zip(of_axes).for_each(|(sum, one)| *sum += one);
            }
            _ => spans.push(Span {
                cells: [*cell; 2],
                actual: *actual,
                windows: 1,
                of_axes: *of_axes,
                ln_ratio: vec![*ln_ratio],
            }),
        }
    }
    spans
}

/// Scatter in the range reported over the usual one, of the axes that speak for another, on the mean.
fn ln_scatter_ratio(usual: &Usual<'_>, window: &Window, of_axes: &[f64; 3]) -> f64 {
    let ratios: Vec<f64> = (0..3)
        .filter(|axis| of_axes[*axis] > 0.0)
        .filter_map(|axis| {
            let seen = window.axes[axis]?;
            let resolution = usual.calibration.resolution_ng[axis][seen.range.index()];
            Some((seen.estimate.winsorised_sd.max(SCATTER_COUNTS_MIN) * resolution / usual.scatter_ng[axis]).ln())
        })
        .collect();
    ratios.iter().sum::<f64>() / ratios.len().max(1) as f64
}

/// The ends of a span to the second, the axes concerned, and the sentence.
fn settle_span(
    archive: &Archive,
    usual: &Usual<'_>,
    windows: &Windows,
    span: &Span,
    known_at: Clock,
) -> Option<(Anomaly, Vec<RangeCorrection>)> {
    let inside = windows.get(&((span.cells[0] + span.cells[1]) / 2)).or_else(|| windows.get(&span.cells[0]))?;
    let reported: Vec<(Axis, Range)> = Axis::ALL
        .into_iter()
        .filter_map(|axis| inside.axes[axis.index()].map(|a| (axis, a.range)))
        .filter(|(axis, range)| *range != span.actual && span.of_axes[axis.index()] > 0.0)
        .collect();
    let (_, reported_range) = *reported.first()?;
    let first = Clock::from_tenths(span.cells[0] * 250);
    let last = Clock::from_tenths((span.cells[1] + 2) * 250);
    let seconds = |from: Clock, to: Clock| {
        let between = [from.plus_tenths(-SEARCH_TENTHS), to.plus_tenths(SEARCH_TENTHS)];
        seconds_between(archive, usual, &reported, span.actual, between, known_at)
    };
    let (from, to) = if last.tenths() - first.tenths() < 2 * SEARCH_TENTHS {
        best_run(&seconds(first, last))?
    } else {
        (end_near(&seconds(first, first), true)?, end_near(&seconds(last, last), false)?)
    };
    let corrections = reported
        .iter()
        .map(|(axis, range)| RangeCorrection { from, to, axis: *axis, reported: *range, actual: span.actual })
        .collect();
    let count = span.ln_ratio.len() as f64;
    let mean = span.ln_ratio.iter().sum::<f64>() / count;
    let spread = (span.ln_ratio.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt();
    let value = (-mean).exp();
    let axes: Vec<Axis> = reported.iter().map(|(axis, _)| *axis).collect();
    let letters: Vec<String> = axes.iter().map(|axis| axis.letter().to_uppercase()).collect();
    let lasts_s = (to.tenths() - from.tenths()) as f64 / 10.0;
    let lasts = if lasts_s < 3600.0 { format!("{lasts_s:.0} s") } else { format!("{:.2} h", lasts_s / 3600.0) };
    let (times, than) = if value >= 1.0 { (value, "less") } else { (value.recip(), "more") };
    let sentence = format!(
        "For {lasts} the records say range {} in {} while the sensor was in range {}: the samples scatter {} times \
         {than} than they would; the windows are calibrated in range {} and flagged range_corrected, those at the edges have no \
         value.",
        reported_range.letter(),
        letters.join(", "),
        span.actual.letter(),
        if times >= 10.0 { format!("{times:.0}") } else { format!("{times:.3}") },
        span.actual.letter(),
    );
    let anomaly = Anomaly {
        kind: AnomalyKind::RangeMisreport,
        from,
        to,
        axes,
        value,
        sigma: value * spread / count.sqrt(),
        unit: "ratio",
        sentence,
    };
    Some((anomaly, corrections))
}

/// What one second says for the actual range against the one reported.
fn second_evidence(usual: &Usual<'_>, record: &AccRecord, reported: &[(Axis, Range)], actual: Range) -> f64 {
    let mut total = 0.0;
    for (axis, range) in reported {
        let counts: Vec<f64> = record.counts.iter().map(|s| f64::from(s[axis.index()])).collect();
        if record.counts.iter().any(|s| AccRecord::is_at_rail(s[axis.index()])) {
            continue;
        }
        let level = counts.iter().sum::<f64>() / 10.0;
        // Ten correlated samples scatter by about 0.6 of what a window's do.
        let scatter = (counts.iter().map(|c| (c - level).powi(2)).sum::<f64>() / 9.0).sqrt() / 0.6;
        let temperature_c = f64::from(record.temperature_c);
        let seen = Seen { axis: *axis, level, scatter, clock_s: record.clock.seconds(), temperature_c };
        let level_ng = LEVEL_NG.hypot(2.0 * usual.scatter_ng[axis.index()]);
        if let (Some(a), Some(r)) = (usual.favour(&seen, actual, level_ng), usual.favour(&seen, *range, level_ng)) {
            total += a - r;
        }
    }
    total.clamp(-SECOND_EVIDENCE_MAX, SECOND_EVIDENCE_MAX)
}

/// The seconds between two instants and what each says, as far as they were known.
fn seconds_between(
    archive: &Archive,
    usual: &Usual<'_>,
    reported: &[(Axis, Range)],
    actual: Range,
    [from, to]: [Clock; 2],
    known_at: Clock,
) -> Vec<(Clock, f64)> {
    archive
        .records_between(from, to)
        .filter(|record| record.clock <= known_at)
        .map(|record| {
            let concerned = record.mode == Mode::Normal
                && reported.iter().all(|(axis, range)| record.ranges[axis.index()] == *range);
            let says = if concerned { second_evidence(usual, record, reported, actual) } else { -SECOND_EVIDENCE_MAX };
            (record.clock, says)
        })
        .collect()
}

/// The run of seconds with the most evidence: of a span so short that both its ends are near to everything in it.
fn best_run(seconds: &[(Clock, f64)]) -> Option<(Clock, Clock)> {
    let (mut best, mut run) = ((0.0, None), (0.0, 0));
    for (place, (clock, says)) in seconds.iter().enumerate() {
        if run.0 <= 0.0 {
            run = (0.0, place);
        }
        run.0 += says;
        if run.0 > best.0 {
            best = (run.0, Some((seconds[run.1].0, clock.plus_tenths(RECORD_TENTHS))));
        }
    }
    best.1
}

/// The end of a span: the split of the seconds around it that their evidence favours most.
fn end_near(seconds: &[(Clock, f64)], is_start: bool) -> Option<Clock> {
    let total: f64 = seconds.iter().map(|(_, says)| says).sum();
    let mut before = 0.0;
    let (mut best, mut best_clock) = (f64::NEG_INFINITY, None);
    for place in 0..=seconds.len() {
        let favour = if is_start { total - 2.0 * before } else { 2.0 * before - total };
        if favour > best {
            best = favour;
            best_clock = match place {
                n if n < seconds.len() => Some(seconds[n].0),
                _ => seconds.last().map(|(clock, _)| clock.plus_tenths(RECORD_TENTHS)),
            };
        }
        if let Some((_, says)) = seconds.get(place) {
            before += says;
        }
    }
    best_clock
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_run_is_from_its_first_second_to_the_end_of_its_last() {
        let says = |i: i64| if (13..58).contains(&i) && i != 30 { 15.0 } else { -15.0 };
        let seconds: Vec<(Clock, f64)> = (-90..120).map(|i| (Clock::from_tenths(10 * i), says(i))).collect();
        assert_eq!(best_run(&seconds), Some((Clock::from_tenths(130), Clock::from_tenths(580))));
        let none: Vec<(Clock, f64)> = (0..50).map(|i| (Clock::from_tenths(10 * i), -15.0)).collect();
        assert_eq!(best_run(&none), None);
    }
}
