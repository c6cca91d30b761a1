//! Records to packets, packets to frames.

use std::collections::BTreeMap;

use crate::ingest::wire::frame::{FECF_OCTETS, FrameId, HEADER_OCTETS, NO_PACKET_STARTS, write as write_frame};
use crate::ingest::wire::packet::{PRIMARY_OCTETS, write as write_packet, write_idle};
use crate::ingest::wire::record::{write_acc, write_evt, write_hsk, write_prc, write_tbl};
use crate::ingest::wire::{Apid, LinkConfig, PacketId, Record};
use crate::simulate::flight::{Damage, Sent};

/// Writes records as packets, with a sequence count for each APID.
#[derive(Debug, Default)]
pub struct Packetiser {
    counts: BTreeMap<Apid, u16>,
}

impl Packetiser {
    /// The packet of a record, damage and all.
    pub fn packet(&mut self, sent: &Sent) -> Vec<u8> {
        let (apid, clock, mut data) = match &sent.record {
            Record::Acc(acc) => (Apid::ACC, acc.clock, write_acc(acc).to_vec()),
            Record::Hsk(hsk) => (Apid::HSK, hsk.clock, write_hsk(hsk).to_vec()),
            Record::Tbl(tbl) => (Apid::TBL, tbl.clock, write_tbl(tbl).to_vec()),
            Record::Evt(evt) => (Apid::EVT, evt.clock, write_evt(evt)),
            Record::Prc(prc) => (Apid::PRC, prc.clock, write_prc(prc)),
        };
        match sent.damage {
            Some(Damage::CutShort) => data.truncate(data.len() / 2),
            // Month 0x2F is no BCD.
            Some(Damage::NoTime) => data[2] = 0x2F,
            None => {}
        }
        self.write(apid, clock, &data)
    }

    /// A packet of any APID, as a foreign instrument might send.
    pub fn write(&mut self, apid: Apid, clock: crate::units::Clock, data: &[u8]) -> Vec<u8> {
        let sequence = self.counts.entry(apid).or_default();
        let id = PacketId { apid, clock, sequence: *sequence };
        *sequence = (*sequence + 1) & 0x3fff;
        write_packet(id, data)
    }
}

/// Fills frames of one virtual channel with packets, back to back.
#[derive(Debug)]
pub struct Framer {
    link: LinkConfig,
    next: FrameId,
    data: Vec<u8>,
    /// Where the first packet that starts in the present frame starts.
    first_header: Option<usize>,
}

impl Framer {
    /// For a channel (0 real time, 1 recorder), counting from `first_count`.
    pub fn new(link: LinkConfig, channel: u8, first_count: u32) -> Self {
        Self { link, next: FrameId { channel, count: first_count }, data: Vec::new(), first_header: None }
    }

    /// Adds a packet; hands on every frame that is full.
    pub fn push(&mut self, packet: &[u8], mut hand_on: impl FnMut(Vec<u8>)) {
        let room = self.room();
        self.first_header.get_or_insert(self.data.len());
        self.data.extend(packet);
        while self.data.len() >= room {
            let rest = self.data.split_off(room);
            let full = std::mem::replace(&mut self.data, rest);
            let first_header = self.first_header.take().map_or(NO_PACKET_STARTS, |at| at as u16);
            hand_on(self.write(first_header, &full));
        }
    }

    /// Fills the last frame with an idle packet and hands it on.
    pub fn finish(&mut self, mut hand_on: impl FnMut(Vec<u8>)) {
        if self.data.is_empty() {
            return;
        }
        let free = self.room() - self.data.len();
        // An idle packet has 7 octets at least: where fewer are free it fills the next frame too.
        let idle = if free > PRIMARY_OCTETS { free } else { free + self.room() };
        self.push(&write_idle(0, idle), &mut hand_on);
    }

    fn room(&self) -> usize {
        self.link.frame_octets - HEADER_OCTETS - FECF_OCTETS
    }

    fn write(&mut self, first_header: u16, data: &[u8]) -> Vec<u8> {
        let frame = write_frame(&self.link, self.next, self.next.count as u8, first_header, data);
        self.next.count = self.next.count.wrapping_add(1);
        frame
    }
}
