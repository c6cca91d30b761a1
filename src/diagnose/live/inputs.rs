//! A digest of what the windows are compared with: what was found of the same inputs holds after a restart, and of others nothing.

use super::Policy;
use crate::diagnose::case::Expectation;

/// Fowler, Noll and Vo's hash, a word at a time.
struct Digest(u64);

impl Digest {
    fn word(&mut self, word: u64) {
        self.0 = (self.0 ^ word).wrapping_mul(0x0000_0100_0000_01b3);
        // What a step leaves in the upper half would never come down again.
        self.0 ^= self.0 >> 32;
    }

    fn numbers<'a>(&mut self, numbers: impl IntoIterator<Item = &'a f64>) {
        numbers.into_iter().for_each(|number| self.word(number.to_bits()));
        self.word(u64::MAX);
    }

    fn text(&mut self, text: &str) {
        text.bytes().for_each(|octet| self.word(u64::from(octet)));
        self.word(u64::MAX);
    }
}

/// The digest of simulation, ancillary data, log, case, and of what is searched for and claimed. Where the files lie and how often is
/// searched are no part of it.
pub fn digest(expected: &Expectation, policy: &Policy) -> u64 {
    let mut digest = Digest(0xcbf2_9ce4_8422_2325);
    let (simulation, ancillary, header) = (&expected.simulation, &expected.ancillary, &expected.header);
    digest.numbers(&simulation.clock_s);
    simulation.a_ng.iter().for_each(|axis| digest.numbers(axis));
    digest.numbers(&ancillary.clock_s);
    for vectors in [&ancillary.r_m, &ancillary.v_m_s, &ancillary.w_rad_s] {
        digest.numbers(vectors.iter().flatten());
    }
    digest.numbers(ancillary.q.iter().flatten());
    digest.numbers(ancillary.density_kg_m3.iter().chain(&ancillary.temperature_c));
    for event in &expected.events {
        digest.numbers([&event.clock_s, &event.duration_s]);
        digest.text(&event.kind);
    }
    let vehicle = &header.vehicle;
    digest.numbers([&vehicle.mass_kg, &vehicle.drag_coefficient, &vehicle.srp_coefficient]);
    digest.numbers(vehicle.area_m2.iter().chain(&vehicle.sensor_offset_m));
    digest.numbers([&header.liftoff_clock_s, &policy.claim_probability].into_iter().chain(&header.span_s));
    digest.text(&header.epoch_utc.to_string());
    digest.text(&header.id);
    header.includes.iter().chain(&policy.without).for_each(|word| digest.text(word));
    digest.0
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::diagnose::case::{Ancillary, Event, Header, Simulation};

    /// An expectation of two rows.
    pub(in crate::diagnose::live) fn expected(change: impl FnOnce(&mut Expectation)) -> Expectation {
        let text = "[case]\nid = \"a\"\nepoch_utc = \"1994-07-08T12:53:01Z\"\n[recording]\nkind = \"series_csv\"\n";
        let mut expected = Expectation {
            header: Header::parse(text, &[]).unwrap(),
            simulation: Simulation { clock_s: vec![0.0, 60.0], a_ng: std::array::from_fn(|_| vec![1.0, 2.0]) },
            ancillary: Ancillary { clock_s: vec![0.0, 60.0], density_kg_m3: vec![1e-11; 2], ..Ancillary::default() },
            events: vec![Event { clock_s: 5.0, duration_s: 1.0, kind: "water_dump".into(), detail: String::new() }],
        };
        change(&mut expected);
        expected
    }

    #[test]
    fn whatever_is_compared_or_claimed_otherwise_is_another_digest() {
        let policy = Policy::default();
        let of = |change: fn(&mut Expectation)| digest(&expected(change), &policy);
        let same = of(|_| {});
        assert_eq!(of(|e| e.header.files.simulation = "elsewhere/simulation.csv".into()), same);
        let often = Policy { search_every_s: 60.0, ..policy.clone() };
        assert_eq!(digest(&expected(|_| {}), &often), same, "how often is no matter");
        let others = [
            of(|e| e.simulation.a_ng[2][1] = 2.000_000_001),
            of(|e| e.ancillary.density_kg_m3[0] = 2e-11),
            of(|e| e.events[0].duration_s = 2.0),
            of(|e| e.events.clear()),
            of(|e| e.header.vehicle.mass_kg += 1.0),
            of(|e| e.header.span_s[1] = 50.0),
            digest(&expected(|_| {}), &Policy { claim_probability: 0.01, ..policy.clone() }),
            digest(&expected(|_| {}), &Policy { without: vec!["vent_leak".into()], ..policy.clone() }),
        ];
        for (n, other) in others.iter().enumerate() {
            assert_ne!(*other, same, "{n}");
        }
    }
}
