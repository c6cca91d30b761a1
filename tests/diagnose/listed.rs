//! What the catalogue lists is not lost to a formula: neither where the log has an entry at the same instant, nor where an effect is
//! several times its usual size.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::measure::window_means;
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

/// Two seconds, where manoeuvres are fast enough to show them: here a quiet record of slower ones.
#[test]
fn a_clock_that_is_two_seconds_out_is_told() {
    for offset_s in [2.0, -1.5] {
        let order = Order { kind: Kind::Clean, seed: 3, only: None, manner: Manner::default() };
        let mut case = super::case(&draw_order(&order).files);
        let simulation = case.simulation.clone();
        for k in 0..3 {
            let seen =
                |ahead_s| window_means(&simulation.clock_s, &simulation.a_ng[k], &case.recording.clock_s, ahead_s);
            let (now, late) = (seen(0.0), seen(offset_s));
            for ((x, now), late) in case.recording.a_ng[k].iter_mut().zip(now).zip(late) {
                *x = late + 0.05 * (*x - now);
            }
        }
        let found = diagnose(&case, &Settings::default()).unwrap();
        assert_eq!(
            (found.verdict, super::ids(&found)),
            (Verdict::Explained, vec!["time_offset"]),
            "{:?}",
            found.hypothesis
        );
        let told = &found.effects[0].parameters[0];
        assert!((told.value - offset_s).abs() < 4.0 * told.sigma, "{told:?}");
        assert!(told.sigma < 0.5, "{told:?}");
    }
}
