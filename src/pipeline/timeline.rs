//! Packets of one kind in order of instrument time, held close together: a mission has hundreds of thousands of them, and most come
//! down in order or against it.

use std::collections::BTreeMap;

use super::archive::Addition;
use crate::units::Clock;

/// Tenths of a second in a chunk: a hundred of the most frequent packets, which one that comes late may move.
const CHUNK_TENTHS: i64 = 10_000;
/// Places by which a chunk grows: doubling would leave a quarter of them empty.
const GROWTH: usize = 16;

/// Instrument time and sequence count.
type Key = (Clock, u16);

/// Packets by instrument time and sequence count.
#[derive(Debug)]
pub struct Timeline<T> {
    chunks: BTreeMap<i64, Vec<(Key, T)>>,
    /// Packets whose place is another's, so that each counts as a conflict once, whichever came first.
    lost: BTreeMap<Key, Vec<T>>,
}

impl<T> Default for Timeline<T> {
    fn default() -> Self {
        Self { chunks: BTreeMap::new(), lost: BTreeMap::new() }
    }
}

impl<T: PartialEq + std::fmt::Debug> Timeline<T> {
    /// Adds one. Of two that claim one place and differ, the one whose debug form is lower stays, which is arbitrary but the same in
    /// every order.
    pub fn add(&mut self, clock: Clock, sequence: u16, value: T) -> Addition {
        let chunk = self.chunks.entry(clock.tenths().div_euclid(CHUNK_TENTHS)).or_default();
        let key = (clock, sequence);
        match chunk.binary_search_by_key(&key, |(held, _)| *held) {
            Err(at) => {
                if chunk.len() == chunk.capacity() {
                    chunk.reserve_exact(GROWTH);
                }
                chunk.insert(at, (key, value));
                Addition::New
            }
            Ok(at) if chunk[at].1 == value => Addition::Repeat,
            Ok(at) => {
                let lost = self.lost.entry(key).or_default();
                if lost.contains(&value) {
                    return Addition::Repeat;
                }
                let held = &mut chunk[at].1;
                let replaced = format!("{value:?}") < format!("{held:?}");
                lost.push(if replaced { std::mem::replace(held, value) } else { value });
                Addition::Conflict { replaced }
            }
        }
    }

    /// All, in order.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.chunks.values().flatten().map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_of_arrival_does_not_matter_and_of_two_that_differ_the_lower_stays() {
        let said = [(3, 20_001, "c"), (1, -5, "a"), (2, 20_001, "b"), (3, 20_001, "d")];
        for order in [[0, 1, 2, 3], [3, 2, 1, 0], [2, 3, 0, 1]] {
            let mut timeline = Timeline::default();
            for (sequence, tenths, text) in order.map(|n| said[n]) {
                timeline.add(Clock::from_tenths(tenths), sequence, text);
            }
            let held: Vec<&str> = timeline.iter().copied().collect();
            assert_eq!(held, ["a", "b", "c"]);
            assert_eq!(timeline.add(Clock::from_tenths(-5), 1, "a"), Addition::Repeat);
            assert_eq!(
                timeline.add(Clock::from_tenths(20_001), 3, "d"),
                Addition::Repeat,
                "it has lost its place before"
            );
            assert_eq!(timeline.add(Clock::from_tenths(20_001), 3, "e"), Addition::Conflict { replaced: false });
        }
    }
}
