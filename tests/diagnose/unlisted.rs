//! Laws that look like a listed effect at first sight, and are none.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::measure::window_means;
use oare_ground::diagnose::{Settings, diagnose};

/// Deviation of each law over the record, ng.
const SIZE_NG: f64 = 45.0;

/// A clean record with a law on the x, y and z axes in these shares.
fn with(law: impl Fn(&Case) -> Vec<f64>, shares: [f64; 3]) -> Case {
    let order = Order { kind: Kind::Clean, seed: 1_191_002, only: None, manner: Manner::default() };
    let mut case = super::case(&draw_order(&order).files);
    let law = law(&case);
    let mean = law.iter().sum::<f64>() / law.len() as f64;
    let deviation = (law.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / law.len() as f64).sqrt();
    for (axis, share) in case.recording.a_ng.iter_mut().zip(shares) {
        axis.iter_mut().zip(&law).for_each(|(x, law)| *x += SIZE_NG * share * law / deviation);
    }
    case
}

fn is_unlisted(case: &Case, formula: &str) {
    let found = diagnose(case, &Settings::default()).unwrap();
    assert_eq!(found.verdict, Verdict::Unexplained, "{formula}: {:?}", super::ids(&found));
    assert!(found.effects.is_empty());
    let told = found.hypothesis.unwrap().formula;
    assert!(told.contains(formula), "{formula}: {told}");
}

/// It rises at once as a step does, and on as a drift does.
#[test]
fn creep_is_no_step_and_no_drift() {
    let creep = |case: &Case| {
        let clock_s = &case.recording.clock_s;
        let onset_s = clock_s[clock_s.len() / 3] + 400.0;
        clock_s.iter().map(|t| ((t - onset_s).max(0.0) / 300.0).ln_1p()).collect()
    };
    is_unlisted(&with(creep, [0.6, -0.5, 0.6]), "log(1 + max(t - ");
}

/// The excess over a level is lost in part: less than a scale factor below it, more above.
#[test]
fn saturation_is_no_scale_factor() {
    let lost = |case: &Case| {
        let simulation = &case.simulation;
        let m = window_means(&simulation.clock_s, &simulation.a_ng[1], &case.recording.clock_s, 0.0);
        let mut sizes: Vec<f64> = m.iter().map(|x| x.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let level = sizes[sizes.len() * 2 / 3];
        m.iter().map(|x| x.clamp(-level, level) - x).collect()
    };
    is_unlisted(&with(lost, [0.0, 1.0, 0.0]), "(my beyond ");
}

/// Hours long and of a steady period: slow noise of any size would not keep its phase.
#[test]
fn a_slow_swing_is_no_slow_noise() {
    let swing = |case: &Case| {
        let clock_s = &case.recording.clock_s;
        clock_s.iter().map(|t| (std::f64::consts::TAU * t / 19_550.0).sin()).collect()
    };
    is_unlisted(&with(swing, [0.6, -0.2, 0.3]), "cycles per orbit");
}

/// A push that dies away after every falling asleep, and the opposite one after every waking.
#[test]
fn what_dies_away_after_falling_asleep_and_waking_is_no_crew_activity_and_no_leak() {
    let both = |case: &Case| {
        let sleeps = case.spans("crew_sleep");
        let since = |t: f64, from: f64| if t > from { (-(t - from) / 4000.0).exp() } else { 0.0 };
        let pushes = |t: &f64| sleeps.iter().map(|[a, b]| since(*t, *a) - since(*t, *b)).sum();
        case.recording.clock_s.iter().map(pushes).collect()
    };
    is_unlisted(&with(both, [0.7, 0.3, -0.3]), "start or end of crew_sleep, signed");
}
