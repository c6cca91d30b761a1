//! Any bits, in any chunks: the deframer finds what it finds without a panic, and chunks change nothing.
#![no_main]

use libfuzzer_sys::fuzz_target;
use oare_ground::ingest::wire::{Deframer, LinkConfig};

fuzz_target!(|input: (u8, bool, Vec<u8>)| {
    let (chunk_octets, coded, octets) = input;
    // Small frames, so that short inputs hold several; the coded link has the smallest interleave.
    let link = match coded {
        false => LinkConfig { frame_octets: 16, ..LinkConfig::default() },
        true => LinkConfig {
            frame_octets: 223,
            randomised: true,
            reed_solomon_interleave: Some(1),
            ..LinkConfig::default()
        },
    };
    let arrivals = |chunk: usize| {
        let mut deframer = Deframer::new(link);
        let mut found = Vec::new();
        octets.chunks(chunk).for_each(|chunk| deframer.push(chunk, |arrival| found.push(arrival)));
        deframer.finish(|arrival| found.push(arrival));
        found
    };
    assert_eq!(arrivals(usize::from(chunk_octets).max(1)), arrivals(octets.len().max(1)));
});
