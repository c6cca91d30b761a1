//! Instants at which something happens to the vehicle, over and over: the edges of the shadow, changes of attitude, entries of the log.

use super::case::WINDOW_STRIDE_S;
use super::scene::Scene;
use crate::math::robust::median;

/// A change of attitude begins where the angular acceleration passes so many times its median, and what is no more than rounding, rad/s2.
const MANOEUVRE: f64 = 8.0;
const ROUNDING_RAD_S2: f64 = 1e-7;
/// A change of attitude is over when it does not go on for so long, s: it is turned by one push and stopped by another.
const STILL_S: f64 = 1800.0;
/// What begins so near to the start or end of a change of attitude, or of an entry of the log, s, may be of it.
const NEAR_S: f64 = 120.0;
/// Share of the record that is so near to the entries of a kind, up to which being there says something: eight entries in 36 h.
const SELDOM_NEAR: f64 = 0.03;

/// What happens over and over, in words, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct Recurring {
    /// In words.
    pub what: String,
    /// When, s, in order, at least twice in the record.
    pub at_s: Vec<f64>,
}

/// Instants at which a grid series crosses a level, with the sign of the crossing.
fn crossings(grid: &[f64], series: &[f64], level: f64) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    for i in 1..series.len() {
        let (a, b) = (series[i - 1] - level, series[i] - level);
        if a * b <= 0.0 && a != b {
            out.push((grid[i - 1] + (grid[i] - grid[i - 1]) * a / (a - b), (b - a).signum()));
        }
    }
    out
}

/// Edges of the shadow: 1 into the light, -1 out of it.
pub fn terminators(s: &Scene) -> Vec<(f64, f64)> {
    crossings(&s.grid_s, &s.sunlit, 0.5)
}

/// Where the vehicle begins to be turned or stopped, 1, and where that ends, -1.
pub fn manoeuvres(s: &Scene) -> Vec<(f64, f64)> {
    let acceleration: Vec<f64> = s.wdot_rad_s2.iter().map(|w| w.norm()).collect();
    let usual = median(&mut acceleration.clone()).unwrap_or(0.0);
    crossings(&s.grid_s, &acceleration, MANOEUVRE * usual + ROUNDING_RAD_S2)
}

/// Where changes of attitude begin, and where they end: a change that goes on by pushes near to each other is one.
pub fn changes_of_attitude(s: &Scene) -> [Vec<f64>; 2] {
    let pushes = manoeuvres(s);
    let [begins, ends] = [1.0, -1.0].map(|sign| of_sign(&pushes, sign));
    let apart = |a: f64, b: f64| b - a > STILL_S;
    let first = begins.iter().enumerate().filter(|(i, t)| *i == 0 || apart(begins[i - 1], **t)).map(|(_, t)| *t);
    let last = ends.iter().enumerate().filter(|(i, t)| ends.get(i + 1).is_none_or(|next| apart(**t, *next)));
    [first.collect(), last.map(|(_, t)| *t).collect()]
}

/// What a push from an instant on takes for granted where something is known to happen just then: that it is not of that.
pub fn of_chance(s: &Scene, onset_s: f64) -> Option<String> {
    of_a_turn(s, onset_s).or_else(|| of_an_entry(s, onset_s))
}

/// The same of an entry of the log, of a kind that has few.
fn of_an_entry(s: &Scene, onset_s: f64) -> Option<String> {
    let [start, end] = s.span_s();
    let near = s.case.kinds_tried().into_iter().flat_map(|kind| {
        let spans = s.case.spans(kind);
        // Before and after its start, and before and after its end.
        let share = 4.0 * NEAR_S * spans.len() as f64 / (end - start);
        let ends = spans.into_iter().flat_map(|[from, to]| [("begins", from), ("ends", to)]);
        ends.filter(move |_| share < SELDOM_NEAR).map(move |(which, at_s)| (kind, which, at_s))
    });
    let (kind, which, at_s) = near.min_by(|a, b| (a.2 - onset_s).abs().total_cmp(&(b.2 - onset_s).abs()))?;
    let apart_s = (at_s - onset_s).abs();
    (apart_s <= NEAR_S).then(|| {
        format!(
            "its onset is {apart_s:.0} s from where an entry {kind} of the log {which}, at {at_s:.0} s, and that is taken for chance: what comes \
             of the entry, and goes on after it, begins there as well"
        )
    })
}

/// The same of a change of attitude, where the vehicle is turned or stopped.
fn of_a_turn(s: &Scene, onset_s: f64) -> Option<String> {
    let [begins, ends] = changes_of_attitude(s);
    let of = |which: &'static str, all: Vec<f64>| all.into_iter().map(move |t| (which, t));
    let nearest = of("begins", begins).chain(of("ends", ends));
    let (which, at_s) = nearest.min_by(|a, b| (a.1 - onset_s).abs().total_cmp(&(b.1 - onset_s).abs()))?;
    let apart_s = (at_s - onset_s).abs();
    (apart_s <= NEAR_S).then(|| {
        format!(
            "its onset is {apart_s:.0} s from where a change of attitude {which}, at {at_s:.0} s, and that is taken for chance: what a turn \
             moves or warms, a fluid or a structure, begins there as well"
        )
    })
}

/// How much is left at the start of each entry of what the one before had when it ended, and that dies away; nothing at the first.
pub fn still_warm(spans: &[[f64; 2]], tau_s: f64) -> Vec<f64> {
    let left = |pair: &[[f64; 2]]| (-(pair[1][0] - pair[0][1]).max(0.0) / tau_s).exp();
    let none = spans.first().map(|_| 0.0);
    none.into_iter().chain(spans.windows(2).map(left)).collect()
}

fn of_sign(all: &[(f64, f64)], sign: f64) -> Vec<f64> {
    all.iter().filter(|x| x.1 == sign).map(|x| x.0).collect()
}

/// All that recurs in a record.
pub fn recurring(s: &Scene) -> Vec<Recurring> {
    let [start, end] = s.span_s();
    let mut found = Vec::new();
    let mut add = |what: String, mut at_s: Vec<f64>| {
        at_s.retain(|t| (start..end).contains(t));
        at_s.sort_by(f64::total_cmp);
        if at_s.len() > 1 {
            found.push(Recurring { what, at_s });
        }
    };
    let edges = terminators(s);
    add("sunrise".into(), of_sign(&edges, 1.0));
    add("sunset".into(), of_sign(&edges, -1.0));
    let [begins, ends] = changes_of_attitude(s);
    add("start of a change of attitude".into(), begins);
    add("end of a change of attitude".into(), ends);
    for kind in s.case.kinds_tried() {
        let spans = s.case.spans(kind);
        add(format!("start of {kind}"), spans.iter().map(|x| x[0]).collect());
        // Ends that follow their starts by the same time are the same instants.
        let lengths = spans.iter().map(|x| x[1] - x[0]);
        let [shortest, longest] = lengths.fold([f64::INFINITY, 0.0], |[low, high], x| [x.min(low), x.max(high)]);
        if longest - shortest > WINDOW_STRIDE_S {
            add(format!("end of {kind}"), spans.iter().map(|x| x[1]).collect());
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::diagnose::catalogue::made;
    use crate::diagnose::scene::Surroundings;
    use crate::physics::Vec3;

    #[test]
    fn a_level_is_crossed_between_two_points_up_and_down() {
        let grid = [0.0, 10.0, 20.0, 30.0, 40.0];
        let found = crossings(&grid, &[0.0, 0.0, 1.0, 1.0, 0.2], 0.6);
        let expected = [(16.0, 1.0), (35.0, -1.0)];
        assert!(found.len() == 2 && found.iter().zip(expected).all(|(a, b)| (a.0 - b.0).abs() < 1e-9 && a.1 == b.1));
    }

    #[test]
    fn an_onset_at_a_turn_is_told_and_one_beside_it_is_not() {
        let case = made::case();
        let mut surroundings = Surroundings::new(&case.expected).unwrap();
        let turn = surroundings.grid_s.len() / 2;
        surroundings.wdot_rad_s2[turn] = Vec3::new(0.0, 1e-5, 0.0);
        let scene = Scene::within(&case, Arc::new(surroundings));
        let [begins, ends] = changes_of_attitude(&scene);
        let all = [&begins[..], &ends[..]].concat();
        assert_eq!(all.len(), 2);
        let told = of_a_turn(&scene, all[0] - 100.0).unwrap();
        assert!(told.contains("its onset is 100 s from where a change of attitude"), "{told}");
        let [start, end] = scene.span_s();
        let far = |t: &f64| all.iter().all(|turn| (turn - t).abs() > NEAR_S + 1.0);
        let beside = (0..1000).map(|i| start + (end - start) * f64::from(i) / 1000.0).find(far).unwrap();
        assert_eq!(of_a_turn(&scene, beside), None);
    }

    #[test]
    fn an_onset_at_an_entry_of_a_kind_that_has_few_is_told() {
        let case = made::case();
        let scene = Scene::new(&case).unwrap();
        let of_kind = |kind: &str| scene.case.spans(kind);
        let [_, end_s] = of_kind("water_dump")[0];
        let told = of_an_entry(&scene, end_s + 6.0).unwrap();
        assert!(told.contains("6 s from where an entry water_dump of the log ends"), "{told}");
        assert_eq!(of_an_entry(&scene, end_s + 3.0 * NEAR_S), None);
        // In so short a record two are so many that one is near by chance.
        assert_eq!(of_kind("thruster").len(), 2);
        assert_eq!(of_an_entry(&scene, of_kind("thruster")[1][0]), None);
    }
}
