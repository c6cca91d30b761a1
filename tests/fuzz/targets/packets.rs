//! Any frames in any order: packets are joined, broken or left waiting without a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use oare_ground::ingest::wire::{Assembled, Assembler, FrameId, SpacePacket, TransferFrame};

fuzz_target!(|frames: Vec<(u8, u16, Vec<u8>)>| {
    let mut assembler = Assembler::default();
    let mut seen = std::collections::BTreeSet::new();
    for (count, first_header, data) in &frames {
        let id = FrameId { channel: count & 1, count: u32::from(*count >> 1) };
        let inside = usize::from(*first_header) < data.len() || (0x7FE..=0x7FF).contains(first_header);
        if !inside || !seen.insert(id) {
            continue;
        }
        assembler.take(&TransferFrame { id, first_header: *first_header, data }, |assembled| {
            if let Assembled::Packet(_, octets) = assembled {
                let _ = SpacePacket::read(octets);
            }
        });
    }
});
