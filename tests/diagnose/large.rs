//! Pushes far above their usual size, in a short and loud record: still themselves, and no formula or other push that a larger size is
//! more usual of.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::{ParameterAnswer, Verdict};
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::measure::{coverage, decay, window_means};
use oare_ground::diagnose::{Settings, diagnose};

/// What the noise of the clean record is multiplied by.
const LOUDER: f64 = 2.0;

/// A record of so many hours, with a push of a unit series and a vector in ng.
fn with(hours: u32, push: impl Fn(&Case) -> Vec<f64>, vector_ng: [f64; 3]) -> Case {
    pushed(1_191_007, hours, push, vector_ng)
}

fn pushed(seed: u64, hours: u32, push: impl Fn(&Case) -> Vec<f64>, vector_ng: [f64; 3]) -> Case {
    let manner = Manner { hours, ..Manner::default() };
    let order = Order { kind: Kind::Clean, seed, only: None, manner };
    let mut case = super::case(&draw_order(&order).files);
    let push = push(&case);
    for axis in 0..3 {
        let simulation = &case.simulation;
        let expected = window_means(&simulation.clock_s, &simulation.a_ng[axis], &case.recording.clock_s, 0.0);
        let recorded = case.recording.a_ng[axis].iter_mut();
        for ((recorded, expected), push) in recorded.zip(&expected).zip(&push) {
            *recorded = expected + LOUDER * (*recorded - expected) + vector_ng[axis] * push;
        }
        case.recording.dev_ng[axis].iter_mut().for_each(|deviation| *deviation *= LOUDER);
    }
    case
}

fn is_named(case: &Case, id: &str, vector_ng: [f64; 3]) -> Vec<ParameterAnswer> {
    let found = diagnose(case, &Settings::default()).unwrap();
    let ids = super::ids(&found);
    assert_eq!(
        (found.verdict, ids),
        (Verdict::Explained, vec![id]),
        "{:?} {:?}",
        found.cannot_tell_apart,
        found.hypothesis
    );
    for (name, truth) in ["ax_ng", "ay_ng", "az_ng"].into_iter().zip(vector_ng) {
        let p = found.effects[0].parameters.iter().find(|p| p.name == name).unwrap();
        assert!((p.value - truth).abs() < 3.5 * p.sigma, "{id}: {p:?}, truth {truth}");
    }
    found.effects[0].parameters.clone()
}

/// When a share of the record is over.
fn after(case: &Case, share: f64) -> f64 {
    let clock_s = &case.recording.clock_s;
    clock_s[(clock_s.len() as f64 * share) as usize]
}

#[test]
fn a_step_of_nine_usual_sizes_is_no_leak() {
    let vector_ng = [30.0, -560.0, -150.0];
    let step = |case: &Case| decay(&case.recording.clock_s, after(case, 0.4), f64::INFINITY);
    let case = with(12, step, vector_ng);
    // Four windows hold the edge, at 11 ng for every second of it.
    let onset = &is_named(&case, "bias_step", vector_ng)[0];
    let error_s = (onset.value - after(&case, 0.4)).abs();
    assert!(error_s < 3.5 * onset.sigma && (1.0..20.0).contains(&onset.sigma), "{onset:?}: out by {error_s} s");
}

#[test]
fn a_leak_of_eight_usual_sizes_is_no_formula() {
    let vector_ng = [-640.0, -470.0, -150.0];
    let leak = |case: &Case| decay(&case.recording.clock_s, after(case, 0.5), 3900.0);
    is_named(&with(12, leak, vector_ng), "vent_leak", vector_ng);
}

#[test]
fn a_crew_that_pushes_a_dozen_usual_sizes_is_no_formula() {
    let vector_ng = [260.0, 30.0, -110.0];
    let awake =
        |case: &Case| coverage(&case.recording.clock_s, &case.spans("crew_sleep")).iter().map(|x| 1.0 - x).collect();
    is_named(&with(36, awake, vector_ng), "crew_activity", vector_ng);
}

#[test]
fn firings_of_eight_usual_sizes_are_no_formula() {
    let vector_ng = [-620.0, -490.0, -1650.0];
    let firings = |case: &Case| coverage(&case.recording.clock_s, &case.spans("thruster"));
    is_named(&with(12, firings, vector_ng), "thruster_residual", vector_ng);
}

/// What was found at eight times its usual size is told without a prior that draws it back, and a half of the record in which hardly
/// anything of it is seen is not asked to predict it.
#[test]
fn a_leak_thirty_usual_sizes_large_has_an_error_that_holds() {
    let vector_ng = [2500.0, 2500.0, 2500.0];
    let (mut squares, mut sum, mut count) = (0.0, 0.0, 0.0);
    for (seed, share, tau_s) in [(0, 0.3, 500.0), (1, 0.45, 700.0), (2, 0.6, 1500.0), (3, 0.75, 500.0)] {
        let leak = |case: &Case| decay(&case.recording.clock_s, after(case, share), tau_s);
        let parameters = is_named(&pushed(1_191_020 + seed, 24, leak, vector_ng), "vent_leak", vector_ng);
        for p in parameters.iter().filter(|p| p.unit == "ng") {
            let pull = (p.value - 2500.0) / p.sigma;
            (squares, sum, count) = (squares + pull * pull, sum + pull, count + 1.0);
        }
    }
    assert!(squares / count < 2.2 && f64::abs(sum / count) < 0.9, "{} {}", squares / count, sum / count);
}

/// A leak that begins while nothing is recorded had any size that dies down to what is seen afterwards: its error says so.
#[test]
fn a_leak_that_begins_in_a_hole_has_the_error_of_the_hole() {
    const HOLE_S: f64 = 2400.0;
    let vector_ng = [250.0, 250.0, 250.0];
    let (mut within, mut of) = (0, 0);
    for (seed, share) in [(0, 0.3), (1, 0.5), (2, 0.6), (3, 0.4)] {
        let leak = |case: &Case| decay(&case.recording.clock_s, after(case, share), 3000.0);
        let mut case = pushed(1_191_030 + seed, 24, leak, vector_ng);
        let begins_s = after(&case, share);
        let r = &mut case.recording;
        let kept = r.clock_s.iter().map(|t| !(begins_s - 300.0..begins_s + HOLE_S - 300.0).contains(t));
        let kept: Vec<bool> = kept.collect();
        let only = |series: &mut Vec<f64>| {
            let mut kept = kept.iter();
            series.retain(|_| *kept.next().unwrap());
        };
        r.a_ng.iter_mut().chain(&mut r.dev_ng).for_each(only);
        only(&mut r.clock_s);
        let found = diagnose(&case, &Settings::default()).unwrap();
        for effect in found.effects.iter().filter(|effect| effect.id == "vent_leak") {
            for p in effect.parameters.iter().filter(|p| p.unit == "ng") {
                within += usize::from((p.value - 250.0).abs() <= 2.0 * p.sigma);
                of += 1;
            }
        }
    }
    assert!(of >= 9 && within + 2 >= of, "{within} of {of} sizes within two standard errors");
}
