//! Noise that is not as the deviations or the usual sizes have it: louder, slower, and as loud asleep as awake.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::{Diagnosis, Settings, diagnose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Level of the added noise, and its correlation time, s.
struct Red {
    level_ng: f64,
    tau_s: f64,
}

/// A record in which nothing is missing, with an autoregression added that no crew has a share in; so many times as loud at an instant.
fn beside(red: &Red, louder: impl Fn(f64) -> f64, seed: u64) -> Diagnosis {
    let concealed = draw_order(&Order { kind: Kind::Clean, seed, only: None, manner: Manner::default() });
    let mut case: Case = super::case(&concealed.files);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let clock_s = case.recording.clock_s.clone();
    for axis in &mut case.recording.a_ng {
        let mut now = normal();
        let mut before_s = clock_s[0];
        for (value, at_s) in axis.iter_mut().zip(&clock_s) {
            let keep = (-(at_s - before_s) / red.tau_s).exp();
            now = keep * now + (1.0 - keep * keep).sqrt() * normal();
            before_s = *at_s;
            *value += louder(*at_s) * red.level_ng * now;
        }
    }
    diagnose(&case, &Settings::default()).unwrap()
}

/// Slow noise of 100 ng and more is no leak, step or line: it has the whole range of amplitudes to be.
#[test]
fn slow_noise_louder_than_any_instrument_should_have_is_no_finding() {
    for (seed, red) in [
        (1_250_000, Red { level_ng: 150.0, tau_s: 3000.0 }),
        (1_250_001, Red { level_ng: 300.0, tau_s: 700.0 }),
        (1_250_002, Red { level_ng: 1000.0, tau_s: 2000.0 }),
        (1_250_005, Red { level_ng: 1500.0, tau_s: 240.0 }),
    ] {
        let answer = beside(&red, |_| 1.0, seed);
        assert_eq!(answer.verdict, Verdict::Consistent, "{seed}: {:?} {:?}", super::ids(&answer), answer.hypothesis);
    }
}

/// The samples are louder awake and the means of the windows are not: the windows are believed, and it is told.
#[test]
fn noise_that_does_not_follow_the_deviations_is_no_finding() {
    for (seed, tau_s) in [(1_250_003, 36.0), (1_250_004, 110.0)] {
        let answer = beside(&Red { level_ng: 1500.0, tau_s }, |_| 1.0, seed);
        assert_eq!(answer.verdict, Verdict::Consistent, "{seed}: {:?} {:?}", super::ids(&answer), answer.hypothesis);
        let told =
            answer.notes.iter().filter(|note| note.contains("times as loud with the crew awake as asleep")).count();
        assert_eq!(told, 3, "{seed}: {:?}", answer.notes);
    }
}

/// Six hours five times as loud as the others, of which no log knows, and a level that follows the day.
#[test]
fn hours_that_are_louder_than_others_are_no_finding() {
    let six_hours = |t: f64| if (10_000.0..31_600.0).contains(&(t % 86_400.0)) { 5.0 } else { 1.0 };
    let by_day = |t: f64| 1.0 + 0.7 * (t / 86_400.0 * std::f64::consts::TAU).sin();
    let levels: [&dyn Fn(f64) -> f64; 2] = [&six_hours, &by_day];
    for (seed, louder) in (1_250_006..).zip(levels) {
        let answer = beside(&Red { level_ng: 1500.0, tau_s: 5.0 }, louder, seed);
        assert_eq!(answer.verdict, Verdict::Consistent, "{seed}: {:?} {:?}", super::ids(&answer), answer.hypothesis);
        let told = answer.notes.iter().find(|note| note.contains("is louder in some half hours"));
        assert!(
            told.is_some_and(|note| ["x ", "y ", "z "].iter().all(|axis| note.contains(axis))),
            "{:?}",
            answer.notes
        );
    }
}

/// Half an hour to two and a half, two to four times as loud, as the deviations show and no log does: samples are as loud as they are in
/// both windows that have them.
#[test]
fn hours_that_are_louder_by_their_deviations_are_no_finding() {
    for seed in [1_250_010, 1_250_017, 1_250_022, 1_250_035, 1_250_042] {
        let concealed = draw_order(&Order { kind: Kind::Clean, seed, only: None, manner: Manner::default() });
        let mut case: Case = super::case(&concealed.files);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let clock_s = case.recording.clock_s.clone();
        let [start, end] = [clock_s[0], clock_s[clock_s.len() - 1]];
        let mut uniform = |from: f64, to: f64| rng.random_range(from..to);
        let bursts: Vec<[f64; 3]> =
            (0..7).map(|_| [uniform(start, end), uniform(1800.0, 9000.0), uniform(2.0, 4.0)]).collect();
        let level = |t: f64| {
            let inside = bursts.iter().filter(|[from, lasts, _]| (*from..from + lasts).contains(&t));
            inside.map(|[.., level]| *level).fold(1.0, f64::max)
        };
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        for (values, dev_ng) in case.recording.a_ng.iter_mut().zip(&mut case.recording.dev_ng) {
            let mut half = normal();
            for ((value, dev_ng), at_s) in values.iter_mut().zip(dev_ng).zip(&clock_s) {
                let next = level(at_s + 12.5) * normal();
                *value += 250.0 * (half + next);
                *dev_ng = 900.0 * level(*at_s) * (0.25 * normal()).exp();
                half = next;
            }
        }
        let answer = diagnose(&case, &Settings::default()).unwrap();
        assert_eq!(answer.verdict, Verdict::Consistent, "{seed}: {:?} {:?}", super::ids(&answer), answer.hypothesis);
        let told = answer.notes.iter().any(|note| note.contains("the deviations show when, the windows agree"));
        assert!(told, "{seed}: {:?}", answer.notes);
    }
}
