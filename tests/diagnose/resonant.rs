//! Noise of the second order, which oscillates and forgets its phase, and oscillations that do not.

use std::f64::consts::TAU;

use oare_ground::challenge::conceal::{Concealed, Kind, Manner, Order, Wander, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Settings, diagnose};

/// Records in which two autoregressions alone leave a line, or a harmonic of the orbit.
const SEEDS: [u64; 2] = [1_300_017, 1_300_045];

fn drawn(kind: Kind, seed: u64, wander: Wander) -> Concealed {
    draw_order(&Order { kind, seed, only: None, manner: Manner { wander, ..Manner::default() } })
}

/// Noise that resonates is noise, and told as such.
#[test]
fn noise_that_resonates_is_no_finding_and_is_told() {
    for seed in SEEDS {
        let concealed = drawn(Kind::Slow, seed, Wander::Resonant);
        let answer = diagnose(&super::case(&concealed.files), &Settings::default()).unwrap();
        assert_eq!(answer.verdict, Verdict::Consistent, "{seed}: {:?} {:?}", super::ids(&answer), answer.hypothesis);
        assert!(answer.notes.iter().any(|note| note.contains("is taken to resonate")), "{seed}: {:?}", answer.notes);
    }
}

/// An oscillation that keeps its phase is a finding, a tenth of the noise as it is; so it stays when the noise resonates elsewhere.
#[test]
fn an_oscillation_that_keeps_its_phase_is_no_noise() {
    for (seed, wander) in [(1, Wander::Autoregression), (2, Wander::Resonant)] {
        let concealed = drawn(if wander == Wander::Resonant { Kind::Slow } else { Kind::Clean }, seed, wander);
        let mut case = super::case(&concealed.files);
        for axis in &mut case.recording.a_ng {
            let mean = axis.iter().sum::<f64>() / axis.len() as f64;
            let rms = (axis.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / axis.len() as f64).sqrt();
            for (x, t) in axis.iter_mut().zip(&case.recording.clock_s) {
                *x += 0.1 * rms * (TAU * t / 1234.0).sin();
            }
        }
        let answer = diagnose(&case, &Settings::default()).unwrap();
        assert_eq!(answer.verdict, Verdict::Unexplained, "{seed}: {:?}", answer.notes);
        let form = answer.hypothesis.map(|h| h.formula).unwrap_or_default();
        assert!(form.contains("an oscillation, its period 123"), "{seed}: {form}");
    }
}
