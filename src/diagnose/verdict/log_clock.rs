//! Is the log kept by another clock than the recording: from lift-off, of another zone, or a day off? What it would then explain is told
//! beside what is found, and named by nobody: a log is mended by those who keep it.

use std::sync::Arc;

use crate::diagnose::case::{Case, Expectation};
use crate::diagnose::catalogue::{
    Effect, Shape, Theta, crew_activity, evaporator_venting, mass_shift, thruster_residual, water_dump,
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
    // Of every clock one case at a time: a log is small, and what it comes with is not.
    let by_clock = shared_work::map(&later_s, |later_s| {
        let case = with_a_later_log(scene.case, *later_s);
        let scene = scene.with_log_of(&case);
        LOGGED.map(|effect| {
            let theta = (effect.grid)(&scene).into_iter().next()?;
            Some(([*later_s, 0.0], (effect.signature)(&scene, &theta)?))
        })
    });
    let mut points: [Vec<(Theta, Shape)>; LOGGED.len()] = Default::default();
    by_clock.into_iter().for_each(|of_clock| points.iter_mut().zip(of_clock).for_each(|(all, one)| all.extend(one)));
    let tried = |(effect, points): (&'static Effect, Vec<(Theta, Shape)>)| {
        let entry = Entry::without_points(effect).at(points)?;
        let seeds = seldom::seeds(set, library, &entry);
        let found = seldom::beside(frame, library, &seeds, &entry, library.entries.len())?;
        Some((found.members.last()?.theta[0], found.score - set.score, effect.id))
    };
    let found = LOGGED.into_iter().zip(points).filter_map(tried);
    let (later_s, gained, id) = found.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|most| most.1 > TOLD)?;
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
