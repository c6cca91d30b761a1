//! The payload recorder and the link: records to packets to frames to playbacks, with everything a tape and a radio do to them.
//!
//! A playback is one pass of the tape: forward or reversed, normal or inverted, cut at any bit, with errors. Which frames were
//! touched is told with each, so that a test knows what a receiver can have.

mod damage;
mod frames;

pub use frames::{Framer, Packetiser};

use rand::RngExt;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::ingest::wire::LinkConfig;
use crate::ingest::wire::coding::{SYNC_MARKER, encode};

use super::{Purpose, Second, generator};

/// What tape and link do. Rates and chances are 0 for a clean dump.
#[derive(Debug, Clone, PartialEq)]
pub struct RecorderConfig {
    /// Frames of one playback.
    pub frames_per_playback: usize,
    /// Frames of a playback that the next repeats.
    pub overlap_frames: usize,
    /// Chance that a playback runs backwards.
    pub reversed: f64,
    /// Chance that a playback is inverted.
    pub inverted: f64,
    /// Whether playbacks begin at any bit of an octet, in mid-frame.
    pub shifted: bool,
    /// Chance of each frame to be left out of the tape for good.
    pub lost_frames: f64,
    /// Wrong bits per bit.
    pub bit_errors: f64,
    /// Bursts of wrong bits per playback, of 20 to 400 bits.
    pub bursts: usize,
    /// Bit slips per playback: one bit lost or doubled.
    pub slips: usize,
    /// Markers with one wrong bit, per playback.
    pub damaged_markers: usize,
    /// Stretches of noise between or within frames, per playback, of 50 to 3000 octets.
    pub noise: usize,
    /// Chance that a whole playback is sent again.
    pub repeats: f64,
    /// Whether playbacks arrive in any order.
    pub shuffled: bool,
}

impl RecorderConfig {
    /// One forward playback without a fault.
    pub fn clean() -> Self {
        Self {
            frames_per_playback: usize::MAX,
            overlap_frames: 0,
            reversed: 0.0,
            inverted: 0.0,
            shifted: false,
            lost_frames: 0.0,
            bit_errors: 0.0,
            bursts: 0,
            slips: 0,
            damaged_markers: 0,
            noise: 0,
            repeats: 0.0,
            shuffled: false,
        }
    }

    /// Overlaps, reversals, inversions and losses as on a bad day.
    pub fn messy() -> Self {
        Self {
            frames_per_playback: 620,
            overlap_frames: 30,
            reversed: 0.4,
            inverted: 0.4,
            shifted: true,
            lost_frames: 0.002,
            bit_errors: 5e-7,
            bursts: 4,
            slips: 2,
            damaged_markers: 3,
            noise: 1,
            repeats: 0.1,
            shuffled: true,
        }
    }
}

/// One pass of the tape as it arrives.
#[derive(Debug, Clone)]
pub struct Playback {
    /// The octets on the wire.
    pub octets: Vec<u8>,
    /// Whether it runs backwards.
    pub reversed: bool,
    /// Whether it is inverted.
    pub inverted: bool,
    /// Index of the first frame in it, among those given.
    pub first_frame: usize,
    /// Frames in it.
    pub frames: usize,
    /// Indices of frames that errors, slips or noise have touched.
    pub touched: Vec<usize>,
    /// Indices of frames left out.
    pub lost: Vec<usize>,
}

/// Every frame of a flight's seconds, on the recorder's channel.
pub fn frames(seconds: impl Iterator<Item = Second>, link: LinkConfig) -> Vec<Vec<u8>> {
    let (mut packetiser, mut framer) = (Packetiser::default(), Framer::new(link, 1, 0));
    let mut frames = Vec::new();
    for second in seconds {
        for sent in &second.sent {
            framer.push(&packetiser.packet(sent), |frame| frames.push(frame));
        }
    }
    framer.finish(|frame| frames.push(frame));
    frames
}

/// Cuts frames (as the [`Framer`] made them) into playbacks, and treats them as tape and link do.
pub fn playbacks(frames: &[Vec<u8>], link: &LinkConfig, config: &RecorderConfig, seed: u64) -> Vec<Playback> {
    let mut random = generator(seed, Purpose::Recorder);
    let lost: Vec<bool> = frames.iter().map(|_| random.random_bool(config.lost_frames.clamp(0.0, 1.0))).collect();
    let mut all = Vec::new();
    let mut first = 0;
    while first < frames.len() {
        let until = first.saturating_add(config.frames_per_playback.max(1)).min(frames.len());
        let playback = one(&frames[first..until], first, &lost, link, config, &mut random);
        if random.random_bool(config.repeats.clamp(0.0, 1.0)) {
            all.push(one(&frames[first..until], first, &lost, link, config, &mut random));
        }
        all.push(playback);
        if until == frames.len() {
            break;
        }
        first = until.saturating_sub(config.overlap_frames).max(first + 1);
    }
    if config.shuffled {
        all.shuffle(&mut random);
    }
    all
}

fn one(
    frames: &[Vec<u8>],
    first_frame: usize,
    lost: &[bool],
    link: &LinkConfig,
    config: &RecorderConfig,
    random: &mut ChaCha8Rng,
) -> Playback {
    let unit = 4 + link.coded_octets();
    let mut octets = Vec::with_capacity(frames.len() * unit);
    let mut on_tape = Vec::with_capacity(frames.len());
    for (k, frame) in frames.iter().enumerate() {
        if !lost[first_frame + k] {
            octets.extend(SYNC_MARKER.to_be_bytes());
            octets.extend(encode(link, frame));
            on_tape.push(first_frame + k);
        }
    }
    let lost = (first_frame..first_frame + frames.len()).filter(|k| lost[*k]).collect();
    let reversed = random.random_bool(config.reversed.clamp(0.0, 1.0));
    let inverted = random.random_bool(config.inverted.clamp(0.0, 1.0));
    let is_plain = config.bit_errors == 0.0
        && config.bursts + config.slips + config.damaged_markers + config.noise == 0
        && !config.shifted
        && !reversed;
    let mut touched = Vec::new();
    if !is_plain {
        let mut tape = damage::Tape::new(octets, unit);
        tape.suffer(config, random);
        touched = tape.touched.iter().filter_map(|k| on_tape.get(*k).copied()).collect();
        octets = tape.play(reversed);
    }
    if inverted {
        octets.iter_mut().for_each(|octet| *octet = !*octet);
    }
    Playback { octets, reversed, inverted, first_frame, frames: frames.len(), touched, lost }
}
