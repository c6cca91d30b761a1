//! Packets out of frames that arrive in any order: a packet cut by a missing frame waits for it, from whatever playback.
//!
//! The result is a function of the set of frames: each packet belongs to the frame in which it starts, and is complete
//! when the frames it runs over are there.

use std::collections::{BTreeMap, HashMap};

use super::frame::{FrameId, IDLE_DATA_ONLY, NO_PACKET_STARTS, TransferFrame};
use super::packet::{self, PACKET_OCTETS_MAX};

/// What of a frame concerns its neighbours.
struct Edge {
    /// Octets that continue a packet of an earlier frame.
    head: Box<[u8]>,
    /// No packet starts here: the head is the whole frame (empty for idle data).
    passes_on: bool,
    /// The last packet that starts here and does not end here.
    tail: Option<Box<[u8]>>,
}

impl Edge {
    /// Whether anything here may concern a neighbour.
    fn waits(&self) -> bool {
        self.passes_on || !self.head.is_empty() || self.tail.is_some()
    }
}

/// Where a packet came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    /// The frame in which it starts.
    pub first: FrameId,
    /// The frame in which it ends.
    pub last: FrameId,
}

/// Something that became whole when a frame arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Assembled<'a> {
    /// A packet, primary header and all.
    Packet(Placement, &'a [u8]),
    /// The frames of a packet are all there and contradict each other: what there is of it.
    Broken(Placement, &'a [u8]),
}

/// The frames of a channel by their count.
#[derive(Default)]
struct Edges {
    /// None once nothing of a frame waits for its neighbours any more, which is soon so of most.
    by_count: BTreeMap<u32, Option<Box<Edge>>>,
    idle: IdleRuns,
}

/// Frames of nothing but idle data, which a packet passes over: stretches of them by their first and by their last count, so that hours of
/// them are one step.
#[derive(Default)]
struct IdleRuns {
    last_by_first: HashMap<u32, u32>,
    first_by_last: HashMap<u32, u32>,
}

impl IdleRuns {
    /// Takes one more; the first of its stretch.
    fn take(&mut self, count: u32) -> u32 {
        let first = self.first_by_last.remove(&count.wrapping_sub(1)).unwrap_or(count);
        let last = self.last_by_first.remove(&count.wrapping_add(1)).unwrap_or(count);
        self.last_by_first.insert(first, last);
        self.first_by_last.insert(last, first);
        first
    }

    /// The count before, stretches passed over.
    fn before(&self, count: u32) -> u32 {
        let at = count.wrapping_sub(1);
        self.first_by_last.get(&at).map_or(at, |first| first.wrapping_sub(1))
    }

    /// The count after, stretches passed over.
    fn after(&self, count: u32) -> u32 {
        let at = count.wrapping_add(1);
        self.last_by_first.get(&at).map_or(at, |last| last.wrapping_add(1))
    }
}

/// Joins packets over frame borders.
#[derive(Default)]
pub struct Assembler {
    channels: HashMap<u8, Edges>,
}

impl Assembler {
    /// Takes one frame (each identity once) and hands on every packet that it completes.
    pub fn take(&mut self, frame: &TransferFrame<'_>, mut hand_on: impl FnMut(Assembled<'_>)) {
        let edge = walk(frame, &mut hand_on);
        let (continues, opens) = (edge.passes_on || !edge.head.is_empty(), edge.tail.is_some());
        let edges = self.channels.entry(frame.id.channel).or_default();
        edges.by_count.insert(frame.id.count, edge.waits().then(|| Box::new(edge)));
        let count = frame.id.count;
        let begins = if frame.first_header == IDLE_DATA_ONLY { edges.idle.take(count) } else { count };
        if continues && let Some(start) = start_of_packet_into(edges, begins) {
            complete(edges, FrameId { count: start, ..frame.id }, &mut hand_on);
        }
        if opens {
            complete(edges, frame.id, &mut hand_on);
        }
    }

    /// Frames held, of every channel.
    pub fn frames(&self) -> usize {
        self.channels.values().map(|edges| edges.by_count.len()).sum()
    }
}

/// Hands on the packets that lie wholly inside a frame.
fn walk(frame: &TransferFrame<'_>, hand_on: &mut impl FnMut(Assembled<'_>)) -> Edge {
    match frame.first_header {
        IDLE_DATA_ONLY => return Edge { head: Box::default(), passes_on: true, tail: None },
        NO_PACKET_STARTS => return Edge { head: frame.data.into(), passes_on: true, tail: None },
        _ => {}
    }
    let (head, mut rest) = frame.data.split_at(usize::from(frame.first_header));
    let placement = Placement { first: frame.id, last: frame.id };
    while let Some(total) = packet::total_octets(rest)
        && total <= rest.len()
    {
        hand_on(Assembled::Packet(placement, &rest[..total]));
        rest = &rest[total..];
    }
    Edge { head: head.into(), passes_on: false, tail: (!rest.is_empty()).then(|| rest.into()) }
}

/// The frame with the unfinished packet that frame `count` continues, if everything between is there.
fn start_of_packet_into(edges: &Edges, count: u32) -> Option<u32> {
    let mut at = count;
    let mut octets = 0;
    while octets <= PACKET_OCTETS_MAX {
        at = edges.idle.before(at);
        let edge = edges.by_count.get(&at)?.as_deref()?;
        if edge.tail.is_some() {
            return Some(at);
        }
        if !edge.passes_on {
            return None;
        }
        octets += edge.head.len();
    }
    None
}

/// Hands on the packet that starts at the end of frame `first`, when the frames it runs over are there.
fn complete(edges: &mut Edges, first: FrameId, hand_on: &mut impl FnMut(Assembled<'_>)) {
    let tail = edges.by_count.get(&first.count).and_then(|edge| edge.as_ref()?.tail.as_ref());
    let Some(mut octets) = tail.map(|tail| tail.to_vec()) else { return };
    let mut last = first;
    let whole = loop {
        last.count = edges.idle.after(last.count);
        let Some(edge) = edges.by_count.get(&last.count) else { return };
        let (head, passes_on) = edge.as_ref().map_or((&[][..], false), |edge| (&edge.head, edge.passes_on));
        octets.extend_from_slice(head);
        let total = packet::total_octets(&octets);
        if !passes_on {
            break total == Some(octets.len());
        }
        match total {
            Some(total) if octets.len() >= total => break octets.len() == total,
            _ if octets.len() > PACKET_OCTETS_MAX => break false,
            _ => {}
        }
    };
    let placement = Placement { first, last };
    hand_on(if whole { Assembled::Packet(placement, &octets) } else { Assembled::Broken(placement, &octets) });
    forget(edges, placement);
}

/// Frees what a settled packet held.
fn forget(edges: &mut Edges, placement: Placement) {
    let mut free = |count: u32, part: fn(&mut Edge)| {
        let Some(place) = edges.by_count.get_mut(&count) else { return };
        if let Some(edge) = place {
            part(edge);
        }
        *place = place.take().filter(|edge| edge.waits());
    };
    free(placement.first.count, |edge| edge.tail = None);
    free(placement.last.count, |edge| {
        if !edge.passes_on {
            edge.head = Box::default();
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ingest::wire::LinkConfig;
    use crate::ingest::wire::frame;
    use crate::ingest::wire::packet::{Apid, PacketId, write, write_idle};
    use crate::units::Clock;

    /// Small frames, so that packets run over several.
    const LINK: LinkConfig =
        LinkConfig { spacecraft_id: 0x41, frame_octets: 52, randomised: false, reed_solomon_interleave: None };

    /// Twenty packets of many lengths, and the frames that carry them.
    fn stream() -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
        let packets: Vec<Vec<u8>> = (0..20u16)
            .map(|n| {
                let id = PacketId { apid: Apid::EVT, clock: Clock::from_tenths(i64::from(n)), sequence: n };
                write(id, &vec![n as u8; usize::from(n * 37 % 131) + 1])
            })
            .collect();
        let mut octets = packets.concat();
        octets.extend(write_idle(0, 47 + (40 - (octets.len() + 47) % 40) % 40));
        let mut starts = vec![];
        let mut at = 0;
        while at < octets.len() {
            starts.push(at);
            at += packet::total_octets(&octets[at..]).unwrap();
        }
        let frames = octets
            .chunks(40)
            .enumerate()
            .map(|(count, data)| {
                let inside = starts.iter().find(|start| (count * 40..count * 40 + 40).contains(*start));
                let first_header = inside.map_or(NO_PACKET_STARTS, |start| (start - count * 40) as u16);
                frame::write(&LINK, FrameId { channel: 1, count: count as u32 }, 0, first_header, data)
            })
            .collect();
        (packets, frames)
    }

    fn assemble(frames: &[Vec<u8>]) -> Vec<Vec<u8>> {
        let mut assembler = Assembler::default();
        let mut packets = Vec::new();
        for octets in frames {
            let frame = TransferFrame::read(&LINK, octets).unwrap();
            assembler.take(&frame, |assembled| match assembled {
                Assembled::Packet(_, packet) if packet::apid(packet) != Apid::IDLE => packets.push(packet.to_vec()),
                Assembled::Packet(..) => {}
                Assembled::Broken(..) => panic!("nothing is broken here"),
            });
        }
        packets.sort();
        packets
    }

    #[test]
    fn the_order_of_frames_does_not_matter() {
        let (mut packets, frames) = stream();
        packets.sort();
        assert_eq!(assemble(&frames), packets);
        for step in [3, 7, 11, 13] {
            let shuffled: Vec<_> = (0..frames.len()).map(|i| frames[i * step % frames.len()].clone()).collect();
            if shuffled.iter().collect::<std::collections::BTreeSet<_>>().len() == frames.len() {
                assert_eq!(assemble(&shuffled), packets, "step {step}");
            }
        }
        let backwards: Vec<_> = frames.iter().rev().cloned().collect();
        assert_eq!(assemble(&backwards), packets);
    }

    /// A packet cut by hours of idle data goes on behind them, in whatever order the frames come; and each idle frame is one step.
    #[test]
    fn a_packet_goes_on_behind_any_number_of_idle_frames() {
        const IDLE: u32 = 200_000;
        let id = PacketId { apid: Apid::EVT, clock: Clock::from_tenths(7), sequence: 1 };
        let packet = write(id, &[9; 58]);
        let frame = |count, first_header, data: &[u8]| {
            frame::write(&LINK, FrameId { channel: 1, count }, 0, first_header, data)
        };
        let rest = [&packet[40..], &write_idle(0, 80 - packet.len())].concat();
        let mut frames = vec![frame(0, 0, &packet[..40])];
        frames.extend((1..=IDLE).map(|count| frame(count, IDLE_DATA_ONLY, &[0; 40])));
        frames.push(frame(IDLE + 1, (packet.len() - 40) as u16, &rest));
        assert_eq!(assemble(&frames), [&packet[..]]);
        frames.reverse();
        assert_eq!(assemble(&frames), [&packet[..]]);
        let (even, odd): (Vec<_>, Vec<_>) = frames.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
        let apart: Vec<Vec<u8>> = even.into_iter().chain(odd).map(|(_, frame)| frame).collect();
        assert_eq!(assemble(&apart), [&packet[..]]);
    }

    #[test]
    fn a_missing_frame_costs_only_the_packets_that_touch_it() {
        let (packets, frames) = stream();
        for missing in 0..frames.len() {
            let mut left = frames.clone();
            left.remove(missing);
            let mut expected = Vec::new();
            let mut at = 0;
            for packet in &packets {
                let touches = at / 40..=(at + packet.len() - 1) / 40;
                if !touches.contains(&missing) {
                    expected.push(packet.clone());
                }
                at += packet.len();
            }
            expected.sort();
            assert_eq!(assemble(&left), expected, "without frame {missing}");
        }
    }
}
