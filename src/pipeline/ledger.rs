//! Every bit, frame and packet accounted for, in total and by playback.

use std::collections::BTreeMap;

use crate::ingest::wire::{FrameRefusal, Sense};
use crate::units::Clock;

/// Number of a playback, in order of arrival.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PlaybackId(pub u32);

/// Counters of one playback, or of all.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Account {
    /// Bits received.
    pub bits_in: u64,
    /// Frames found in the stream, good or not.
    pub frames_found: u64,
    /// Good frames not seen before.
    pub frames_new: u64,
    /// Good frames seen before.
    pub frames_repeated: u64,
    /// Frames refused, by reason.
    pub frames_refused: BTreeMap<FrameRefusal, u64>,
    /// Packets read, by the name of their APID; idle packets too.
    pub packets: BTreeMap<&'static str, u64>,
    /// Packets refused, by reason.
    pub packets_refused: BTreeMap<&'static str, u64>,
}

impl Account {
    /// Whether frames found = new + repeated + refused.
    pub fn closes(&self) -> bool {
        self.frames_found == self.frames_new + self.frames_repeated + self.frames_refused.values().sum::<u64>()
    }

    fn add(&mut self, other: &Account) {
        self.bits_in += other.bits_in;
        self.frames_found += other.frames_found;
        self.frames_new += other.frames_new;
        self.frames_repeated += other.frames_repeated;
        other.frames_refused.iter().for_each(|(reason, n)| *self.frames_refused.entry(*reason).or_default() += n);
        other.packets.iter().for_each(|(name, n)| *self.packets.entry(name).or_default() += n);
        other.packets_refused.iter().for_each(|(reason, n)| *self.packets_refused.entry(reason).or_default() += n);
    }
}

/// The account of one playback.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlaybackAccount {
    /// Its counters.
    pub account: Account,
    /// Sense of its good frames; None while there is none.
    pub sense: Option<Sense>,
    /// Position modulo 8, in received order, of the first received bit of its first good frame.
    pub bit_offset: Option<u8>,
    /// Distinct seconds with a science record that its frames brought, themselves or by completing another's.
    pub seconds: SecondSet,
    /// Whether it is over.
    pub closed: bool,
}

/// A set of whole seconds, as disjoint half-open spans in order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SecondSet(BTreeMap<i64, i64>);

impl SecondSet {
    /// Adds the second that holds a clock.
    pub fn add(&mut self, clock: Clock) {
        let second = clock.tenths().div_euclid(10);
        let (mut from, mut to) = (second, second + 1);
        if let Some((&start, &end)) = self.0.range(..=second).next_back() {
            if end > second {
                return;
            }
            if end == second {
                self.0.remove(&start);
                from = start;
            }
        }
        if let Some(end) = self.0.remove(&to) {
            to = end;
        }
        self.0.insert(from, to);
    }

    /// Seconds in the set.
    pub fn len(&self) -> u64 {
        self.0.iter().map(|(from, to)| (to - from) as u64).sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Spans between the first and the last second that are not in the set, in whole seconds.
    pub fn gaps(&self) -> Vec<(i64, i64)> {
        self.0.iter().zip(self.0.iter().skip(1)).map(|((_, to), (next, _))| (*to, *next)).collect()
    }

    /// The spans, in whole seconds.
    pub fn spans(&self) -> impl Iterator<Item = (i64, i64)> + '_ {
        self.0.iter().map(|(from, to)| (*from, *to))
    }
}

/// The whole ledger.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ledger {
    playbacks: BTreeMap<PlaybackId, PlaybackAccount>,
    /// Seconds covered by all together.
    pub seconds: SecondSet,
    /// Frames of one identity that check and differ.
    pub frame_conflicts: u64,
}

impl Ledger {
    /// The account of a playback, opened if need be.
    pub fn playback_mut(&mut self, id: PlaybackId) -> &mut PlaybackAccount {
        self.playbacks.entry(id).or_default()
    }

    /// Playbacks in order of arrival.
    pub fn playbacks(&self) -> impl Iterator<Item = (PlaybackId, &PlaybackAccount)> {
        self.playbacks.iter().map(|(id, account)| (*id, account))
    }

    /// The sum over all playbacks.
    pub fn total(&self) -> Account {
        let mut total = Account::default();
        self.playbacks.values().for_each(|playback| total.add(&playback.account));
        total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_second_set_is_the_set_of_its_seconds(seconds in prop::collection::vec(0i64..40, 0..60)) {
            let mut set = SecondSet::default();
            seconds.iter().for_each(|second| set.add(Clock::from_tenths(second * 10 + 3)));
            let expected: std::collections::BTreeSet<i64> = seconds.into_iter().collect();
            let held: Vec<i64> = set.spans().flat_map(|(from, to)| from..to).collect();
            prop_assert_eq!(held, expected.iter().copied().collect::<Vec<_>>());
            prop_assert_eq!(set.len(), expected.len() as u64);
        }
    }
}
