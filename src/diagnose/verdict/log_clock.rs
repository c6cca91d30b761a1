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
use crate::physics::time::S_PER_DAY;

/// Clocks are apart by half hours, up to so many, by a day, or by the time of lift-off; by less than half an hour, no entry is far from what it
/// explains.
const HALF_HOUR_S: f64 = 1800.0;
const HALF_HOURS: i32 = 24;
/// Log odds of a log of another clock before anything is seen.
const LOG_ODDS: f64 = -6.0;
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
    let later_s = later_by_s(lift_off_s);
    // Of every clock one case at a time: a log is small, and what it comes with is not.
    let by_clock = shared_work::map(&later_s, |later_s| {
        let case = with_a_later_log(scene.case, *later_s);
        let scene = scene.with_log_of(&case);
        LOGGED.map(|effect| {
            // The first of the ways that an effect has to go by the log is enough to ask.
            let theta = (effect.grid)(&scene).into_iter().next()?;
            Some(([*later_s, 0.0], (effect.signature)(&scene, &theta)?))
        })
    });
    let mut points: [Vec<(Theta, Shape)>; LOGGED.len()] = Default::default();
    by_clock.into_iter().for_each(|of_clock| points.iter_mut().zip(of_clock).for_each(|(all, one)| all.extend(one)));
    let tried = |(effect, points): (&'static Effect, Vec<(Theta, Shape)>)| {
        let entry = library.allows(effect).then(|| Entry::without_points(effect, LOG_ODDS).at(points))??;
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

/// By how much the log of another clock is late, s.
fn later_by_s(lift_off_s: f64) -> Vec<f64> {
    let half_hours = (-HALF_HOURS..=HALF_HOURS).map(|n| HALF_HOUR_S * f64::from(n));
    let all = half_hours.chain([-S_PER_DAY, S_PER_DAY, -lift_off_s, lift_off_s]);
    all.filter(|later_s| later_s.abs() >= HALF_HOUR_S).collect()
}

fn with_a_later_log(case: &Case, later_s: f64) -> Case {
    let mut events = case.events.clone();
    events.iter_mut().for_each(|event| event.clock_s += later_s);
    Case { expected: Arc::new(Expectation { events, ..Expectation::clone(&case.expected) }), ..case.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_by_its_own_clock_is_not_tried_again() {
        assert_eq!(later_by_s(13_800.0).len(), 52);
        for lift_off_s in [0.0, 20.0] {
            let later_s = later_by_s(lift_off_s);
            assert!(later_s.len() == 50 && later_s.iter().all(|s| s.abs() >= HALF_HOUR_S), "{later_s:?}");
        }
    }
}
