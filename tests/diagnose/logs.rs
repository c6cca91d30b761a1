//! Logs as they are kept: by another clock, of very many kinds, with one night twice.

use std::sync::Arc;

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::{Event, Expectation};
use oare_ground::diagnose::{Settings, diagnose};

use super::drag_case::{drag, files, with_key, with_lines};

#[test]
fn a_log_of_another_clock_and_a_claim_that_does_not_hold_are_told() {
    let (.., notes) = drag(&with_lines("case.toml", |lines| {
        for line in lines.iter_mut().filter(|line| line.starts_with("includes")) {
            *line = "includes = [\"rotation\", \"aerodynamic_drag\"]".into();
        }
    }));
    let of = |word: &str, notes: &[String]| notes.iter().filter(|note| note.contains(word)).count();
    let (.., of_no_effect) = drag(&with_key("includes", "[\"rotation\", \"gravity_gradiant\"]"));
    assert_eq!(of("includes gravity_gradiant: that is none", &of_no_effect), 1, "{of_no_effect:?}");
    assert_eq!(of("includes aerodynamic_drag: the recording shows", &notes), 1, "{notes:?}");
    assert_eq!((of("includes rotation", &notes), of("another clock", &notes)), (0, 0), "{notes:?}");
    let (.., notes) = drag(&with_lines("events.csv", |lines| {
        for line in &mut lines[1..] {
            let (clock_s, rest) = line.split_once(',').unwrap();
            *line = format!("{},{rest}", 1e9 + clock_s.parse::<f64>().unwrap());
        }
    }));
    assert_eq!(of("another clock", &notes), 1, "{notes:?}");
}

/// A kind to every entry: each would be another chance for noise, and all of them minutes of work.
#[test]
fn a_log_of_very_many_kinds_is_tried_in_part_and_told() {
    let (value, sigma, notes) = drag(&files());
    assert!(!notes.iter().any(|note| note.contains("kinds of entries")), "{notes:?}");
    let (beside, _, notes) = drag(&with_lines("events.csv", |lines| {
        let first = lines[1].clone();
        let at: f64 = first.split(',').next().unwrap().parse().unwrap();
        for kind in 0..2000 {
            for entry in 0..3 {
                let at = at + 41.0 * f64::from(kind) + 9000.0 * f64::from(entry);
                lines.push(format!("{at:.1},60.0,kind_{kind},"));
            }
        }
    }));
    assert!(notes.iter().any(|note| note.contains("kinds of entries: formulas are made of the 32")), "{notes:?}");
    assert!((beside - value).abs() < 0.5 * sigma, "{beside} for {value}");
}

/// An entry that is in the log twice, as from two shifts, is one night.
#[test]
fn sleep_that_is_logged_twice_is_no_more_sleep() {
    let twice = with_lines("events.csv", |lines| {
        let sleep: Vec<String> = lines.iter().filter(|line| line.contains("crew_sleep")).cloned().collect();
        assert!(!sleep.is_empty());
        lines.extend(sleep);
    });
    let [once, twice] = [files(), twice].map(|files| drag(&files));
    assert_eq!(once, twice);
}

/// The clock of a log is asked about where what it logs is plainly there, only at another time.
#[test]
fn a_log_that_is_hours_off_is_asked_about() {
    for (effect, seed) in [("water_dump", 1_460_003), ("crew_activity", 1_470_005), ("thruster_residual", 1_470_001)] {
        let concealed = draw_order(&Order { kind: Kind::One, seed, only: Some(effect), manner: Manner::default() });
        assert!(concealed.truth.snr[effect] > 12.0, "{:?}", concealed.truth.snr);
        let asked = |earlier_s: f64| {
            let mut files = concealed.files.clone();
            let (_, log) = files.iter_mut().find(|(name, _)| name == "events.csv").unwrap();
            let text = String::from_utf8(log.clone()).unwrap();
            let moved = |line: &str| match line.split_once(',').map(|(at, rest)| (at.parse::<f64>(), rest)) {
                Some((Ok(clock_s), rest)) => format!("{},{rest}\n", clock_s - earlier_s),
                _ => format!("{line}\n"),
            };
            *log = text.lines().map(moved).collect::<String>().into();
            let found = diagnose(&super::case(&files), &Settings::default()).unwrap();
            found.notes.into_iter().find(|note| note.contains("is the log of another clock"))
        };
        assert_eq!(asked(0.0), None);
        let note = asked(3600.0).unwrap_or_default();
        assert!(note.contains("3600 s later") && note.contains(effect), "{effect}: {note}");
    }
}

/// Two acts that the log always has at the same time: no attitude tells which of them pushes, one of them alone does.
#[test]
fn acts_that_are_always_logged_together_are_told_apart_by_one_alone() {
    let order = Order { kind: Kind::One, seed: 1_460_003, only: Some("water_dump"), manner: Manner::default() };
    let mut case = super::case(&draw_order(&order).files);
    let mut expected = Expectation::clone(&case.expected);
    expected.events.retain(|event| event.kind != "evaporator");
    let dumps: Vec<Event> = expected.events.iter().filter(|event| event.kind == "water_dump").cloned().collect();
    assert!(!dumps.is_empty());
    expected.events.extend(dumps.into_iter().map(|dump| Event { kind: "evaporator".into(), ..dump }));
    expected.events.sort_by(|a, b| a.clock_s.total_cmp(&b.clock_s));
    case.expected = Arc::new(expected);
    let found = diagnose(&case, &Settings::default()).unwrap();
    assert_eq!(found.verdict, Verdict::Ambiguous, "{:?} {:?}", super::ids(&found), found.alternatives);
    for id in ["water_dump", "evaporator_venting"] {
        assert!(found.cannot_tell_apart.iter().any(|set| *set == [id]), "{:?}", found.cannot_tell_apart);
    }
    let told = found.separating_observation.expect("what would decide");
    assert_eq!(told.kind, "log", "{told:?}");
    assert!(told.text.starts_with("Have one act of kind water_dump, of ") && told.gain.unwrap() > 3.0, "{told:?}");
}
