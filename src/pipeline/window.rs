//! The uncalibrated window: 50 s of counts, per axis the adaptive trimmed mean and its figures, in the range reported.
//!
//! Two sorted halves of 25 s make a window, so that each half is sorted once. Samples at the rail, and samples taken
//! while the table was not in its normal position, enter no estimate.

use std::collections::{BTreeMap, BTreeSet};

use rapidhash::v3::rapidhash_v3;

use super::archive::{Archive, CELL_TENTHS, RECORD_TENTHS};
use super::settings::WindowPolicy;
use crate::math::ranked::{Pair, Ranked};
use crate::math::robust::{TrimmedMean, trimmed_mean};
use crate::telemetry::{AccRecord, Mode, Quality, Range, SAMPLES_PER_RECORD};
use crate::units::Clock;

/// Samples in a whole window.
pub const WINDOW_SAMPLES: usize = 2 * CELL_TENTHS as usize;
/// Tenths of a second in a window.
pub const WINDOW_TENTHS: i64 = 2 * CELL_TENTHS;

/// The sorted samples of one half window.
#[derive(Debug, Clone, Default)]
pub struct HalfWindow {
    /// Usable counts, per axis and range.
    ranked: [[Ranked; 3]; 3],
    /// Samples that came down.
    present: u16,
    /// Of those, samples taken out of normal mode.
    away: u16,
    /// Samples with any axis at the rail.
    at_rail: u16,
    /// Records per mode, in the order of the codes (the first unknown).
    modes: [u16; 5],
    /// Sum of the records' temperatures, C, and their number.
    temperature: (f64, u16),
    /// The latest record, and a hash of all.
    latest: Option<Clock>,
    hash: u64,
}

impl HalfWindow {
    /// Sorts the records of one cell.
    pub fn of(records: &[AccRecord]) -> Self {
        let mut half = HalfWindow::default();
        let mut counts: [[Vec<i16>; 3]; 3] = Default::default();
        let mut hashed = Vec::with_capacity(records.len() * HASHED_OCTETS);
        for record in records {
            half.add(record, &mut counts);
            hashed.extend(hashed_octets(record));
        }
        half.ranked = counts.map(|by_range| by_range.map(Ranked::of));
        half.hash = rapidhash_v3(&hashed);
        half
    }

    fn add(&mut self, record: &AccRecord, counts: &mut [[Vec<i16>; 3]; 3]) {
        self.present += SAMPLES_PER_RECORD as u16;
        self.modes[usize::from(record.mode.code())] += 1;
        self.temperature.0 += f64::from(record.temperature_c);
        self.temperature.1 += 1;
        self.latest = self.latest.max(Some(record.clock));
        if record.mode != Mode::Normal || record.table_moving {
            self.away += SAMPLES_PER_RECORD as u16;
            return;
        }
        let is_at_rail = |sample: &[i16; 3]| sample.iter().any(|count| AccRecord::is_at_rail(*count));
        let at_rail = record.counts.iter().filter(|sample| is_at_rail(sample)).count();
        self.at_rail += at_rail as u16;
        for (axis, by_range) in counts.iter_mut().enumerate() {
            let counts = &mut by_range[record.ranges[axis].index()];
            if counts.capacity() == 0 {
                counts.reserve_exact(CELL_TENTHS as usize);
            }
            let axis_counts = record.counts.iter().map(|sample| sample[axis]);
            match at_rail {
                0 => counts.extend(axis_counts),
                _ => counts.extend(axis_counts.filter(|count| !AccRecord::is_at_rail(*count))),
            }
        }
    }
}

/// Octets of a record that are hashed.
const HASHED_OCTETS: usize = 17 + SAMPLES_PER_RECORD * 6;

/// Everything of a record that a window is made from.
fn hashed_octets(record: &AccRecord) -> [u8; HASHED_OCTETS] {
    let mut octets = [0u8; HASHED_OCTETS];
    octets[..8].copy_from_slice(&record.clock.tenths().to_le_bytes());
    octets[8..12].copy_from_slice(&record.temperature_c.to_le_bytes());
    octets[12..14].copy_from_slice(&[record.mode.code(), u8::from(record.table_moving)]);
    octets[14..17].copy_from_slice(&record.ranges.map(|range| range.index() as u8));
    for (octets, count) in octets[17..].as_chunks_mut::<2>().0.iter_mut().zip(record.counts.as_flattened()) {
        *octets = count.to_le_bytes();
    }
    octets
}

/// One axis of a window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisWindow {
    /// The range whose samples were used: the most frequent one, the coarser of two that are equal.
    pub range: Range,
    /// The estimate, in counts of that range.
    pub estimate: TrimmedMean,
}

/// An uncalibrated window, in counts of OARE axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    /// Its start, on the 25 s grid fixed to clock 0.
    pub start: Clock,
    /// X, Y, Z; None where too few samples can be used.
    pub axes: [Option<AxisWindow>; 3],
    /// Samples that came down.
    pub samples: u16,
    /// Mean sensor temperature, C.
    pub temperature_c: f64,
    /// The mode of most records; of equally many, the later code.
    pub mode: Mode,
    /// Reasons for care that show in the counts.
    pub quality: Quality,
    /// Instrument clock of the latest record used.
    pub known_since: Clock,
    /// Hash of every record in it.
    pub hash: u64,
}

/// Windows by the number of their first cell. Boxed, because the nodes of a tree that grows at its end stay half empty.
pub type Windows = BTreeMap<i64, Box<Window>>;

/// Numbers of the cells under the windows wanted, in order.
pub fn cells_of(windows: &Windows, wanted: impl Fn(&Window) -> bool) -> impl Iterator<Item = i64> {
    let cells: BTreeSet<i64> =
        windows.iter().filter(|(_, window)| wanted(window)).flat_map(|(cell, _)| [*cell, *cell + 1]).collect();
    cells.into_iter()
}

impl Window {
    /// Middle of the window, s.
    pub fn centre_s(&self) -> f64 {
        self.start.plus_tenths(WINDOW_TENTHS / 2).seconds()
    }

    /// Whether its time is over at an instrument clock: nothing more can come for it but what comes late.
    pub fn is_over(&self, clock: Clock) -> bool {
        self.known_since.max(self.start.plus_tenths(WINDOW_TENTHS - RECORD_TENTHS)) <= clock
    }

    /// The window that starts with cell `cell`, of its two halves; None when both are empty.
    pub fn of(cell: i64, halves: [&HalfWindow; 2], policy: &WindowPolicy) -> Option<Self> {
        let total = |count: fn(&HalfWindow) -> u16| count(halves[0]) + count(halves[1]);
        let samples = total(|half| half.present);
        let known_since = halves[0].latest.max(halves[1].latest)?;
        let mut mixed = false;
        let axes = [0, 1, 2].map(|axis| {
            let points = [0, 1, 2].map(|range| halves.map(|half| half.ranked[axis][range].len()).iter().sum::<usize>());
            mixed |= points.iter().filter(|points| **points > 0).count() > 1;
            // The coarser of two equally frequent ranges: the reversed order makes it the last maximum.
            let range = [2, 1, 0].into_iter().max_by_key(|range| points[*range]).unwrap_or(0);
            if points[range] < policy.samples_min {
                return None;
            }
            let counts = Pair(halves.map(|half| &half.ranked[axis][range]));
            let estimate = trimmed_mean(counts, &policy.trim)?;
            Some(AxisWindow { range: Range::ALL[range], estimate })
        });
        let modes = [0, 1, 2, 3, 4].map(|code| halves[0].modes[code] + halves[1].modes[code]);
        let mode = (0..5u8).max_by_key(|code| modes[usize::from(*code)]).and_then(Mode::from_code);
        let (away, at_rail) = (total(|half| half.away), total(|half| half.at_rail));
        let used_all = usize::from(samples - away - at_rail) >= WINDOW_SAMPLES;
        let quality = Quality::GOOD
            .with_if(Quality::PARTIAL, !used_all)
            .with_if(Quality::GAP, usize::from(samples) < WINDOW_SAMPLES)
            .with_if(Quality::SATURATED, at_rail > 0)
            .with_if(Quality::RANGE_MIXED, mixed)
            .with_if(Quality::TABLE_MOVING, away > 0);
        let temperature_c = halves.map(|half| half.temperature.0).iter().sum::<f64>()
            / f64::from(halves.map(|half| half.temperature.1).iter().sum::<u16>());
        let hash = rapidhash_v3([halves[0].hash.to_le_bytes(), halves[1].hash.to_le_bytes()].as_flattened());
        Some(Self {
            start: Clock::from_tenths(cell * CELL_TENTHS),
            axes,
            samples,
            temperature_c,
            mode: mode.unwrap_or(Mode::Unknown),
            quality,
            known_since,
            hash,
        })
    }
}

/// The windows that start with the given cells (ascending, without repeats); a cell without any sample yields None.
pub fn windows(
    archive: &Archive,
    cells: impl IntoIterator<Item = i64>,
    policy: &WindowPolicy,
    mut hand_on: impl FnMut(i64, Option<Window>),
) {
    let mut last: Option<(i64, HalfWindow)> = None;
    for cell in cells {
        let first = match last.take() {
            Some((number, half)) if number == cell => half,
            _ => HalfWindow::of(archive.cell(cell)),
        };
        let second = HalfWindow::of(archive.cell(cell + 1));
        hand_on(cell, Window::of(cell, [&first, &second], policy));
        last = Some((cell + 1, second));
    }
}
