//! A push of radiation or air that one satellite has for itself: where an arc keeps more than the stated accuracy allows with all that
//! is common, and one term of the catalogue takes that away.
//!
//! It belongs to that arc and is no common cause. One that another term replaces as well is not named, nor one with which the arc is worse
//! predicted beyond its fit, nor one that a push no catalogue has does better than: that is told for what it is. Not here: what most arcs ask for
//! (`search`), velocity steps (`manoeuvre`).

use super::arc::ArcFit;
use super::forces::Term;
use super::manoeuvre::LEFT_MAX;
use super::search::{Level, Problem, SCORE_MIN, evidence, no_worse_foretold, with};
use super::unlisted::pushes;

/// Evidence by which it must be above every other term that would do: twice the logarithm of odds of twenty.
const MARGIN: f64 = 6.0;

/// One found.
#[derive(Debug, Clone)]
pub struct Own {
    /// Place of its arc.
    pub arc: usize,
    /// The term.
    pub term: Term,
    /// Evidence.
    pub score: f64,
    /// 3-D rms of the arc without it and with it, m.
    pub rms_m: [f64; 2],
    /// The arc with it.
    pub fit: ArcFit,
}

impl Own {
    /// Whether it is of the catalogue.
    pub fn is_listed(&self) -> bool {
        !matches!(self.term, Term::Unlisted(_))
    }
}

/// Those beside a level.
pub fn found(problem: &Problem, level: &Level) -> Vec<Own> {
    (0..problem.arcs.len()).filter_map(|i| of_arc(problem, level, i)).collect()
}

fn of_arc(problem: &Problem, level: &Level, i: usize) -> Option<Own> {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    let was = fit.rms_m(0..arc.fitted);
    // What the only arc asks for, the search has asked already.
    if problem.arcs.len() == 1 || !fit.impulses.is_empty() || !was.is_finite() || was <= problem.rms_max_m() {
        return None;
    }
    let free = problem.candidates(&level.baseline).into_iter().filter(|term| !term.is_known_size());
    let terms: Vec<Term> = free.chain(pushes().map(Term::Unlisted)).collect();
    let wide = arc.fit(&problem.environment, &level.baseline, &level.baseline.estimated, &terms, Some(fit));
    let tried = |term: &Term| {
        let with = problem.fit_arc(arc, &with(&level.baseline, *term), Some(fit));
        let is = with.rms_m(0..arc.fitted);
        let foretold = no_worse_foretold(arc, [fit, &with]);
        let own = Own { arc: i, term: *term, score: evidence(arc, &wide, *term), rms_m: [was, is], fit: with };
        (foretold && is <= problem.rms_max_m() && is < LEFT_MAX * was && own.score > SCORE_MIN).then_some(own)
    };
    let mut all: Vec<Own> = terms.iter().filter_map(tried).collect();
    all.sort_by(|a, b| b.score.total_cmp(&a.score));
    // A name must be above all else by a margin. A formula is none: the first of all is what is told.
    let second = all.get(1).map_or(f64::NEG_INFINITY, |own| own.score);
    all.into_iter().next().filter(|own| !own.is_listed() || own.score > second + MARGIN)
}
