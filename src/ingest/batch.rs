//! The octets of one batch of the raw log: entries back to back, little-endian, each with a tag in front.

use super::raw_log::{Entry, Place};
use crate::ingest::wire::{Arrival, Direction, FrameId, FrameRefusal, Polarity, Sense, Verdict};

const OPENED: u8 = 1;
const GOOD: u8 = 2;
const REPEAT: u8 = 3;
const REFUSED: u8 = 4;
const CLOSED: u8 = 5;

/// An entry as it stands in a batch.
#[derive(Debug, Clone, PartialEq)]
pub enum Stored {
    /// Whole; for a frame, the offset of its octets.
    Entry(Entry, u32),
    /// A frame that is known: its octets are elsewhere.
    Repeat {
        /// Playback.
        playback: u32,
        /// The arrival, without octets.
        arrival: Arrival,
        /// Where the octets are.
        place: Place,
    },
}

/// Adds an entry, as a reference when its frame is known; the offset of a frame's octets.
pub fn write(out: &mut Vec<u8>, entry: &Entry, original: Option<Place>) -> Option<u32> {
    match entry {
        Entry::Opened { playback } => {
            out.push(OPENED);
            out.extend(playback.to_le_bytes());
        }
        Entry::Closed { playback, bits } => {
            out.push(CLOSED);
            out.extend(playback.to_le_bytes());
            out.extend(bits.to_le_bytes());
        }
        Entry::Arrival { playback, arrival } => {
            out.push(match (arrival.verdict, original) {
                (Verdict::Refused(_), _) => REFUSED,
                (Verdict::Good(_), Some(_)) => REPEAT,
                (Verdict::Good(_), None) => GOOD,
            });
            out.extend(playback.to_le_bytes());
            out.push(sense_code(arrival.sense));
            out.extend(arrival.first_bit.to_le_bytes());
            match arrival.verdict {
                Verdict::Good(id) => {
                    out.push(id.channel);
                    out.extend(id.count.to_le_bytes());
                }
                Verdict::Refused(refusal) => out.push(refusal as u8),
            }
            if let (Verdict::Good(_), Some(place)) = (arrival.verdict, original) {
                out.extend(place.batch.to_le_bytes());
                out.extend(place.offset.to_le_bytes());
                return None;
            }
            let offset = out.len() as u32;
            out.extend((arrival.octets.len() as u32).to_le_bytes());
            out.extend(&arrival.octets);
            return Some(offset);
        }
    }
    None
}

/// Reads a batch; where it is damaged, the octet and what stands there.
pub fn read(octets: &[u8]) -> Result<Vec<Stored>, (usize, String)> {
    let mut reader = Reader { octets, at: 0 };
    let mut entries = Vec::new();
    while reader.at < octets.len() {
        let start = reader.at;
        match reader.entry() {
            Some(entry) => entries.push(entry),
            None => return Err((start, format!("tag {}", octets[start]))),
        }
    }
    Ok(entries)
}

/// The frame whose octets begin (with their length) at an offset.
pub fn frame_at(octets: &[u8], offset: u32) -> Option<&[u8]> {
    let mut reader = Reader { octets, at: offset as usize };
    reader.counted()
}

fn sense_code(sense: Sense) -> u8 {
    u8::from(sense.direction == Direction::Reverse) | u8::from(sense.polarity == Polarity::Inverted) << 1
}

fn sense(code: u8) -> Option<Sense> {
    let direction = if code & 1 == 0 { Direction::Forward } else { Direction::Reverse };
    let polarity = if code & 2 == 0 { Polarity::Normal } else { Polarity::Inverted };
    (code < 4).then_some(Sense { direction, polarity })
}

struct Reader<'a> {
    octets: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let taken = self.octets.get(self.at..self.at.checked_add(N)?)?.try_into().ok();
        self.at += N;
        taken
    }

    fn octet(&mut self) -> Option<u8> {
        self.take::<1>().map(|[octet]| octet)
    }

    fn u32(&mut self) -> Option<u32> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn counted(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()? as usize;
        let taken = self.octets.get(self.at..self.at.checked_add(length)?)?;
        self.at += length;
        Some(taken)
    }

    fn entry(&mut self) -> Option<Stored> {
        let entry = match self.octet()? {
            OPENED => Entry::Opened { playback: self.u32()? },
            CLOSED => Entry::Closed { playback: self.u32()?, bits: self.u64()? },
            tag @ (GOOD | REPEAT | REFUSED) => return self.arrival(tag),
            _ => return None,
        };
        Some(Stored::Entry(entry, 0))
    }

    fn arrival(&mut self, tag: u8) -> Option<Stored> {
        let playback = self.u32()?;
        let sense = sense(self.octet()?)?;
        let first_bit = self.u64()?;
        let verdict = match tag {
            REFUSED => {
                let code = self.octet()?;
                Verdict::Refused(FrameRefusal::ALL.into_iter().find(|refusal| *refusal as u8 == code)?)
            }
            _ => Verdict::Good(FrameId { channel: self.octet()?, count: self.u32()? }),
        };
        let mut arrival = Arrival { sense, first_bit, verdict, octets: Vec::new() };
        if tag == REPEAT {
            let place = Place { batch: self.u64()?, offset: self.u32()? };
            return Some(Stored::Repeat { playback, arrival, place });
        }
        let offset = self.at as u32;
        arrival.octets = self.counted()?.to_vec();
        Some(Stored::Entry(Entry::Arrival { playback, arrival }, offset))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrival(verdict: Verdict) -> Entry {
        let sense = Sense { direction: Direction::Reverse, polarity: Polarity::Inverted };
        Entry::Arrival { playback: 7, arrival: Arrival { sense, first_bit: 12_345, verdict, octets: vec![1, 2, 3] } }
    }

    #[test]
    fn every_entry_is_read_as_it_was_written() {
        let good = arrival(Verdict::Good(FrameId { channel: 1, count: 9 }));
        let entries = [
            Entry::Opened { playback: 7 },
            good.clone(),
            arrival(Verdict::Refused(FrameRefusal::Spacecraft)),
            Entry::Closed { playback: 7, bits: 99 },
        ];
        let mut octets = Vec::new();
        let offsets: Vec<_> = entries.iter().map(|entry| write(&mut octets, entry, None)).collect();
        let read_back = read(&octets).unwrap();
        for ((entry, stored), offset) in entries.iter().zip(&read_back).zip(offsets) {
            assert_eq!(stored, &Stored::Entry(entry.clone(), offset.unwrap_or(0)));
            if let Some(offset) = offset {
                assert_eq!(frame_at(&octets, offset), Some(&[1, 2, 3][..]));
            }
        }
        let place = Place { batch: 3, offset: 44 };
        let mut repeat = Vec::new();
        assert_eq!(write(&mut repeat, &good, Some(place)), None);
        assert!(
            matches!(&read(&repeat).unwrap()[..], [Stored::Repeat { playback: 7, place: found, .. }] if *found == place)
        );
    }

    #[test]
    fn a_damaged_batch_is_told_with_its_place() {
        let mut octets = Vec::new();
        write(&mut octets, &Entry::Opened { playback: 1 }, None);
        octets.push(77);
        assert_eq!(read(&octets), Err((5, "tag 77".into())));
    }
}
