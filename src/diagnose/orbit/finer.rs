//! The finer terms of a force model that no list of includes names: the tide that Sun and Moon raise in the solid Earth, and the Earth's
//! relativistic term. A satellite feels both; a recording that was made by another program may hold neither, and the lack of what is
//! always in would be named as something else.
//!
//! Both are in unless the recording is better without: beside the fullest model of everything else, or, where radiation or air was named,
//! by a second search that needs less of those. The second look doubles the time of such a case.

use super::arc::{Arc, ArcFit};
use super::forces::{Baseline, Finer, Term};
use super::search::{Problem, SCORE_ARC_MAX, SCORE_MIN, Search, independent, residual};

/// Arcs that are asked first.
const ARCS_MAX: usize = 6;

/// The search, with the finer terms that the recording has.
pub fn settled(problem: &mut Problem) -> Search {
    problem.environment.finer = beside_everything(problem);
    let search = problem.search(&mut |_| ());
    // Radiation imitates what is lacking or too much: nothing but an explanation without it shows that it was no more than that.
    let imitated = |term: &Term| matches!(term, Term::YBias | Term::BBias | Term::OncePerRev | Term::Drag);
    let last = &search.levels[search.levels.len() - 1];
    if problem.environment.finer != Finer::ALL || !last.accepted.iter().any(|(term, _)| imitated(term)) {
        return search;
    }
    problem.environment.finer = NEITHER;
    let other = problem.search(&mut |_| ());
    if is_better(problem, &other, &search) {
        return other;
    }
    problem.environment.finer = Finer::ALL;
    search
}

const NEITHER: Finer = Finer { tide: false, relativity: false };

/// Whether one explanation has more evidence than another, its numbers counted.
fn is_better(problem: &Problem, one: &Search, other: &Search) -> bool {
    let kept = |search: &Search| -> Vec<(Left, f64)> {
        let end = search.end();
        let left = |(arc, fit)| (Left::of(problem, arc, fit), fit.coefficients.len() as f64);
        problem.arcs.iter().zip(&end.fits).map(left).collect()
    };
    let (one, other) = (kept(one), kept(other));
    let score = |((one, less), (other, more)): (&(Left, f64), &(Left, f64))| {
        one.evidence_over(other) + (more - less) * one.independent.ln()
    };
    asked_for(one.iter().zip(&other).map(score).collect()) > SCORE_MIN
}

/// What all arcs ask for together, one of them so much at most; nothing where most do not.
fn asked_for(each: Vec<f64>) -> f64 {
    let wanting = each.iter().filter(|score| **score > 0.0).count();
    if 2 * wanting > each.len() { each.iter().map(|score| score.min(SCORE_ARC_MAX)).sum() } else { 0.0 }
}

/// The finer terms of a recording beside the fullest model of everything else.
fn beside_everything(problem: &mut Problem) -> Finer {
    let with = left(problem, Finer::ALL);
    let mut score = |finer: Finer| {
        let without = left(problem, finer);
        asked_for(without.iter().zip(&with).map(|(without, with)| without.evidence_over(with)).collect())
    };
    let neither = score(NEITHER);
    if neither <= SCORE_MIN {
        return Finer::ALL;
    }
    // Without one of them alone only where it is better than without both.
    let alone = [Finer { tide: false, ..Finer::ALL }, Finer { relativity: false, ..Finer::ALL }];
    let alone = alone.map(|finer| (score(finer), finer));
    alone.into_iter().fold((neither, NEITHER), |best, other| if other.0 > best.0 { other } else { best }).1
}

/// The fullest model: whatever the recording may have.
pub(super) fn fullest() -> Baseline {
    let radiation = [Term::SolarRadiation, Term::YBias, Term::BBias, Term::OncePerRev];
    Baseline { degree: usize::MAX, known: vec![Term::Sun, Term::Moon], estimated: radiation.to_vec() }
}

/// What an arc keeps.
struct Left {
    squares: f64,
    independent: f64,
}

impl Left {
    fn of(problem: &Problem, arc: &Arc, fit: &ArcFit) -> Self {
        let left = residual(arc, fit);
        // Below its accuracy a recording tells nothing.
        let floor = left.len() as f64 * problem.sigma_m.powi(2);
        Self { squares: left.norm_squared().max(floor), independent: independent(&left, 6 + fit.coefficients.len()) }
    }

    fn evidence_over(&self, other: &Self) -> f64 {
        self.independent * (other.squares / self.squares).ln()
    }
}

fn left(problem: &mut Problem, finer: Finer) -> Vec<Left> {
    problem.environment.finer = finer;
    let model = fullest();
    let asked = problem.arcs.iter().step_by(problem.arcs.len().div_ceil(ARCS_MAX));
    let one = |arc| Left::of(problem, arc, &arc.fit(&problem.environment, &model, &model.estimated, &[], None));
    asked.map(one).collect()
}
