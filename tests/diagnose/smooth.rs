//! Slow noise that no autoregression is, on concealed records.

use oare_ground::challenge::conceal::{Kind, Manner, Order, Wander, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Settings, diagnose};

/// Records of which a filter of autoregressions leaves as much as would be a line in white noise, or an effect beside it.
#[test]
fn smooth_slow_noise_is_no_finding() {
    for seed in [1_180_002, 1_180_091, 1_180_165, 1_180_203] {
        let manner = Manner { wander: Wander::Smooth, ..Manner::default() };
        let concealed = draw_order(&Order { kind: Kind::Slow, seed, only: None, manner });
        let answer = diagnose(&super::case(&concealed.files), &Settings::default()).unwrap();
        assert_eq!(answer.verdict, Verdict::Consistent, "{seed}: {answer:?}");
    }
}

/// Slow noise of the same power in every octave, to days: the slowest octaves, which an autoregression lacks, would be a step and a drift.
#[test]
fn flicker_noise_is_no_finding() {
    for seed in [1_250_008, 1_250_043] {
        let manner = Manner { wander: Wander::Flicker, ..Manner::default() };
        let concealed = draw_order(&Order { kind: Kind::Slow, seed, only: None, manner });
        let answer = diagnose(&super::case(&concealed.files), &Settings::default()).unwrap();
        assert_eq!(answer.verdict, Verdict::Consistent, "{seed}: {answer:?}");
    }
}
