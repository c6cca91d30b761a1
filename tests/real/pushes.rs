//! Pushes that no catalogue has on orbits made to order, and what must not be taken for one.

use nalgebra::Vector3;
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::orbit::arc::Impulse;
use oare_ground::diagnose::orbit::forces::{Air, Direction, Term, Unlisted};

use super::ids;
use super::made::{ALL, Made, SIGMA_M, circular, close, gps, low, without};

fn three() -> Vec<super::made::Satellite> {
    vec![gps("G01", 0.0, 10.0), gps("G02", 120.0, 200.0), gps("G03", 240.0, 320.0)]
}

/// A constant along the track takes the shape of a push along the panels' axis, more or less; it is neither that nor any other of the catalogue.
#[test]
fn a_push_along_the_track_is_a_formula_and_no_radiation() {
    let mut satellites = three();
    let push = Term::Unlisted(Unlisted::Steady(Direction::Along));
    for satellite in &mut satellites {
        satellite.terms.retain(|(term, _)| *term != Term::YBias);
        satellite.terms.push((push, [8e-10, 0.0]));
    }
    let answer = Made::every_quarter((2016, 8, 2), 40.0, satellites).diagnose(&without("srp_y_bias"));
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Unexplained, vec![]), "{:?}", answer.effects);
    let hypothesis = answer.hypothesis.expect("a formula");
    assert_eq!((hypothesis.axis.as_str(), hypothesis.unit.as_str()), ("along", "m/s^2"));
    assert!(hypothesis.formula.starts_with("a = 8.0"), "{hypothesis:?}");
    assert!(answer.arcs.iter().all(|arc| arc.verdict == Verdict::Unexplained && arc.rms_after < 2.0 * SIGMA_M));
    assert!(
        answer.fit.after.rms_total < 2.0 * SIGMA_M
            && answer.steps.last().unwrap().added.as_deref() == Some("hypothesis")
    );
}

/// Of three satellites one is pushed along its track: a push along its panels' axis would take most of it off.
#[test]
fn a_push_of_one_satellite_that_no_catalogue_has_is_told_there() {
    let mut satellites = three();
    for satellite in &mut satellites {
        satellite.terms.retain(|(term, _)| *term != Term::YBias);
    }
    satellites[1].terms.push((Term::Unlisted(Unlisted::Steady(Direction::Along)), [6e-10, 0.0]));
    let answer = Made::every_quarter((2016, 8, 2), 40.0, satellites).diagnose(&without("srp_y_bias"));
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Unexplained, vec![]), "{:?}", answer.effects);
    let verdicts: Vec<Verdict> = answer.arcs.iter().map(|a| a.verdict).collect();
    assert_eq!(verdicts, [Verdict::Consistent, Verdict::Unexplained, Verdict::Consistent]);
    let hypothesis = answer.hypothesis.expect("a formula");
    assert!(hypothesis.formula.starts_with("a = 6.0") && hypothesis.axis == "along", "{hypothesis:?}");
    assert!(hypothesis.location.starts_with("G02 alone"), "{hypothesis:?}");
    let note = answer.arcs[1].note.clone().expect("a note");
    assert!(note.contains("along, a = 6.0"), "{note}");
}

/// Once per revolution along the radius, which one along B takes for its own in part.
#[test]
fn a_radial_push_once_per_revolution_is_a_formula() {
    let mut satellites = three();
    for satellite in &mut satellites {
        satellite.terms.push((Term::Unlisted(Unlisted::PerRevolution(Direction::Radial)), [2e-9, 0.0]));
    }
    let answer = Made::every_quarter((2016, 8, 2), 40.0, satellites).diagnose(&ALL);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Unexplained, vec![]), "{:?}", answer.effects);
    assert_eq!(answer.hypothesis.expect("a formula").axis, "radial");
}

/// A simulation that has the Moon beside a recording that was computed without.
#[test]
fn a_pull_that_the_recording_has_not_is_told() {
    let without_moon = Made { known: vec![Term::Sun], ..Made::every_quarter((2016, 8, 2), 40.0, three()) };
    let answer = without_moon.diagnose(&ALL);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Unexplained, vec![]), "{:?}", answer.effects);
    assert_eq!(answer.hypothesis.expect("a formula").formula, "a = -(pull of the Moon)");
}

/// Air that thins more slowly than is assumed is air, and nothing else is named to mend its shape.
#[test]
fn drag_in_air_of_another_scale_height_is_drag_alone() {
    let mut satellite = low();
    satellite.start = circular(620e3, 74.0, 30.0, 0.0);
    satellite.start.v *= 1.0008;
    satellite.terms = vec![(Term::SolarRadiation, [3e-8, 0.0]), (Term::Drag, [30.0, 0.0])];
    let air = Air::about(620e3, 115e3);
    let made = Made { spacing_s: 300.0, air, ..Made::every_quarter((2008, 5, 14), 14.0, vec![satellite]) };
    let answer = made.diagnose(&["gravity:12", "sun", "moon", "solar_radiation_pressure"]);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Explained, vec!["aerodynamic_drag"]), "{:?}", answer.notes);
    assert!(
        answer.notes.iter().any(|note| note.starts_with("Drag is that of air which thins to 1/e in 115 km")),
        "{:?}",
        answer.notes
    );
}

#[test]
fn two_velocity_steps_of_one_satellite_are_named_with_their_instants() {
    let mut satellites = three();
    let there = Impulse { at_s: 31_300.0, dv_m_s: Vector3::new(0.004, -0.015, 0.009) };
    let back = Impulse { at_s: 97_800.0, dv_m_s: Vector3::new(-0.006, 0.013, -0.002) };
    satellites[1].kicks = vec![there, back];
    let answer = Made::every_quarter((2019, 11, 2), 40.0, satellites).diagnose(&ALL);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Explained, vec!["manoeuvre", "manoeuvre"]));
    let of = |name: &str, k: usize| answer.effects[k].parameters.iter().find(|p| p.name == name).unwrap().value;
    let in_order = if of("at_s", 0) < of("at_s", 1) { [&there, &back] } else { [&back, &there] };
    for (k, kick) in in_order.into_iter().enumerate() {
        close(&answer, k, "at_s", kick.at_s);
        close(&answer, k, "dv_m_s", kick.dv_m_s.norm());
    }
    let [before, after] = [answer.arcs[1].rms_before, answer.arcs[1].rms_after];
    assert!(before > 50.0 && after < 2.0 * SIGMA_M, "{before} m, {after} m");
}

/// What no term explains takes something off for many of them: that is no name, neither there nor for all. Where it would have to be is told.
#[test]
fn what_an_odd_satellite_alone_asks_for_and_is_not_explained_by_is_not_named() {
    let mut satellites = vec![gps("E05", 30.0, 60.0), gps("E14", 150.0, 200.0)];
    for satellite in &mut satellites {
        satellite.terms = vec![(Term::SolarRadiation, [9.1e-8, 0.0])];
    }
    let mut made = Made::every_quarter((2018, 2, 21), 30.0, satellites);
    let (t_s, flown, ..) = made.flown();
    // Pushed along its track for eight hours.
    let kick = |k: usize| Impulse { at_s: t_s[k], dv_m_s: flown[0][k].v.normalize() * 2e-4 };
    made.satellites[0].kicks = (60..92).step_by(2).map(kick).collect();
    let answer = made.diagnose(&["gravity:12", "sun", "moon", "solar_radiation_pressure"]);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Unexplained, vec![]), "{:?}", answer.effects);
    let verdicts: Vec<Verdict> = answer.arcs.iter().map(|a| a.verdict).collect();
    assert_eq!(verdicts, [Verdict::Unexplained, Verdict::Consistent]);
    let interval = &answer.located.intervals[0];
    let (from_s, to_s) = (t_s[60], t_s[90]);
    assert!(interval.start_s > from_s - 3_600.0 && interval.end_s < to_s + 3_600.0, "{interval:?}");
    assert!(interval.end_s - interval.start_s > 0.4 * (to_s - from_s), "{interval:?}");
}

/// Four times the stated noise is noise, and told.
#[test]
fn noise_beyond_the_stated_accuracy_is_noise_and_told() {
    let made = Made { noise_m: 4.0 * SIGMA_M, ..Made::every_quarter((2023, 3, 20), 40.0, three()) };
    let answer = made.diagnose(&ALL);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Consistent, vec![]), "{:?}", answer.arcs);
    assert!((answer.fit.noise_floor[0] / made.noise_m - 1.0).abs() < 0.1, "{:?}", answer.fit.noise_floor);
    assert!(answer.notes.iter().any(|note| note.contains("times the accuracy stated")), "{:?}", answer.notes);
}
