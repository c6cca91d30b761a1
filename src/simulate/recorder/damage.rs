//! What tape and radio do to a playback: wrong bits, bursts, slips, damaged markers, noise, a start in mid-octet.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::RecorderConfig;

/// A stream of bits on a tape, forward, with the frames that were touched.
pub struct Tape {
    octets: Vec<u8>,
    /// Octets from one marker to the next, before anything was inserted.
    unit: usize,
    /// Frames touched, by position on the tape, in order.
    pub touched: Vec<usize>,
    edits: Vec<Edit>,
    leading_bits: usize,
    cut_front: usize,
}

/// An edit that changes the length, by bit position.
#[derive(Debug, Clone)]
struct Edit {
    at_bit: usize,
    kind: EditKind,
}

#[derive(Debug, Clone)]
enum EditKind {
    DropBit,
    DoubleBit,
    Noise(Vec<u8>),
}

impl Tape {
    /// Whole units (marker and frame), back to back.
    pub fn new(octets: Vec<u8>, unit: usize) -> Self {
        Self { octets, unit, touched: Vec::new(), edits: Vec::new(), leading_bits: 0, cut_front: 0 }
    }

    /// Everything the configuration asks for.
    pub fn suffer(&mut self, config: &RecorderConfig, random: &mut ChaCha8Rng) {
        let bits = self.octets.len() * 8;
        if bits == 0 {
            return;
        }
        self.scatter_errors(config.bit_errors, random);
        for _ in 0..config.bursts {
            let (at, length) = (random.random_range(0..bits), random.random_range(20..400));
            for bit in at..(at + length).min(bits) {
                if random.random_bool(0.5) {
                    self.flip(bit);
                }
            }
            self.touch(at, length);
        }
        for _ in 0..config.damaged_markers {
            let unit = random.random_range(0..self.octets.len() / self.unit);
            let bit = unit * self.unit * 8 + random.random_range(0..32);
            self.flip(bit);
        }
        for _ in 0..config.slips {
            let at_bit = random.random_range(0..bits);
            let kind = if random.random_bool(0.5) { EditKind::DropBit } else { EditKind::DoubleBit };
            self.touch(at_bit, 1);
            self.edits.push(Edit { at_bit, kind });
        }
        for _ in 0..config.noise {
            let at_bit = random.random_range(0..bits);
            let length = random.random_range(50..3000);
            let noise = (0..length).map(|_| random.random()).collect();
            self.touch(at_bit, 1);
            self.edits.push(Edit { at_bit, kind: EditKind::Noise(noise) });
        }
        if config.shifted {
            self.leading_bits = random.random_range(0..8);
            // Begin in mid-frame: the first frame is lost to this playback.
            self.cut_front = random.random_range(1..self.unit.min(self.octets.len()));
            self.touch(0, 1);
        }
        self.touched.sort_unstable();
        self.touched.dedup();
    }

    /// Independent wrong bits at a rate, by their exponential distances.
    fn scatter_errors(&mut self, rate: f64, random: &mut ChaCha8Rng) {
        if rate <= 0.0 {
            return;
        }
        let bits = self.octets.len() * 8;
        let mut at = 0.0;
        loop {
            at += -random.random_range(1e-12..1.0_f64).ln() / rate;
            if at >= bits as f64 {
                return;
            }
            self.flip(at as usize);
            self.touch(at as usize, 1);
        }
    }

    fn flip(&mut self, bit: usize) {
        self.octets[bit / 8] ^= 0x80 >> (bit % 8);
    }

    fn touch(&mut self, at_bit: usize, length: usize) {
        let last = (at_bit + length - 1) / 8 / self.unit;
        self.touched.extend(at_bit / 8 / self.unit..=last);
    }

    /// The octets as played: edits done, shifted, backwards if asked.
    pub fn play(mut self, reversed: bool) -> Vec<u8> {
        self.edits.sort_by_key(|edit| edit.at_bit);
        let mut out = Bits::default();
        for _ in 0..self.leading_bits {
            out.push_bits(1, 1);
        }
        let mut from_bit = self.cut_front * 8;
        for edit in &self.edits {
            if edit.at_bit < from_bit {
                continue;
            }
            out.copy(&self.octets, from_bit, edit.at_bit);
            from_bit = match &edit.kind {
                EditKind::DropBit => edit.at_bit + 1,
                EditKind::DoubleBit => {
                    out.copy(&self.octets, edit.at_bit, edit.at_bit + 1);
                    edit.at_bit
                }
                EditKind::Noise(noise) => {
                    out.copy(noise, 0, noise.len() * 8);
                    edit.at_bit
                }
            };
        }
        out.copy(&self.octets, from_bit, self.octets.len() * 8);
        let mut octets = out.finish();
        if reversed {
            octets.reverse();
            octets.iter_mut().for_each(|octet| *octet = octet.reverse_bits());
        }
        octets
    }
}

/// Bits gathered into octets.
#[derive(Default)]
struct Bits {
    octets: Vec<u8>,
    held: u32,
    held_bits: u32,
}

impl Bits {
    fn push_bits(&mut self, value: u8, bits: u32) {
        self.held = self.held << bits | u32::from(value) & ((1 << bits) - 1);
        self.held_bits += bits;
        while self.held_bits >= 8 {
            self.held_bits -= 8;
            self.octets.push((self.held >> self.held_bits) as u8);
        }
        self.held &= (1 << self.held_bits) - 1;
    }

    fn copy(&mut self, from: &[u8], start_bit: usize, end_bit: usize) {
        let mut bit = start_bit;
        while bit < end_bit {
            let within = bit % 8;
            let take = (8 - within).min(end_bit - bit);
            let value = from[bit / 8] << within >> (8 - take);
            self.push_bits(value, take as u32);
            bit += take;
        }
    }

    /// The octets, the last filled up with ones.
    fn finish(mut self) -> Vec<u8> {
        while self.held_bits != 0 {
            self.push_bits(1, 1);
        }
        self.octets
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_copied_at_any_offset() {
        let from = [0b1010_0110, 0b1111_0000, 0b0001_1000];
        let mut bits = Bits::default();
        bits.push_bits(0b101, 3);
        bits.copy(&from, 2, 19);
        // 101 10_0110 1111_0000 000 and four ones.
        assert_eq!(bits.finish(), [0b1011_0011, 0b0111_1000, 0b0000_1111]);
    }
}
