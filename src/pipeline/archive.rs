//! Everything decoded, without repeats and in order of instrument time: what all products are made from.
//!
//! The content is a function of the set of packets. Where two packets claim the same place and differ, the one that
//! compares lower stays.

use std::collections::BTreeMap;

use super::timeline::Timeline;
use crate::ingest::wire::Record;
use crate::telemetry::{AccRecord, Event, Housekeeping, OnBoardEstimate, TableReport};
use crate::units::Clock;

/// Tenths of a second in a cell: half a window.
pub const CELL_TENTHS: i64 = 250;
/// Tenths of a second in a record.
pub const RECORD_TENTHS: i64 = 10;

/// Number of the 25 s cell that holds a clock; cell k spans clock 25 k s to 25 (k + 1) s.
pub fn cell_of(clock: Clock) -> i64 {
    clock.tenths().div_euclid(CELL_TENTHS)
}

/// What adding a record changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Addition {
    /// New.
    New,
    /// The same packet again, whether it has its place or has lost it.
    Repeat,
    /// Another packet claims the place; the lower one stays, and whether that changed the archive.
    Conflict {
        /// The new one took the place.
        replaced: bool,
    },
}

/// Records by instrument time.
#[derive(Debug, Default)]
pub struct Archive {
    cells: BTreeMap<i64, Vec<AccRecord>>,
    /// Science records whose place is another's, so that each counts as a conflict once, whichever came first.
    lost: BTreeMap<Clock, Vec<AccRecord>>,
    housekeeping: Timeline<Housekeeping>,
    table: Timeline<TableReport>,
    events: Timeline<Event>,
    estimates: Timeline<OnBoardEstimate>,
}

impl Archive {
    /// Adds a decoded packet.
    pub fn add(&mut self, record: Record, sequence: u16) -> Addition {
        match record {
            Record::Acc(acc) => self.add_acc(acc),
            Record::Hsk(report) => self.housekeeping.add(report.clock, sequence, report),
            Record::Tbl(report) => self.table.add(report.clock, sequence, report),
            Record::Evt(event) => self.events.add(event.clock, sequence, event),
            Record::Prc(estimate) => self.estimates.add(estimate.clock, sequence, estimate),
        }
    }

    fn add_acc(&mut self, acc: AccRecord) -> Addition {
        let cell = self.cells.entry(cell_of(acc.clock)).or_default();
        let at = cell.partition_point(|held| held.clock < acc.clock);
        if let Some(held) = cell.get_mut(at)
            && held.clock == acc.clock
        {
            if *held == acc {
                return Addition::Repeat;
            }
            let lost = self.lost.entry(acc.clock).or_default();
            if lost.contains(&acc) {
                return Addition::Repeat;
            }
            let replaced = precedes(&acc, held);
            lost.push(if replaced { std::mem::replace(held, acc) } else { acc });
            return Addition::Conflict { replaced };
        }
        if cell.capacity() == 0 {
            cell.reserve_exact((CELL_TENTHS / RECORD_TENTHS) as usize);
        }
        cell.insert(at, acc);
        Addition::New
    }

    /// The science records of a cell, in order.
    pub fn cell(&self, cell: i64) -> &[AccRecord] {
        self.cells.get(&cell).map_or(&[], Vec::as_slice)
    }

    /// Numbers of the cells that hold records, in order.
    pub fn cells(&self) -> impl DoubleEndedIterator<Item = i64> + '_ {
        self.cells.keys().copied()
    }

    /// All science records, in order.
    pub fn records(&self) -> impl Iterator<Item = &AccRecord> {
        self.cells.values().flatten()
    }

    /// Science records whose cell lies in `[from, to)`, in order; the first and last cells are given whole.
    pub fn records_between(&self, from: Clock, to: Clock) -> impl Iterator<Item = &AccRecord> {
        self.cells.range(cell_of(from)..=cell_of(to)).flat_map(|(_, cell)| cell)
    }

    /// Housekeeping, in order.
    pub fn housekeeping(&self) -> impl Iterator<Item = &Housekeeping> {
        self.housekeeping.iter()
    }

    /// Table reports, in order.
    pub fn table(&self) -> impl Iterator<Item = &TableReport> {
        self.table.iter()
    }

    /// Events, in order.
    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.events.iter()
    }

    /// On-board estimates, in order.
    pub fn estimates(&self) -> impl Iterator<Item = &OnBoardEstimate> {
        self.estimates.iter()
    }

    /// Instrument clock of the first and behind the last science record.
    pub fn span(&self) -> Option<(Clock, Clock)> {
        let first = self.cells.values().next()?.first()?;
        let last = self.cells.values().next_back()?.last()?;
        Some((first.clock, last.clock.plus_tenths(RECORD_TENTHS)))
    }
}

/// Whether the first of two different records of one instant stays.
fn precedes(a: &AccRecord, b: &AccRecord) -> bool {
    let by_temperature = a.temperature_c.total_cmp(&b.temperature_c);
    precedence(a).cmp(&precedence(b)).then(by_temperature).is_lt()
}

/// What is compared of a record, first to last, but for its temperature.
fn precedence(acc: &AccRecord) -> (u16, i64, [[i16; 3]; 10], [usize; 3], u8, u8) {
    (
        acc.sequence,
        acc.orbiter_unix_ms,
        acc.counts,
        acc.ranges.map(crate::telemetry::Range::index),
        crate::ingest::wire::record::data_status(acc),
        acc.target << 4 | acc.step as u8,
    )
}
