//! What names of pushes are worth: a push that no catalogue has, in one direction of the orbit's own frame, or a pull that the simulation
//! has and the recording has not, in the place of some or all of the pushes that were named.
//!
//! Radiation and drag are fitted with coefficients of their own for every satellite, so that together they take something off whatever
//! pushes. Where something that is no physics in particular does better, none of them is named. Pulls of known size stay: nothing
//! imitates them. Not here: what one satellite has for itself (see `own` and `manoeuvre`).

use super::arc::ArcFit;
use super::compare;
use super::forces::{Baseline, Direction, Term, Unlisted};
use super::search::{Level, Problem, SCORE_MIN, Search, evidence, with};
use crate::math::shared_work;

/// Evidence by which it must be above what was named: twice the logarithm of odds of twenty.
const MARGIN: f64 = 6.0;

/// One found.
#[derive(Clone)]
pub struct Found {
    /// What it is.
    pub term: Unlisted,
    /// Evidence for it beside what is kept.
    pub score: f64,
    /// What was named in its place.
    pub instead_of: Vec<Term>,
    /// Median over the arcs of the rms that the names left, m.
    pub named_rms_m: f64,
    /// Evidence by which it is above them.
    pub above: f64,
    /// The arcs with it.
    pub level: Level,
}

/// A push that does better than some or all of those a search has named, with the search that is left without these.
pub fn settled(problem: &Problem, search: Search) -> Search {
    let end = search.end();
    let (known, free): (Vec<Term>, Vec<Term>) =
        end.accepted.iter().map(|(term, _)| *term).partition(|term| term.is_known_size());
    let is_odd = |fits: &[ArcFit]| {
        let beyond = fits.iter().zip(&problem.arcs).filter(|(fit, arc)| fit.rms_m(0..arc.fitted) > problem.rms_max_m());
        2 * beyond.count() > problem.arcs.len()
    };
    let odd = is_odd(&end.fits);
    if free.is_empty() && !odd {
        return search;
    }
    let named_rms_m = problem.median_rms_m(&end);
    let one = |kept: Vec<Term>| -> Option<(Vec<Term>, Found)> {
        // Beside all that was named only what takes away what is too much there: every satellite has a little more than any list.
        let beside_all = kept == free;
        if beside_all && !odd {
            return None;
        }
        let terms: Vec<Term> = known.iter().chain(&kept).copied().collect();
        let baseline = terms.iter().fold(problem.baseline.clone(), |model, term| with(&model, *term));
        let (term, score, level) = best(problem, &baseline, &end.fits)?;
        let above = compare::evidence_over(problem, &level.fits, &end.fits);
        let instead_of = free.iter().filter(|term| !kept.contains(term)).copied().collect();
        (above > MARGIN && !(beside_all && is_odd(&level.fits)))
            .then_some((terms, Found { term, score, instead_of, named_rms_m, above, level }))
    };
    let all = kept(&free).into_iter().filter_map(one);
    let Some((terms, found)) = all.max_by(|a, b| a.1.above.total_cmp(&b.1.above)) else { return search };
    let levels = problem.walk(&search.levels, end.accepted.iter().filter(|(term, _)| terms.contains(term)).copied());
    Search { levels, unlisted: Some(found), own: Vec::new(), alone: Vec::new(), ..search }
}

/// Which of the named pushes may stay beside one that no catalogue has: none, sunlight, all but one, all.
fn kept(free: &[Term]) -> Vec<Vec<Term>> {
    let without = |left_out: &dyn Fn(Term) -> bool| free.iter().copied().filter(|term| !left_out(*term)).collect();
    let mut kept: Vec<Vec<Term>> = vec![Vec::new(), without(&|term| term != Term::SolarRadiation), free.to_vec()];
    kept.extend(free.iter().map(|one| without(&|term| term == *one)));
    kept.sort();
    kept.dedup();
    kept
}

/// The push that all arcs ask for most beside a model, by its columns, with the arcs fitted to it.
fn best(problem: &Problem, baseline: &Baseline, from: &[ArcFit]) -> Option<(Unlisted, f64, Level)> {
    let all = all(problem);
    let terms: Vec<Term> = all.iter().map(|one| Term::Unlisted(*one)).collect();
    let one =
        |i: usize| problem.arcs[i].fit(&problem.environment, baseline, &baseline.estimated, &terms, Some(&from[i]));
    let bare: Vec<ArcFit> = shared_work::map_range(problem.arcs.len(), one);
    let each = |one: Unlisted| -> (Unlisted, Vec<f64>) {
        let of_arcs = problem.arcs.iter().zip(&bare);
        (one, of_arcs.map(|(arc, fit)| evidence(arc, fit, Term::Unlisted(one))).collect())
    };
    let all = shared_work::map(&all, |one| each(*one));
    // Which of them by all that the arcs say; how much they are asked for by no more than one arc may say.
    let sum = |(_, each): &(Unlisted, Vec<f64>)| each.iter().sum::<f64>();
    let (term, each) = all.into_iter().max_by(|a, b| sum(a).total_cmp(&sum(b)))?;
    let score = compare::asked_for(each);
    if score <= SCORE_MIN {
        return None;
    }
    let baseline = with(baseline, Term::Unlisted(term));
    let level = problem.fit(&baseline, Vec::new(), Some(&bare));
    Some((term, score, level))
}

/// Pushes that one satellite may have for itself.
pub(super) fn pushes() -> impl Iterator<Item = Unlisted> {
    let of = |kind: fn(Direction) -> Unlisted| Direction::ALL.map(kind);
    let kinds = [of(Unlisted::Steady), of(Unlisted::PerRevolution), of(Unlisted::Growing)];
    kinds.into_iter().flatten().chain([Unlisted::DaySide])
}

/// All that are tried: three directions, steady, once per revolution and growing, the day side, and every pull of the simulation's own taken away.
fn all(problem: &Problem) -> Vec<Unlisted> {
    let own = &problem.baseline;
    let bodies = [(Term::Sun, Unlisted::NoSun), (Term::Moon, Unlisted::NoMoon)];
    let bodies = bodies.into_iter().filter(|(term, _)| own.known.contains(term)).map(|(_, away)| away);
    let degrees = (2..=own.degree).map(|from| Unlisted::NoDegrees(from, own.degree));
    pushes().chain(bodies).chain(degrees).collect()
}
