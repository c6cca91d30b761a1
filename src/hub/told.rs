//! Which revision of every window was told last, and by which message, as the store keeps it: in chunks of windows, so that a new
//! calibration, which tells of every window again, costs a write a chunk.
//!
//! After a crash this says what readers know: a window whose product is another one by then is told of again.

use crate::pipeline::product::Revision;
use crate::pipeline::window::WINDOW_TENTHS;
use crate::units::Clock;

/// From one window to the next.
const STEP_TENTHS: i64 = WINDOW_TENTHS / 2;
/// Windows in a chunk: 53 minutes.
const WINDOWS: i64 = 128;
/// A message number and a revision.
const OCTETS: usize = 16;

/// What was told of a window last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Told {
    /// Start of the window.
    pub start: Clock,
    /// Number of the message.
    pub seq: u64,
    /// The revision told.
    pub revision: Revision,
}

/// Number of the chunk that holds a window.
pub fn chunk_of(start: Clock) -> i64 {
    start.tenths().div_euclid(STEP_TENTHS * WINDOWS)
}

/// Start of the first window of a chunk.
pub fn first_start(chunk: i64) -> Clock {
    Clock::from_tenths(chunk * STEP_TENTHS * WINDOWS)
}

/// A chunk as it stands in the store; a window that was not told of has number 0.
pub fn to_octets(chunk: i64, told: impl Iterator<Item = Told>) -> Vec<u8> {
    let mut octets = vec![0u8; WINDOWS as usize * OCTETS];
    for Told { start, seq, revision } in told {
        let place = (start.tenths() - first_start(chunk).tenths()) / STEP_TENTHS;
        let at = place as usize * OCTETS;
        octets[at..at + 8].copy_from_slice(&seq.to_le_bytes());
        octets[at + 8..at + 16].copy_from_slice(&revision.0.to_le_bytes());
    }
    octets
}

/// Reads a chunk of the store.
pub fn from_octets(chunk: i64, octets: &[u8]) -> impl Iterator<Item = Told> + '_ {
    let number = |octets: &[u8]| octets.try_into().map_or(0, u64::from_le_bytes);
    octets.chunks_exact(OCTETS).zip(0i64..).filter_map(move |(octets, place)| {
        let (seq, revision) = octets.split_at(8);
        let start = first_start(chunk).plus_tenths(place * STEP_TENTHS);
        let told = Told { start, seq: number(seq), revision: Revision(number(revision)) };
        (told.seq > 0).then_some(told)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_is_read_as_it_was_written() {
        for first in [-5 * 250, 127 * 250, 12_345 * 250] {
            let start = Clock::from_tenths(first);
            let told = Told { start, seq: 77, revision: Revision(0xfeed) };
            let chunk = chunk_of(start);
            let octets = to_octets(chunk, std::iter::once(told));
            assert_eq!(from_octets(chunk, &octets).collect::<Vec<_>>(), [told]);
        }
        assert_ne!(chunk_of(Clock::from_tenths(127 * 250)), chunk_of(Clock::from_tenths(128 * 250)));
    }
}
