//! When a frame was recorded: the instrument clock of a packet that starts in it.

use crate::ingest::wire::packet::{self, SpacePacket};
use crate::ingest::wire::{Apid, LinkConfig, TransferFrame};
use crate::units::Clock;

/// Clock of the first timed packet that starts in a good frame; the packet itself may run on into the next frame.
pub fn frame_clock(link: &LinkConfig, octets: &[u8]) -> Option<Clock> {
    /// Primary header and time field.
    const NEEDED_OCTETS: usize = 12;
    let frame = TransferFrame::read(link, octets).ok()?;
    let mut rest = frame.data.get(usize::from(frame.first_header)..)?;
    while rest.len() >= NEEDED_OCTETS {
        if packet::apid(rest) != Apid::IDLE
            && let Ok(found) = SpacePacket::read(&rest[..NEEDED_OCTETS])
        {
            return Some(found.id.clock);
        }
        rest = rest.get(packet::total_octets(rest)?..)?;
    }
    None
}
