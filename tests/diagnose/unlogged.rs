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
