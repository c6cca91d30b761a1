//! Leaks that are not as usual: one that opens twice, and one that takes days.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::{Diagnosis, Settings, diagnose};

/// A leak: its onset as a share of the record, amplitudes, ng, and time constant, s.
struct Leak(f64, [f64; 3], f64);

/// A record of so many hours in which nothing is missing but these.
fn beside(hours: u32, seed: u64, leaks: &[Leak]) -> Diagnosis {
    let manner = Manner { hours, ..Manner::default() };
    let concealed = draw_order(&Order { kind: Kind::Clean, seed, only: None, manner });
    let mut case: Case = super::case(&concealed.files);
    let clock_s = case.recording.clock_s.clone();
    let (first, last) = (clock_s[0], clock_s[clock_s.len() - 1]);
    for Leak(onset, a_ng, tau_s) in leaks {
        let onset_s = first + onset * (last - first);
        for (series, a_ng) in case.recording.a_ng.iter_mut().zip(a_ng) {
            let later = series.iter_mut().zip(&clock_s).filter(|(_, t)| **t > onset_s);
            later.for_each(|(value, t)| *value += a_ng * (-(t - onset_s) / tau_s).exp());
        }
    }
    diagnose(&case, &Settings::default()).unwrap()
}

/// The catalogue's leak begins once: where it begins twice one of both is not all there is, and where the other is, is told.
#[test]
fn a_leak_that_opens_twice_is_not_explained_by_one() {
    let seed = 1_250_025;
    let once = beside(24, seed, &[Leak(0.6, [70.0, -140.0, 95.0], 8000.0)]);
    assert_eq!((once.verdict, super::ids(&once)), (Verdict::Explained, vec!["vent_leak"]));
    for leaks in [
        [Leak(0.6, [70.0, -140.0, 95.0], 8000.0), Leak(0.2, [70.0, -140.0, 95.0], 8000.0)],
        [Leak(0.6, [100.0, -140.0, 95.0], 5000.0), Leak(0.2, [60.0, 140.0, -95.0], 5000.0)],
    ] {
        let twice = beside(24, seed, &leaks);
        assert_eq!(twice.verdict, Verdict::Unexplained, "{:?}", super::ids(&twice));
        let hypothesis = twice.hypothesis.unwrap();
        assert!(hypothesis.formula.contains("vent_leak once more"), "{hypothesis:?}");
    }
}

/// In four days a decay over more than one is told from a step.
#[test]
fn a_leak_of_days_has_its_time_constant_where_the_record_is_long_enough() {
    let tau_s = 130_000.0;
    let found = beside(96, 1_250_012, &[Leak(0.3, [90.0, -70.0, 80.0], tau_s)]);
    assert_eq!((found.verdict, super::ids(&found)), (Verdict::Explained, vec!["vent_leak"]), "{:?}", found.notes);
    let told = found.effects[0].parameters.iter().find(|parameter| parameter.name == "tau_s").unwrap();
    assert!((told.value - tau_s).abs() < 4.0 * told.sigma && told.sigma < 0.2 * tau_s, "{told:?}");
}
