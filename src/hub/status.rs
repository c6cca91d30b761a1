//! What the service says of itself: one immutable picture at a time, taken over whole.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, RwLock};

use crate::units::Clock;

/// The state of the dump port and the store, as of the last durable batch.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Picture {
    /// Frames in the raw log: new, repeated and refused.
    pub frames_durable: u64,
    /// Good frames, each once.
    pub frames_new: u64,
    /// Good frames seen before.
    pub frames_repeated: u64,
    /// Frames refused, by reason.
    pub frames_refused: BTreeMap<&'static str, u64>,
    /// Packets read, by the name of their APID.
    pub packets: BTreeMap<&'static str, u64>,
    /// Packets refused, by reason.
    pub packets_refused: BTreeMap<&'static str, u64>,
    /// Bits of the playbacks that are over.
    pub bits_in: u64,
    /// Frames of one identity that check and differ.
    pub frame_conflicts: u64,
    /// Playbacks begun.
    pub playbacks: u64,
    /// Playbacks not over yet.
    pub playbacks_open: u64,
    /// Distinct seconds with a science record.
    pub seconds_covered: u64,
    /// Spans between them that are not covered.
    pub gaps: Vec<(Clock, Clock)>,
    /// Latest instrument clock received, s.
    pub latest_clock_s: Option<f64>,
    /// Version of the calibration in use; 0: none.
    pub calibration: u32,
    /// Events known.
    pub events: u64,
    /// Anomalies known.
    pub anomalies: u64,
    /// Everything durable is in the products.
    pub settled: bool,
}

/// What is being counted while it happens.
#[derive(Debug, Default)]
pub struct Counters {
    /// Octets read from senders.
    pub octets_in: AtomicU64,
    /// Connections accepted.
    pub connections: AtomicU64,
    /// Connections open.
    pub connections_open: AtomicU64,
    /// Connections turned away: not on the allow-list.
    pub connections_refused: AtomicU64,
    /// Connections closed because they were silent.
    pub connections_idle: AtomicU64,
    /// Durable batches.
    pub batches: AtomicU64,
    /// Writes the system refused.
    pub store_faults: AtomicU64,
    /// WebSocket clients connected.
    pub live_clients: AtomicU64,
    /// Messages delivered to them.
    pub live_delivered: AtomicU64,
    /// Messages they were told they missed.
    pub live_lagged: AtomicU64,
    /// Messages in recordings; what is written anew counts again.
    pub recorded: AtomicU64,
    /// Times a recording could not be written.
    pub recording_faults: AtomicU64,
}

/// Adds to a counter.
pub fn count(counter: &AtomicU64, n: u64) {
    counter.fetch_add(n, Ordering::Relaxed);
}

/// Reads a counter.
pub fn counted(counter: &AtomicU64) -> u64 {
    counter.load(Ordering::Relaxed)
}

/// Where the service is in its life.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Phase {
    /// The raw log is being read again.
    Replaying,
    /// Taking and serving.
    Running,
    /// The store refuses writes: nothing is taken until it does not.
    Stuck(String),
    /// Ending: nothing new is taken.
    Draining,
}

/// Everything the service says of itself.
#[derive(Debug)]
pub struct Board {
    picture: RwLock<Arc<Picture>>,
    phase: RwLock<Phase>,
    recording: RwLock<Option<String>>,
    /// Counted while it happens.
    pub counters: Counters,
}

impl Default for Board {
    fn default() -> Self {
        Self {
            picture: RwLock::default(),
            phase: RwLock::new(Phase::Replaying),
            recording: RwLock::default(),
            counters: Counters::default(),
        }
    }
}

impl Board {
    /// The picture as of the last durable batch.
    pub fn picture(&self) -> Arc<Picture> {
        self.picture.read().expect("no holder panics").clone()
    }

    /// Takes over a new picture.
    pub fn show(&self, picture: Picture) {
        *self.picture.write().expect("no holder panics") = Arc::new(picture);
    }

    /// Where the service is in its life.
    pub fn phase(&self) -> Phase {
        self.phase.read().expect("no holder panics").clone()
    }

    /// Why there is no recording of what comes in, while there is none.
    pub fn recording_trouble(&self) -> Option<String> {
        self.recording.read().expect("no holder panics").clone()
    }

    /// Takes over whether recordings can be written.
    pub fn tell_of_recording(&self, trouble: Option<String>) {
        *self.recording.write().expect("no holder panics") = trouble;
    }

    /// Enters a phase.
    pub fn enter(&self, phase: Phase) {
        *self.phase.write().expect("no holder panics") = phase;
    }
}
