//! The finer terms of a force model that no list of includes names: the tide that Sun and Moon raise in the solid Earth, and the Earth's
//! relativistic term. A satellite feels both; a recording that was made by another program may hold neither, and the lack of what is
//! always in would be named as something else.
//!
//! Both are in unless the recording, beside the fullest model of everything else, is far better without.

use super::arc::Arc;
use super::forces::{Baseline, Finer, Term};
use super::search::{Problem, independent, residual};

/// Arcs that are asked.
const ARCS_MAX: usize = 6;
/// Evidence for being without, of all arcs: of a satellite both are beyond doubt. One arc counts for so much at most.
const SCORE_MIN: f64 = 60.0;
const SCORE_ARC_MAX: f64 = 100.0;

/// A problem with the finer terms that its recording has.
pub fn settled(mut problem: Problem) -> Problem {
    let with = left(&mut problem, Finer::ALL);
    let score = |problem: &mut Problem, finer: Finer| {
        let each: Vec<f64> = left(problem, finer)
            .iter()
            .zip(&with)
            .map(|(without, with)| (without.independent * (with.squares / without.squares).ln()).min(SCORE_ARC_MAX))
            .collect();
        let wanting = each.iter().filter(|score| **score > 0.0).count();
        if 2 * wanting > each.len() { each.iter().sum() } else { 0.0 }
    };
    let mut best = (SCORE_MIN, Finer::ALL);
    // Without one of them alone only where it is better without both.
    let neither = Finer { tide: false, relativity: false };
    for finer in [neither, Finer { tide: false, relativity: true }, Finer { tide: true, relativity: false }] {
        let found = score(&mut problem, finer);
        if found > best.0 {
            best = (found, finer);
        }
        if best.1 == Finer::ALL {
            break;
        }
    }
    problem.environment.finer = best.1;
    problem
}

/// What an arc keeps beside the fullest model.
struct Left {
    squares: f64,
    independent: f64,
}

fn left(problem: &mut Problem, finer: Finer) -> Vec<Left> {
    problem.environment.finer = finer;
    let radiation = [Term::SolarRadiation, Term::YBias, Term::BBias, Term::OncePerRev];
    let fullest = Baseline { degree: usize::MAX, known: vec![Term::Sun, Term::Moon], estimated: radiation.to_vec() };
    let asked = problem.arcs.iter().step_by(problem.arcs.len().div_ceil(ARCS_MAX));
    let one = |arc: &Arc| {
        let fit = arc.fit(&problem.environment, &fullest, &fullest.estimated, &[], None);
        let left = residual(arc, &fit);
        // Below its accuracy a recording tells nothing.
        let floor = left.len() as f64 * problem.sigma_m.powi(2);
        Left { squares: left.norm_squared().max(floor), independent: independent(&left, 6 + 5) }
    };
    asked.map(one).collect()
}
