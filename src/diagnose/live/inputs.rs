//! A digest of what the windows are compared with: what was found of the same inputs holds after a restart, and of others nothing.

use rapidhash::v3::rapidhash_v3;

use super::Policy;
use crate::diagnose::case::Expectation;

/// What is digested, each part with an end that no value has.
#[derive(Default)]
struct Octets(Vec<u8>);

impl Octets {
    fn numbers<'a>(&mut self, numbers: impl IntoIterator<Item = &'a f64>) {
        numbers.into_iter().for_each(|number| self.0.extend(number.to_le_bytes()));
        self.0.extend([u8::MAX; 8]);
    }

    fn text(&mut self, text: &str) {
        self.0.extend(text.bytes().chain([u8::MAX]));
    }
}

/// The digest of simulation, ancillary data, log, case, and of what is searched for and claimed. Where the files lie and how often is
/// searched are no part of it.
pub fn digest(expected: &Expectation, policy: &Policy) -> u64 {
    let mut octets = Octets::default();
    let (simulation, ancillary, header) = (&expected.simulation, &expected.ancillary, &expected.header);
    octets.numbers(&simulation.clock_s);
    simulation.a_ng.iter().for_each(|axis| octets.numbers(axis));
    octets.numbers(&ancillary.clock_s);
    for vectors in [&ancillary.r_m, &ancillary.v_m_s, &ancillary.w_rad_s] {
        octets.numbers(vectors.iter().flatten());
    }
    octets.numbers(ancillary.q.iter().flatten());
    octets.numbers(ancillary.density_kg_m3.iter().chain(&ancillary.temperature_c));
    for event in &expected.events {
        octets.numbers([&event.clock_s, &event.duration_s]);
        octets.text(&event.kind);
    }
    let vehicle = &header.vehicle;
    octets.numbers([&vehicle.mass_kg, &vehicle.drag_coefficient, &vehicle.srp_coefficient]);
    octets.numbers(vehicle.area_m2.iter().chain(&vehicle.sensor_offset_m));
    octets.numbers([&header.liftoff_clock_s, &policy.claim_probability].into_iter().chain(&header.span_s));
    octets.text(&header.epoch_utc.to_string());
    octets.text(&header.id);
    for words in [&header.includes, &policy.without] {
        words.iter().for_each(|word| octets.text(word));
        octets.text("");
    }
    rapidhash_v3(&octets.0)
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
