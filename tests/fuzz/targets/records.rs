//! Any packet: it is read or refused without a panic, and what is read can be written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use oare_ground::ingest::wire::record::{write_evt, write_hsk, write_prc};
use oare_ground::ingest::wire::{Record, SpacePacket};

fuzz_target!(|octets: &[u8]| {
    let Ok(packet) = SpacePacket::read(octets) else { return };
    let Ok(record) = Record::read(&packet) else { return };
    let written = match &record {
        Record::Evt(event) => write_evt(event),
        Record::Prc(estimate) => write_prc(estimate),
        Record::Hsk(report) => write_hsk(report).to_vec(),
        Record::Acc(_) | Record::Tbl(_) => return,
    };
    let again = Record::read(&SpacePacket { id: packet.id, data: &written });
    assert_eq!(again, Ok(record));
});
