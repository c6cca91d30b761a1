//! Laws that look like a listed effect at first sight, and are none.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::catalogue;
use oare_ground::diagnose::measure::{weighted_coverage, window_means};
use oare_ground::diagnose::{Settings, diagnose};
use oare_ground::physics::{shadow, sun};

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

/// The simulation of one axis at the windows.
fn simulated(case: &Case, axis: usize) -> Vec<f64> {
    let simulation = &case.simulation;
    window_means(&simulation.clock_s, &simulation.a_ng[axis], &case.recording.clock_s, 0.0)
}

fn is_unlisted(case: &Case, formula: &str) {
    let found = diagnose(case, &Settings::default()).unwrap();
    assert_eq!(found.verdict, Verdict::Unexplained, "{formula}: {:?}", super::ids(&found));
    assert!(found.effects.is_empty());
    let told = found.hypothesis.unwrap().formula;
    assert!(told.contains(formula), "{formula}: {told}");
    // A kind of the log's entries may have the name of an effect.
    let named = catalogue::ALL.iter().filter(|effect| !catalogue::LOGGED_KINDS.contains(&effect.id));
    assert_eq!(named.filter(|effect| told.contains(effect.id)).count(), 0, "{told}");
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
        let m = simulated(case, 1);
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

/// Grows from one calibration to the next: a sensor that is taken back to its place each time.
#[test]
fn what_every_gap_sets_back_is_no_drift() {
    let sawtooth = |case: &Case| {
        let clock_s = &case.recording.clock_s;
        let mut from = clock_s[0];
        let mut before = clock_s[0];
        let grown = |t: &f64| {
            from = if t - before > 130.0 { *t } else { from };
            before = *t;
            t - from
        };
        clock_s.iter().map(grown).collect()
    };
    is_unlisted(&with(sawtooth, [0.5, -0.4, 0.7]), "the last gap) / [");
}

/// One axis feels another late.
#[test]
fn a_late_copy_of_another_axis_is_no_scale_factor_and_no_misalignment() {
    let late = |case: &Case| {
        let m = simulated(case, 2);
        let mut state = m[0];
        let mut before = case.recording.clock_s[0];
        let follow = |(t, m): (&f64, &f64)| {
            state = m + (state - m) * (-(t - before) / 4000.0).exp();
            before = *t;
            state
        };
        case.recording.clock_s.iter().zip(&m).map(follow).collect()
    };
    is_unlisted(&with(late, [1.0, 0.0, 0.0]), "(mz, relaxing in ");
}

/// On below one temperature until another is reached.
#[test]
fn a_thermostat_is_no_step_and_no_temperature_bias() {
    let heater = |case: &Case| {
        let ancillary = &case.ancillary;
        let t = window_means(&ancillary.clock_s, &ancillary.temperature_c, &case.recording.clock_s, 0.0);
        let mut sorted = t.clone();
        sorted.sort_by(f64::total_cmp);
        let [low, high] = [0.36, 0.57].map(|share| sorted[(sorted.len() as f64 * share) as usize]);
        let mut on = t[0] < low;
        let follow = |t: &f64| {
            on = *t < low || on && *t <= high;
            f64::from(u8::from(on))
        };
        t.iter().map(follow).collect()
    };
    is_unlisted(&with(heater, [0.8, -0.5, 0.2]), "on below T = ");
}

/// It lags behind as long as the temperature rises or falls, and stands still after every reversal.
#[test]
fn what_follows_the_temperature_with_a_slack_has_no_lag() {
    let moved = |case: &Case| {
        let ancillary = &case.ancillary;
        let t = window_means(&ancillary.clock_s, &ancillary.temperature_c, &case.recording.clock_s, 0.0);
        let mean = t.iter().sum::<f64>() / t.len() as f64;
        let half = 0.5 * (t.iter().map(|t| (t - mean).powi(2)).sum::<f64>() / t.len() as f64).sqrt();
        let mut moved = t[0];
        let follow = |t: &f64| {
            moved = moved.clamp(t - half, t + half);
            moved
        };
        t.iter().map(follow).collect()
    };
    is_unlisted(&with(moved, [0.7, -0.6, 0.4]), "T through a slack of ");
}

/// A thruster that pushes the less the longer it has rested.
#[test]
fn what_only_a_thruster_still_warm_does_is_no_residual_of_every_firing() {
    let warm = |case: &Case| {
        let firings = case.spans("thruster");
        let warm = |w: &[[f64; 2]]| (w[1], (-(w[1][0] - w[0][1]).max(0.0) / 400.0).exp());
        weighted_coverage(&case.recording.clock_s, firings.windows(2).map(warm))
    };
    is_unlisted(&with(warm, [0.6, 0.6, -0.3]), "thruster lasts, exp(-(pause before it)/");
}

/// It pushes as a firing does, and harder from one to the next.
#[test]
fn a_push_that_grows_is_no_residual_of_every_firing() {
    let growing = |case: &Case| {
        let firings = case.spans("thruster");
        let share = |n: usize| n as f64 / firings.len() as f64;
        weighted_coverage(&case.recording.clock_s, firings.iter().enumerate().map(|(n, span)| (*span, share(n))))
    };
    let found = diagnose(&with(growing, [0.7, 0.6, -0.4]), &Settings::default()).unwrap();
    assert_eq!(found.verdict, Verdict::Unexplained, "{:?}", super::ids(&found));
    assert!(found.hypothesis.is_none(), "{:?}", found.hypothesis);
    let told = found.notes.join("\n");
    assert!(told.contains("the size of thruster_residual is not the same throughout, but follows the time"), "{told}");
}

/// In sunlight or asleep, and not both: neither alone says anything of it.
#[test]
fn a_law_of_two_conditions_is_told_as_their_product() {
    let either = |case: &Case| {
        let ancillary = &case.expected.ancillary;
        let asleep = case.spans("crew_sleep");
        let at = |(t, r): (&f64, &[f64; 3])| {
            let lit = shadow::sunlit_fraction(&(*r).into(), &sun::direction(case.header.unix_s(*t)));
            let sleeps = asleep.iter().any(|[from, to]| (from..to).contains(&t));
            if sleeps { 1.0 - lit } else { lit }
        };
        let series: Vec<f64> = ancillary.clock_s.iter().zip(&ancillary.r_m).map(at).collect();
        window_means(&ancillary.clock_s, &series, &case.recording.clock_s, 0.0)
    };
    is_unlisted(&with(either, [0.1, -0.05, 0.2]), "nu (crew_sleep lasts)");
}

/// A pump with two outlets that takes them in turn.
#[test]
fn what_turns_its_sense_from_entry_to_entry_is_no_push_of_them() {
    let in_turn = |case: &Case| {
        let signs = [1.0, -1.0].into_iter().cycle();
        weighted_coverage(&case.recording.clock_s, case.spans("evaporator").into_iter().zip(signs))
    };
    is_unlisted(&with(in_turn, [0.7, 0.5, -0.4]), "evaporator lasts, its sign changed from entry to entry");
}
