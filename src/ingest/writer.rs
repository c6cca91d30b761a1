//! The one writer: makes every batch durable, then lets the station take it, then publishes what changed.
//!
//! It runs on a thread of its own. Nothing counts a frame before the raw log holds it. After a restart the log is taken again, and
//! only what the journal does not hold yet is published.

use std::collections::HashMap;
use std::sync::{Arc, RwLock};
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::mpsc;
use tokio_util::sync::CancellationToken;

use super::listener::Parts;
use super::raw_log::{Entry, JournalPart, RawLog, StoreError};
use crate::hub::status::{Board, Phase, Picture, count};
use crate::hub::wire::{AnomalyWire, EventWire, Gap, members};
use crate::hub::{Body, Hub, Journaled, SampleSource, Topic, journal};
use crate::ingest::wire::playback::PlaybackPart;
use crate::pipeline::files::version_json;
use crate::pipeline::{Change, PlaybackId, Settings, Station};
use crate::telemetry::AccRecord;
use crate::units::Clock;

/// A batch is written when it holds this much, however much more is waiting: it bounds memory and the time to the next commit. The store
/// gives a value a power of two of room: with what stands beside the frames, a batch stays just below 4 MiB.
const BATCH_OCTETS_MAX: usize = 3_900_000;
/// What waits for durability and has no company is written after this.
const TICK: Duration = Duration::from_millis(50);
/// Windows that are not whole are published when nothing came for this long: longer than a window and the pause of its
/// successor.
const IDLE_FLUSH: Duration = Duration::from_secs(90);
/// A refused write is tried again after this.
const RETRY: Duration = Duration::from_secs(1);

/// The station, shared with those who ask it about the past.
pub type SharedStation = Arc<RwLock<Station>>;

/// Raw samples out of the station's archive.
pub struct StationSamples(pub SharedStation);

impl SampleSource for StationSamples {
    fn second(&self, clock: Clock) -> Option<AccRecord> {
        let station = self.0.read().expect("no holder panics");
        station.archive().records_between(clock, clock).find(|record| record.clock == clock).copied()
    }
}

/// The one writer.
pub struct Writer {
    log: Arc<RawLog>,
    station: SharedStation,
    hub: Arc<Hub>,
    board: Arc<Board>,
    /// Number of the next batch.
    batch: u64,
    next_playback: u32,
    /// The open playback of a connection.
    open: HashMap<u64, u32>,
    /// Journal entries that are not durable yet.
    unjournaled: Journaled,
    /// Batches whose changes are published.
    published: u64,
    flushed: bool,
}

impl Writer {
    /// Takes up where the log ends: replays it, restores the hub, publishes what the journal lacks.
    ///
    /// # Errors
    /// When the log cannot be read.
    pub fn restore(
        log: Arc<RawLog>,
        station: SharedStation,
        hub: Arc<Hub>,
        board: Arc<Board>,
    ) -> Result<Self, StoreError> {
        let (entries, journaled) = log.journal()?;
        let mut writer = Self {
            log: log.clone(),
            station,
            hub,
            board,
            batch: 0,
            next_playback: 0,
            open: HashMap::new(),
            unjournaled: Journaled::default(),
            published: journaled,
            flushed: true,
        };
        let mut orphans: HashMap<u32, (u64, u64)> = HashMap::new();
        let mut to_restore = Some(entries);
        log.replay(|number, batch| {
            if number == journaled {
                writer.restore_hub(to_restore.take().unwrap_or_default());
            }
            batch.iter().for_each(|entry| note_open(&mut orphans, entry));
            writer.next_playback = batch.iter().map(next_playback).fold(writer.next_playback, u32::max);
            // What was told of already is not gathered again.
            writer.station.write().expect("no holder panics").announce_raw(number >= journaled);
            writer.take(&batch);
            writer.batch = number + 1;
            if number >= journaled {
                writer.settle_and_publish();
            }
        })?;
        if let Some(entries) = to_restore {
            writer.restore_hub(entries);
        }
        writer.published = writer.batch;
        let mut closing: Vec<Entry> = orphans
            .into_iter()
            .map(|(playback, (from_bit, to_bit))| Entry::Closed { playback, bits: to_bit - from_bit })
            .collect();
        closing.sort_by_key(next_playback);
        writer.write(&closing)?;
        writer.station.write().expect("no holder panics").announce_raw(true);
        writer.take(&closing);
        writer.set_frames_aside()?;
        writer.flush();
        writer.journal()?;
        writer.show();
        Ok(writer)
    }

    /// The hub takes up the journal of an earlier run, with the products as they are now.
    fn restore_hub(&mut self, entries: Vec<journal::Entry>) {
        let mut station = self.station.write().expect("no holder panics");
        station.settle();
        self.hub.restore(entries, station.products().copied());
    }

    /// Works until all connections are gone and everything they brought is durable, or until `give_up`.
    ///
    /// # Errors
    /// When the store refused to the end; what it refused was counted nowhere.
    pub fn run(
        mut self,
        runtime: &Handle,
        mut parts: mpsc::Receiver<Parts>,
        give_up: &CancellationToken,
    ) -> Result<(), StoreError> {
        let mut last_arrival = Instant::now();
        loop {
            let received = runtime.block_on(async { tokio::time::timeout(TICK, parts.recv()).await });
            match received {
                Ok(Some(first)) => {
                    let batch = self.gather(first, &mut parts);
                    self.write_until_durable(&batch, runtime, give_up)?;
                    self.take(&batch);
                    self.settle_and_publish();
                    self.publish_waiting();
                    self.conclude(&batch, parts.is_empty())?;
                    last_arrival = Instant::now();
                }
                Ok(None) => break,
                Err(_) => {
                    if !self.flushed && last_arrival.elapsed() > IDLE_FLUSH {
                        self.flush();
                    }
                    self.publish_waiting();
                    self.journal_until_durable(runtime, give_up)?;
                }
            }
        }
        self.flush();
        self.publish_waiting();
        self.journal_until_durable(runtime, give_up)
    }

    /// Everything that is waiting, up to the bound of a batch.
    fn gather(&mut self, first: Parts, parts: &mut mpsc::Receiver<Parts>) -> Vec<Entry> {
        let mut batch = Vec::new();
        let mut octets = 0;
        let mut next = Some(first);
        while let Some(parts_of) = next {
            octets += self.number(parts_of, &mut batch);
            next = if octets < BATCH_OCTETS_MAX { parts.try_recv().ok() } else { None };
        }
        batch
    }

    /// Gives the playbacks of a connection their numbers.
    fn number(&mut self, parts: Parts, batch: &mut Vec<Entry>) -> usize {
        let mut octets = 0;
        for part in parts.parts {
            let playback = self.open.get(&parts.connection).copied();
            match (part, playback) {
                (PlaybackPart::Opened, _) => {
                    let playback = self.next_playback;
                    self.next_playback += 1;
                    self.open.insert(parts.connection, playback);
                    batch.push(Entry::Opened { playback });
                }
                (PlaybackPart::Arrival(arrival), Some(playback)) => {
                    octets += arrival.octets.len();
                    batch.push(Entry::Arrival { playback, arrival });
                }
                (PlaybackPart::Closed { bits }, Some(playback)) => {
                    self.open.remove(&parts.connection);
                    batch.push(Entry::Closed { playback, bits });
                }
                (_, None) => debug_assert!(false, "a part outside of a playback"),
            }
        }
        octets
    }

    /// Makes a batch durable, with the journal so far.
    fn write(&mut self, batch: &[Entry]) -> Result<(), StoreError> {
        let journal = JournalPart {
            entries: &self.unjournaled.entries,
            forgotten: &self.unjournaled.forgotten,
            batches: self.published,
        };
        self.log.append(self.batch, batch, &journal)?;
        if !batch.is_empty() {
            self.batch += 1;
            count(&self.board.counters.batches, 1);
        }
        self.unjournaled = Journaled::default();
        Ok(())
    }

    fn write_until_durable(
        &mut self,
        batch: &[Entry],
        runtime: &Handle,
        give_up: &CancellationToken,
    ) -> Result<(), StoreError> {
        let mut stuck = false;
        loop {
            let error = match self.write(batch) {
                Ok(()) => break,
                Err(error) => error,
            };
            count(&self.board.counters.store_faults, 1);
            if !stuck {
                tracing::error!(%error, "the store refuses to write: nothing more is taken until it does; nothing is lost");
                stuck = true;
            }
            self.board.enter(Phase::Stuck(error.to_string()));
            let waited = runtime.block_on(async { tokio::time::timeout(RETRY, give_up.cancelled()).await });
            if waited.is_ok() {
                return Err(error);
            }
            if let Err(error) = self.log.reopen() {
                tracing::debug!(%error, "the store cannot be opened again yet");
            }
        }
        if stuck {
            tracing::info!("the store writes again");
            self.board.enter(Phase::Running);
        }
        Ok(())
    }

    fn journal(&mut self) -> Result<(), StoreError> {
        if self.unjournaled.entries.is_empty() { Ok(()) } else { self.write(&[]) }
    }

    fn journal_until_durable(&mut self, runtime: &Handle, give_up: &CancellationToken) -> Result<(), StoreError> {
        if self.unjournaled.entries.is_empty() { Ok(()) } else { self.write_until_durable(&[], runtime, give_up) }
    }

    /// The station takes a durable batch.
    fn take(&mut self, batch: &[Entry]) {
        let mut station = self.station.write().expect("no holder panics");
        take_into(&mut station, batch);
    }

    fn settle_and_publish(&mut self) {
        let changes = self.station.write().expect("no holder panics").settle();
        self.publish(changes);
        self.published = self.batch;
        self.flushed = false;
        self.show();
    }

    fn flush(&mut self) {
        let changes = self.station.write().expect("no holder panics").flush();
        self.publish(changes);
        self.flushed = true;
        self.show();
    }

    /// After a batch: partial windows when a playback is over and nothing more waits, and frames that lost a vote.
    fn conclude(&mut self, batch: &[Entry], nothing_waits: bool) -> Result<(), StoreError> {
        self.set_frames_aside()?;
        let one_ended = batch.iter().any(|entry| matches!(entry, Entry::Closed { .. }));
        if nothing_waits && one_ended {
            self.flush();
        }
        Ok(())
    }

    /// Two good frames of one identity differ, and the one in use lost the vote: the log is taken again without it.
    fn set_frames_aside(&mut self) -> Result<(), StoreError> {
        let station = self.station.read().expect("no holder panics");
        let Some(set_aside) = station.to_set_aside() else { return Ok(()) };
        let mut anew = Station::without(station.settings().clone(), None, set_aside);
        drop(station);
        tracing::warn!("good frames of one identity differ; the log is taken again with the ones seen more often");
        self.log.replay(|_, batch| take_into(&mut anew, &batch))?;
        let mut changes = anew.settle();
        // All else was told before; a window is told again only where its revision is another one.
        changes.retain(|change| matches!(change, Change::Window { .. } | Change::Calibration { .. }));
        anew.announce_raw(true);
        *self.station.write().expect("no holder panics") = anew;
        self.publish(changes);
        Ok(())
    }

    /// Publishes changes, some at a time: a new calibration changes every window there is.
    fn publish(&mut self, changes: Vec<Change>) {
        const AT_ONCE: usize = 1024;
        let mut changes = changes.into_iter().peekable();
        while changes.peek().is_some() {
            let bodies: Vec<Body> = {
                let station = self.station.read().expect("no holder panics");
                changes.by_ref().take(AT_ONCE).filter_map(|change| body(&self.hub, &station, change)).collect()
            };
            self.publish_bodies(bodies);
        }
    }

    /// What others left at the hub.
    fn publish_waiting(&mut self) {
        let waiting = self.hub.take_waiting();
        if !waiting.is_empty() {
            self.publish_bodies(waiting);
        }
    }

    fn publish_bodies(&mut self, bodies: Vec<Body>) {
        let journaled = self.hub.publish(bodies);
        self.unjournaled.entries.extend(journaled.entries);
        self.unjournaled.forgotten.extend(journaled.forgotten);
    }

    fn show(&self) {
        let station = self.station.read().expect("no holder panics");
        self.board.show(picture(&station));
    }
}

/// A station over a whole log, with nobody to tell.
///
/// # Errors
/// When the log cannot be read.
pub fn rebuild(log: &RawLog, settings: &Settings) -> Result<Station, StoreError> {
    let mut station = Station::new(settings.clone(), None);
    log.replay(|_, batch| take_into(&mut station, &batch))?;
    if let Some(set_aside) = station.to_set_aside() {
        station = Station::without(settings.clone(), None, set_aside);
        log.replay(|_, batch| take_into(&mut station, &batch))?;
    }
    station.flush();
    Ok(station)
}

fn take_into(station: &mut Station, batch: &[Entry]) {
    for entry in batch {
        match entry {
            Entry::Opened { playback } => station.open_playback(PlaybackId(*playback)),
            Entry::Arrival { playback, arrival } => station.take(PlaybackId(*playback), arrival),
            Entry::Closed { playback, bits } => station.close_playback(PlaybackId(*playback), *bits),
        }
    }
}

/// What a change says to readers; `None` when they know.
fn body(hub: &Hub, station: &Station, change: Change) -> Option<Body> {
    let mission = station.settings().time;
    let told = |topic, clock, json| Some(Body::Told { topic, clock, json });
    match change {
        Change::Window { product, .. } => match hub.told_revision(product.start) {
            Some(revision) if revision == product.revision => None,
            Some(revision) => Some(Body::Supersede(*product, Some(revision))),
            None => Some(Body::Window(*product)),
        },
        Change::Raw(record) => Some(Body::Second(record)),
        Change::Gap { from, to } => told(Topic::Window, from, members("gap", &Gap::new(&mission, from, to))),
        Change::Event(event) => told(Topic::Event, event.clock, members("event", &EventWire::new(&mission, &event))),
        Change::Anomaly(anomaly) => told(Topic::Anomaly, anomaly.from, members("anomaly", &AnomalyWire::new(&anomaly))),
        Change::Calibration { known_since, .. } => {
            let json = station.calibration().map(version_json)?;
            told(Topic::Calibration, known_since, members("calibration", &json))
        }
    }
}

fn picture(station: &Station) -> Picture {
    let ledger = station.ledger();
    let total = ledger.total();
    let refused: u64 = total.frames_refused.values().sum();
    let latest = ledger.seconds.spans().last().map(|(_, to)| to as f64);
    Picture {
        frames_durable: total.frames_new + total.frames_repeated + refused,
        frames_new: total.frames_new,
        frames_repeated: total.frames_repeated,
        frames_refused: total.frames_refused.iter().map(|(reason, n)| (reason.word(), *n)).collect(),
        packets: total.packets,
        packets_refused: total.packets_refused,
        bits_in: total.bits_in,
        frame_conflicts: ledger.frame_conflicts,
        playbacks: ledger.playbacks().count() as u64,
        playbacks_open: ledger.playbacks().filter(|(_, playback)| !playback.closed).count() as u64,
        seconds_covered: ledger.seconds.len(),
        gaps: station.gaps(),
        latest_clock_s: latest,
        calibration: station.calibration().map_or(0, |calibration| calibration.version),
        events: station.events().count() as u64,
        anomalies: station.derived().anomalies.len() as u64,
    }
}

/// One more than the playback an entry names.
fn next_playback(entry: &Entry) -> u32 {
    match entry {
        Entry::Opened { playback } | Entry::Arrival { playback, .. } | Entry::Closed { playback, .. } => playback + 1,
    }
}

/// Keeps the playbacks that a crash left open: from which bit of their stream to which.
fn note_open(open: &mut HashMap<u32, (u64, u64)>, entry: &Entry) {
    match entry {
        Entry::Opened { playback } => {
            open.insert(*playback, (0, 0));
        }
        Entry::Closed { playback, .. } => {
            open.remove(playback);
        }
        Entry::Arrival { playback, arrival } => {
            let end_bit = arrival.first_bit + arrival.octets.len() as u64 * 8;
            let span = open.entry(*playback).or_insert((arrival.first_bit, end_bit));
            if *span == (0, 0) {
                *span = (arrival.first_bit, end_bit);
            }
            span.1 = span.1.max(end_bit);
        }
    }
}
