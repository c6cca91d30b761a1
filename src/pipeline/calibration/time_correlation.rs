//! Instrument clock against the Orbiter's UTC: unix time - clock = offset + drift x (clock - reference), by straight pieces
//! between jumps.
//!
//! The pair of times in every science record gives it. Half-window means are fitted; a jump is where neighbours differ by far
//! more than jitter and drift allow, and stays so.

use crate::math::robust::median;
use crate::pipeline::archive::Archive;
use crate::units::Clock;

/// Neighbouring cells whose offsets differ by less are never a jump, s: jitter is milliseconds.
const JUMP_S_MIN: f64 = 0.05;
/// Records of the new level that make a jump of a step in the pair of times.
const RECORDS_MIN: usize = 5;
/// One in so many cells enters the fit when there are very many: the fit is no better for more.
const CELLS_MAX: usize = 20_000;

/// A jump of the two clocks against each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockJump {
    /// First record at the new level.
    pub at: Clock,
    /// Last record at the old level.
    pub before: Clock,
    /// Forward positive: the Orbiter's clock gained on the instrument's, s.
    pub jump_s: f64,
    /// Standard error, s.
    pub sigma_s: f64,
}

/// One straight piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimePiece {
    /// First and last clock it is valid for.
    pub span: [Clock; 2],
    /// Unix time less instrument clock at `reference_s`, s.
    pub offset_s: f64,
    /// Its standard error, s.
    pub offset_sigma_s: f64,
    /// Clock the offset holds for, s.
    pub reference_s: f64,
    /// Drift of the Orbiter's clock against the instrument's, parts per million.
    pub drift_ppm: f64,
    /// Its standard error.
    pub drift_sigma_ppm: f64,
    /// RMS of a single record's time from the piece, s.
    pub residual_s: f64,
    /// Records fitted.
    pub records: usize,
}

/// The correlation over the whole mission.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TimeCorrelation {
    /// Pieces in order.
    pub pieces: Vec<TimePiece>,
    /// The jumps between them.
    pub jumps: Vec<ClockJump>,
}

impl TimeCorrelation {
    /// Unix time of an instrument clock, s, by the piece it lies in or is nearest to.
    pub fn unix_s(&self, clock_s: f64) -> Option<f64> {
        let piece = self.pieces.iter().rev().find(|p| p.span[0].seconds() <= clock_s).or(self.pieces.first())?;
        Some(clock_s + piece.offset_s + piece.drift_ppm * 1e-6 * (clock_s - piece.reference_s))
    }
}

/// The median offset of one cell, and its clock.
struct Level {
    cell: i64,
    clock_s: f64,
    offset_s: f64,
    records: usize,
}

fn offset_s(record: &crate::telemetry::AccRecord) -> f64 {
    // Both in whole milliseconds: exact.
    (record.orbiter_unix_ms - record.clock.tenths() * 100) as f64 / 1000.0
}

/// Fits the pieces and finds the jumps.
pub fn correlate(archive: &Archive) -> TimeCorrelation {
    let total = archive.cells().count();
    let stride = total.div_ceil(CELLS_MAX).max(1);
    let levels: Vec<Level> = archive
        .cells()
        .enumerate()
        .filter(|(n, _)| n % stride == 0 || *n + 1 == total)
        .filter_map(|(_, cell)| level(archive, cell))
        .collect();
    let Some(first) = levels.first() else { return TimeCorrelation::default() };
    let mut found = TimeCorrelation::default();
    let mut piece: Vec<&Level> = vec![first];
    for n in 1..levels.len() {
        let (before, this) = (&levels[n - 1], &levels[n]);
        let allowed = JUMP_S_MIN + 50e-6 * (this.clock_s - before.clock_s);
        // A level that its successor does not share is a disturbed cell, or the cell in which the jump lies.
        let lasting = levels.get(n + 1).is_none_or(|next| (next.offset_s - this.offset_s).abs() < allowed + 1e-3);
        let differs = (this.offset_s - piece[piece.len() - 1].offset_s).abs() > allowed;
        match (differs, lasting) {
            (false, _) => piece.push(this),
            (true, false) => {}
            (true, true) => {
                let from = piece[piece.len() - 1];
                if let Some(jump) = locate(archive, from, this) {
                    found.jumps.push(jump);
                    found.pieces.extend(fit(&piece));
                    piece = vec![this];
                }
            }
        }
    }
    found.pieces.extend(fit(&piece));
    found
}

fn level(archive: &Archive, cell: i64) -> Option<Level> {
    let records = archive.cell(cell);
    let mut offsets: Vec<f64> = records.iter().map(offset_s).collect();
    let clock_s = records.iter().map(|r| r.clock.seconds()).sum::<f64>() / records.len() as f64;
    Some(Level { cell, clock_s, offset_s: median(&mut offsets)?, records: records.len() })
}

/// The record at which the level changes from one cell's to another's.
fn locate(archive: &Archive, from: &Level, to: &Level) -> Option<ClockJump> {
    let middle = 0.5 * (from.offset_s + to.offset_s);
    let sign = (to.offset_s - from.offset_s).signum();
    let cells = archive.cells().filter(|cell| (from.cell..=to.cell).contains(cell));
    let records: Vec<_> = cells.flat_map(|cell| archive.cell(cell)).collect();
    // The place that leaves the fewest records on the wrong side.
    let wrong_before: Vec<usize> = std::iter::once(0)
        .chain(records.iter().scan(0, |wrong, r| {
            *wrong += usize::from(sign * (offset_s(r) - middle) > 0.0);
            Some(*wrong)
        }))
        .collect();
    let high_in_all = wrong_before[records.len()];
    let wrong = |at: usize| wrong_before[at] + (records.len() - at) - (high_in_all - wrong_before[at]);
    let at = (1..records.len()).min_by_key(|at| wrong(*at))?;
    let jitter = 0.003;
    let sides = [at.min(25), (records.len() - at).min(25)];
    (sides[1] >= RECORDS_MIN.min(records.len() - at) && sides[0] > 0).then(|| ClockJump {
        at: records[at].clock,
        before: records[at - 1].clock,
        jump_s: to.offset_s - from.offset_s,
        sigma_s: jitter * (1.0 / sides[0] as f64 + 1.0 / sides[1] as f64).sqrt(),
    })
}

/// A straight line through the levels of one piece.
fn fit(levels: &[&Level]) -> Option<TimePiece> {
    let (first, last) = (levels.first()?, levels.last()?);
    let count = levels.len() as f64;
    let reference_s = levels.iter().map(|l| l.clock_s).sum::<f64>() / count;
    let base = first.offset_s;
    let mean = levels.iter().map(|l| l.offset_s - base).sum::<f64>() / count;
    let tt: f64 = levels.iter().map(|l| (l.clock_s - reference_s).powi(2)).sum();
    let ty: f64 = levels.iter().map(|l| (l.clock_s - reference_s) * (l.offset_s - base - mean)).sum();
    let slope = if tt > 0.0 { ty / tt } else { 0.0 };
    let square: f64 =
        levels.iter().map(|l| (l.offset_s - base - mean - slope * (l.clock_s - reference_s)).powi(2)).sum();
    let scatter = (square / (count - 2.0).max(1.0)).sqrt();
    let records: usize = levels.iter().map(|l| l.records).sum();
    Some(TimePiece {
        span: [Clock::from_tenths(first.cell * 250), Clock::from_tenths((last.cell + 1) * 250)],
        offset_s: base + mean,
        offset_sigma_s: scatter / count.sqrt(),
        reference_s,
        drift_ppm: slope * 1e6,
        drift_sigma_ppm: if tt > 0.0 { scatter / tt.sqrt() * 1e6 } else { 0.0 },
        // The median of n normal records scatters by 1.2533 / sqrt(n).
        residual_s: scatter * (records as f64 / count).sqrt() / 1.2533,
        records,
    })
}
