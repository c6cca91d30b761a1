//! A push that no catalogue has, as the hypothesis of an answer.

use super::forces::{Direction, Term, Unlisted};
use super::search::{Estimate, Level, Problem, Search, estimates};
use super::unlisted::Found;
use crate::diagnose::answer::Hypothesis;
use crate::diagnose::measured::spread::{median, scatter};

/// The hypothesis of a search, where it has one.
pub fn hypothesis(problem: &Problem, search: &Search) -> Option<Hypothesis> {
    let found = search.unlisted.as_ref()?;
    let end = search.end();
    let rows: Vec<Vec<Estimate>> =
        (0..problem.arcs.len()).map(|i| estimates(problem, &end, i, Term::Unlisted(found.term))).collect();
    let value = |k: usize| of_all(&rows, k);
    let (formula, axis, unit) = match found.term {
        Unlisted::Steady(direction) => (format!("a = {}", value(0)), direction.name(), "m/s^2"),
        Unlisted::PerRevolution(direction) => (
            format!("a = ({}) cos u + ({}) sin u, u the argument of latitude", value(0), value(1)),
            direction.name(),
            "m/s^2",
        ),
        Unlisted::NoSun => ("a = -(pull of the Sun)".to_owned(), "all", "1"),
        Unlisted::NoMoon => ("a = -(pull of the Moon)".to_owned(), "all", "1"),
        Unlisted::NoDegrees(from, to) => (format!("a = -(degrees {from} to {to} of the gravity field)"), "all", "1"),
    };
    Some(Hypothesis {
        formula,
        axis: axis.to_owned(),
        unit: unit.to_owned(),
        location: place(problem, search, found, &end),
    })
}

/// One coefficient over all arcs: the median, with how much satellites differ.
fn of_all(rows: &[Vec<Estimate>], k: usize) -> String {
    let each: Vec<Estimate> = rows.iter().filter_map(|row| row.get(k).copied()).collect();
    let values: Vec<f64> = each.iter().map(|e| e.value).collect();
    let error = median(each.iter().map(|e| e.sigma));
    match values.len() {
        1 => format!("{:.2e} +- {error:.1e} m/s^2", values[0]),
        n => format!("{:.2e} m/s^2 (median of {n}; scatter {:.1e})", median(values.iter().copied()), scatter(&values)),
    }
}

fn place(problem: &Problem, search: &Search, found: &Found, end: &Level) -> String {
    let n = problem.arcs.len();
    let last = &search.levels[search.levels.len() - 1];
    let of = if n > 1 { format!(" (median of {n})") } else { String::new() };
    let mut words = match found.term {
        Unlisted::Steady(_) | Unlisted::PerRevolution(_) => "All along the arcs, one value for each.".to_owned(),
        Unlisted::NoSun | Unlisted::NoMoon | Unlisted::NoDegrees(..) => {
            "The simulation has it, and the recording seems to have been made without.".to_owned()
        }
    };
    words.push_str(&format!(
        " With it the 3-D residual falls from {:.3} m to {:.3} m{of}.",
        problem.median_rms_m(last),
        problem.median_rms_m(end)
    ));
    if !found.instead_of.is_empty() {
        let ids: Vec<&str> = found.instead_of.iter().map(|term| term.id()).collect();
        words.push_str(&format!(
            " In its place {} would leave {:.3} m{of}, log odds of {:.0} against.",
            ids.join(" with "),
            found.named_rms_m,
            0.5 * found.above
        ));
    }
    if found.term == Unlisted::Steady(Direction::Along) && found.instead_of.contains(&Term::Drag) {
        words.push_str(" No air that thins with height pushes so.");
    }
    words
}
