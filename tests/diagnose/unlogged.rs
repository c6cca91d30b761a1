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

/// A transfer goes on for a while: the log's entry is where it begins, and the shift that is fitted lies in its middle.
#[test]
fn a_logged_shift_of_mass_may_take_its_time() {
    const EARLIER_S: f64 = 900.0;
    for seed in [1_450_005, 1_450_014] {
        let order = Order { kind: Kind::One, seed, only: Some("mass_shift"), manner: Manner::default() };
        let concealed = draw_order(&order);
        let onset_s = concealed.truth.effects["mass_shift"]["onset_s"].as_f64().unwrap();
        let mut files = concealed.files.clone();
        let (_, log) = files.iter_mut().find(|(name, _)| name == "events.csv").unwrap();
        let text = String::from_utf8(log.clone()).unwrap();
        let earlier = |line: &str| match line.split_once(',') {
            Some((at, rest)) if line.contains("mass_change") => {
                format!("{:.1},{rest}", at.parse::<f64>().unwrap() - EARLIER_S)
            }
            _ => line.to_owned(),
        };
        *log = text.split_inclusive('\n').map(earlier).collect::<String>().into();
        let found = diagnose(&super::case(&files), &Settings::default()).unwrap();
        assert_eq!(super::ids(&found), ["mass_shift"], "{seed}: {found:?}");
        let told = found.effects[0].parameters.iter().find(|p| p.name == "onset_s").unwrap();
        assert!((told.value - onset_s).abs() < 3.5 * told.sigma && told.sigma < 200.0, "{seed}: {onset_s}, {told:?}");
        assert!(found.notes.iter().any(|note| note.contains("that goes on for a while")), "{:?}", found.notes);
    }
}
