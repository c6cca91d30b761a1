//! Which of two explanations has more evidence, by what each leaves of every arc and by the numbers it needs. Not here: what a search adds
//! from one level to the next, which is judged by columns (see `search`).

use super::arc::{Arc, ArcFit};
use super::search::{Problem, SCORE_ARC_MAX, independent, residual};

/// What an arc keeps.
pub(super) struct Left {
    squares: f64,
    independent: f64,
    unknowns: usize,
}

impl Left {
    pub(super) fn of(problem: &Problem, arc: &Arc, fit: &ArcFit) -> Self {
        let left = residual(arc, fit);
        // Below its accuracy a recording tells nothing: the stated one, or where its positions scatter by less, that.
        let accuracy_m = problem.scatter_m.map_or(problem.sigma_m, |scatter_m| scatter_m.min(problem.sigma_m));
        let floor = left.len() as f64 * accuracy_m.powi(2);
        let unknowns = fit.unknowns();
        Self { squares: left.norm_squared().max(floor), independent: independent(&left, unknowns), unknowns }
    }

    /// By the squares alone.
    pub(super) fn squares_over(&self, other: &Self) -> f64 {
        self.independent * (other.squares / self.squares).ln()
    }

    fn evidence_over(&self, other: &Self) -> f64 {
        self.squares_over(other) + (other.unknowns as f64 - self.unknowns as f64) * self.independent.ln()
    }
}

/// What all arcs ask for together, one of them so much at most; nothing where most do not.
pub(super) fn asked_for(each: Vec<f64>) -> f64 {
    let wanting = each.iter().filter(|score| **score > 0.0).count();
    if 2 * wanting > each.len() { each.iter().map(|score| score.min(SCORE_ARC_MAX)).sum() } else { 0.0 }
}

/// Evidence of one explanation over another, twice the logarithm of the odds: of all arcs that fits of both are given for.
pub(super) fn evidence_over(problem: &Problem, one: &[ArcFit], other: &[ArcFit]) -> f64 {
    let left = |fits: &[ArcFit]| -> Vec<Left> {
        problem.arcs.iter().zip(fits).map(|(arc, fit)| Left::of(problem, arc, fit)).collect()
    };
    asked_for(left(one).iter().zip(&left(other)).map(|(one, other)| one.evidence_over(other)).collect())
}

/// The same of one arc.
pub(super) fn of_arc(problem: &Problem, i: usize, one: &ArcFit, other: &ArcFit) -> f64 {
    let [one, other] = [one, other].map(|fit| Left::of(problem, &problem.arcs[i], fit));
    one.evidence_over(&other)
}

/// Natural logarithm of the chance that noise of the stated accuracy leaves as much as a fit does in an arc (Chernoff's bound of the
/// chi-square tail, of independent residuals).
pub(super) fn log_chance(problem: &Problem, i: usize, fit: &ArcFit) -> f64 {
    let left = Left::of(problem, &problem.arcs[i], fit);
    let ratio = left.squares / (3.0 * problem.arcs[i].fitted as f64 * problem.sigma_m.powi(2));
    -0.5 * left.independent * (ratio - 1.0 - ratio.ln())
}
