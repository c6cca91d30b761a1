//! What a reader of an orbit's answer must know before trusting its figures.

use super::forces::{Air, Finer, Term};
use super::report::LOUD;
use super::search::{Problem, Search};
use crate::diagnose::answer::Verdict;
use crate::diagnose::measured::answer::ArcAnswer;

fn finer(Finer { tide, relativity }: Finer) -> &'static str {
    match (tide, relativity) {
        (true, true) => {
            "The pull of Sun and Moon includes the tide they raise in the solid Earth; the Earth's relativistic term is in."
        }
        (true, false) => {
            "The recording has no relativistic term, as every satellite has: a computed orbit, it seems. The pull of Sun and Moon \
             includes the tide they raise in the solid Earth; the relativistic term is left out here too."
        }
        (false, true) => {
            "The recording has no tide of the solid Earth, as every satellite feels: a computed orbit, it seems. It is left out here too; \
             the Earth's relativistic term is in."
        }
        (false, false) => {
            "The recording has neither the tide of the solid Earth nor the Earth's relativistic term, as every satellite has: a computed \
             orbit, it seems. Both are left out here too."
        }
    }
}

/// All of them.
pub fn notes(problem: &Problem, arcs: &[ArcAnswer], search: &Search) -> Vec<String> {
    let mut notes = vec![
        "The initial state of every arc, and the coefficients of radiation terms that the simulation includes, are estimated with it."
            .to_owned(),
        finer(problem.environment.finer).to_owned(),
    ];
    let last = search.last();
    let of_panels = |term: &Term| matches!(term, Term::YBias | Term::BBias | Term::OncePerRev);
    if last.accepted.iter().map(|(term, _)| term).chain(&problem.baseline.estimated).any(of_panels) {
        notes.push(
            "Directions: D from the satellite to the Sun, Y along D x r (r from the Earth's centre), B along D x Y. The pushes of sunlight \
             (along -D), along B and once per revolution stop in shadow; that along Y does not. cos and sin are of the argument of latitude."
                .to_owned(),
        );
    }
    let air = problem.environment.air;
    if air != Air::MEAN && last.accepted.iter().any(|(term, _)| *term == Term::Drag) {
        notes.push(format!(
            "Drag is that of air which thins to 1/e in {:.0} km: the {:.0} km assumed at first explain less. Its fraction is of 0.01 m^2/kg \
             with coefficient 2.2 in the density of a mean Sun at {:.0} km.",
            air.scale_height_m / 1e3,
            Air::MEAN.scale_height_m / 1e3,
            air.height_m / 1e3
        ));
    }
    if problem.sigma_m > problem.stated_sigma_m {
        notes.push(format!(
            "Positions scatter by {:.3} m a coordinate from one to the next, {:.1} times the accuracy stated for them ({:.3} m); what they \
             scatter by is taken for it.",
            problem.sigma_m,
            problem.sigma_m / problem.stated_sigma_m,
            problem.stated_sigma_m
        ));
    }
    let masked: usize = problem.arcs.iter().map(|arc| arc.masked).sum();
    if masked > 0 {
        let are = if masked == 1 {
            "position is left out: it is missing, cannot be read, or is"
        } else {
            "positions are left out: they are missing, cannot be read, or are"
        };
        notes.push(format!("{masked} {are} off the orbit through the others."));
    }
    if !problem.left_out.is_empty() {
        notes.push(format!("Left out: {}.", problem.left_out.join("; ")));
    }
    let odd: Vec<&str> =
        arcs.iter().filter(|arc| arc.verdict == Verdict::Unexplained).map(|arc| arc.id.as_str()).collect();
    if !odd.is_empty() {
        notes.push(format!("Unexplained, and given no cause: {}.", odd.join(", ")));
    }
    let stated_m = 3f64.sqrt() * problem.sigma_m;
    let above = |arc: &&ArcAnswer| arc.verdict != Verdict::Unexplained && arc.rms_after > LOUD * stated_m;
    let loud: Vec<String> = arcs
        .iter()
        .filter(above)
        .map(|arc| format!("{} ({:.3} m, {:.1} times)", arc.id, arc.rms_after, arc.rms_after / stated_m))
        .collect();
    if !loud.is_empty() && search.manoeuvres.is_empty() {
        notes.push(format!(
            "More remains than the stated accuracy, {stated_m:.3} m in three dimensions, in {}: no more than the pushes that satellites \
             have and no list does, so that nothing is claimed of it. A velocity step too small to be told from these may be there.",
            loud.join(", ")
        ));
    }
    notes
}
