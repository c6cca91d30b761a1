//! The finer terms of a force model that no list of includes names: the tide that Sun and Moon raise in the solid Earth, and the Earth's
//! relativistic term. A satellite feels both; a recording that was made by another program may hold neither, and the lack of what is
//! always in would be named as something else.
//!
//! Both are in unless the recording is better without: beside the fullest model of everything else, or, where radiation or air was named,
//! by a second search that needs less of those. The second look doubles the time of such a case.

use super::compare::{self, Left, asked_for};
use super::forces::{Baseline, Finer, Term};
use super::search::{Problem, SCORE_MIN, Search};

/// Arcs that are asked first.
const ARCS_MAX: usize = 6;

/// The search, with the finer terms that the recording has.
pub fn settled(problem: &mut Problem) -> Search {
    problem.environment.finer = beside_everything(problem);
    let search = problem.search(&mut |_| ());
    // Radiation imitates what is lacking or too much: nothing but an explanation without it shows that it was no more than that.
    let imitated = |term: &Term| matches!(term, Term::YBias | Term::BBias | Term::OncePerRev | Term::Drag);
    let last = search.last();
    if problem.environment.finer != Finer::ALL || !last.accepted.iter().any(|(term, _)| imitated(term)) {
        return search;
    }
    problem.environment.finer = NEITHER;
    let other = problem.search(&mut |_| ());
    if compare::evidence_over(problem, &other.end().fits, &search.end().fits) > SCORE_MIN {
        return other;
    }
    problem.environment.finer = Finer::ALL;
    search
}

const NEITHER: Finer = Finer { tide: false, relativity: false };

/// The finer terms of a recording beside the fullest model of everything else.
fn beside_everything(problem: &mut Problem) -> Finer {
    let with = left(problem, Finer::ALL);
    let mut score = |finer: Finer| {
        let without = left(problem, finer);
        asked_for(without.iter().zip(&with).map(|(without, with)| without.squares_over(with)).collect())
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

fn left(problem: &mut Problem, finer: Finer) -> Vec<Left> {
    problem.environment.finer = finer;
    let model = fullest();
    let asked = problem.arcs.iter().step_by(problem.arcs.len().div_ceil(ARCS_MAX));
    let one = |arc| Left::of(problem, arc, &arc.fit(&problem.environment, &model, &model.estimated, &[], None));
    asked.map(one).collect()
}
