//! The TM transfer frame (CCSDS 132.0-B) with its 32-bit channel count and FECF.
//!
//! The FECF only detects: no frame is ever repaired with it.

use std::fmt;

use crc::{CRC_16_IBM_3740, Crc, Table};

use super::coding::LinkConfig;

/// Polynomial 0x1021, preset 0xFFFF: the FECF of CCSDS 132.0-B.
static FECF: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_IBM_3740);

/// Octets before the packets: primary header 6, secondary header 4.
pub const HEADER_OCTETS: usize = 10;
/// Octets of the frame error control field.
pub const FECF_OCTETS: usize = 2;
/// First header pointer: no packet starts in this frame.
pub const NO_PACKET_STARTS: u16 = 0x7FF;
/// First header pointer: idle data only.
pub const IDLE_DATA_ONLY: u16 = 0x7FE;
/// Secondary header id: version 0, three octets follow.
const SECONDARY_HEADER_ID: u8 = 0x03;

/// What a frame is for good, within a mission: its channel and its 32-bit count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameId {
    /// Virtual channel: 0 real time, 1 recorder playback.
    pub channel: u8,
    /// 32-bit virtual channel count.
    pub count: u32,
}

impl fmt::Display for FrameId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "channel {} frame {}", self.channel, self.count)
    }
}

/// Why a frame is not used. Each is a counter of the ledger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, thiserror::Error)]
pub enum FrameRefusal {
    /// The FECF does not check.
    #[error("the frame error control field does not check")]
    Fecf,
    /// More errors than the Reed-Solomon code corrects.
    #[error("more errors than the Reed-Solomon code corrects")]
    ReedSolomon,
    /// The stream ended, or began, inside the frame.
    #[error("the stream ended or began inside the frame")]
    Truncated,
    /// Checks, but belongs to another spacecraft.
    #[error("the frame belongs to another spacecraft")]
    Spacecraft,
    /// Checks, but its header is not the one agreed.
    #[error("the frame checks, but its header is not the agreed one")]
    Header,
}

impl FrameRefusal {
    /// Every reason.
    pub const ALL: [FrameRefusal; 5] = [Self::Fecf, Self::ReedSolomon, Self::Truncated, Self::Spacecraft, Self::Header];

    /// The word in the ledger.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Fecf => "fecf",
            Self::ReedSolomon => "reed_solomon",
            Self::Truncated => "truncated",
            Self::Spacecraft => "spacecraft",
            Self::Header => "header",
        }
    }
}

/// A frame that checks, read in place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TransferFrame<'a> {
    /// Its identity.
    pub id: FrameId,
    /// Where the first packet header is in `data`, or one of the two reserved values.
    pub first_header: u16,
    /// Packets, back to back, running over frame borders.
    pub data: &'a [u8],
}

impl<'a> TransferFrame<'a> {
    /// Reads a frame of the link's length, as it is after channel decoding.
    ///
    /// # Errors
    /// The first reason why the frame cannot be used.
    pub fn read(link: &LinkConfig, octets: &'a [u8]) -> Result<Self, FrameRefusal> {
        if octets.len() != link.frame_octets || octets.len() < HEADER_OCTETS + FECF_OCTETS {
            return Err(FrameRefusal::Truncated);
        }
        let (body, fecf) = octets.split_at(octets.len() - FECF_OCTETS);
        if FECF.checksum(body).to_be_bytes() != fecf {
            return Err(FrameRefusal::Fecf);
        }
        let word = u16::from_be_bytes([body[0], body[1]]);
        if (word >> 4) & 0x3ff != link.spacecraft_id {
            return Err(FrameRefusal::Spacecraft);
        }
        let status = u16::from_be_bytes([body[4], body[5]]);
        // Version 0; secondary header present, no sync flag, no packet order flag, segment length id 11.
        let agreed = word >> 14 == 0 && status >> 11 == 0b1_0011 && body[6] == SECONDARY_HEADER_ID;
        let first_header = status & 0x7ff;
        let data = &body[HEADER_OCTETS..];
        let points_inside = usize::from(first_header) < data.len() || first_header >= IDLE_DATA_ONLY;
        if !agreed || !points_inside {
            return Err(FrameRefusal::Header);
        }
        let id = FrameId {
            channel: ((word >> 1) & 7) as u8,
            count: u32::from_be_bytes([body[7], body[8], body[9], body[3]]),
        };
        Ok(Self { id, first_header, data })
    }
}

/// Writes a frame: header, data and FECF. `data` must fill the link's frame exactly.
pub fn write(link: &LinkConfig, id: FrameId, master_count: u8, first_header: u16, data: &[u8]) -> Vec<u8> {
    assert_eq!(data.len(), link.frame_octets - HEADER_OCTETS - FECF_OCTETS, "data must fill the frame");
    let mut octets = Vec::with_capacity(link.frame_octets);
    let word = (link.spacecraft_id << 4) | (u16::from(id.channel) << 1);
    octets.extend(word.to_be_bytes());
    let count = id.count.to_be_bytes();
    octets.extend([master_count, count[3]]);
    octets.extend((0b1_0011 << 11 | first_header).to_be_bytes());
    octets.extend([SECONDARY_HEADER_ID, count[0], count[1], count[2]]);
    octets.extend(data);
    octets.extend(FECF.checksum(&octets).to_be_bytes());
    octets
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Vec<u8> {
        write(&LinkConfig::default(), FrameId { channel: 1, count: 0x0102_0304 }, 9, 84, &[0xA5; 1103])
    }

    #[test]
    fn a_written_frame_is_read_back() {
        let octets = sample();
        let frame = TransferFrame::read(&LinkConfig::default(), &octets).unwrap();
        assert_eq!(frame.id, FrameId { channel: 1, count: 0x0102_0304 });
        assert_eq!((frame.first_header, frame.data.len()), (84, 1103));
    }

    #[test]
    fn the_fecf_of_the_check_string_is_the_published_one() {
        // The catalogue of parametrised CRC algorithms: CRC-16/IBM-3740 of "123456789" is 0x29B1.
        assert_eq!(FECF.checksum(b"123456789"), 0x29B1);
    }

    #[test]
    fn every_single_wrong_bit_is_refused() {
        let octets = sample();
        for bit in 0..octets.len() * 8 {
            let mut wrong = octets.clone();
            wrong[bit / 8] ^= 0x80 >> (bit % 8);
            assert_eq!(TransferFrame::read(&LinkConfig::default(), &wrong), Err(FrameRefusal::Fecf));
        }
    }

    #[test]
    fn a_frame_of_another_spacecraft_is_named_so() {
        let other = LinkConfig { spacecraft_id: 0x42, ..LinkConfig::default() };
        assert_eq!(TransferFrame::read(&other, &sample()), Err(FrameRefusal::Spacecraft));
    }
}
