//! Is the log kept by another clock than the recording: from lift-off, of another zone, or a day off? What it would then explain is told
//! beside what is found, and named by nobody: a log is mended by those who keep it.

use std::sync::Arc;

use crate::diagnose::case::{Case, Expectation};
use crate::diagnose::catalogue::{
    Effect, crew_activity, evaporator_venting, mass_shift, thruster_residual, water_dump,
};
use crate::diagnose::design::Frame;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Entry, Set};
use crate::diagnose::seldom;
use crate::diagnose::solve::Library;
use crate::math::shared_work;

/// Clocks are apart by half hours, up to so many, or by a day.
const HALF_HOUR_S: f64 = 1800.0;
const HALF_HOURS: i32 = 24;
const DAY_S: f64 = 86_400.0;
/// Log odds above what is found, of a hundred and fifty, from which it is told.
const TOLD: f64 = 5.0;

/// Effects that act by the log.
const LOGGED: [&Effect; 5] = [
    &water_dump::EFFECT,
    &evaporator_venting::EFFECT,
    &thruster_residual::EFFECT,
    &crew_activity::EFFECT,
    &mass_shift::EFFECT,
];

/// What the log would explain beside or in place of a set that is found, if it were later by the same all through; nothing found is a set
/// of nothing.
pub fn of_another_clock(scene: &Scene, library: &Library, frame: &Frame, set: &Set) -> Option<String> {
    if scene.case.events.is_empty() {
        return None;
    }
    let lift_off_s = scene.case.header.liftoff_clock_s;
    let half_hours = (-HALF_HOURS..=HALF_HOURS).filter(|n| *n != 0).map(|n| HALF_HOUR_S * f64::from(n));
    let later_s: Vec<f64> = half_hours.chain([-DAY_S, DAY_S, -lift_off_s, lift_off_s]).collect();
    let cases: Vec<Case> = later_s.iter().map(|later_s| with_a_later_log(scene.case, *later_s)).collect();
    let tried = |effect: &&'static Effect| {
        let points = later_s.iter().zip(&cases).filter_map(|(later_s, case)| {
            let scene = scene.with_log_of(case);
            let theta = (effect.grid)(&scene).into_iter().next()?;
            Some(([*later_s, 0.0], (effect.signature)(&scene, &theta)?))
        });
        let entry = Entry::without_points(effect).at(points.collect())?;
        let seeds = seldom::seeds(set, library, &entry);
        let found = seldom::beside(frame, library, &seeds, &entry, library.entries.len())?;
        let gained = found.score - set.score;
        Some((found.members.last()?.theta[0], gained, effect.id))
    };
    let found: Vec<(f64, f64, &str)> = shared_work::map(&LOGGED, tried).into_iter().flatten().collect();
    let (later_s, gained, id) = found.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).filter(|most| most.1 > TOLD)?;
    let which = if later_s < 0.0 { "earlier" } else { "later" };
    let since_lift_off = if later_s == lift_off_s { ", as if it told the time since lift-off" } else { "" };
    Some(format!(
        "is the log of another clock? Its entries {:.0} s {which} than it has them{since_lift_off}, {id} is likelier than what is found \
         here (log odds {gained:.1})",
        later_s.abs()
    ))
}

fn with_a_later_log(case: &Case, later_s: f64) -> Case {
    let mut events = case.events.clone();
    events.iter_mut().for_each(|event| event.clock_s += later_s);
    Case { expected: Arc::new(Expectation { events, ..Expectation::clone(&case.expected) }), ..case.clone() }
}
