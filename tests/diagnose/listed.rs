//! What the catalogue lists is not lost to a formula: neither where the log has an entry at the same instant, nor where an effect is
//! several times its usual size.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Settings, diagnose};

/// The effects of a concealed case, and the answer to it has them exactly.
fn is_named(kind: Kind, seed: u64, truth: &[&str]) {
    let concealed = draw_order(&Order { kind, seed, only: None, manner: Manner::default() });
    assert_eq!(concealed.truth.ids(), truth, "{seed}");
    let found = diagnose(&super::case(&concealed.files), &Settings::default()).unwrap();
    let mut named = super::ids(&found);
    named.sort_unstable();
    assert_eq!((found.verdict, named.as_slice()), (Verdict::Explained, truth), "{seed}: {:?}", found.hypothesis);
}

/// The leak begins after the only water dump of the log: "exp(-(time since end of water_dump)/6000 s)" would have known its onset, and
/// says nothing that a leak does not.
#[test]
fn a_leak_after_the_only_entry_of_its_kind_is_a_leak() {
    is_named(Kind::One, 1_120_264, &["vent_leak"]);
}

/// Seven times the usual sensitivity beside a step: what a narrow prior takes from nine numbers, products of the field gave back.
#[test]
fn a_magnetic_sensitivity_of_any_size_is_one() {
    is_named(Kind::Two, 1_120_089, &["bias_step", "magnetic_sensitivity"]);
}
