//! The one seam between those who make products and those who read them.
//!
//! One writer publishes; readers hold a position each and read at their own pace. What is kept for them is bounded: the last
//! messages of every topic in memory, all others as references (see [`journal`]), so a slow reader costs nothing but its own
//! wait, and is told what it missed. One hub serves one mission and spacecraft, whose ids stand in every key of its store.

pub mod desk;
pub mod journal;
mod message;
mod reader;
pub mod status;
pub mod told;
pub mod wire;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, Mutex, RwLock};
use std::time::Instant;

use tokio::sync::watch;

use crate::pipeline::product::{Product, Revision, latest};
use crate::telemetry::AccRecord;
use crate::units::Clock;
use journal::Entry;
pub use message::{Body, Message, Topic, Topics};
pub use reader::{History, Reader, Step};
use told::Told;

/// Messages published under one hold of the lock, so that readers wait for milliseconds at most.
const PUBLISHED_AT_ONCE: usize = 512;
/// Entries of the journal kept; a reader that asks for older ones is told what it missed.
const JOURNAL_ENTRIES_MAX: usize = 1 << 18;

/// Messages of others than the one writer that wait for it.
const WAITING_MAX: usize = 64;

/// Where raw samples are read again.
pub trait SampleSource: Send + Sync {
    /// The second of raw samples that begins at a clock.
    fn second(&self, clock: Clock) -> Option<AccRecord>;
}

/// A window as it is known now.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// The window.
    pub product: Arc<Product>,
    /// Number of the last message about it.
    pub seq: u64,
    /// The revision that message told: after a restart the product may be a later one until it is told of.
    pub told: Revision,
}

/// The newest calibrated window.
#[derive(Debug, Clone, Copy)]
pub struct Latest {
    /// The window.
    pub product: Product,
    /// When this service came to know it.
    pub since: Instant,
}

/// The last messages of a topic.
#[derive(Default)]
struct Ring {
    messages: VecDeque<Arc<Message>>,
    /// The last message that is no longer here.
    dropped_through: u64,
    /// The last message of the topic.
    last_seq: u64,
}

#[derive(Default)]
struct State {
    head_seq: u64,
    rings: [Ring; 6],
    windows: BTreeMap<Clock, Held>,
    journal: VecDeque<Arc<Entry>>,
    /// Messages up to here are no longer in the journal.
    forgotten_through: u64,
}

/// The hub of one mission and spacecraft.
pub struct Hub {
    mission: String,
    spacecraft_id: u16,
    ring_messages_max: usize,
    state: RwLock<State>,
    latest: RwLock<Option<Latest>>,
    head: watch::Sender<u64>,
    /// What others than the one writer have to tell.
    waiting: Mutex<VecDeque<Body>>,
    samples: Arc<dyn SampleSource>,
}

/// What publishing adds to the journal of the store.
#[derive(Debug, Default)]
pub struct Journaled {
    /// New entries, in order.
    pub entries: Vec<Entry>,
    /// First numbers of the entries that fell out of the bound.
    pub forgotten: Vec<u64>,
    /// Chunks (see [`told`]) with windows told of.
    pub chunks: BTreeSet<i64>,
}

impl Journaled {
    /// Whether the store need not be told anything.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty() && self.forgotten.is_empty() && self.chunks.is_empty()
    }

    /// Adds what a later publication adds.
    pub fn extend(&mut self, later: Journaled) {
        self.entries.extend(later.entries);
        self.forgotten.extend(later.forgotten);
        self.chunks.extend(later.chunks);
    }
}

impl Hub {
    /// An empty hub.
    pub fn new(mission: &str, spacecraft_id: u16, ring_messages_max: usize, samples: Arc<dyn SampleSource>) -> Self {
        Self {
            mission: mission.into(),
            spacecraft_id,
            ring_messages_max,
            state: RwLock::default(),
            latest: RwLock::default(),
            head: watch::Sender::new(0),
            waiting: Mutex::default(),
            samples,
        }
    }

    /// The mission it serves.
    pub fn mission(&self) -> &str {
        &self.mission
    }

    /// The spacecraft it serves.
    pub fn spacecraft_id(&self) -> u16 {
        self.spacecraft_id
    }

    /// Takes up where an earlier run ended: its journal, what it told of every window, and the number up to which it may have told
    /// messages that the journal does not hold. `product` gives windows as they are now; what was told of windows that there are no longer
    /// is given back.
    pub fn restore(
        &self,
        entries: Vec<Entry>,
        told: impl IntoIterator<Item = Told>,
        numbered_through: u64,
        product: impl Fn(Clock) -> Option<Arc<Product>>,
    ) -> Vec<Told> {
        let mut state = self.state.write().expect("no holder panics");
        state.forgotten_through = entries.first().map_or(0, |entry| entry.first_seq() - 1);
        state.head_seq = entries.last().map_or(0, Entry::last_seq).max(numbered_through);
        for entry in &entries {
            state.rings[entry.topic() as usize].last_seq = entry.last_seq();
        }
        let head_seq = state.head_seq;
        state.rings.iter_mut().for_each(|ring| ring.dropped_through = head_seq);
        let mut gone = Vec::new();
        for told in told {
            match product(told.start) {
                Some(product) => {
                    state.windows.insert(told.start, Held { product, seq: told.seq, told: told.revision });
                }
                None => gone.push(told),
            }
        }
        state.journal = entries.into_iter().map(Arc::new).collect();
        self.note_latest(&state);
        self.head.send_replace(head_seq);
        gone
    }

    /// What was told of windows that there are no longer.
    pub fn gone(&self, is_there: impl Fn(Clock) -> bool) -> Vec<Told> {
        let state = self.state.read().expect("no holder panics");
        let gone = state.windows.iter().filter(|(start, _)| !is_there(**start));
        gone.map(|(start, held)| Told { start: *start, seq: held.seq, revision: held.told }).collect()
    }

    /// Everything told whole that the journal still holds and that was not taken back, with the clock it is about.
    pub fn told_texts(&self) -> BTreeMap<(Topic, String), Clock> {
        let state = self.state.read().expect("no holder panics");
        let mut told = BTreeMap::new();
        for entry in &state.journal {
            let Entry::Told { topic, clock, json, .. } = &**entry else { continue };
            match wire::withdrawn_by(json) {
                Some(anomaly) => told.remove(&(*topic, anomaly)),
                None => told.insert((*topic, json.clone()), *clock),
            };
        }
        told
    }

    /// A chunk of what was told last, as the store keeps it.
    pub fn told_chunk(&self, chunk: i64) -> Vec<u8> {
        let state = self.state.read().expect("no holder panics");
        let held = state.windows.range(told::first_start(chunk)..told::first_start(chunk + 1));
        told::to_octets(chunk, held.map(|(start, held)| Told { start: *start, seq: held.seq, revision: held.told }))
    }

    /// Numbers and publishes messages; what the store's journal must take up.
    pub fn publish(&self, bodies: Vec<Body>) -> Journaled {
        let mut journaled = Journaled::default();
        let mut bodies = bodies.into_iter().peekable();
        while bodies.peek().is_some() {
            let mut entries = Vec::new();
            let mut state = self.state.write().expect("no holder panics");
            for body in bodies.by_ref().take(PUBLISHED_AT_ONCE) {
                state.head_seq += 1;
                let seq = state.head_seq;
                note_in_journal(&mut entries, seq, &body);
                journaled.chunks.extend(body.window_start().map(told::chunk_of));
                state.take_up(seq, body, self.ring_messages_max);
            }
            state.journal.extend(entries.iter().cloned().map(Arc::new));
            while state.journal.len() > JOURNAL_ENTRIES_MAX {
                let Some(entry) = state.journal.pop_front() else { break };
                state.forgotten_through = entry.last_seq();
                journaled.forgotten.push(entry.first_seq());
            }
            self.note_latest(&state);
            self.head.send_replace(state.head_seq);
            journaled.entries.extend(entries);
        }
        journaled
    }

    /// Leaves something for the one writer to publish. When it is slow, the oldest of what waits gives way: newer news of the same
    /// kind stand for it.
    pub fn tell(&self, body: Body) {
        let mut waiting = self.waiting.lock().expect("no holder panics");
        if waiting.len() == WAITING_MAX {
            waiting.pop_front();
        }
        waiting.push_back(body);
    }

    /// What was left to be published.
    pub fn take_waiting(&self) -> Vec<Body> {
        self.waiting.lock().expect("no holder panics").drain(..).collect()
    }

    /// The number of the last message, as it changes: a slot that holds the latest only.
    pub fn subscribe(&self) -> watch::Receiver<u64> {
        self.head.subscribe()
    }

    /// The revision of a window that was told last.
    pub fn told_revision(&self, start: Clock) -> Option<Revision> {
        let state = self.state.read().expect("no holder panics");
        state.windows.get(&start).map(|held| held.told)
    }

    fn note_latest(&self, state: &State) {
        let newest = latest(state.windows.values().rev().map(|held| held.product.as_ref()));
        let mut latest = self.latest.write().expect("no holder panics");
        match newest {
            Some(product) if latest.is_none_or(|latest| latest.product.revision != product.revision) => {
                *latest = Some(Latest { product: *product, since: Instant::now() });
            }
            Some(_) => {}
            None => *latest = None,
        }
    }

    /// The newest calibrated window.
    pub fn latest(&self) -> Option<Latest> {
        *self.latest.read().expect("no holder panics")
    }

    /// Number of the last message.
    pub fn head_seq(&self) -> u64 {
        self.state.read().expect("no holder panics").head_seq
    }

    /// Windows known.
    pub fn windows(&self) -> usize {
        self.state.read().expect("no holder panics").windows.len()
    }

    /// The windows that start in a span, in order of time.
    pub fn history(&self, from: Clock, to: Clock) -> Vec<Product> {
        if from > to {
            return Vec::new();
        }
        let state = self.state.read().expect("no holder panics");
        state.windows.range(from..=to).map(|(_, held)| *held.product).collect()
    }

    /// Start of the first and of the last window.
    pub fn span(&self) -> Option<(Clock, Clock)> {
        let state = self.state.read().expect("no holder panics");
        Some((*state.windows.first_key_value()?.0, *state.windows.last_key_value()?.0))
    }
}

impl State {
    fn take_up(&mut self, seq: u64, body: Body, ring_messages_max: usize) {
        match &body {
            Body::Window(product) | Body::Supersede(product, _) => {
                self.windows.insert(product.start, Held { product: product.clone(), seq, told: product.revision });
            }
            Body::Withdrawn { start, .. } => {
                self.windows.remove(start);
            }
            Body::Second(_) | Body::Told { .. } => {}
        }
        let ring = &mut self.rings[body.topic() as usize];
        ring.last_seq = seq;
        if let Body::Second(_) = body {
            // Too many to keep: readers get them from the journal.
            ring.dropped_through = seq;
            return;
        }
        ring.messages.push_back(Arc::new(Message::new(seq, body)));
        if ring.messages.len() > ring_messages_max
            && let Some(dropped) = ring.messages.pop_front()
        {
            ring.dropped_through = dropped.seq;
        }
    }
}

fn note_in_journal(entries: &mut Vec<Entry>, seq: u64, body: &Body) {
    let last = entries.last_mut();
    match body {
        Body::Window(product) | Body::Supersede(product, _) => {
            let supersedes = matches!(body, Body::Supersede(..));
            let (first_seq, first_start) = (seq, product.start);
            if !last.is_some_and(|last| last.continue_with_window(seq, first_start, supersedes)) {
                entries.push(Entry::Windows { first_seq, count: 1, first_start, step_tenths: 0, supersedes });
            }
        }
        Body::Second(record) => {
            let (first_seq, first_clock) = (seq, record.clock);
            if !last.is_some_and(|last| last.continue_with_second(seq, first_clock)) {
                entries.push(Entry::Seconds { first_seq, count: 1, first_clock, step_tenths: 0 });
            }
        }
        Body::Withdrawn { start, json } => {
            entries.push(Entry::Told { seq, topic: Topic::Window, clock: *start, json: json.clone() });
        }
        Body::Told { topic, clock, json } => {
            entries.push(Entry::Told { seq, topic: *topic, clock: *clock, json: json.clone() });
        }
    }
}
