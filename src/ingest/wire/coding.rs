//! Channel coding of one link: the pseudo-randomiser and the Reed-Solomon code, both optional (CCSDS 131.0-B).

use fec::{RsDecoder, RsEncoder};

use super::frame::FrameRefusal;

/// The 32-bit attached sync marker.
pub const SYNC_MARKER: u32 = 0x1ACF_FC1D;
/// Message octets of one Reed-Solomon codeword.
const RS_MESSAGE_OCTETS: usize = 223;
/// Octets of one Reed-Solomon codeword.
const RS_BLOCK_OCTETS: usize = 255;
/// A transfer frame holds its headers and FECF at least; longer than this is no TM frame (CCSDS 132.0-B: 2048 octets).
pub const FRAME_OCTETS_MIN: usize = 10 + 2 + 1;
/// Longest TM transfer frame.
pub const FRAME_OCTETS_MAX: usize = 2048;

/// What the ground must be told of a link; everything else is discovered from the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LinkConfig {
    /// Spacecraft id in the frame header (10 bits).
    pub spacecraft_id: u16,
    /// Octets of a transfer frame.
    pub frame_octets: usize,
    /// Whether frames are pseudo-randomised.
    pub randomised: bool,
    /// Reed-Solomon interleave depth of a (255,223) E=16 dual-basis code; `None` when the link has no such code.
    pub reed_solomon_interleave: Option<usize>,
}

impl Default for LinkConfig {
    /// STS-65: spacecraft 0x41, 1115 octets, no channel coding.
    fn default() -> Self {
        Self { spacecraft_id: 0x41, frame_octets: 1115, randomised: false, reed_solomon_interleave: None }
    }
}

/// What is wrong with a link's configuration.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LinkFault {
    /// The frame length is out of range.
    #[error("frame_octets is {found}; a transfer frame has {FRAME_OCTETS_MIN} to {FRAME_OCTETS_MAX} octets")]
    FrameOctets {
        /// What was configured.
        found: usize,
    },
    /// The spacecraft id does not fit.
    #[error("spacecraft_id is {found:#x}; a TM spacecraft id has 10 bits, 0x3ff at most")]
    SpacecraftId {
        /// What was configured.
        found: u16,
    },
    /// The frame length and the interleave depth contradict each other.
    #[error(
        "frame_octets is {frame_octets} and reed_solomon_interleave is {interleave}; a (255,223) code of that depth holds exactly {} octets",
        interleave * RS_MESSAGE_OCTETS
    )]
    Interleave {
        /// Configured frame length.
        frame_octets: usize,
        /// Configured depth.
        interleave: usize,
    },
}

impl LinkConfig {
    /// Everything wrong with this configuration; empty when it can be used.
    pub fn faults(&self) -> Vec<LinkFault> {
        let mut faults = Vec::new();
        if !(FRAME_OCTETS_MIN..=FRAME_OCTETS_MAX).contains(&self.frame_octets) {
            faults.push(LinkFault::FrameOctets { found: self.frame_octets });
        }
        if self.spacecraft_id > 0x3ff {
            faults.push(LinkFault::SpacecraftId { found: self.spacecraft_id });
        }
        if let Some(interleave) = self.reed_solomon_interleave
            && interleave * RS_MESSAGE_OCTETS != self.frame_octets
        {
            faults.push(LinkFault::Interleave { frame_octets: self.frame_octets, interleave });
        }
        faults
    }

    /// Octets between two sync markers.
    pub fn coded_octets(&self) -> usize {
        match self.reed_solomon_interleave {
            Some(interleave) => interleave * RS_BLOCK_OCTETS,
            None => self.frame_octets,
        }
    }
}

/// The pseudo-random sequence of CCSDS 131.0-B: x^8 + x^7 + x^5 + x^3 + 1, all ones at the start, period 255 bits.
const fn randomiser_sequence() -> [u8; RS_BLOCK_OCTETS] {
    let mut sequence = [0u8; RS_BLOCK_OCTETS];
    let mut register = 0xFFu8;
    let mut bit = 0;
    while bit < RS_BLOCK_OCTETS * 8 {
        let out = register & 1;
        sequence[bit / 8] |= out << (7 - bit % 8);
        let feedback = (register ^ (register >> 3) ^ (register >> 5) ^ (register >> 7)) & 1;
        register = (register >> 1) | (feedback << 7);
        bit += 1;
    }
    sequence
}

/// 255 octets, after which it repeats.
static RANDOMISER: [u8; RS_BLOCK_OCTETS] = randomiser_sequence();

/// Adds the pseudo-random sequence; the same operation removes it.
pub fn randomise(octets: &mut [u8]) {
    for block in octets.chunks_mut(RS_BLOCK_OCTETS) {
        for (octet, random) in block.iter_mut().zip(RANDOMISER) {
            *octet ^= random;
        }
    }
}

/// Removes the channel coding of frames of one link.
pub struct ChannelDecoder {
    link: LinkConfig,
    reed_solomon: Option<RsDecoder>,
}

impl ChannelDecoder {
    /// For links of this configuration, which must have no faults.
    pub fn new(link: LinkConfig) -> Self {
        Self { link, reed_solomon: link.reed_solomon_interleave.map(|_| RsDecoder::new_ccsds()) }
    }

    /// Coded octets to a transfer frame, in place.
    ///
    /// # Errors
    /// [`FrameRefusal::ReedSolomon`] when a codeword has more errors than the code corrects.
    pub fn decode(&mut self, coded: &mut Vec<u8>) -> Result<(), FrameRefusal> {
        if self.link.randomised {
            randomise(coded);
        }
        let (Some(decoder), Some(depth)) = (&mut self.reed_solomon, self.link.reed_solomon_interleave) else {
            return Ok(());
        };
        let mut frame = vec![0u8; depth * RS_MESSAGE_OCTETS];
        for lane in 0..depth {
            let block: Vec<u8> = coded.iter().skip(lane).step_by(depth).copied().collect();
            let mut message = [0u8; RS_MESSAGE_OCTETS];
            decoder.decode_ccsds_dual(&block, &mut message).map_err(|_| FrameRefusal::ReedSolomon)?;
            for (position, octet) in message.into_iter().enumerate() {
                frame[position * depth + lane] = octet;
            }
        }
        *coded = frame;
        Ok(())
    }
}

/// Adds the channel coding of a link to a transfer frame: the octets that follow the sync marker.
pub fn encode(link: &LinkConfig, frame: &[u8]) -> Vec<u8> {
    let mut coded = frame.to_vec();
    if let Some(depth) = link.reed_solomon_interleave {
        let mut encoder = RsEncoder::new_ccsds();
        coded.resize(depth * RS_BLOCK_OCTETS, 0);
        for lane in 0..depth {
            let message: Vec<u8> = frame.iter().skip(lane).step_by(depth).copied().collect();
            let mut parity = [0u8; RS_BLOCK_OCTETS - RS_MESSAGE_OCTETS];
            encoder.encode_ccsds_dual(&message, &mut parity).expect("223 octets a lane and 32 of parity");
            for (position, octet) in parity.into_iter().enumerate() {
                coded[(RS_MESSAGE_OCTETS + position) * depth + lane] = octet;
            }
        }
    }
    if link.randomised {
        randomise(&mut coded);
    }
    coded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_random_sequence_begins_as_ccsds_131_prints_it() {
        assert_eq!(RANDOMISER[..8], [0xFF, 0x48, 0x0E, 0xC0, 0x9A, 0x0D, 0x70, 0xBC]);
    }

    #[test]
    fn sixteen_wrong_octets_a_codeword_are_corrected_and_more_are_refused() {
        let link = LinkConfig { randomised: true, reed_solomon_interleave: Some(5), ..LinkConfig::default() };
        assert!(link.faults().is_empty());
        let frame: Vec<u8> = (0..1115).map(|i| (i * 7 % 251) as u8).collect();
        let clean = encode(&link, &frame);
        assert_eq!(clean.len(), 1275);
        let mut damaged = clean.clone();
        for octet in damaged.iter_mut().take(16 * 5) {
            *octet ^= 0x5A;
        }
        let mut decoder = ChannelDecoder::new(link);
        decoder.decode(&mut damaged).unwrap();
        assert_eq!(damaged, frame);
        let mut lost = clean;
        for octet in lost.iter_mut().take(40 * 5) {
            *octet ^= 0x5A;
        }
        assert_eq!(decoder.decode(&mut lost), Err(FrameRefusal::ReedSolomon));
    }

    #[test]
    fn all_faults_of_a_link_are_told_at_once() {
        let link = LinkConfig {
            spacecraft_id: 0x400,
            frame_octets: 4000,
            reed_solomon_interleave: Some(5),
            ..LinkConfig::default()
        };
        assert_eq!(link.faults().len(), 3);
    }
}
