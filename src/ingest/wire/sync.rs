//! From a bit stream to transfer frames, whatever the direction, polarity and bit alignment of the playback.
//!
//! While searching, a marker with at most one wrong bit at any bit offset, in any of the four senses, is a candidate; it is
//! believed when its frame checks. Once locked, the next frame is expected in its place: a marker with at most three
//! wrong bits is accepted there, and two frames without one are passed over (their frames are still tried) before the
//! search starts again behind the last good frame, so that nothing is skipped. Where a good frame ends the passing over,
//! what lies between is searched as well: two slips may have cancelled. Every decision waits for the bits it needs: how
//! the stream is cut into chunks changes nothing.

use super::coding::{ChannelDecoder, LinkConfig, SYNC_MARKER};
use super::frame::{FrameId, FrameRefusal, TransferFrame};

/// Wrong bits allowed in a marker while searching.
const SEARCH_WRONG_BITS_MAX: u32 = 1;
/// Wrong bits allowed in a marker at its expected place.
const LOCKED_WRONG_BITS_MAX: u32 = 3;
/// Frames without a marker that are passed over before searching again.
const FLYWHEEL_FRAMES_MAX: u32 = 2;
/// Frames that do not check, in their expected places, before searching again: bounds what must be kept.
const UNCHECKED_FRAMES_MAX: u32 = 256;
/// Refused frames that may lie over one another, of those that a search finds: a stretch that is full of markers would otherwise become
/// many times its size.
const OVERLAPPING_MAX: usize = 8;
/// Bits of the marker.
const MARKER_BITS: u64 = 32;

/// Whether the tape ran forward.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Direction {
    /// First bit first.
    Forward,
    /// Last bit first.
    Reverse,
}

/// Whether the bits are as they were written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Polarity {
    /// As written.
    Normal,
    /// Every bit complemented.
    Inverted,
}

/// One of the four senses of a playback.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Sense {
    /// Direction of the tape.
    pub direction: Direction,
    /// Polarity of the link.
    pub polarity: Polarity,
}

impl Sense {
    /// The four, in the order in which they are tried.
    pub const ALL: [Sense; 4] = [
        Sense { direction: Direction::Forward, polarity: Polarity::Normal },
        Sense { direction: Direction::Forward, polarity: Polarity::Inverted },
        Sense { direction: Direction::Reverse, polarity: Polarity::Normal },
        Sense { direction: Direction::Reverse, polarity: Polarity::Inverted },
    ];

    /// The marker as it appears in a stream of this sense.
    const fn marker(self) -> u32 {
        let marker = match self.direction {
            Direction::Forward => SYNC_MARKER,
            Direction::Reverse => SYNC_MARKER.reverse_bits(),
        };
        match self.polarity {
            Polarity::Normal => marker,
            Polarity::Inverted => !marker,
        }
    }

    /// `forward` or `reverse`.
    pub const fn direction_word(self) -> &'static str {
        match self.direction {
            Direction::Forward => "forward",
            Direction::Reverse => "reverse",
        }
    }

    /// `normal` or `inverted`.
    pub const fn polarity_word(self) -> &'static str {
        match self.polarity {
            Polarity::Normal => "normal",
            Polarity::Inverted => "inverted",
        }
    }
}

/// What became of a frame found in the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It checks.
    Good(FrameId),
    /// It is not used, and why.
    Refused(FrameRefusal),
}

/// A frame found in the stream, good or not.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Arrival {
    /// The sense in which it was found.
    pub sense: Sense,
    /// First received bit of the frame (its marker left out), counted from the start of the stream.
    pub first_bit: u64,
    /// What became of it.
    pub verdict: Verdict,
    /// The frame, channel coding removed where that succeeded, as it was received otherwise.
    pub octets: Vec<u8>,
}

/// A frame in its expected place.
#[derive(Debug, Clone, Copy)]
struct Lock {
    sense: Sense,
    /// Where the next marker-and-frame begins.
    next_bit: u64,
    /// Frames in a row without a marker.
    passed_over: u32,
    /// Whether one was passed over since the last good one.
    skipped: bool,
    /// Frames that did not check since the last good one.
    unchecked: u32,
}

impl Lock {
    /// Behind a good frame.
    const fn new(sense: Sense, next_bit: u64) -> Self {
        Self { sense, next_bit, passed_over: 0, skipped: false, unchecked: 0 }
    }
}

/// Finds frames in one stream of bits.
pub struct Deframer {
    link: LinkConfig,
    decoder: ChannelDecoder,
    /// The bits still needed.
    buffer: Vec<u8>,
    /// Octets dropped before `buffer`.
    dropped_octets: u64,
    lock: Option<Lock>,
    /// Next bit to try as the start of a marker.
    search_bit: u64,
    /// End of the last good frame: nothing before it is read again.
    floor_bit: u64,
    /// Refused frames that a good one may still show to be none.
    doubtful: Vec<Arrival>,
}

impl Deframer {
    /// For a stream of this link, whose configuration must have no faults.
    pub fn new(link: LinkConfig) -> Self {
        Self {
            link,
            decoder: ChannelDecoder::new(link),
            buffer: Vec::new(),
            dropped_octets: 0,
            lock: None,
            search_bit: 0,
            floor_bit: 0,
            doubtful: Vec::new(),
        }
    }

    /// Bits received so far.
    pub fn received_bits(&self) -> u64 {
        (self.dropped_octets + self.buffer.len() as u64) * 8
    }

    /// Takes the next octets of the stream and hands on the frames they complete, in the order received.
    pub fn push(&mut self, octets: &[u8], mut hand_on: impl FnMut(Arrival)) {
        self.buffer.extend_from_slice(octets);
        while self.step(false, &mut hand_on) {}
        self.drop_what_is_read();
    }

    /// The stream has ended: hands on what was waiting for more bits.
    pub fn finish(&mut self, mut hand_on: impl FnMut(Arrival)) {
        while self.step(true, &mut hand_on) {}
        self.doubtful.drain(..).for_each(hand_on);
    }

    fn coded_bits(&self) -> u64 {
        self.link.coded_octets() as u64 * 8
    }

    /// One decision; false when more bits are needed.
    fn step(&mut self, ended: bool, hand_on: &mut impl FnMut(Arrival)) -> bool {
        match self.lock {
            Some(lock) => self.step_locked(lock, ended, hand_on),
            None => self.step_search(ended, hand_on),
        }
    }

    fn step_locked(&mut self, mut lock: Lock, ended: bool, hand_on: &mut impl FnMut(Arrival)) -> bool {
        let unit_bits = MARKER_BITS + self.coded_bits();
        if lock.next_bit + unit_bits > self.received_bits() {
            if ended {
                self.search_again();
            }
            return ended;
        }
        let (marker_bit, frame_bit) = match lock.sense.direction {
            Direction::Forward => (lock.next_bit, lock.next_bit + MARKER_BITS),
            Direction::Reverse => (lock.next_bit + self.coded_bits(), lock.next_bit),
        };
        let wrong_bits = (self.word_at(marker_bit) ^ lock.sense.marker()).count_ones();
        let arrival = self.read_frame(lock.sense, frame_bit);
        let end_bit = lock.next_bit + unit_bits;
        lock.next_bit = end_bit;
        if accepted(&arrival) {
            if lock.skipped {
                self.search_between(end_bit - unit_bits, hand_on);
            }
            self.believe(lock, arrival, end_bit, hand_on);
            return true;
        }
        if wrong_bits <= LOCKED_WRONG_BITS_MAX {
            lock.passed_over = 0;
            self.doubtful.push(arrival);
        } else {
            lock.passed_over += 1;
            lock.skipped = true;
        }
        lock.unchecked += 1;
        self.lock = Some(lock);
        if lock.passed_over > FLYWHEEL_FRAMES_MAX || lock.unchecked > UNCHECKED_FRAMES_MAX {
            self.search_again();
        }
        true
    }

    /// Hands on the good frames out of their expected places from the last good one on, up to where the next begins.
    fn search_between(&mut self, end_bit: u64, hand_on: &mut impl FnMut(Arrival)) {
        self.search_bit = self.floor_bit;
        while let Some((bit, sense)) = self.next_marker().filter(|(bit, _)| *bit < end_bit) {
            self.search_bit = bit + 1;
            let Some(frame_bit) = self.frame_at(bit, sense) else { continue };
            let behind_bit = end_of(bit, frame_bit, self.coded_bits());
            if behind_bit > end_bit {
                continue;
            }
            let arrival = self.read_frame(sense, frame_bit);
            if accepted(&arrival) {
                self.believe(Lock::new(sense, behind_bit), arrival, behind_bit, hand_on);
            }
        }
    }

    /// First bit of the frame that a marker belongs to; None where that lies before what is to be read.
    fn frame_at(&self, marker_bit: u64, sense: Sense) -> Option<u64> {
        match sense.direction {
            Direction::Forward => Some(marker_bit + MARKER_BITS),
            Direction::Reverse => {
                marker_bit.checked_sub(self.coded_bits()).filter(|frame_bit| *frame_bit >= self.floor_bit)
            }
        }
    }

    /// Gives up the lock and searches from the last good frame on.
    fn search_again(&mut self) {
        self.lock = None;
        self.doubtful.clear();
        self.search_bit = self.floor_bit;
    }

    fn step_search(&mut self, ended: bool, hand_on: &mut impl FnMut(Arrival)) -> bool {
        let found = self.next_marker();
        self.settle_doubtful(hand_on);
        let Some((bit, sense)) = found else { return false };
        let coded_bits = self.coded_bits();
        let Some(frame_bit) = self.frame_at(bit, sense) else {
            self.doubt(self.truncated(sense, self.floor_bit, bit));
            self.search_bit = bit + 1;
            return true;
        };
        if frame_bit + coded_bits > self.received_bits() {
            self.search_bit = bit;
            if !ended {
                return false;
            }
            self.doubt(self.truncated(sense, frame_bit, self.received_bits()));
            self.search_bit = bit + 1;
            return true;
        }
        let arrival = self.read_frame(sense, frame_bit);
        self.search_bit = bit + 1;
        if accepted(&arrival) {
            let end_bit = end_of(bit, frame_bit, coded_bits);
            self.believe(Lock::new(sense, end_bit), arrival, end_bit, hand_on);
        } else {
            self.doubt(arrival);
        }
        true
    }

    /// Keeps a refused frame of a search, unless many lie over it already: their octets are those of the others.
    fn doubt(&mut self, refused: Arrival) {
        let end_of = |arrival: &Arrival| arrival.first_bit + arrival.octets.len() as u64 * 8;
        let lies_over = |other: &&Arrival| other.first_bit < end_of(&refused) && refused.first_bit < end_of(other);
        if self.doubtful.iter().filter(lies_over).count() < OVERLAPPING_MAX {
            self.doubtful.push(refused);
        }
    }

    /// Hands on refused frames that no frame found from here on can reach back to.
    fn settle_doubtful(&mut self, hand_on: &mut impl FnMut(Arrival)) {
        let reach_bits = 2 * (MARKER_BITS + self.coded_bits());
        let settled =
            self.doubtful.iter().take_while(|arrival| arrival.first_bit + reach_bits < self.search_bit).count();
        self.doubtful.drain(..settled).for_each(hand_on);
    }

    /// A frame checks: what was doubtful before it is settled, what lies over it was none, and the next one is expected behind it.
    fn believe(&mut self, lock: Lock, good: Arrival, end_bit: u64, hand_on: &mut impl FnMut(Arrival)) {
        let start_bit = end_bit - MARKER_BITS - self.coded_bits();
        let (before, behind): (Vec<_>, Vec<_>) =
            self.doubtful.drain(..).partition(|doubtful| doubtful.first_bit < end_bit);
        self.doubtful = behind;
        // A marker inside a frame that checks was none.
        before.into_iter().filter(|doubtful| doubtful.first_bit <= start_bit).for_each(&mut *hand_on);
        hand_on(good);
        self.floor_bit = end_bit;
        self.search_bit = end_bit;
        self.lock = Some(Lock::new(lock.sense, lock.next_bit));
    }

    fn read_frame(&mut self, sense: Sense, frame_bit: u64) -> Arrival {
        let mut octets = self.bits(sense, frame_bit, self.coded_bits());
        let verdict = match self.decoder.decode(&mut octets) {
            Err(refusal) => Verdict::Refused(refusal),
            Ok(()) => match TransferFrame::read(&self.link, &octets) {
                Ok(frame) => Verdict::Good(frame.id),
                Err(refusal) => Verdict::Refused(refusal),
            },
        };
        Arrival { sense, first_bit: frame_bit, verdict, octets }
    }

    /// A frame of which only a part is in the stream; whole octets of it are kept.
    fn truncated(&self, sense: Sense, from_bit: u64, to_bit: u64) -> Arrival {
        let bits = (to_bit - from_bit) / 8 * 8;
        let start_bit = match sense.direction {
            Direction::Forward => from_bit,
            Direction::Reverse => to_bit - bits,
        };
        let octets = self.bits(sense, start_bit, bits);
        Arrival { sense, first_bit: start_bit, verdict: Verdict::Refused(FrameRefusal::Truncated), octets }
    }

    /// The next place, from `search_bit` on, where a marker of any sense stands; moves `search_bit` up to it, or to the
    /// first place that cannot be decided yet.
    fn next_marker(&mut self) -> Option<(u64, Sense)> {
        let base_bit = self.dropped_octets * 8;
        let mut at = (self.search_bit - base_bit) as usize;
        let end = (self.buffer.len() * 8).checked_sub(MARKER_BITS as usize - 1)?;
        let forward = Sense::ALL[0].marker();
        let reverse = Sense::ALL[2].marker();
        while at < end {
            let octet = at / 8;
            let mut window = [0u8; 8];
            let there = &self.buffer[octet..(octet + 8).min(self.buffer.len())];
            window[..there.len()].copy_from_slice(there);
            let window = u64::from_be_bytes(window);
            let last = (end - octet * 8).min(32);
            for shift in at % 8..last {
                let word = (window << shift >> 32) as u32;
                // A marker or its complement: almost all its bits agree, or almost none.
                let agree = [(word ^ forward).count_ones(), (word ^ reverse).count_ones()];
                let far = 32 - SEARCH_WRONG_BITS_MAX;
                let is_near = |wrong: u32| wrong <= SEARCH_WRONG_BITS_MAX || wrong >= far;
                if is_near(agree[0]) || is_near(agree[1]) {
                    let sense = match (is_near(agree[0]), agree[0] >= far, agree[1] >= far) {
                        (true, false, _) => Sense::ALL[0],
                        (true, true, _) => Sense::ALL[1],
                        (false, _, false) => Sense::ALL[2],
                        (false, _, true) => Sense::ALL[3],
                    };
                    self.search_bit = base_bit + (octet * 8 + shift) as u64;
                    return Some((self.search_bit, sense));
                }
            }
            at = octet * 8 + last;
        }
        self.search_bit = base_bit + at as u64;
        None
    }

    /// 32 bits of the stream as received.
    fn word_at(&self, bit: u64) -> u32 {
        let at = bit - self.dropped_octets * 8;
        let (octet, shift) = ((at / 8) as usize, at % 8);
        let octets = &self.buffer[octet..(octet + 5).min(self.buffer.len())];
        let window = octets.iter().fold(0u64, |window, next| window << 8 | u64::from(*next));
        let spare = octets.len() as u64 * 8 - 32;
        (window >> (spare - shift)) as u32
    }

    /// Whole octets of the stream from `bit` on, in the order and polarity in which they were written.
    fn bits(&self, sense: Sense, bit: u64, bits: u64) -> Vec<u8> {
        let at = bit - self.dropped_octets * 8;
        let (start, shift) = ((at / 8) as usize, at % 8);
        let count = (bits / 8) as usize;
        let mut octets = match shift {
            0 => self.buffer[start..start + count].to_vec(),
            _ => {
                let window = &self.buffer[start..=start + count];
                window.windows(2).map(|pair| pair[0] << shift | pair[1] >> (8 - shift)).collect()
            }
        };
        if sense.direction == Direction::Reverse {
            octets.reverse();
            octets.iter_mut().for_each(|octet| *octet = octet.reverse_bits());
        }
        if sense.polarity == Polarity::Inverted {
            octets.iter_mut().for_each(|octet| *octet = !*octet);
        }
        octets
    }

    /// Drops octets that no later decision reads, when enough of them have gathered to be worth the move.
    fn drop_what_is_read(&mut self) {
        const WORTH_MOVING_OCTETS: u64 = 1 << 14;
        let needed_bit = match self.lock {
            Some(_) => self.floor_bit,
            None => self.floor_bit.max(self.search_bit.saturating_sub(self.coded_bits())),
        };
        let done = needed_bit / 8 - self.dropped_octets;
        if done >= WORTH_MOVING_OCTETS.min(self.buffer.len() as u64 / 2 + 1) {
            self.buffer.drain(..done as usize);
            self.dropped_octets += done;
        }
    }
}

/// Where a marker and its frame end, whichever comes first.
const fn end_of(marker_bit: u64, frame_bit: u64, coded_bits: u64) -> u64 {
    if frame_bit > marker_bit { frame_bit + coded_bits } else { marker_bit + MARKER_BITS }
}

/// Whether a frame's error control vouches for its place, whoever it belongs to.
fn accepted(arrival: &Arrival) -> bool {
    match arrival.verdict {
        Verdict::Good(_) => true,
        Verdict::Refused(refusal) => matches!(refusal, FrameRefusal::Spacecraft | FrameRefusal::Header),
    }
}

#[cfg(test)]
mod tests;
