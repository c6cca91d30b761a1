//! The space packet (CCSDS 133.0-B) with its six-octet CUC time.

use spacepackets::{PacketType, SpHeader};

use crate::units::Clock;

/// Octets of the primary header.
pub const PRIMARY_OCTETS: usize = 6;
/// Octets of the time field that opens the data of every telemetry packet.
pub const TIME_OCTETS: usize = 6;
/// Longest packet the protocol allows: header and 65,536 octets of data.
pub const PACKET_OCTETS_MAX: usize = PRIMARY_OCTETS + 65_536;

/// Application process of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Apid(pub u16);

impl Apid {
    /// Science.
    pub const ACC: Apid = Apid(0x010);
    /// Housekeeping.
    pub const HSK: Apid = Apid(0x011);
    /// Calibration table.
    pub const TBL: Apid = Apid(0x012);
    /// Event.
    pub const EVT: Apid = Apid(0x013);
    /// On-board estimate.
    pub const PRC: Apid = Apid(0x014);
    /// Idle.
    pub const IDLE: Apid = Apid(0x7FF);

    /// The name in the ledger; packets of an unknown APID are counted as `unknown`.
    pub const fn word(self) -> &'static str {
        match self {
            Apid::ACC => "ACC",
            Apid::HSK => "HSK",
            Apid::TBL => "TBL",
            Apid::EVT => "EVT",
            Apid::PRC => "PRC",
            Apid::IDLE => "idle",
            _ => "unknown",
        }
    }
}

/// What makes two packets the same packet, on whatever channel they came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PacketId {
    /// Application process.
    pub apid: Apid,
    /// Time of its first sample.
    pub clock: Clock,
    /// Sequence count.
    pub sequence: u16,
}

/// Why a packet is kept raw and not used. Each is a counter of the ledger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, thiserror::Error)]
pub enum PacketRefusal {
    /// The primary header is none of a telemetry packet with secondary header.
    #[error("the header is not that of a telemetry packet with a time field")]
    Header,
    /// Nobody here knows the APID.
    #[error("the APID is unknown")]
    UnknownApid,
    /// The data are not as long as this kind's.
    #[error("the packet is not as long as its kind")]
    Length,
    /// A BCD field is no valid date and time.
    #[error("the BCD time is no valid date and time")]
    Bcd,
    /// A range code is 3.
    #[error("a range code is 3")]
    Range,
    /// A mode, step or other code has no meaning.
    #[error("a mode or step code has no meaning")]
    Code,
    /// The frames it runs over are all there and do not fit together.
    #[error("the frames that the packet runs over do not fit together")]
    Broken,
    /// Text that is not UTF-8.
    #[error("the text is not UTF-8")]
    Text,
}

impl PacketRefusal {
    /// The word in the ledger.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Header => "header",
            Self::UnknownApid => "unknown_apid",
            Self::Length => "length",
            Self::Bcd => "bcd",
            Self::Range => "range",
            Self::Code => "code",
            Self::Broken => "broken",
            Self::Text => "text",
        }
    }
}

/// A packet, read in place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SpacePacket<'a> {
    /// Its identity.
    pub id: PacketId,
    /// What follows the time field.
    pub data: &'a [u8],
}

/// Length of the whole packet whose primary header stands at the start of `octets`, if the header is all there.
pub fn total_octets(octets: &[u8]) -> Option<usize> {
    let length = octets.get(4..6)?;
    Some(PRIMARY_OCTETS + usize::from(u16::from_be_bytes([length[0], length[1]])) + 1)
}

/// The APID in a primary header.
pub fn apid(octets: &[u8]) -> Apid {
    Apid(u16::from_be_bytes([octets[0], octets[1]]) & 0x7ff)
}

impl<'a> SpacePacket<'a> {
    /// Reads one whole packet.
    ///
    /// # Errors
    /// When the header is not that of a telemetry packet with a time field.
    pub fn read(octets: &'a [u8]) -> Result<Self, PacketRefusal> {
        let (header, _) = SpHeader::from_be_bytes(octets).map_err(|_| PacketRefusal::Header)?;
        let telemetry = header.version.value() == 0 && header.packet_id.packet_type == PacketType::Tm;
        let timed = header.packet_id.sec_header_flag && octets.len() >= PRIMARY_OCTETS + TIME_OCTETS;
        if !telemetry || !timed {
            return Err(PacketRefusal::Header);
        }
        let time = &octets[PRIMARY_OCTETS..PRIMARY_OCTETS + TIME_OCTETS];
        let seconds = u32::from_be_bytes([time[0], time[1], time[2], time[3]]);
        let fraction = u16::from_be_bytes([time[4], time[5]]);
        let id = PacketId {
            apid: Apid(header.packet_id.apid.value()),
            clock: Clock::from_cuc(seconds, fraction),
            sequence: header.psc.seq_count.value(),
        };
        Ok(Self { id, data: &octets[PRIMARY_OCTETS + TIME_OCTETS..] })
    }
}

/// Writes a telemetry packet.
pub fn write(id: PacketId, data: &[u8]) -> Vec<u8> {
    let mut octets = Vec::with_capacity(PRIMARY_OCTETS + TIME_OCTETS + data.len());
    octets.extend((0x0800 | id.apid.0).to_be_bytes());
    octets.extend((0xC000 | (id.sequence & 0x3fff)).to_be_bytes());
    octets.extend(((TIME_OCTETS + data.len() - 1) as u16).to_be_bytes());
    let (seconds, fraction) = id.clock.to_cuc();
    octets.extend(seconds.to_be_bytes());
    octets.extend(fraction.to_be_bytes());
    octets.extend(data);
    octets
}

/// Writes an idle packet of exactly `octets` octets, 7 at least.
pub fn write_idle(sequence: u16, octets: usize) -> Vec<u8> {
    assert!((PRIMARY_OCTETS + 1..=PACKET_OCTETS_MAX).contains(&octets), "an idle packet has 7 octets at least");
    let mut packet = Vec::with_capacity(octets);
    packet.extend(Apid::IDLE.0.to_be_bytes());
    packet.extend((0xC000 | (sequence & 0x3fff)).to_be_bytes());
    packet.extend(((octets - PRIMARY_OCTETS - 1) as u16).to_be_bytes());
    packet.resize(octets, 0x55);
    packet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_packet_is_read_back() {
        let id = PacketId { apid: Apid::HSK, clock: Clock::from_tenths(2_262_803), sequence: 77 };
        let octets = write(id, &[1, 2, 3]);
        assert_eq!(total_octets(&octets), Some(octets.len()));
        assert_eq!(SpacePacket::read(&octets).unwrap(), SpacePacket { id, data: &[1, 2, 3] });
    }

    #[test]
    fn a_telecommand_is_no_telemetry() {
        let id = PacketId { apid: Apid::HSK, clock: Clock::from_tenths(0), sequence: 0 };
        let mut octets = write(id, &[0]);
        octets[0] |= 0x10;
        assert_eq!(SpacePacket::read(&octets), Err(PacketRefusal::Header));
    }
}
