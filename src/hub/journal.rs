//! The journal: which message had which number, as references that need little room and last over restarts.
//!
//! A message about a window refers to the window, a second of raw samples to its clock; the few others are kept whole. A message read from the journal carries what is known of its window *now*: a later revision has a number of its own
//! further on.

use super::message::Topic;
use crate::units::Clock;

/// A run of messages with consecutive numbers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Entry {
    /// Windows at regular distances.
    Windows {
        /// Number of the first.
        first_seq: u64,
        /// How many.
        count: u32,
        /// Start of the first window.
        first_start: Clock,
        /// From one window to the next; negative when they came backwards.
        step_tenths: i32,
        /// Whether they superseded an earlier revision.
        supersedes: bool,
    },
    /// Seconds of raw samples at regular distances.
    Seconds {
        /// Number of the first.
        first_seq: u64,
        /// How many.
        count: u32,
        /// Clock of the first.
        first_clock: Clock,
        /// From one to the next; negative when they came backwards.
        step_tenths: i32,
    },
    /// Any other message, whole.
    Told {
        /// Its number.
        seq: u64,
        /// Its topic.
        topic: Topic,
        /// The instrument clock it is about.
        clock: Clock,
        /// Its JSON members.
        json: String,
    },
}

impl Entry {
    /// Number of its first message.
    pub fn first_seq(&self) -> u64 {
        match self {
            Entry::Windows { first_seq, .. } | Entry::Seconds { first_seq, .. } => *first_seq,
            Entry::Told { seq, .. } => *seq,
        }
    }

    /// Messages in it.
    pub fn count(&self) -> u64 {
        match self {
            Entry::Windows { count, .. } | Entry::Seconds { count, .. } => u64::from(*count),
            Entry::Told { .. } => 1,
        }
    }

    /// Number of its last message.
    pub fn last_seq(&self) -> u64 {
        self.first_seq() + self.count() - 1
    }

    /// The topic of all its messages.
    pub fn topic(&self) -> Topic {
        match self {
            Entry::Windows { .. } => Topic::Window,
            Entry::Seconds { .. } => Topic::Raw,
            Entry::Told { topic, .. } => *topic,
        }
    }

    /// Takes one more window into the run, where it continues it.
    pub fn continue_with_window(&mut self, seq: u64, start: Clock, superseding: bool) -> bool {
        match self {
            Entry::Windows { first_seq, count, first_start, step_tenths, supersedes } if *supersedes == superseding => {
                continue_run(seq, start, *first_seq, count, *first_start, step_tenths)
            }
            _ => false,
        }
    }

    /// Takes one more second into the run, where it continues it.
    pub fn continue_with_second(&mut self, seq: u64, clock: Clock) -> bool {
        match self {
            Entry::Seconds { first_seq, count, first_clock, step_tenths } => {
                continue_run(seq, clock, *first_seq, count, *first_clock, step_tenths)
            }
            _ => false,
        }
    }

    /// The clock that a message of a run is about.
    pub fn clock_of(&self, seq: u64) -> Clock {
        let (first_seq, first, step_tenths) = match self {
            Entry::Windows { first_seq, first_start, step_tenths, .. } => (first_seq, first_start, step_tenths),
            Entry::Seconds { first_seq, first_clock, step_tenths, .. } => (first_seq, first_clock, step_tenths),
            Entry::Told { clock, .. } => return *clock,
        };
        first.plus_tenths((seq - first_seq) as i64 * i64::from(*step_tenths))
    }

    /// As it stands in the store.
    pub fn to_octets(&self) -> Vec<u8> {
        let mut out = Vec::new();
        match self {
            Entry::Windows { first_seq, count, first_start, step_tenths, supersedes } => {
                out.push(if *supersedes { 2 } else { 1 });
                out.extend(first_seq.to_le_bytes());
                out.extend(count.to_le_bytes());
                out.extend(first_start.tenths().to_le_bytes());
                out.extend(step_tenths.to_le_bytes());
            }
            Entry::Seconds { first_seq, count, first_clock, step_tenths } => {
                out.push(3);
                out.extend(first_seq.to_le_bytes());
                out.extend(count.to_le_bytes());
                out.extend(first_clock.tenths().to_le_bytes());
                out.extend(step_tenths.to_le_bytes());
            }
            Entry::Told { seq, topic, clock, json } => {
                out.push(4);
                out.extend(seq.to_le_bytes());
                out.push(*topic as u8);
                out.extend(clock.tenths().to_le_bytes());
                out.extend(json.as_bytes());
            }
        }
        out
    }

    /// Reads one entry of the store; `None` when it is damaged.
    pub fn from_octets(octets: &[u8]) -> Option<Self> {
        let (&tag, mut rest) = octets.split_first()?;
        let first_seq = take(&mut rest).map(u64::from_le_bytes)?;
        match tag {
            1 | 2 => Some(Entry::Windows {
                first_seq,
                count: take(&mut rest).map(u32::from_le_bytes)?,
                first_start: Clock::from_tenths(take(&mut rest).map(i64::from_le_bytes)?),
                step_tenths: take(&mut rest).map(i32::from_le_bytes)?,
                supersedes: tag == 2,
            }),
            3 => Some(Entry::Seconds {
                first_seq,
                count: take(&mut rest).map(u32::from_le_bytes)?,
                first_clock: Clock::from_tenths(take(&mut rest).map(i64::from_le_bytes)?),
                step_tenths: take(&mut rest).map(i32::from_le_bytes)?,
            }),
            4 => {
                let [topic] = take(&mut rest)?;
                let clock = Clock::from_tenths(take(&mut rest).map(i64::from_le_bytes)?);
                let topic = *Topic::ALL.get(usize::from(topic))?;
                Some(Entry::Told { seq: first_seq, topic, clock, json: String::from_utf8(rest.to_vec()).ok()? })
            }
            _ => None,
        }
    }
}

fn continue_run(seq: u64, clock: Clock, first_seq: u64, count: &mut u32, first: Clock, step_tenths: &mut i32) -> bool {
    if first_seq + u64::from(*count) != seq {
        return false;
    }
    let last_tenths = first.tenths() + i64::from(*step_tenths) * i64::from(*count - 1);
    let Ok(step) = i32::try_from(clock.tenths() - last_tenths) else { return false };
    if *count > 1 && step != *step_tenths {
        return false;
    }
    *step_tenths = step;
    *count += 1;
    true
}

fn take<const N: usize>(rest: &mut &[u8]) -> Option<[u8; N]> {
    let (taken, left) = rest.split_first_chunk::<N>()?;
    *rest = left;
    Some(*taken)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_is_read_as_it_was_written() {
        let entries = [
            Entry::Windows {
                first_seq: 5,
                count: 7,
                first_start: Clock::from_tenths(250),
                step_tenths: -250,
                supersedes: true,
            },
            Entry::Seconds { first_seq: 12, count: 9, first_clock: Clock::from_tenths(30), step_tenths: 10 },
            Entry::Told { seq: 21, topic: Topic::Event, clock: Clock::from_tenths(1), json: "\"a\":1".into() },
        ];
        for entry in entries {
            assert_eq!(Entry::from_octets(&entry.to_octets()), Some(entry));
        }
        assert_eq!(Entry::from_octets(&[9, 1]), None);
    }

    #[test]
    fn windows_in_step_share_an_entry() {
        let start = |n: i64| Clock::from_tenths(n * 250);
        let mut run =
            Entry::Windows { first_seq: 1, count: 1, first_start: start(4), step_tenths: 0, supersedes: false };
        assert!(run.continue_with_window(2, start(5), false));
        assert!(run.continue_with_window(3, start(6), false));
        assert!(!run.continue_with_window(4, start(8), false), "out of step");
        assert!(!run.continue_with_window(4, start(7), true), "another kind");
        assert!(!run.continue_with_window(5, start(7), false), "a number left out");
        assert_eq!((run.count(), run.last_seq()), (3, 3));
    }
}
