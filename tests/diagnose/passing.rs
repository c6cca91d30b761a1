//! What oscillates for a while, and then no more.

use std::f64::consts::TAU;

use oare_ground::challenge::conceal::{Kind, Manner, Order, Wander, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Settings, diagnose};

/// Rings once, dies away, and is told with when: in noise of two autoregressions, and in noise that resonates elsewhere, where a formula
/// explains a part of it.
#[test]
fn what_rings_once_is_told_with_when() {
    for (seed, kind, wander) in [(1, Kind::Clean, Wander::Autoregression), (2, Kind::Slow, Wander::Resonant)] {
        let order = Order { kind, seed, only: None, manner: Manner { wander, ..Manner::default() } };
        let mut case = super::case(&draw_order(&order).files);
        let clock_s = &case.recording.clock_s;
        let onset_s = clock_s[clock_s.len() / 3];
        let z = &mut case.recording.a_ng[2];
        let mean = z.iter().sum::<f64>() / z.len() as f64;
        let rms = (z.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / z.len() as f64).sqrt();
        for (x, t) in z.iter_mut().zip(clock_s).filter(|(_, t)| **t > onset_s) {
            let since_s = t - onset_s;
            *x += 3.0 * rms * (-since_s / 4000.0).exp() * (TAU * since_s / 700.0).sin();
        }
        let answer = diagnose(&case, &Settings::default()).unwrap();
        assert_eq!(answer.verdict, Verdict::Unexplained, "{seed}: {:?}", answer.notes);
        assert!(answer.effects.is_empty(), "{seed}: {:?}", super::ids(&answer));
        let told = answer.hypothesis.unwrap();
        assert!(told.formula.contains("an oscillation for a while"), "{seed}: {}", told.formula);
        assert_eq!(told.axis, "mostly z", "{seed}");
        assert!(answer.located.axes.contains(&"z".into()), "{seed}: {:?}", answer.located.axes);
        let when = &answer.located.intervals[0];
        assert_eq!(when.why, "the oscillation");
        assert!((when.start_s - onset_s).abs() < 2000.0 && when.end_s > onset_s, "{seed}: {when:?} {onset_s}");
    }
}

/// Rings that are faint each, after every entry of the log of some kind and with the same phase: told with after what.
#[test]
fn what_rings_after_every_entry_of_the_log_is_told_with_after_what() {
    const ENTRIES_S: [f64; 5] = [9_000.0, 31_700.0, 52_300.0, 78_100.0, 104_900.0];
    let order = Order { kind: Kind::Clean, seed: 2, only: None, manner: Manner::default() };
    let mut files = draw_order(&order).files;
    let first_s = super::case(&files).recording.clock_s[0];
    let log = &mut files.iter_mut().find(|(name, _)| name == "events.csv").unwrap().1;
    let entries = ENTRIES_S.map(|since_s| first_s + since_s);
    let lines: String = entries.iter().map(|t| format!("{t},60,airlock,\n")).collect();
    log.extend(lines.as_bytes());
    let mut case = super::case(&files);
    let clock_s = &case.recording.clock_s;
    let y = &mut case.recording.a_ng[1];
    let mean = y.iter().sum::<f64>() / y.len() as f64;
    let rms = (y.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / y.len() as f64).sqrt();
    for (x, t) in y.iter_mut().zip(clock_s) {
        for since_s in entries.iter().map(|at| t - at).filter(|since_s| *since_s > 0.0) {
            *x += rms * (-since_s / 2500.0).exp() * (TAU * since_s / 800.0).sin();
        }
    }
    let answer = diagnose(&case, &Settings::default()).unwrap();
    assert_eq!(answer.verdict, Verdict::Unexplained, "{:?}", answer.notes);
    assert!(answer.effects.is_empty(), "{:?}", super::ids(&answer));
    let told = answer.hypothesis.unwrap();
    assert!(told.formula.contains("a ringing after every start of airlock"), "{}", told.formula);
    assert_eq!(told.axis, "mostly y");
    let when: Vec<f64> = answer.located.intervals.iter().map(|i| i.start_s).collect();
    assert_eq!(when, entries);
}
