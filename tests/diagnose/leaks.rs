//! Leaks that are not as usual: one that opens twice, one that takes days, and what is none because it ends.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::{Diagnosis, Settings, diagnose};

/// A leak: its onset as a share of the record, amplitudes, ng, and time constant, s.
struct Leak(f64, [f64; 3], f64);

/// A record of so many hours in which nothing is missing but these.
fn beside(hours: u32, seed: u64, leaks: &[Leak]) -> Diagnosis {
    pushed(hours, seed, |t, [first, last]| {
        let of = |Leak(onset, a_ng, tau_s): &Leak| {
            let since_s = t - (first + onset * (last - first));
            a_ng.map(|a| if since_s > 0.0 { a * (-since_s / tau_s).exp() } else { 0.0 })
        };
        leaks.iter().map(of).fold([0.0; 3], |sum, a| std::array::from_fn(|k| sum[k] + a[k]))
    })
}

/// The same with a push, ng, at an instant of a record from one to another.
fn pushed(hours: u32, seed: u64, mut push: impl FnMut(f64, [f64; 2]) -> [f64; 3]) -> Diagnosis {
    let manner = Manner { hours, ..Manner::default() };
    let concealed = draw_order(&Order { kind: Kind::Clean, seed, only: None, manner });
    let mut case: Case = super::case(&concealed.files);
    let clock_s = case.recording.clock_s.clone();
    let span_s = [clock_s[0], clock_s[clock_s.len() - 1]];
    for (axis, series) in case.recording.a_ng.iter_mut().enumerate() {
        series.iter_mut().zip(&clock_s).for_each(|(value, t)| *value += push(*t, span_s)[axis]);
    }
    diagnose(&case, &Settings::default()).unwrap()
}

/// What ends, or grows, is near enough to a leak to be taken for one; it is no leak, and when it was there is told.
#[test]
fn a_push_that_ends_is_no_leak() {
    type Course = (&'static str, fn(f64) -> f64, f64);
    let courses: [Course; 3] = [
        ("a constant push", |_| 1.0, 1500.0),
        ("a push that grows from nothing", |x| x, 4000.0),
        ("a push that rises and falls as half a sine", |x| (std::f64::consts::PI * x).sin(), 5000.0),
    ];
    for (said, course, length_s) in courses {
        let found = pushed(24, 1_250_025, |t, [first, last]| {
            let x = (t - (first + 0.6 * (last - first))) / length_s;
            [70.0, -140.0, 95.0].map(|a| if (0.0..1.0).contains(&x) { 1.6 * a * course(x) } else { 0.0 })
        });
        assert_eq!(found.verdict, Verdict::Unexplained, "{said}: {:?}", super::ids(&found));
        let hypothesis = found.hypothesis.unwrap();
        assert!(hypothesis.formula.contains(said), "{said}: {hypothesis:?}");
        let told = &found.located.intervals[0];
        assert!(((told.end_s - told.start_s) / length_s - 1.0).abs() < 0.2, "{said}: {told:?}");
    }
}

/// A push of hours on one axis alone is near to what slow noise does there, and, louder, to a leak and a step that end each other: it is
/// neither.
#[test]
fn a_push_of_hours_on_one_axis_is_no_slow_noise() {
    let length_s = 24_000.0;
    for (ng, form) in [(-62.0, "x (1 from"), (-75.0, "a constant push")] {
        let mut start_s = 0.0;
        let found = pushed(36, 1_250_027, |t, [first, last]| {
            start_s = first + 0.3 * (last - first);
            [0.0, if (start_s..start_s + length_s).contains(&t) { ng } else { 0.0 }, 0.0]
        });
        assert_eq!(found.verdict, Verdict::Unexplained, "{ng}: {:?}", super::ids(&found));
        let hypothesis = found.hypothesis.unwrap();
        assert!(hypothesis.formula.contains(form), "{hypothesis:?}");
        let told = &found.located.intervals[0];
        let told_s = told.end_s - told.start_s;
        assert!((told.start_s - start_s).abs() < 600.0 && (told_s / length_s - 1.0).abs() < 0.4, "{told:?}");
    }
}

/// What falls evenly is hardly told from a leak where it is faint: it is named one, and that it may be none is told. Of a leak it is not.
#[test]
fn a_fall_that_may_be_no_leak_is_told() {
    let told = |found: &Diagnosis| found.notes.iter().any(|note| note.contains("that it dies away"));
    let falls = |size: f64| {
        pushed(24, 1_250_025, move |t, [first, last]| {
            let x = (t - (first + 0.6 * (last - first))) / 6000.0;
            [70.0, -140.0, 95.0].map(|a| if (0.0..1.0).contains(&x) { size * a * (1.0 - x) } else { 0.0 })
        })
    };
    for size in [1.2, 2.0] {
        let found = falls(size);
        assert_eq!((found.verdict, super::ids(&found)), (Verdict::Explained, vec!["vent_leak"]));
        assert!(told(&found), "{size}: {:?}", found.notes);
    }
    let leak = beside(24, 1_250_025, &[Leak(0.6, [70.0, -140.0, 95.0], 3000.0)]);
    assert!(!told(&leak), "{:?}", leak.notes);
}

/// The catalogue's leak begins once: where it begins twice one of both is not all there is, and where the other is, is told.
#[test]
fn a_leak_that_opens_twice_is_not_explained_by_one() {
    let seed = 1_250_025;
    let once = beside(24, seed, &[Leak(0.6, [70.0, -140.0, 95.0], 8000.0)]);
    assert_eq!((once.verdict, super::ids(&once)), (Verdict::Explained, vec!["vent_leak"]));
    for leaks in [
        [Leak(0.6, [70.0, -140.0, 95.0], 8000.0), Leak(0.2, [70.0, -140.0, 95.0], 8000.0)],
        [Leak(0.6, [100.0, -140.0, 95.0], 5000.0), Leak(0.2, [60.0, 140.0, -95.0], 5000.0)],
    ] {
        let twice = beside(24, seed, &leaks);
        assert_eq!(twice.verdict, Verdict::Unexplained, "{:?}", super::ids(&twice));
        let hypothesis = twice.hypothesis.unwrap();
        assert!(hypothesis.formula.contains("vent_leak once more"), "{hypothesis:?}");
    }
}

/// In four days a decay over more than one is told from a step.
#[test]
fn a_leak_of_days_has_its_time_constant_where_the_record_is_long_enough() {
    let tau_s = 130_000.0;
    let found = beside(96, 1_250_012, &[Leak(0.3, [90.0, -70.0, 80.0], tau_s)]);
    assert_eq!((found.verdict, super::ids(&found)), (Verdict::Explained, vec!["vent_leak"]), "{:?}", found.notes);
    let told = found.effects[0].parameters.iter().find(|parameter| parameter.name == "tau_s").unwrap();
    assert!((told.value - tau_s).abs() < 4.0 * told.sigma && told.sigma < 0.2 * tau_s, "{told:?}");
}
