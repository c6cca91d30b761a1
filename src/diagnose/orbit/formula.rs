//! A push that no catalogue has, as the hypothesis of an answer.

use super::forces::{Direction, Term, Unlisted};
use super::search::{Estimate, Level, Problem, Search, estimates};
use super::unlisted::Found;
use crate::diagnose::answer::Hypothesis;
use crate::diagnose::measured::spread::{median, scatter};

/// The hypothesis of a search, where it has one: of all satellites, or of the one that has most for itself.
pub fn hypothesis(problem: &Problem, search: &Search) -> Option<Hypothesis> {
    let end = search.end();
    let rows = |term: Unlisted, arcs: std::ops::Range<usize>| -> Vec<Vec<Estimate>> {
        arcs.map(|i| estimates(problem, &end, i, Term::Unlisted(term))).collect()
    };
    if let Some(found) = &search.unlisted {
        let [formula, axis, unit] = said(found.term, &rows(found.term, 0..problem.arcs.len()));
        return Some(Hypothesis { formula, axis, unit, location: place(problem, search, found, &end) });
    }
    let most = search.alone.iter().max_by(|a, b| a.rms_m[0].total_cmp(&b.rms_m[0]))?;
    let Term::Unlisted(term) = most.term else { return None };
    let [formula, axis, unit] = said(term, &rows(term, most.arc..most.arc + 1));
    let [was, is] = most.rms_m;
    let others = if search.alone.len() > 1 { " Others have one of their own (see `arcs`)." } else { "" };
    let location = format!(
        "{} alone, all along its arc: the 3-D residual falls from {was:.3} m to {is:.3} m, and no term of the catalogue does as well.{others}",
        problem.arcs[most.arc].id
    );
    Some(Hypothesis { formula, axis, unit, location })
}

/// Formula, axis and unit of a push with its coefficients in some arcs.
pub fn said(term: Unlisted, rows: &[Vec<Estimate>]) -> [String; 3] {
    let value = |k: usize| of_all(rows, k);
    let (formula, axis, unit) = match term {
        Unlisted::Steady(direction) => (format!("a = {}", value(0)), direction.name(), "m/s^2"),
        Unlisted::Growing(direction) => {
            (format!("a = ({}) x (days since the first epoch)", value(0)), direction.name(), "m/s^2")
        }
        Unlisted::PerRevolution(direction) => (
            format!("a = ({}) cos u + ({}) sin u, u the argument of latitude", value(0), value(1)),
            direction.name(),
            "m/s^2",
        ),
        Unlisted::DaySide => (
            format!("a = ({}) max(0, cos(angle from the Sun at the Earth's centre)) (R/r)^2", value(0)),
            "radial",
            "m/s^2",
        ),
        Unlisted::NoSun => ("a = -(pull of the Sun)".to_owned(), "all", "1"),
        Unlisted::NoMoon => ("a = -(pull of the Moon)".to_owned(), "all", "1"),
        Unlisted::NoDegrees(from, to) => (format!("a = -(degrees {from} to {to} of the gravity field)"), "all", "1"),
    };
    [formula, axis.to_owned(), unit.to_owned()]
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
    let last = search.last();
    let of = if n > 1 { format!(" (median of {n})") } else { String::new() };
    let mut words = match found.term {
        Unlisted::Steady(_) | Unlisted::PerRevolution(_) | Unlisted::Growing(_) | Unlisted::DaySide => {
            "All along the arcs, one value for each.".to_owned()
        }
        Unlisted::NoSun | Unlisted::NoMoon | Unlisted::NoDegrees(..) => {
            "The simulation has it, and the recording seems to have been made without.".to_owned()
        }
    };
    words.push_str(&format!(
        " With it the 3-D residual falls from {:.3} m to {:.3} m{of}.",
        problem.median_rms_m(last),
        problem.median_rms_m(end)
    ));
    let left_m = problem.median_rms_m(end);
    if left_m > problem.rms_max_m() {
        words.push_str(&format!(
            " That is more than the stated accuracy allows ({:.3} m): it is not all of what is there.",
            problem.rms_max_m()
        ));
    }
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
        words.push_str(" Air of no scale height that was tried pushes so.");
    }
    words
}
