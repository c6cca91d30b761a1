//! One stream (a connection, a file) cut into playbacks: a playback starts with the stream, or when direction or polarity
//! changes.

use super::coding::LinkConfig;
use super::sync::{Arrival, Deframer, Sense, Verdict};

/// What a stream consists of, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PlaybackPart {
    /// A playback starts.
    Opened,
    /// A frame of the open playback, good or refused.
    Arrival(Arrival),
    /// The open playback is over; how many bits of the stream were its.
    Closed {
        /// Bits received, those between and around its frames included.
        bits: u64,
    },
}

/// Reads one stream.
pub struct PlaybackReader {
    deframer: Deframer,
    open: Option<Open>,
}

struct Open {
    first_bit: u64,
    sense: Option<Sense>,
}

impl PlaybackReader {
    /// For a stream of this link, whose configuration must have no faults.
    pub fn new(link: LinkConfig) -> Self {
        Self { deframer: Deframer::new(link), open: None }
    }

    /// Takes the next octets of the stream.
    pub fn push(&mut self, octets: &[u8], mut hand_on: impl FnMut(PlaybackPart)) {
        let open = &mut self.open;
        if open.is_none() && !octets.is_empty() {
            *open = Some(Open { first_bit: 0, sense: None });
            hand_on(PlaybackPart::Opened);
        }
        self.deframer.push(octets, |arrival| sort_in(open, arrival, &mut hand_on));
    }

    /// The stream has ended.
    pub fn finish(&mut self, mut hand_on: impl FnMut(PlaybackPart)) {
        let open = &mut self.open;
        self.deframer.finish(|arrival| sort_in(open, arrival, &mut hand_on));
        if let Some(last) = self.open.take() {
            hand_on(PlaybackPart::Closed { bits: self.deframer.received_bits() - last.first_bit });
        }
    }

    /// Bits received so far.
    pub fn received_bits(&self) -> u64 {
        self.deframer.received_bits()
    }
}

/// Hands a frame on, in a new playback where a good one shows another sense.
fn sort_in(open: &mut Option<Open>, arrival: Arrival, hand_on: &mut impl FnMut(PlaybackPart)) {
    if let (Verdict::Good(_), Some(playback)) = (arrival.verdict, open.as_mut()) {
        match playback.sense {
            Some(sense) if sense != arrival.sense => {
                hand_on(PlaybackPart::Closed { bits: arrival.first_bit - playback.first_bit });
                hand_on(PlaybackPart::Opened);
                *playback = Open { first_bit: arrival.first_bit, sense: Some(arrival.sense) };
            }
            _ => playback.sense = Some(arrival.sense),
        }
    }
    hand_on(PlaybackPart::Arrival(arrival));
}
