//! A reader's position, and what comes after it.

use std::collections::VecDeque;
use std::sync::Arc;

use tokio::sync::watch;

use super::journal::Entry;
use super::message::{Body, Message, Topics};
use super::{Hub, State};
use crate::units::Clock;

/// Reads the messages of some topics, each once, in order.
pub struct Reader {
    hub: Arc<Hub>,
    topics: Topics,
    /// Everything up to here has been handed on, or was on other topics.
    after: u64,
    /// A reader further behind than this many messages is told what it missed; `None`: never, it waits for the disk.
    behind_max: Option<u64>,
    /// Leaves out messages about windows of which a later message is known.
    newest_only: bool,
    head: watch::Receiver<u64>,
}

/// What a reader gets.
#[derive(Debug)]
pub enum Step {
    /// The next messages.
    Messages(Vec<Arc<Message>>),
    /// Messages it will not get.
    Lag {
        /// Number of the first message missed, of whatever topic.
        from_seq: u64,
        /// Number of the last.
        to_seq: u64,
        /// How many of them were on its topics.
        count: u64,
    },
}

impl Hub {
    /// A reader of what comes after a message.
    pub fn reader(self: &Arc<Self>, topics: Topics, after: u64, behind_max: Option<u64>) -> Reader {
        Reader { hub: self.clone(), topics, after, behind_max, newest_only: false, head: self.head.subscribe() }
    }

    /// What is known from a clock on, each window once and in its present revision, in the order of the messages about it.
    pub fn known_from(self: &Arc<Self>, from: Clock, topics: Topics) -> History {
        let state = self.state.read().expect("no holder panics");
        let mut messages = Vec::new();
        let mut seconds = VecDeque::new();
        if topics.has(super::Topic::Window) {
            let held = state.windows.range(from..).map(|(_, held)| held);
            messages.extend(held.map(|held| Arc::new(Message::new(held.seq, Body::Window(held.product.clone())))));
        }
        for entry in state.journal.iter().filter(|entry| topics.has(entry.topic())) {
            match &**entry {
                Entry::Told { seq, topic, clock, json } if *clock >= from => {
                    let body = Body::Told { topic: *topic, clock: *clock, json: json.clone() };
                    messages.push(Arc::new(Message::new(*seq, body)));
                }
                Entry::Seconds { .. } => seconds.push_back(entry.clone()),
                Entry::Told { .. } | Entry::Windows { .. } => {}
            }
        }
        messages.sort_by_key(|message| message.seq);
        let read_through = seconds.front().map_or(0, |entry| entry.first_seq() - 1);
        History { hub: self.clone(), from, messages: messages.into(), seconds, read_through, after: state.head_seq }
    }

    /// Number of the last message on these topics up to a message.
    pub fn last_seq_on(&self, topics: Topics, through: u64) -> u64 {
        let state = self.state.read().expect("no holder panics");
        let newest = topics.iter().map(|topic| state.rings[topic as usize].last_seq).max().unwrap_or(0);
        if newest <= through {
            return newest;
        }
        let at = state.journal.partition_point(|entry| entry.first_seq() <= through);
        let before = state.journal.range(..at).rev().find(|entry| topics.has(entry.topic()));
        before.map_or(0, |entry| entry.last_seq().min(through))
    }
}

/// What is known from a clock on, handed on some at a time; raw samples are read again as they are wanted.
pub struct History {
    hub: Arc<Hub>,
    from: Clock,
    messages: VecDeque<Arc<Message>>,
    /// Runs of raw samples, and the message up to which they are read.
    seconds: VecDeque<Arc<Entry>>,
    read_through: u64,
    after: u64,
}

impl History {
    /// Number of the message after which a reader goes on.
    pub fn after(&self) -> u64 {
        self.after
    }

    /// The next messages, at most so many; none when it is over.
    pub fn next(&mut self, messages_max: usize) -> Vec<Arc<Message>> {
        let mut next = Vec::new();
        while next.len() < messages_max {
            let second = self.next_second();
            let told = self.messages.front().map(|message| message.seq);
            match (second, told) {
                (Some((seq, clock)), told) if told.is_none_or(|told| seq < told) => {
                    self.read_through = seq;
                    let record = self.hub.samples.second(clock);
                    next.extend(record.map(|record| Arc::new(Message::new(seq, Body::Second(Box::new(record))))));
                }
                (_, Some(_)) => next.extend(self.messages.pop_front()),
                (_, None) => break,
            }
        }
        next
    }

    /// The next second of raw samples that is late enough.
    fn next_second(&mut self) -> Option<(u64, Clock)> {
        loop {
            let entry = self.seconds.front()?;
            let mut later = (self.read_through + 1).max(entry.first_seq())..=entry.last_seq();
            match later.find(|seq| entry.clock_of(*seq) >= self.from) {
                Some(seq) => {
                    self.read_through = seq - 1;
                    return Some((seq, entry.clock_of(seq)));
                }
                None => {
                    self.read_through = entry.last_seq();
                    self.seconds.pop_front();
                }
            }
        }
    }
}

impl Reader {
    /// This reader, for whom a window told of again while it was behind is told of once, by the newest message.
    pub fn newest_only(mut self) -> Self {
        self.newest_only = true;
        self
    }

    /// Number of the message up to which all is read.
    pub fn after(&self) -> u64 {
        self.after
    }

    /// Waits until there is something after its position; false when the hub is gone.
    pub async fn wait(&mut self) -> bool {
        let after = self.after;
        self.head.wait_for(|head| *head > after).await.is_ok()
    }

    /// The next messages, at most about so many; `None` when there is nothing yet.
    pub fn next(&mut self, messages_max: usize) -> Option<Step> {
        let hub = self.hub.clone();
        let state = hub.state.read().expect("no holder panics");
        let head = state.head_seq;
        if head <= self.after {
            return None;
        }
        // After a crash the numbers jump: that many are not that many messages.
        let too_far = self.behind_max.filter(|most| head - self.after > *most);
        let lost_through = state.forgotten_through.max(too_far.map_or(0, |most| state.before_the_last(most)));
        if lost_through > self.after {
            let from_seq = self.after + 1;
            let count = state.count_on(self.topics, self.after, lost_through);
            self.after = lost_through;
            if count > 0 {
                return Some(Step::Lag { from_seq, to_seq: lost_through, count });
            }
        }
        if self.topics.iter().all(|topic| state.rings[topic as usize].dropped_through <= self.after) {
            let mut messages = state.in_rings(self.topics, self.after, messages_max);
            self.after = match messages.last() {
                Some(last) if messages.len() == messages_max => last.seq,
                _ => head,
            };
            if self.newest_only {
                messages.retain(|message| state.is_newest(message.seq, message.body.window_start()));
            }
            return Some(Step::Messages(messages));
        }
        let mut messages = Vec::new();
        let mut clocks = Vec::new();
        let at = state.journal.partition_point(|entry| entry.last_seq() <= self.after);
        let mut read_through = head;
        for entry in state.journal.range(at..) {
            let first = entry.first_seq().max(self.after + 1);
            let room = messages_max.saturating_sub(messages.len() + clocks.len()) as u64;
            if room == 0 {
                read_through = self.after;
                break;
            }
            if !self.topics.has(entry.topic()) {
                self.after = entry.last_seq();
                continue;
            }
            let last = entry.last_seq().min(first + room - 1);
            match &**entry {
                Entry::Seconds { .. } => clocks.extend((first..=last).map(|seq| (seq, entry.clock_of(seq)))),
                entry => {
                    let newest_only = self.newest_only && matches!(entry, Entry::Windows { .. });
                    let wanted = |seq: &u64| !newest_only || state.is_newest(*seq, Some(entry.clock_of(*seq)));
                    messages.extend((first..=last).filter(wanted).filter_map(|seq| state.in_journal(entry, seq)));
                }
            }
            self.after = last;
            if last < entry.last_seq() {
                read_through = last;
                break;
            }
        }
        // Numbers between the last entry and the head were left out after a crash.
        self.after = read_through;
        drop(state);
        if !clocks.is_empty() {
            let seconds = clocks.into_iter().filter_map(|(seq, clock)| Some((seq, hub.samples.second(clock)?)));
            messages.extend(seconds.map(|(seq, record)| Arc::new(Message::new(seq, Body::Second(Box::new(record))))));
            messages.sort_by_key(|message| message.seq);
        }
        Some(Step::Messages(messages))
    }
}

impl State {
    /// Messages after a number, from the rings, merged by number.
    fn in_rings(&self, topics: Topics, after: u64, messages_max: usize) -> Vec<Arc<Message>> {
        let mut messages = Vec::new();
        for topic in topics.iter() {
            let ring = &self.rings[topic as usize].messages;
            let at = ring.partition_point(|message| message.seq <= after);
            messages.extend(ring.range(at..).take(messages_max).cloned());
        }
        messages.sort_by_key(|message| message.seq);
        messages.truncate(messages_max);
        messages
    }

    /// Whether no later message is about the same window.
    fn is_newest(&self, seq: u64, window_start: Option<Clock>) -> bool {
        let held = window_start.and_then(|start| self.windows.get(&start));
        held.is_none_or(|held| held.seq <= seq)
    }

    /// A message of the past, with what is known of its window now.
    fn in_journal(&self, entry: &Entry, seq: u64) -> Option<Arc<Message>> {
        let body = match entry {
            Entry::Told { topic, clock, json, .. } => Body::Told { topic: *topic, clock: *clock, json: json.clone() },
            Entry::Windows { supersedes, .. } => {
                let product = self.windows.get(&entry.clock_of(seq))?.product.clone();
                if *supersedes { Body::Supersede(product, None) } else { Body::Window(product) }
            }
            Entry::Seconds { .. } => return None,
        };
        Some(Arc::new(Message::new(seq, body)))
    }

    /// Number of the message before the last so many, of whatever topic; 0 where there are no more.
    fn before_the_last(&self, messages: u64) -> u64 {
        let mut left = messages;
        for entry in self.journal.iter().rev() {
            if entry.count() > left {
                return entry.last_seq() - left;
            }
            left -= entry.count();
        }
        0
    }

    /// Messages on these topics with numbers in (after, through].
    fn count_on(&self, topics: Topics, after: u64, through: u64) -> u64 {
        let at = self.journal.partition_point(|entry| entry.last_seq() <= after);
        let concerned = self.journal.range(at..).take_while(|entry| entry.first_seq() <= through);
        concerned
            .filter(|entry| topics.has(entry.topic()))
            .map(|entry| entry.last_seq().min(through) - (entry.first_seq() - 1).max(after))
            .sum()
    }
}
