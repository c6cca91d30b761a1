//! The way from the simulation as it stands to all that was found, a rung for each finding. Not here: what a rung means (see `report`).

use super::arc::{Arc, ArcFit};
use super::search::{Level, Problem, Search, predicted_m};
use crate::diagnose::measured::Plates;
use crate::diagnose::measured::answer::StepAnswer;
use crate::diagnose::measured::plates::OrbitPlate;

struct Rung {
    added: Option<&'static str>,
    score: Option<f64>,
    level: Level,
}

fn rungs(problem: &Problem, search: &Search) -> Vec<Rung> {
    let mut rungs = vec![Rung { added: None, score: None, level: as_it_stands(problem, search) }];
    if !search.manoeuvres.is_empty() {
        let score = search.manoeuvres.iter().map(|one| one.score).reduce(f64::max);
        rungs.push(Rung { added: Some("manoeuvre"), score, level: search.levels[0].clone() });
    }
    rungs.extend(search.levels.iter().filter_map(|level| {
        let (term, score) = level.accepted.last()?;
        Some(Rung { added: Some(term.id()), score: Some(*score), level: level.clone() })
    }));
    let end = search.end();
    if let Some(found) = &search.unlisted {
        rungs.push(Rung { added: Some("hypothesis"), score: Some(found.score), level: end });
    } else if let Some(last) = rungs.last_mut() {
        // With what single satellites have for themselves.
        last.level = end;
    }
    rungs
}

/// The first level without the velocity steps that a search puts into it.
pub fn as_it_stands(problem: &Problem, search: &Search) -> Level {
    let first = &search.levels[0];
    let bare = |(arc, fit): (&Arc, &ArcFit)| match fit.impulses.is_empty() {
        true => fit.clone(),
        false => problem.fit_arc(arc, &first.baseline, Some(&ArcFit { impulses: Vec::new(), ..fit.clone() })),
    };
    Level { fits: problem.arcs.iter().zip(&first.fits).map(bare).collect(), ..first.clone() }
}

/// As entries of the answer.
pub fn steps(problem: &Problem, search: &Search) -> Vec<StepAnswer> {
    let one = |Rung { added, score, level }: &Rung| StepAnswer {
        added: added.map(str::to_owned),
        rms: problem.median_rms_m(level),
        predicted_rms: problem.median_predicted_m(level),
        score: *score,
    };
    rungs(problem, search).iter().map(one).collect()
}

/// Numbers for the figures.
pub fn plates(problem: &Problem, search: &Search) -> Plates {
    let rungs = rungs(problem, search);
    let each = |of: &dyn Fn(&Arc, &ArcFit) -> Option<f64>| {
        let level =
            |rung: &Rung| problem.arcs.iter().zip(&rung.level.fits).filter_map(|(arc, fit)| of(arc, fit)).collect();
        rungs.iter().map(level).collect::<Vec<Vec<f64>>>()
    };
    Plates::Orbit(OrbitPlate {
        arcs: problem.arcs.iter().map(|arc| arc.id.clone()).collect(),
        added: rungs.iter().map(|rung| rung.added.unwrap_or("as it stands").to_owned()).collect(),
        rms_m: each(&|arc, fit| Some(fit.rms_m(0..arc.fitted))),
        predicted_m: each(&predicted_m),
        rms_max_m: problem.rms_max_m(),
    })
}
