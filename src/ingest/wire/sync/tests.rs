//! Marker search over senses, offsets, errors and slips.

use super::*;
use crate::ingest::wire::frame;
use proptest::prelude::*;

const LINK: LinkConfig =
    LinkConfig { spacecraft_id: 0x41, frame_octets: 64, randomised: false, reed_solomon_interleave: None };

fn frames(count: u32) -> Vec<Vec<u8>> {
    let data = |n: u32| (0..52u32).map(|i| (n * 31 + i * 7) as u8).collect::<Vec<u8>>();
    (0..count).map(|n| frame::write(&LINK, FrameId { channel: 1, count: n }, 0, 0, &data(n))).collect()
}

fn to_bits(octets: &[u8]) -> Vec<bool> {
    octets.iter().flat_map(|octet| (0..8).map(move |bit| octet & (0x80 >> bit) != 0)).collect()
}

fn to_octets(bits: &[bool]) -> Vec<u8> {
    bits.chunks(8).map(|c| c.iter().enumerate().fold(0, |o, (i, bit)| o | u8::from(*bit) << (7 - i))).collect()
}

/// A playback of these frames in a sense, behind so many alternating leading bits.
fn playback(frames: &[Vec<u8>], sense: Sense, leading_bits: usize) -> Vec<bool> {
    let mut bits: Vec<bool> =
        frames.iter().flat_map(|frame| to_bits(&SYNC_MARKER.to_be_bytes()).into_iter().chain(to_bits(frame))).collect();
    if sense.direction == Direction::Reverse {
        bits.reverse();
    }
    if sense.polarity == Polarity::Inverted {
        bits.iter_mut().for_each(|bit| *bit = !*bit);
    }
    (0..leading_bits).map(|bit| bit % 2 == 0).chain(bits).collect()
}

fn arrivals(octets: &[u8], chunk_octets: usize) -> Vec<Arrival> {
    let mut deframer = Deframer::new(LINK);
    let mut found = Vec::new();
    octets.chunks(chunk_octets).for_each(|chunk| deframer.push(chunk, |arrival| found.push(arrival)));
    deframer.finish(|arrival| found.push(arrival));
    found
}

fn good_counts(found: &[Arrival]) -> Vec<u32> {
    found.iter().filter_map(|a| if let Verdict::Good(id) = a.verdict { Some(id.count) } else { None }).collect()
}

#[test]
fn all_four_senses_are_found_at_every_bit_offset() {
    let frames = frames(4);
    for sense in Sense::ALL {
        for leading_bits in 0..16 {
            let found = arrivals(&to_octets(&playback(&frames, sense, leading_bits)), 1000);
            let mut counts = good_counts(&found);
            assert!(found.iter().all(|arrival| arrival.sense == sense));
            if sense.direction == Direction::Reverse {
                counts.reverse();
            }
            assert_eq!(counts, [0, 1, 2, 3], "{sense:?} behind {leading_bits} bits");
        }
    }
}

#[test]
fn three_wrong_bits_in_an_expected_marker_and_one_in_the_first_do_no_harm() {
    let frames = frames(5);
    let unit = 32 + 64 * 8;
    for sense in [Sense::ALL[0], Sense::ALL[1]] {
        let mut bits = playback(&frames, sense, 3);
        bits[3 + 7] ^= true;
        for wrong in [2, 11, 30] {
            bits[3 + 2 * unit + wrong] ^= true;
        }
        assert_eq!(good_counts(&arrivals(&to_octets(&bits), 7)), [0, 1, 2, 3, 4]);
    }
}

#[test]
fn a_bit_slip_costs_only_the_frame_it_is_in() {
    let frames = frames(8);
    let unit = 32 + 64 * 8;
    for sense in Sense::ALL {
        let mut bits = playback(&frames, sense, 5);
        bits.remove(5 + 3 * unit + 200);
        let mut counts = good_counts(&arrivals(&to_octets(&bits), 33));
        if sense.direction == Direction::Reverse {
            counts.iter_mut().for_each(|count| *count = 7 - *count);
        }
        assert_eq!(counts, [0, 1, 2, 4, 5, 6, 7], "{sense:?}");
    }
}

#[test]
fn slips_that_cancel_cost_only_the_frames_they_are_in() {
    let frames = frames(9);
    let unit = 32 + 64 * 8;
    for sense in Sense::ALL {
        for (first, second) in [(3, 5), (3, 6), (2, 6)] {
            let mut bits = playback(&frames, sense, 5);
            bits.insert(5 + first * unit + 200, true);
            bits.remove(5 + second * unit + 300);
            let found = arrivals(&to_octets(&bits), 33);
            let mut counts = good_counts(&found);
            if sense.direction == Direction::Reverse {
                counts.iter_mut().for_each(|count| *count = 8 - *count);
            }
            let expected: Vec<u32> = (0..9).filter(|n| ![first, second].contains(&(*n as usize))).collect();
            assert_eq!(counts, expected, "{sense:?}, slips in {first} and {second}");
            assert!(found.is_sorted_by_key(|arrival| arrival.first_bit));
        }
    }
}

#[test]
fn a_stretch_full_of_markers_does_not_become_many_times_its_size() {
    let markers = SYNC_MARKER.to_be_bytes().repeat(20_000);
    let octets = [to_octets(&playback(&frames(2), Sense::ALL[0], 0)), markers, vec![0x33; 200]].concat();
    let found = arrivals(&octets, 1000);
    assert_eq!(good_counts(&found), [0, 1]);
    let kept: usize = found.iter().map(|arrival| arrival.octets.len()).sum();
    assert!(kept < (OVERLAPPING_MAX + 1) * octets.len(), "{kept}");
    // Every octet of it is in one of them.
    let mut covered_to = 0;
    for arrival in &found {
        assert!(arrival.first_bit <= covered_to + 32, "{} to {}", covered_to, arrival.first_bit);
        covered_to = covered_to.max(arrival.first_bit + 8 * arrival.octets.len() as u64);
    }
    assert!(covered_to / 8 + 64 > 80_000);
}

#[test]
fn a_frame_that_is_cut_off_is_refused_as_truncated() {
    let octets = to_octets(&playback(&frames(2), Sense::ALL[0], 0));
    let found = arrivals(&octets[..octets.len() - 30], 10);
    assert_eq!(good_counts(&found), [0]);
    assert_eq!(found[1].verdict, Verdict::Refused(FrameRefusal::Truncated));
}

#[test]
fn noise_without_end_is_held_in_bounded_memory() {
    let mut deframer = Deframer::new(LINK);
    let marker_and_noise: Vec<u8> = SYNC_MARKER.to_be_bytes().into_iter().chain([0x33; 64]).collect();
    let mut refused = 0;
    for _ in 0..20_000 {
        deframer.push(&marker_and_noise, |_| refused += 1);
    }
    assert!(deframer.buffer.len() < 100_000 && deframer.doubtful.len() < 1000);
    assert!(refused > 19_000);
}

proptest! {
    #[test]
    fn chunks_change_nothing(
        damage in prop::collection::vec((0usize..6000, 0u8..3), 0..12),
        sense in 0usize..4, leading_bits in 0usize..9, chunk_octets in 1usize..200,
    ) {
        let mut bits = playback(&frames(10), Sense::ALL[sense], leading_bits);
        for (at, kind) in damage {
            let at = at % bits.len();
            match kind {
                0 => bits[at] ^= true,
                1 => { bits.remove(at); }
                _ => bits.insert(at, true),
            }
        }
        let octets = to_octets(&bits);
        prop_assert_eq!(arrivals(&octets, chunk_octets), arrivals(&octets, octets.len()));
    }
}
