//! The pipeline as one state machine: frames in, changes out, products at any time.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::archive::{Addition, Archive, cell_of};
use super::calibration::sequence::is_of_a_hold;
use super::calibration::{self, Anomaly, Calibration, Derived, KnownCalibration, RangeCorrection};
use super::derive;
use super::frames::{FrameDigest, FrameSet, Novelty};
use super::ledger::{Ledger, PlaybackId};
use super::product::{Product, Revision, latest};
use super::settings::Settings;
use super::window::{Window, Windows, windows};
use crate::ingest::wire::packet::apid;
use crate::ingest::wire::{
    Apid, Arrival, Assembled, Assembler, FrameId, PacketRefusal, Record, SpacePacket, TransferFrame, Verdict,
};
use crate::telemetry::{AccRecord, Event};
use crate::units::Clock;

/// Something that consumers of the products may want to know.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// A window's product, and the revision it takes the place of.
    Window {
        /// The product.
        product: Arc<Product>,
        /// The revision announced before, if any.
        supersedes: Option<Revision>,
    },
    /// A new version of the calibration is in use.
    Calibration {
        /// Its number.
        version: u32,
        /// Instrument clock since which it can be known.
        known_since: Clock,
    },
    /// An event came down.
    Event(Event),
    /// Something went wrong with the instrument.
    Anomaly(Anomaly),
    /// What more data say of an anomaly announced before: it is none, or another one.
    AnomalyWithdrawn(Anomaly),
    /// A span is not covered.
    Gap {
        /// From this clock.
        from: Clock,
        /// Up to this clock.
        to: Clock,
    },
    /// One second of raw samples (only while raw changes are asked for).
    Raw(Box<AccRecord>),
}

/// Cells of new samples after which normal mode is checked for anomalies again: an hour.
const CHECK_CELLS: usize = 144;
/// And no fewer than this share of all cells, so that the checks of a mission that comes down at once cost little.
const CHECK_SHARE: usize = 8;

/// Products made before they are put in their places: enough to share the work, few enough not to hold a mission's twice.
const DERIVED_AT_ONCE: usize = 4096;

/// Tenths of a second in which the end of a calibration is noticed at once; if all of them are lost, the next check does.
const OVER_TENTHS: i64 = 600;

/// Frames in, changes out, products at any time.
pub struct Station {
    settings: Settings,
    known: Option<KnownCalibration>,
    frames: FrameSet,
    assembler: Assembler,
    archive: Archive,
    ledger: Ledger,
    derived: Derived,
    windows: Windows,
    /// Shared with those who are told of them.
    products: BTreeMap<i64, Arc<Product>>,
    /// Cells with new samples.
    touched: BTreeSet<i64>,
    /// Whether anything that calibration depends on is new.
    calibration_touched: bool,
    /// Latest record, and latest one in which a calibration measured: from the one to the other it is known when that one is over.
    latest: Option<Clock>,
    latest_hold: Option<Clock>,
    /// Whether anything is new that the checks of the calibration look at, and in how many cells; they wait for the next
    /// calibration, for [`CHECK_CELLS`] or for [`Station::flush`].
    checks_touched: bool,
    cells_unchecked: usize,
    /// Windows whose product changed and was not announced.
    unannounced: BTreeSet<i64>,
    announced: BTreeMap<i64, Revision>,
    announced_gaps: BTreeSet<(i64, i64)>,
    announces_raw: bool,
    waiting: Vec<Change>,
}

impl Station {
    /// An empty station; with a known calibration, that one is used instead of estimating any.
    pub fn new(settings: Settings, known: Option<KnownCalibration>) -> Self {
        Self::without(settings, known, BTreeSet::new())
    }

    /// An empty station that will not use these frames: see [`Station::to_set_aside`].
    pub fn without(
        settings: Settings,
        known: Option<KnownCalibration>,
        set_aside: BTreeSet<(FrameId, FrameDigest)>,
    ) -> Self {
        Self {
            settings,
            known,
            frames: FrameSet::without(set_aside),
            assembler: Assembler::default(),
            archive: Archive::default(),
            ledger: Ledger::default(),
            derived: Derived::default(),
            windows: Windows::new(),
            products: BTreeMap::new(),
            touched: BTreeSet::new(),
            calibration_touched: true,
            latest: None,
            latest_hold: None,
            checks_touched: false,
            cells_unchecked: 0,
            unannounced: BTreeSet::new(),
            announced: BTreeMap::new(),
            announced_gaps: BTreeSet::new(),
            announces_raw: false,
            waiting: Vec::new(),
        }
    }

    /// Whether every new second of raw samples is to be among the changes.
    pub fn announce_raw(&mut self, wanted: bool) {
        self.announces_raw = wanted;
    }

    /// Drops the changes that wait to be told.
    pub fn forget_changes(&mut self) {
        self.waiting.clear();
    }

    /// A playback starts. Numbers are the caller's, in order of arrival.
    pub fn open_playback(&mut self, id: PlaybackId) {
        self.ledger.playback_mut(id);
    }

    /// A playback is over.
    pub fn close_playback(&mut self, id: PlaybackId, bits: u64) {
        let playback = self.ledger.playback_mut(id);
        playback.account.bits_in = bits;
        playback.closed = true;
    }

    /// A frame came, good or refused.
    pub fn take(&mut self, id: PlaybackId, arrival: &Arrival) {
        let playback = self.ledger.playback_mut(id);
        playback.account.frames_found += 1;
        let frame = match arrival.verdict {
            Verdict::Refused(refusal) => {
                *playback.account.frames_refused.entry(refusal).or_default() += 1;
                return;
            }
            Verdict::Good(frame) => frame,
        };
        playback.sense.get_or_insert(arrival.sense);
        playback.bit_offset.get_or_insert((arrival.first_bit % 8) as u8);
        let (novelty, usable) = self.frames.add(id, frame, &arrival.octets);
        match novelty {
            Novelty::New => playback.account.frames_new += 1,
            Novelty::Repeated | Novelty::Conflicting => playback.account.frames_repeated += 1,
        }
        if novelty == Novelty::Conflicting {
            self.ledger.frame_conflicts = self.frames.conflicts() as u64;
        }
        if usable && let Ok(frame) = TransferFrame::read(&self.settings.link, &arrival.octets) {
            self.read_packets(id, &frame);
        }
    }

    /// As [`Station::take`], for a good frame known to be a repeat of one taken before, of which only the identity is at hand; false,
    /// and nothing taken, where that does not tell which frame it is.
    pub fn take_repeat(&mut self, id: PlaybackId, arrival: &Arrival) -> bool {
        let Verdict::Good(frame) = arrival.verdict else { return false };
        if !self.frames.add_repeat(id, frame) {
            return false;
        }
        let playback = self.ledger.playback_mut(id);
        playback.account.frames_found += 1;
        playback.account.frames_repeated += 1;
        playback.sense.get_or_insert(arrival.sense);
        playback.bit_offset.get_or_insert((arrival.first_bit % 8) as u8);
        true
    }

    fn read_packets(&mut self, id: PlaybackId, frame: &TransferFrame<'_>) {
        let mut assembler = std::mem::take(&mut self.assembler);
        assembler.take(frame, |assembled| match assembled {
            Assembled::Packet(_, octets) => self.read_packet(id, octets),
            Assembled::Broken(..) => self.refuse_packet(id, PacketRefusal::Broken),
        });
        self.assembler = assembler;
    }

    fn refuse_packet(&mut self, id: PlaybackId, refusal: PacketRefusal) {
        *self.ledger.playback_mut(id).account.packets_refused.entry(refusal.word()).or_default() += 1;
    }

    fn read_packet(&mut self, id: PlaybackId, octets: &[u8]) {
        if apid(octets) == Apid::IDLE {
            *self.ledger.playback_mut(id).account.packets.entry(Apid::IDLE.word()).or_default() += 1;
            return;
        }
        let read = SpacePacket::read(octets).and_then(|packet| Ok((packet.id, Record::read(&packet)?)));
        match read {
            Ok((packet, record)) => self.file(id, packet.apid, packet.sequence, record),
            Err(refusal) => self.refuse_packet(id, refusal),
        }
    }

    /// Puts a decoded packet where it belongs and marks what depends on it.
    fn file(&mut self, id: PlaybackId, apid: Apid, sequence: u16, record: Record) {
        let playback = self.ledger.playback_mut(id);
        if let Record::Acc(acc) = &record {
            playback.seconds.add(acc.clock);
        }
        let copy = match &record {
            Record::Acc(acc) => Some((acc.clock, is_of_a_hold(acc))),
            _ => None,
        };
        let change = match &record {
            Record::Evt(event) => Some(Change::Event(event.clone())),
            Record::Acc(acc) if self.announces_raw => Some(Change::Raw(Box::new(*acc))),
            _ => None,
        };
        let addition = self.archive.add(record, sequence);
        match addition {
            Addition::Repeat => return,
            Addition::New => *playback.account.packets.entry(apid.word()).or_default() += 1,
            Addition::Conflict { .. } => *playback.account.packets_refused.entry("conflict").or_default() += 1,
        }
        if addition == (Addition::Conflict { replaced: false }) {
            return;
        }
        self.waiting.extend(change);
        match copy {
            Some((clock, of_a_hold)) => {
                self.ledger.seconds.add(clock);
                self.touched.insert(cell_of(clock));
                self.calibration_touched |= self.ends_calibration(clock, of_a_hold);
                self.checks_touched = true;
            }
            None => self.checks_touched = true,
        }
    }

    /// Whether this record completes a calibration, or belongs to one that is complete.
    fn ends_calibration(&mut self, clock: Clock, of_a_hold: bool) -> bool {
        self.latest = self.latest.max(Some(clock));
        let before = |later: Option<Clock>| later.map_or(0, |later| later.tenths() - clock.tenths());
        if of_a_hold {
            self.latest_hold = self.latest_hold.max(Some(clock));
            return before(self.latest) >= calibration::CALIBRATION_OVER_TENTHS;
        }
        let since = -before(self.latest_hold);
        (0..OVER_TENTHS).contains(&(since - calibration::CALIBRATION_OVER_TENTHS))
    }

    /// Frames that must not be used although they were, because another variant of them counts more. When there are any, the
    /// owner of the log takes everything again into [`Station::without`] them.
    pub fn to_set_aside(&self) -> Option<BTreeSet<(FrameId, FrameDigest)>> {
        self.frames.to_set_aside()
    }

    /// Brings windows, calibration and products up to date with the frames taken, and tells what changed. A window that is
    /// not whole is announced when nothing more came for it since the last time.
    pub fn settle(&mut self) -> Vec<Change> {
        self.bring_up(true)
    }

    /// As [`Station::settle`], with the calibration as it is: while much is coming, deriving it from everything time and again would
    /// cost more than all the rest. It catches up with the next `settle`.
    pub fn refresh(&mut self) -> Vec<Change> {
        self.bring_up(false)
    }

    /// Whether telemetry came that the calibration in use does not know yet.
    pub fn calibration_waits(&self) -> bool {
        self.calibration_touched
    }

    /// Whether everything taken is in the products and was told.
    pub fn is_settled(&self) -> bool {
        self.touched.is_empty() && self.unannounced.is_empty() && !self.calibration_touched && !self.checks_touched
    }

    fn bring_up(&mut self, calibrating: bool) -> Vec<Change> {
        let touched = self.recompute_windows();
        let calibration_changed = calibrating && self.recompute_calibration();
        if calibration_changed {
            let all: Vec<i64> = self.windows.keys().copied().collect();
            self.recompute_products(all);
        } else {
            self.recompute_products(touched.iter().copied());
        }
        let whole = |station: &Self, cell: &i64| {
            station.windows.get(cell).is_some_and(|w| usize::from(w.samples) >= super::window::WINDOW_SAMPLES)
        };
        let ready: Vec<i64> =
            self.unannounced.iter().filter(|cell| whole(self, cell) || !touched.contains(cell)).copied().collect();
        self.announce(ready)
    }

    /// As [`Station::settle`], and announces every window and gap: nothing more is coming for now.
    pub fn flush(&mut self) -> Vec<Change> {
        self.calibration_touched |= std::mem::take(&mut self.checks_touched);
        let mut changes = self.settle();
        let rest: Vec<i64> = self.unannounced.iter().copied().collect();
        changes.extend(self.announce(rest));
        for (from, to) in self.ledger.seconds.gaps() {
            if self.announced_gaps.insert((from, to)) {
                changes.push(Change::Gap { from: Clock::from_tenths(from * 10), to: Clock::from_tenths(to * 10) });
            }
        }
        changes
    }

    fn recompute_windows(&mut self) -> BTreeSet<i64> {
        let cells = std::mem::take(&mut self.touched);
        self.cells_unchecked += cells.len();
        let starts: BTreeSet<i64> = cells.iter().flat_map(|cell| [cell - 1, *cell]).collect();
        let held = &mut self.windows;
        windows(&self.archive, starts.iter().copied(), &self.settings.window, |cell, window| {
            match window {
                Some(window) => held.insert(cell, Box::new(window)),
                None => held.remove(&cell),
            };
        });
        // A wrong range makes a value a hundred times too large or too small: that does not wait for the next check.
        let mut touched = starts.iter().filter_map(|cell| self.windows.get(cell));
        self.calibration_touched |= touched.any(|window| self.derived.is_news(window));
        starts
    }

    /// Derives the calibration anew where anything it depends on came; whether a product may change by it.
    fn recompute_calibration(&mut self) -> bool {
        let due = self.cells_unchecked >= CHECK_CELLS.max(self.windows.len() / CHECK_SHARE);
        if !(std::mem::take(&mut self.calibration_touched) || due && self.checks_touched) {
            return false;
        }
        self.checks_touched = false;
        self.cells_unchecked = 0;
        let derived =
            calibration::derive(&self.archive, &self.windows, &self.settings, self.known.as_ref(), Some(&self.derived));
        let changed =
            derived.current() != self.derived.current() || derived.range_corrections != self.derived.range_corrections;
        let (before, now) = (&self.derived.anomalies, &derived.anomalies);
        let withdrawn = before.iter().filter(|anomaly| !now.contains(anomaly)).cloned();
        self.waiting.extend(withdrawn.map(Change::AnomalyWithdrawn));
        let new = now.iter().filter(|anomaly| !before.contains(anomaly)).cloned();
        self.waiting.extend(new.map(Change::Anomaly));
        if changed && let Some(current) = derived.current() {
            self.waiting.push(Change::Calibration { version: current.version, known_since: current.known_since });
        }
        self.derived = derived;
        changed
    }

    fn recompute_products(&mut self, cells: impl IntoIterator<Item = i64>) {
        let corrections = &self.derived.range_corrections;
        let held = |cell: i64| Some((cell, self.windows.get(&cell)?.as_ref()));
        let (cells, windows): (Vec<i64>, Vec<&Window>) = cells.into_iter().filter_map(held).unzip();
        for (cells, windows) in cells.chunks(DERIVED_AT_ONCE).zip(windows.chunks(DERIVED_AT_ONCE)) {
            let products = derive::products(windows, self.derived.current(), corrections, &self.settings.window);
            for (cell, product) in cells.iter().zip(products) {
                if self.announced.get(cell) != Some(&product.revision) {
                    self.unannounced.insert(*cell);
                }
                self.products.insert(*cell, Arc::new(product));
            }
        }
    }

    fn announce(&mut self, cells: Vec<i64>) -> Vec<Change> {
        let mut changes = std::mem::take(&mut self.waiting);
        // Seconds in order of time, whichever way the tape ran: whoever keeps note of them needs one entry a run.
        changes.sort_by_key(|change| if let Change::Raw(record) = change { Some(record.clock) } else { None });
        for cell in cells {
            self.unannounced.remove(&cell);
            let Some(product) = self.products.get(&cell) else { continue };
            let supersedes = self.announced.insert(cell, product.revision);
            if supersedes != Some(product.revision) {
                changes.push(Change::Window { product: product.clone(), supersedes });
            }
        }
        changes
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Every bit, frame and packet accounted for.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Everything decoded.
    pub fn archive(&self) -> &Archive {
        &self.archive
    }

    /// Calibration and anomalies.
    pub fn derived(&self) -> &Derived {
        &self.derived
    }

    /// The calibration in use.
    pub fn calibration(&self) -> Option<&Calibration> {
        self.derived.current()
    }

    /// Products in order of their windows.
    pub fn products(&self) -> impl DoubleEndedIterator<Item = &Product> {
        self.products.values().map(Arc::as_ref)
    }

    /// The product of a window.
    pub fn product(&self, start: Clock) -> Option<&Arc<Product>> {
        self.products.get(&cell_of(start)).filter(|product| product.start == start)
    }

    /// Products of windows that start in `[from, to)`, in order.
    pub fn products_between(&self, from: Clock, to: Clock) -> impl DoubleEndedIterator<Item = &Product> {
        let cells = if from < to {
            cell_of(from.plus_tenths(super::archive::CELL_TENTHS - 1))
                ..cell_of(to.plus_tenths(super::archive::CELL_TENTHS - 1))
        } else {
            0..0
        };
        self.products.range(cells).map(|(_, product)| product.as_ref())
    }

    /// The latest value.
    pub fn latest(&self) -> Option<&Product> {
        latest(self.products().rev())
    }

    /// The uncalibrated windows, in order.
    pub fn windows(&self) -> impl Iterator<Item = &Window> {
        self.windows.values().map(Box::as_ref)
    }

    /// The product of a window by the calibration that was known at an instrument clock.
    pub fn product_as_of(&self, start: Clock, known_at: Clock) -> Option<Product> {
        let window = self.windows.get(&cell_of(start)).filter(|window| window.start == start)?;
        let calibration = self.derived.as_of(known_at);
        let corrections = self.range_corrections_as_of(known_at);
        Some(derive::product(window, calibration, &corrections, &self.settings.window))
    }

    /// The spans of wrongly reported ranges as they were known at an instrument clock.
    pub fn range_corrections_as_of(&self, known_at: Clock) -> Vec<RangeCorrection> {
        calibration::range_corrections_as_of(&self.archive, &self.windows, &self.derived, known_at)
    }

    /// Events in order.
    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.archive.events()
    }

    /// Spans between the first and the last second that are not covered.
    pub fn gaps(&self) -> Vec<(Clock, Clock)> {
        let clock = |second: i64| Clock::from_tenths(second * 10);
        self.ledger.seconds.gaps().into_iter().map(|(from, to)| (clock(from), clock(to))).collect()
    }
}

/// A station over a whole log, taken as often as its conflicts need. `log` is called once per pass and gives the playbacks in order
/// of arrival.
pub fn replay<F>(settings: &Settings, known: Option<&KnownCalibration>, mut log: F) -> Station
where
    F: FnMut(&mut Station),
{
    let mut station = Station::new(settings.clone(), known.cloned());
    log(&mut station);
    if let Some(set_aside) = station.to_set_aside() {
        station = Station::without(settings.clone(), known.cloned(), set_aside);
        log(&mut station);
    }
    station.flush();
    station
}
