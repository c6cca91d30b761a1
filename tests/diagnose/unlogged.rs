//! What began before the record is in no log: a law that runs from the last waking is told all the same.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Settings, diagnose};

#[test]
fn a_ramp_from_a_waking_before_the_record_is_no_shift_of_the_crew() {
    for seed in [1_220_073, 1_220_177] {
        let order = Order { kind: Kind::Unknown, seed, only: None, manner: Manner::default() };
        let concealed = draw_order(&order);
        assert!(concealed.truth.effects.contains_key("unknown_sawtooth"), "{:?}", concealed.truth.effects);
        let found = diagnose(&super::case(&concealed.files), &Settings::default()).unwrap();
        let formula = found.hypothesis.as_ref().map(|h| h.formula.as_str()).unwrap_or_default();
        assert_eq!(found.verdict, Verdict::Unexplained, "{seed}: {:?}", super::ids(&found));
        assert!(formula.contains("time since end of crew_sleep"), "{seed}: {formula}");
    }
}

/// What shifts a mass need not be in the log: it is told from an offset of the whole record and from a step, with its instant.
#[test]
fn a_shift_of_mass_that_the_log_forgot_is_told_with_its_instant() {
    for seed in [1_450_000, 1_450_005, 1_450_017] {
        let order = Order { kind: Kind::One, seed, only: Some("mass_shift"), manner: Manner::default() };
        let concealed = draw_order(&order);
        let mut files = concealed.files.clone();
        let (_, log) = files.iter_mut().find(|(name, _)| name == "events.csv").unwrap();
        let text = String::from_utf8(log.clone()).unwrap();
        *log = text.split_inclusive('\n').filter(|line| !line.contains("mass_change")).collect::<String>().into();
        let found = diagnose(&super::case(&files), &Settings::default()).unwrap();
        assert_eq!((found.verdict, super::ids(&found)), (Verdict::Explained, vec!["mass_shift"]), "{seed}: {found:?}");
        for told in &found.effects[0].parameters {
            let truth = concealed.truth.effects["mass_shift"][&told.name].as_f64().unwrap();
            assert!((told.value - truth).abs() < 3.5 * told.sigma, "{seed}: {truth}, {told:?}");
        }
        assert!(found.notes.iter().any(|note| note.contains("the log has no change of mass")), "{:?}", found.notes);
    }
}
