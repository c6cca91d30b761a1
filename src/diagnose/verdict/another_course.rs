//! Does a leak that is named die away as one? A push that ends, or grows until it does, is no leak, and is often near enough to one to be
//! taken for it, or to a leak and a step that end each other. Each is weighed in their place, with as many parameters as the leak and the same
//! sizes expected.

use crate::diagnose::answer::Interval;
use crate::diagnose::case::HALF_WINDOW_S;
use crate::diagnose::catalogue::Theta;
use crate::diagnose::design::{Column, Frame, Raw};
use crate::diagnose::model::entry_columns;
use crate::diagnose::optimise::nelder_mead;
use crate::diagnose::remains::{self, Remains};
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Member, Set, Weighed};
use crate::diagnose::solve::Library;

/// Log odds of another course against a leak from which on there is no leak: of leaks, one in fifty at most is so unlike one. And from which on
/// it is told that there may be none.
const ODDS: f64 = 4.0;
const DOUBT: f64 = 0.0;
/// Lengths tried first, in time constants of the leak, and how far before its onset they begin, in lengths.
const LENGTHS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
const BEFORE: [f64; 3] = [0.0, 0.4, 0.8];
/// First steps downhill from the best of these, in lengths, and how many: start and length are then known far better than a window.
const STEP: f64 = 0.3;
const EVALUATIONS: usize = 80;
/// Shortest push, s: a window.
const SHORTEST_S: f64 = 2.0 * HALF_WINDOW_S;

/// A push from one instant to another.
struct Course {
    said: &'static str,
    /// How much of it is over at a share of its length.
    over: fn(f64) -> f64,
}

const COURSES: [Course; 4] = [
    Course { said: "a constant push", over: |x| x },
    Course { said: "a push that grows from nothing", over: |x| x * x },
    Course { said: "a push that falls evenly to nothing", over: |x| x * (2.0 - x) },
    Course {
        said: "a push that rises and falls as half a sine",
        over: |x| 0.5 - 0.5 * (std::f64::consts::PI * x).cos(),
    },
];

/// When a push is there.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Span {
    start_s: f64,
    length_s: f64,
}

impl Course {
    /// Its mean over each window, of unit mean over its length.
    fn series(&self, clock_s: &[f64], span: Span) -> Vec<f64> {
        let over = |t: f64| (self.over)(((t - span.start_s) / span.length_s).clamp(0.0, 1.0));
        let inside = |t: &f64| over(t + HALF_WINDOW_S) - over(t - HALF_WINDOW_S);
        clock_s.iter().map(|t| inside(t) * span.length_s / (2.0 * HALF_WINDOW_S)).collect()
    }
}

/// What is likelier than a leak that is named.
pub enum AnotherCourse {
    /// Beyond doubt: what is there in its place.
    Instead(Remains),
    /// Not so, as a note.
    Maybe(String),
}

/// What is likelier than a leak that is named, of several the likeliest.
pub fn another_course(scene: &Scene, library: &Library, weighed: &Weighed) -> Option<AnotherCourse> {
    let (frame, set) = weighed.framed(scene, &library.entries);
    let of_id = |id: &'static str| {
        let is = |i: &usize| library.entries[set.members[*i].entry].effect().is_some_and(|effect| effect.id == id);
        (0..set.members.len()).filter(is).collect::<Vec<usize>>()
    };
    let (leaks, steps) = (of_id("vent_leak"), of_id("bias_step"));
    let both = leaks.iter().flat_map(|leak| steps.iter().map(|step| (*leak, Some(*step))));
    let places = leaks.iter().map(|leak| (*leak, None)).chain(both);
    let others = places.filter_map(|(leak, step)| in_place_of(scene, library, &frame, &set, leak, step));
    let (log_odds, other) = others.max_by(|a, b| a.0.total_cmp(&b.0))?;
    if log_odds > ODDS {
        return Some(AnotherCourse::Instead(other));
    }
    (log_odds > DOUBT).then(|| {
        AnotherCourse::Maybe(format!(
            "vent_leak: that it dies away, as the catalogue's does, the record does not show: {} is likelier, by log odds of {log_odds:.1}",
            other.form
        ))
    })
}

/// The likeliest other course of one leak, or of that and a step, and its log odds against them.
fn in_place_of(
    scene: &Scene,
    library: &Library,
    frame: &Frame,
    set: &Set,
    i: usize,
    step: Option<usize>,
) -> Option<(f64, Remains)> {
    let clock_s = scene.clock_s();
    let [first_s, last_s] = [*clock_s.first()?, *clock_s.last()?];
    let leak = &set.members[i];
    let sizes = leak.sizes(&library.entries);
    let mut others = set.clone();
    others.members =
        (0..set.members.len()).filter(|j| *j != i && Some(*j) != step).map(|j| set.members[j].clone()).collect();
    let beside = others.chosen(frame);
    let sized = |column: (&Raw, &f64)| frame.column(column.0, *column.1);
    let columns_of = |member: &Member, theta: &Theta| -> Option<Vec<Column>> {
        let columns = entry_columns(scene, &library.entries[member.entry], theta)?;
        Some(columns.iter().zip(&member.sizes(&library.entries)).map(sized).collect())
    };
    let of_step = step.map_or(Some(Vec::new()), |j| columns_of(&set.members[j], &set.members[j].theta))?;
    let of_leak = |theta: &Theta| -> f64 {
        let columns = columns_of(leak, theta).map(|mut named| {
            named.extend(of_step.iter().cloned());
            named
        });
        columns.map_or(f64::NEG_INFINITY, |named| beside.gain(&named))
    };
    // The leak of the search was the likeliest beside what was chosen then; the courses are refined, and so must it be.
    let from = [leak.theta[0], leak.theta[1]];
    let steps = [STEP * leak.theta[1].exp(), STEP];
    let refined_leak = nelder_mead(&from, &steps, EVALUATIONS, |at| -of_leak(&[at[0], at[1]]));
    let of_leak = of_leak(&leak.theta).max(of_leak(&[refined_leak[0], refined_leak[1]]));
    // A step beside a leak has its own prior odds, and an instant of its own.
    let paid = |member: &Member| library.entries[member.entry].log_prior + member.log_occam;
    let of_named = of_leak + step.map_or(0.0, |j| paid(&set.members[j]));
    let columns = |course: &Course, span: Span| -> Vec<Column> {
        let series = course.series(clock_s, span);
        sizes.iter().enumerate().map(|(axis, size)| frame.scalar(axis, &series, *size)).collect()
    };
    let gain = |course: &Course, span: Span| {
        let inside = span.length_s >= SHORTEST_S && span.start_s >= first_s && span.start_s + span.length_s <= last_s;
        if inside { beside.gain(&columns(course, span)) } else { f64::NEG_INFINITY }
    };
    let [onset_s, tau_s] = [leak.theta[0], leak.theta[1].exp()];
    let best_of = |course: &'static Course| {
        let about_the_leak = LENGTHS.iter().flat_map(|length| {
            let length_s = length * tau_s;
            BEFORE.map(|before| Span { start_s: onset_s - before * length_s, length_s })
        });
        let to_the_step = step
            .map(|j| set.members[j].theta[0])
            .map(|step_s| Span { start_s: onset_s.min(step_s), length_s: (step_s - onset_s).abs() });
        let (span, gained) = refined(about_the_leak.chain(to_the_step), |span| gain(course, span))?;
        Some((course, span, gained))
    };
    let (course, span, gained) = COURSES.iter().filter_map(best_of).max_by(|a, b| a.2.total_cmp(&b.2))?;
    let log_odds = gained - of_named - (COURSES.len() as f64).ln();
    let (mean, _) = beside.normal(&columns(course, span)).posterior();
    let ng: [f64; 3] = std::array::from_fn(|axis| mean[axis] * sizes[axis]);
    let axes = remains::sharing(ng);
    let end_s = span.start_s + span.length_s;
    let when = format!("from {:.0} s to {end_s:.0} s", span.start_s);
    let other = Remains {
        probability: (-log_odds).exp().min(1.0),
        energy: 2.0 * gained,
        form: format!("[{:.0}, {:.0}, {:.0}] ng on the mean x ({} {when}, else 0)", ng[0], ng[1], ng[2], course.said),
        axis: axes.join(", "),
        axes,
        location: match step {
            None => {
                format!("{when}: it ends where a leak would die away, and has log odds of {log_odds:.1} against one")
            }
            Some(_) => {
                format!(
                    "{when}: a leak and a step would end each other there, and it has log odds of {log_odds:.1} against them"
                )
            }
        },
        intervals: vec![Interval { start_s: span.start_s, end_s, why: course.said.into() }],
        period_s: None,
    };
    Some((log_odds, other))
}

/// The best of some spans, and then downhill from it.
fn refined(first: impl Iterator<Item = Span>, gain: impl Fn(Span) -> f64) -> Option<(Span, f64)> {
    let (start, _) = first.map(|span| (span, gain(span))).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let of = |at: &[f64]| Span { start_s: at[0], length_s: at[1] };
    let width = STEP * start.length_s;
    let best = of(&nelder_mead(&[start.start_s, start.length_s], &[width, width], EVALUATIONS, |at| -gain(of(at))));
    Some((best, gain(best)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_course_is_its_mean_over_each_window() {
        let span = Span { start_s: 112.0, length_s: 331.0 };
        let clock_s: Vec<f64> = (0..40).map(|i| 25.0 * f64::from(i)).collect();
        let sine = |x: f64| 0.5 * std::f64::consts::PI * (std::f64::consts::PI * x).sin();
        let at: [fn(f64) -> f64; COURSES.len()] = [|_| 1.0, |x| 2.0 * x, |x| 2.0 - 2.0 * x, sine];
        for (course, at) in COURSES.iter().zip(at) {
            let series = course.series(&clock_s, span);
            for (t, mean) in clock_s.iter().zip(series) {
                let shares = (0..5000).map(|i| (t - 25.0 + 0.01 * (f64::from(i) + 0.5) - span.start_s) / span.length_s);
                let points = shares.filter(|x| (0.0..1.0).contains(x)).map(at).sum::<f64>() / 5000.0;
                assert!((points - mean).abs() < 1e-3, "{} at {t}: {points} {mean}", course.said);
            }
        }
    }

    #[test]
    fn the_best_span_is_come_near_to() {
        let gain = |span: Span| -((span.start_s - 130.0) / 20.0).powi(2) - ((span.length_s - 700.0) / 40.0).powi(2);
        let first = [300.0, 600.0].map(|length_s| Span { start_s: 0.0, length_s });
        let (span, gained) = refined(first.into_iter(), gain).unwrap();
        assert!(
            (span.start_s - 130.0).abs() < 20.0 && (span.length_s - 700.0).abs() < 20.0 && gained > -1.0,
            "{span:?}"
        );
    }
}
