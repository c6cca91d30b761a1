//! The one writer: makes every batch durable, then lets the station take it, then publishes what changed.
//!
//! It runs on a thread of its own. Nothing counts a frame before the raw log holds it. After a restart the log is taken again, and
//! only what the journal does not hold yet is published.

mod telling;

use std::collections::HashMap;
use std::sync::{Arc, RwLock};
use std::time::{Duration, Instant};

use tokio::runtime::Handle;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

use telling::{body, picture, taken_back, whole};

use super::listener::Parts;
use super::log_replay::{Orphans, take_entry, take_log, taken_again};
use super::raw_log::{Entry, Journal, JournalPart, RawLog, StoreError};
use crate::hub::status::{Board, Phase, Picture, count};
use crate::hub::told::Told;
use crate::hub::wire::{told_anomaly, window_withdrawn};
use crate::hub::{Body, Hub, Journaled, SampleSource};
use crate::ingest::wire::playback::PlaybackPart;
use crate::pipeline::{Change, Station};
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
/// While more keeps coming, deriving the calibration from everything waits for so many times as long as it took last.
const CALIBRATION_PAUSES: u32 = 8;
/// The same of taking the log again for frames that lost a vote.
const AGAIN_PAUSES: u32 = 8;
/// Numbers of messages reserved with every commit: more than are ever told between two. After a crash they are left out, so that no
/// number is given twice.
const NUMBERS_AHEAD: u64 = 1 << 24;
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
    /// When the calibration was derived last, and how long that took.
    calibrated: Option<(Instant, Duration)>,
    /// The same of taking the log again.
    taken_again: Option<(Instant, Duration)>,
    /// Frames in use have lost a vote, and the log is not taken again without them yet.
    aside_waits: bool,
    /// When the log could not be taken again last, while it cannot.
    aside_failed: Option<Instant>,
}

impl Writer {
    /// Takes up where the log ends: replays it, restores the hub from its journal, publishes what that lacks.
    ///
    /// # Errors
    /// When the log cannot be read.
    pub fn restore(
        log: Arc<RawLog>,
        journal: Journal,
        station: SharedStation,
        hub: Arc<Hub>,
        board: Arc<Board>,
    ) -> Result<Self, StoreError> {
        let start = Instant::now();
        let messages = journal.entries.len();
        let mut batch = 0;
        let mut orphans;
        {
            let mut held = station.write().expect("no holder panics");
            orphans = Orphans::new(held.settings().link.frame_octets);
            held.announce_raw(journal.batches == 0);
            take_log(&log, &mut held, |station, number, entries| {
                entries.iter().for_each(|stored| orphans.note(stored));
                batch = number + 1;
                // What was told of already is not gathered again.
                if number < journal.batches {
                    station.forget_changes();
                }
                station.announce_raw(batch >= journal.batches);
            })?;
            held.announce_raw(true);
        }
        let mut writer = Self {
            log,
            station,
            hub,
            board,
            batch,
            next_playback: orphans.next_playback,
            open: HashMap::new(),
            unjournaled: Journaled::default(),
            published: journal.batches,
            flushed: true,
            calibrated: None,
            taken_again: None,
            aside_waits: false,
            aside_failed: None,
        };
        let (changes, gone) = writer.restore_hub(journal);
        let closing = orphans.closing();
        writer.write(&closing, NUMBERS_AHEAD)?;
        writer.take(&closing);
        writer.publish_untold(changes, &gone);
        writer.published = writer.batch;
        writer.journal()?;
        writer.show();
        tracing::info!(batches = batch, journal = messages, took = ?start.elapsed(), "the raw log is taken again");
        Ok(writer)
    }

    /// The hub takes up the journal of an earlier run; what may have to be told beside it, and what was told of windows that there are no
    /// longer.
    fn restore_hub(&mut self, journal: Journal) -> (Vec<Change>, Vec<Told>) {
        let mut station = self.station.write().expect("no holder panics");
        let changes = station.flush();
        let product = |start| station.product(start).cloned();
        let gone = self.hub.restore(journal.entries, journal.told, journal.numbered_through, product);
        (changes, gone)
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
                    let (batch, waiting) = self.gather(first, &mut parts);
                    self.write_until_durable(&batch, runtime, give_up, NUMBERS_AHEAD)?;
                    self.take(&batch);
                    self.bring_up();
                    // A connection may have gone meanwhile.
                    waiting.into_iter().for_each(|durable| durable.send(()).unwrap_or(()));
                    self.publish_waiting();
                    self.conclude(&batch, parts.is_empty());
                    last_arrival = Instant::now();
                }
                Ok(None) => break,
                Err(_) => {
                    if !self.flushed && last_arrival.elapsed() > IDLE_FLUSH {
                        self.flush();
                    } else if self.station.read().expect("no holder panics").calibration_waits() {
                        self.bring_up();
                    }
                    if self.aside_waits {
                        self.set_frames_aside(1);
                        // Another station has everything to tell again, windows that are not whole too.
                        if !self.aside_waits {
                            self.flush();
                        }
                    }
                    self.publish_waiting();
                    self.journal_until_durable(runtime, give_up)?;
                }
            }
        }
        self.flush();
        self.publish_waiting();
        self.write_until_durable(&[], runtime, give_up, 0)
    }

    /// Everything that is waiting, up to the bound of a batch, and who is to be told when it is durable and counted.
    fn gather(&mut self, first: Parts, parts: &mut mpsc::Receiver<Parts>) -> (Vec<Entry>, Vec<oneshot::Sender<()>>) {
        let (mut batch, mut waiting) = (Vec::new(), Vec::new());
        let mut octets = 0;
        let mut next = Some(first);
        while let Some(mut parts_of) = next {
            waiting.extend(parts_of.durable.take());
            octets += self.number(parts_of, &mut batch);
            next = if octets < BATCH_OCTETS_MAX { parts.try_recv().ok() } else { None };
        }
        (batch, waiting)
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
    fn write(&mut self, batch: &[Entry], numbers_ahead: u64) -> Result<(), StoreError> {
        let told: Vec<_> = self.unjournaled.chunks.iter().map(|chunk| (*chunk, self.hub.told_chunk(*chunk))).collect();
        let journal = JournalPart {
            entries: &self.unjournaled.entries,
            forgotten: &self.unjournaled.forgotten,
            told: &told,
            numbered_through: self.hub.head_seq() + numbers_ahead,
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
        numbers_ahead: u64,
    ) -> Result<(), StoreError> {
        let mut stuck = false;
        loop {
            let error = match self.write(batch, numbers_ahead) {
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
        if self.unjournaled.is_empty() { Ok(()) } else { self.write(&[], NUMBERS_AHEAD) }
    }

    fn journal_until_durable(&mut self, runtime: &Handle, give_up: &CancellationToken) -> Result<(), StoreError> {
        if self.unjournaled.is_empty() {
            return Ok(());
        }
        self.write_until_durable(&[], runtime, give_up, NUMBERS_AHEAD)
    }

    /// The station takes a durable batch.
    fn take(&mut self, batch: &[Entry]) {
        let mut station = self.station.write().expect("no holder panics");
        batch.iter().for_each(|entry| take_entry(&mut station, entry));
        self.aside_waits = station.to_set_aside().is_some();
    }

    /// Products of what was taken, and a new calibration where one is due.
    fn bring_up(&mut self) {
        let due = self.calibrated.is_none_or(|(when, took)| when.elapsed() >= took * CALIBRATION_PAUSES);
        let changes = {
            let mut station = self.station.write().expect("no holder panics");
            if due && station.calibration_waits() {
                let start = Instant::now();
                let changes = station.settle();
                self.calibrated = Some((Instant::now(), start.elapsed()));
                changes
            } else {
                station.refresh()
            }
        };
        self.publish(changes);
        self.published = self.batch;
        self.flushed = false;
        self.show();
    }

    fn flush(&mut self) {
        let start = Instant::now();
        let changes = self.station.write().expect("no holder panics").flush();
        self.calibrated = Some((Instant::now(), start.elapsed()));
        self.publish(changes);
        self.flushed = true;
        self.show();
    }

    /// After a batch: partial windows when a playback is over and nothing more waits, and frames that lost a vote.
    fn conclude(&mut self, batch: &[Entry], nothing_waits: bool) {
        self.set_frames_aside(AGAIN_PAUSES);
        let one_ended = batch.iter().any(|entry| matches!(entry, Entry::Closed { .. }));
        if nothing_waits && one_ended {
            self.flush();
        }
    }

    /// Two good frames of one identity differ, and the one in use lost the vote: the log is taken again without it, beside the station that
    /// others ask meanwhile. While more such come that waits for `pauses` times as long as it took last. Where the log cannot be read the
    /// station stays as it is, with the frames it has, and it is tried again.
    fn set_frames_aside(&mut self, pauses: u32) {
        let due = self.taken_again.is_none_or(|(when, took)| when.elapsed() >= took * pauses)
            && self.aside_failed.is_none_or(|when| when.elapsed() >= RETRY);
        if !self.aside_waits || !due {
            return;
        }
        let start = Instant::now();
        let again = {
            let station = self.station.read().expect("no holder panics");
            taken_again(&self.log, &station, |_, _, _| {})
        };
        let again = match again {
            Ok(again) => again,
            Err(error) => {
                match self.aside_failed {
                    None => {
                        tracing::error!(%error, "the log cannot be taken again without frames that lost a vote; it is tried again")
                    }
                    Some(_) => tracing::debug!(%error, "the log cannot be taken again yet"),
                }
                self.aside_failed = Some(Instant::now());
                return;
            }
        };
        if self.aside_failed.take().is_some() {
            tracing::info!("the log is taken again at last");
        }
        let Some(mut again) = again else { return };
        let changes = again.settle();
        again.announce_raw(true);
        let gone = self.hub.gone(|start| again.product(start).is_some());
        *self.station.write().expect("no holder panics") = again;
        self.taken_again = Some((Instant::now(), start.elapsed()));
        self.aside_waits = false;
        self.publish_untold(changes, &gone);
        self.show();
    }

    /// Publishes what a station that has told nothing yet says, but for what was told before; a window is told again only where
    /// its revision is another one. Of anomalies all that there are now are told, and those told before that there are no longer are
    /// taken back, whatever the changes say of how it came, and so are windows that are `gone`.
    fn publish_untold(&mut self, mut changes: Vec<Change>, gone: &[Told]) {
        let told = self.hub.told_texts();
        let taken_back: Vec<Body> = {
            let station = self.station.read().expect("no holder panics");
            let anomalies = &station.derived().anomalies;
            changes.retain(|change| !matches!(change, Change::Anomaly(_) | Change::AnomalyWithdrawn(_)));
            changes.extend(anomalies.iter().cloned().map(Change::Anomaly));
            changes.retain(|change| match whole(&station, change) {
                Some(Body::Told { topic, json, .. }) => !told.contains_key(&(topic, json)),
                _ => true,
            });
            let mission = station.settings().time;
            let of_anomalies = taken_back(told, anomalies.iter().map(|anomaly| told_anomaly(&mission, anomaly)));
            gone.iter().map(|told| window_withdrawn(&mission, told)).chain(of_anomalies).collect()
        };
        self.unjournaled.extend(self.hub.publish(taken_back));
        self.publish(changes);
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
            self.unjournaled.extend(self.hub.publish(bodies));
        }
    }

    /// What others left at the hub.
    fn publish_waiting(&mut self) {
        let waiting = self.hub.take_waiting();
        if !waiting.is_empty() {
            self.unjournaled.extend(self.hub.publish(waiting));
        }
    }

    fn show(&self) {
        let station = self.station.read().expect("no holder panics");
        let picture = picture(&station);
        self.board.show(Picture { settled: picture.settled && !self.aside_waits, ..picture });
    }
}

#[cfg(test)]
mod tests;
