//! Which terms the arcs ask for: a forward search over the catalogue on the evidence of all arcs together, refitted in
//! full after every step, then a look back that drops what the rest has made needless.
//!
//! The evidence of a term in one arc is `n ln(RSS0/RSS1) - k ln n`, with `n` the number of *independent* residuals under
//! the richer model: residuals of an orbit are smooth for hours, and counting every epoch would find a term in anything.
//! Not here: words and figures for the reader (see `report`).

use nalgebra::{DMatrix, DVector, Vector3};

use super::arc::{Arc, ArcFit};
use super::forces::{Baseline, Environment, Moment, Term};
use super::manoeuvre::{self, Manoeuvre};
use super::own::{self, Own};
use super::unlisted::Found;
use crate::diagnose::measured::spread::{median, memory};
use crate::math::shared_work;
use crate::physics::integrator::State;

/// Evidence that all arcs together must give for a term: odds of one in 8,000 for chance at twice the log.
pub const SCORE_MIN: f64 = 18.0;
/// One arc counts for no more than this, so that a single odd satellite cannot name a common cause.
pub(super) const SCORE_ARC_MAX: f64 = 100.0;
/// Unlisted accelerations (radiation from the Earth, antennas, attitude: 1e-10 m/s^2) leave up to this many times the stated
/// accuracy in an arc of two days, which is no finding; beyond it something is there.
const EXCESS_MAX: f64 = 4.0;
const EXCESS_SPAN_S: f64 = 2.0 * 86_400.0;
/// Where there is no air, drag is no candidate, m.
const AIR_TOP_M: f64 = 1.5e6;
/// The size of those unlisted accelerations against which a known pull can be weighed (tides' finer terms, the Moon's
/// analytic place, radiation from the Earth), m/s^2.
pub(super) const UNLISTED_M_S2: f64 = 3e-10;
const STEPS_MAX: usize = 10;

/// What is to be explained.
pub struct Problem {
    /// Where they fly.
    pub environment: Environment,
    /// What the simulation includes.
    pub baseline: Baseline,
    /// The arcs.
    pub arcs: Vec<Arc>,
    /// Accuracy of a coordinate, m: the stated one, or what the positions themselves scatter by where that is more.
    pub sigma_m: f64,
    /// The stated one, m.
    pub stated_sigma_m: f64,
    /// What positions scatter by from one to the next, where that is noise, m.
    pub scatter_m: Option<f64>,
    /// Satellites of the recording with too few positions to fit.
    pub left_out: Vec<String>,
}

/// A model and its fits.
#[derive(Clone)]
pub struct Level {
    /// Baseline with the accepted terms of known size in it.
    pub baseline: Baseline,
    /// Terms added so far, with the evidence for each.
    pub accepted: Vec<(Term, f64)>,
    /// One fit an arc.
    pub fits: Vec<ArcFit>,
}

/// An estimate of one coefficient in one arc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard error, the residuals' memory included.
    pub sigma: f64,
}

/// The whole search: every level from the simulation as it stands to the last.
pub struct Search {
    /// Levels in order.
    pub levels: Vec<Level>,
    /// At the first step, the evidence for every candidate, of each arc all of it; most first.
    pub first_scores: Vec<(Term, f64)>,
    /// Candidates not accepted at the end, with their evidence.
    pub refused: Vec<(Term, f64)>,
    /// Velocity steps of single satellites, with the last level's errors.
    pub manoeuvres: Vec<Manoeuvre>,
    /// Pushes of single satellites beside the last level.
    pub own: Vec<Own>,
    /// The same that no catalogue has, of single satellites.
    pub alone: Vec<Own>,
    /// A push that no catalogue has, of all, beside the last level.
    pub unlisted: Option<Found>,
}

impl Search {
    /// The last level.
    pub fn last(&self) -> &Level {
        &self.levels[self.levels.len() - 1]
    }

    /// The same with what no catalogue has, and with what single satellites have for themselves.
    pub fn end(&self) -> Level {
        let last = self.last();
        let mut end = last.clone();
        if let Some(found) = &self.unlisted {
            end = Level { accepted: last.accepted.clone(), ..found.level.clone() };
        }
        self.own.iter().chain(&self.alone).for_each(|own| end.fits[own.arc] = own.fit.clone());
        end
    }
}

impl Problem {
    /// Candidates that the baseline does not hold.
    pub(super) fn candidates(&self, baseline: &Baseline) -> Vec<Term> {
        let mut terms = vec![Term::Sun, Term::Moon];
        if baseline.degree < self.environment.field.degree() {
            terms.push(Term::DegreesFrom(baseline.degree.max(1) + 1));
        }
        if self.arcs.iter().any(|arc| arc.height_min_m() < AIR_TOP_M) {
            // Before radiation: there air pushes more. Of drag alone something can be more by day.
            terms.push(Term::Drag);
            if baseline.estimated.contains(&Term::Drag) {
                terms.push(Term::Bulge);
            }
        }
        terms.extend([Term::SolarRadiation, Term::YBias, Term::BBias, Term::OncePerRev]);
        terms.retain(|term| !baseline.known.contains(term) && !baseline.estimated.contains(term));
        terms
    }

    /// Fit every arc to a model.
    pub fn fit(&self, baseline: &Baseline, accepted: Vec<(Term, f64)>, from: Option<&[ArcFit]>) -> Level {
        let one = |i: usize| self.fit_arc(&self.arcs[i], baseline, from.map(|fits| &fits[i]));
        Level { baseline: baseline.clone(), accepted, fits: shared_work::map_range(self.arcs.len(), one) }
    }

    /// Fit one arc to a model.
    pub fn fit_arc(&self, arc: &Arc, baseline: &Baseline, from: Option<&ArcFit>) -> ArcFit {
        arc.fit(&self.environment, baseline, &baseline.estimated, &self.candidates(baseline), from)
    }

    /// Search. `report` is called after every level, for progress.
    pub fn search(&self, report: &mut dyn FnMut(usize)) -> Search {
        let found = self.search_with(true, report);
        // A velocity step taken on the way that leaves an arc odd in the end may have misled the rest: once more without.
        if !manoeuvre::has_unproven(self, found.last()) {
            return found;
        }
        self.search_with(false, report)
    }

    fn search_with(&self, steps_of_velocity: bool, report: &mut dyn FnMut(usize)) -> Search {
        let mut levels = vec![self.fit(&self.baseline, Vec::new(), None)];
        let mut first_scores = Vec::new();
        let mut refused = Vec::new();
        for step in 0..STEPS_MAX {
            report(step);
            let last = levels.len() - 1;
            let mut scores = self.scores(&levels[last]);
            scores.sort_by(|a, b| b.1.total_cmp(&a.1));
            if step == 0 {
                first_scores = self.scores_up_to(&levels[last], f64::INFINITY);
                first_scores.sort_by(|a, b| b.1.total_cmp(&a.1));
            }
            let best = scores.first().filter(|(_, score)| *score > SCORE_MIN).copied();
            let rivals: Vec<f64> = (0..self.arcs.len()).map(|i| self.left_with(&levels[last], i, best)).collect();
            if let Some(with) = steps_of_velocity.then(|| manoeuvre::step(self, &levels[last], &rivals)).flatten() {
                levels[last] = with;
                continue;
            }
            let Some((term, score)) = best else {
                refused = scores;
                break;
            };
            let mut accepted = levels[last].accepted.clone();
            accepted.push((term, score));
            let next = self.fit(&with(&levels[last].baseline, term), accepted, Some(&levels[last].fits));
            levels.push(next);
        }
        let levels = self.look_back(levels);
        let last = &levels[levels.len() - 1];
        let manoeuvres = manoeuvre::found(self, last);
        let (own, alone) = own::found(self, last).into_iter().partition(Own::is_listed);
        Search { levels, first_scores, refused, manoeuvres, own, alone, unlisted: None }
    }

    /// Rms that one arc would keep with a term (as it stands without one), by its linear columns, m.
    fn left_with(&self, level: &Level, i: usize, best: Option<(Term, f64)>) -> f64 {
        let (arc, fit) = (&self.arcs[i], &level.fits[i]);
        let now = fit.rms_m(0..arc.fitted);
        best.map_or(now, |(term, _)| left_with_m(arc, fit, term))
    }

    /// Drop terms that the last level can do without, and walk the way there once more in the catalogue's order, large
    /// and general terms first, so that every step of the answer stands on what is known by then.
    fn look_back(&self, levels: Vec<Level>) -> Vec<Level> {
        let last = &levels[levels.len() - 1];
        if last.accepted.is_empty() {
            return levels;
        }
        let needed = |(term, _): &&(Term, f64)| term.is_known_size() || self.loss_without(last, *term) >= SCORE_MIN;
        let mut kept: Vec<(Term, f64)> = last.accepted.iter().filter(needed).copied().collect();
        kept.sort_by_key(|(term, _)| *term);
        if kept == last.accepted && levels.iter().all(|level| kicks(level) == kicks(last)) {
            return levels;
        }
        self.walk(&levels, kept.into_iter())
    }

    /// From the simulation as it stands, with the velocity steps of the last of some levels, a term a step.
    pub(super) fn walk(&self, levels: &[Level], terms: impl Iterator<Item = (Term, f64)>) -> Vec<Level> {
        let last = &levels[levels.len() - 1];
        let mut first = levels[0].clone();
        for (i, (fit, final_fit)) in first.fits.iter_mut().zip(&last.fits).enumerate() {
            if fit.impulses != final_fit.impulses {
                let from = ArcFit { impulses: final_fit.impulses.clone(), ..fit.clone() };
                *fit = self.fit_arc(&self.arcs[i], &self.baseline, Some(&from));
            }
        }
        let mut walked = vec![first];
        for (term, score) in terms {
            let level = &walked[walked.len() - 1];
            let mut accepted = level.accepted.clone();
            accepted.push((term, score));
            let next = self.fit(&with(&level.baseline, term), accepted, Some(&level.fits));
            walked.push(next);
        }
        walked
    }

    /// Evidence of every candidate at a level: the sum over arcs, and at least half of the arcs must want it.
    pub fn scores(&self, level: &Level) -> Vec<(Term, f64)> {
        self.scores_up_to(level, SCORE_ARC_MAX)
    }

    /// The same where one arc counts for so much at most.
    fn scores_up_to(&self, level: &Level, most: f64) -> Vec<(Term, f64)> {
        let score = |term: Term| {
            let each: Vec<f64> = self.arcs.iter().zip(&level.fits).map(|(arc, fit)| evidence(arc, fit, term)).collect();
            let wanting = each.iter().filter(|s| **s > 0.0).count();
            let sum: f64 = each.iter().map(|s| s.min(most)).sum();
            if 2 * wanting >= each.len() { sum } else { sum.min(0.0) }
        };
        self.candidates(&level.baseline).into_iter().map(|term| (term, score(term))).collect()
    }

    /// Evidence that would be lost without a term that is in the model (linear, from the last fits).
    fn loss_without(&self, level: &Level, term: Term) -> f64 {
        let one = |(arc, fit): (&Arc, &ArcFit)| evidence_for_active(arc, fit, term).min(SCORE_ARC_MAX);
        self.arcs.iter().zip(&level.fits).map(one).sum()
    }

    /// Rms beyond which an arc is called unexplained, m. What is unlisted grows with the length of the arc.
    pub fn rms_max_m(&self) -> f64 {
        let longest_s = self.arcs.iter().map(|arc| arc.t_s[arc.fitted - 1] - arc.t_s[0]).fold(0.0, f64::max);
        EXCESS_MAX * 3f64.sqrt() * self.sigma_m * (longest_s / EXCESS_SPAN_S).max(1.0)
    }

    /// Median over the arcs of the rms that the fit leaves, m.
    pub fn median_rms_m(&self, level: &Level) -> f64 {
        median(self.arcs.iter().zip(&level.fits).map(|(arc, fit)| fit.rms_m(0..arc.fitted)))
    }

    /// Median over the arcs of the rms of the prediction, m, where anything is left to predict.
    pub fn median_predicted_m(&self, level: &Level) -> Option<f64> {
        let each: Vec<f64> = self.arcs.iter().zip(&level.fits).filter_map(|(arc, fit)| predicted_m(arc, fit)).collect();
        (!each.is_empty()).then(|| median(each))
    }
}

/// How many velocity steps the arcs have in a level.
fn kicks(level: &Level) -> Vec<usize> {
    level.fits.iter().map(|fit| fit.impulses.len()).collect()
}

/// Rms of an arc's prediction beyond its fit, m.
pub fn predicted_m(arc: &Arc, fit: &ArcFit) -> Option<f64> {
    (arc.fitted < arc.t_s.len()).then(|| fit.rms_m(arc.fitted..arc.t_s.len()))
}

/// Times by which a prediction beyond the fit may be worse with a term that is named: a push that is there makes it better, and one that is
/// small may by chance not.
const WORSE_MAX: f64 = 1.5;

/// Whether an arc is no worse predicted beyond its fit with a term than without it, where it goes on beyond.
pub fn no_worse_foretold(arc: &Arc, without_and_with: [&ArcFit; 2]) -> bool {
    match without_and_with.map(|fit| predicted_m(arc, fit)) {
        [Some(without_m), Some(with_m)] => with_m <= WORSE_MAX * without_m,
        _ => true,
    }
}

/// A baseline with one more term: known, or estimated with each satellite.
pub fn with(baseline: &Baseline, term: Term) -> Baseline {
    let mut more = baseline.clone();
    match term {
        Term::DegreesFrom(_) => more.degree = usize::MAX,
        _ if term.is_known_size() => more.known.push(term),
        _ => more.estimated.push(term),
    }
    more
}

/// Residuals and columns of the fitted epochs, with the state and the active terms projected out.
struct Projected {
    residual: DVector<f64>,
    columns: DMatrix<f64>,
    unknowns: usize,
}

fn rows_of(arc: &Arc, fit: &ArcFit, keep: impl Fn(Term) -> bool, wanted: Term) -> Projected {
    let rows = 3 * arc.fitted;
    let all = fit.partials.rows(0, rows);
    let base = fit.fitted_columns(keep);
    let of_wanted: Vec<usize> =
        fit.columns.iter().enumerate().filter(|(_, (term, _))| *term == wanted).map(|(j, _)| 6 + j).collect();
    let mut design = all.select_columns(&base);
    for mut column in design.column_iter_mut() {
        let norm = column.norm().max(1e-300);
        column /= norm;
    }
    let q = design.qr().q();
    let residual = residual(arc, fit);
    let columns = all.select_columns(&of_wanted);
    let residual = &residual - &q * q.tr_mul(&residual);
    let columns = &columns - &q * q.tr_mul(&columns);
    Projected { residual, columns, unknowns: base.len() }
}

/// Rms that an arc would keep with a term, by the term's columns, m.
pub(super) fn left_with_m(arc: &Arc, fit: &ArcFit, term: Term) -> f64 {
    let projected = rows_of(arc, fit, |_| true, term);
    let left = match super::arc::solve(&projected.columns, &projected.residual) {
        Some(step) => (&projected.residual - &projected.columns * step).norm_squared(),
        None => projected.residual.norm_squared(),
    };
    (left / arc.fitted as f64).sqrt()
}

/// What the whole of a term would leave in an arc beside what is fitted, rms, m.
pub(super) fn projected_rms_m(arc: &Arc, fit: &ArcFit, term: Term) -> f64 {
    let columns = rows_of(arc, fit, |_| true, term).columns;
    (columns.column_sum().norm_squared() / arc.fitted as f64).sqrt()
}

/// Observed minus computed of the fitted epochs, one column.
pub(super) fn residual(arc: &Arc, fit: &ArcFit) -> DVector<f64> {
    DVector::from_iterator(3 * arc.fitted, fit.residuals_m[..arc.fitted].iter().flat_map(|r| [r.x, r.y, r.z]))
}

/// Covariance of the unknowns in some columns of a fit, the residuals' memory included.
pub(super) fn covariance(problem: &Problem, arc: &Arc, fit: &ArcFit, used: &[usize]) -> Option<DMatrix<f64>> {
    let design = fit.partials.rows(0, 3 * arc.fitted).select_columns(used);
    let norms: Vec<f64> = design.column_iter().map(|c| c.norm().max(1e-300)).collect();
    let scaled = DMatrix::from_fn(design.nrows(), design.ncols(), |i, j| design[(i, j)] / norms[j]);
    let inverse = scaled.tr_mul(&scaled).try_inverse()?;
    let left = residual(arc, fit);
    let variance = variance(problem, &left, used.len() as f64);
    Some(DMatrix::from_fn(used.len(), used.len(), |i, j| variance * inverse[(i, j)] / (norms[i] * norms[j])))
}

/// Variance of a residual coordinate times the memory of the series. The stated accuracy is a floor: residuals below it
/// are luck, or a filter's smoothing.
fn variance(problem: &Problem, left: &DVector<f64>, unknowns: f64) -> f64 {
    let component = |axis: usize| left.iter().skip(axis).step_by(3).copied().collect::<Vec<f64>>();
    let red = memory(&[component(0), component(1), component(2)]);
    let floor = 0.25 * problem.sigma_m * problem.sigma_m;
    (left.norm_squared() / (left.len() as f64 - unknowns).max(1.0)).max(floor) * red
}

pub(super) fn independent(residual: &DVector<f64>, unknowns: usize) -> f64 {
    let component = |axis: usize| residual.iter().skip(axis).step_by(3).copied().collect::<Vec<f64>>();
    let n = residual.len() as f64 / memory(&[component(0), component(1), component(2)]);
    n.max(unknowns as f64 + 6.0)
}

/// Most drag that is believed, in that of a satellite of 0.01 m^2/kg: a balloon of a square metre a kilogram has it.
const DRAG_MOST: f64 = 100.0;

/// Evidence for a candidate in one arc. A term of known size is tried at that size, and pays for no parameter.
pub fn evidence(arc: &Arc, fit: &ArcFit, term: Term) -> f64 {
    let projected = rows_of(arc, fit, |_| true, term);
    let before = projected.residual.norm_squared();
    let (after, price) = if term.is_known_size() {
        (&projected.residual - projected.columns.column_sum(), 0.0)
    } else {
        let Some(step) = super::arc::solve(&projected.columns, &projected.residual) else { return 0.0 };
        // Air never pushes, and no satellite is so light; sunlight never pulls.
        let believed = match term {
            Term::Drag => (0.0..DRAG_MOST).contains(&step[0]),
            Term::SolarRadiation => step[0] >= 0.0,
            _ => true,
        };
        if !believed {
            return 0.0;
        }
        (&projected.residual - &projected.columns * step, projected.columns.ncols() as f64)
    };
    let n = independent(&after, projected.unknowns);
    n * (before / after.norm_squared().max(1e-300)).ln() - price * n.ln()
}

fn evidence_for_active(arc: &Arc, fit: &ArcFit, term: Term) -> f64 {
    let Some(value) = fit.coefficient(term) else { return 0.0 };
    let projected = rows_of(arc, fit, |t| t != term, term);
    let scaled = DVector::from_iterator(
        projected.columns.ncols(),
        value.iter().take(projected.columns.ncols()).map(|v| v / term.scale()),
    );
    let n = independent(&projected.residual, projected.unknowns);
    let without = (&projected.residual + &projected.columns * scaled).norm_squared();
    let k = projected.columns.ncols() as f64;
    n * (without / projected.residual.norm_squared().max(1e-300)).ln() - k * n.ln()
}

/// Estimates of a term's coefficients in one arc, jointly with the state and all active terms. For a term of known size
/// that is in the model already, the estimate is of its fraction.
pub fn estimates(problem: &Problem, level: &Level, i: usize, term: Term) -> Vec<Estimate> {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    let own;
    let fit = if fit.columns.iter().any(|(t, _)| *t == term) {
        fit
    } else {
        own = arc.fit(&problem.environment, &level.baseline, &level.baseline.estimated, &[term], Some(fit));
        &own
    };
    let projected = rows_of(arc, fit, |t| t != term, term);
    let k = projected.columns.ncols();
    let start: Vec<f64> = match fit.coefficient(term) {
        Some(value) => value.iter().take(k).map(|v| v / term.scale()).collect(),
        None if is_in(&level.baseline, term) => vec![1.0; k],
        None => vec![0.0; k],
    };
    let normal = projected.columns.tr_mul(&projected.columns);
    let (Some(step), Some(inverse)) =
        (super::arc::solve(&projected.columns, &projected.residual), normal.try_inverse())
    else {
        return Vec::new();
    };
    let left = &projected.residual - &projected.columns * &step;
    let variance = variance(problem, &left, (projected.unknowns + k) as f64);
    let systematic = if term.is_known_size() { UNLISTED_M_S2 / size_m_s2(problem, arc, term) } else { 0.0 };
    let one = |j: usize| Estimate {
        value: (start[j] + step[j]) * term.scale(),
        sigma: ((variance * inverse[(j, j)]).max(0.0) * term.scale().powi(2) + systematic * systematic).sqrt(),
    };
    (0..k).map(one).collect()
}

/// Rms of a term's acceleration along an arc.
fn size_m_s2(problem: &Problem, arc: &Arc, term: Term) -> f64 {
    let stride = (arc.fitted / 24).max(1);
    let at = |i: usize| {
        let state = State { r: arc.observed_m[i], v: Vector3::zeros() };
        Moment::new(&problem.environment, arc.t_s[i], &state).columns(&problem.environment, term)[0].norm_squared()
    };
    let sizes: Vec<f64> = (0..arc.fitted).step_by(stride).map(at).collect();
    (sizes.iter().sum::<f64>() / sizes.len().max(1) as f64).sqrt().max(1e-300)
}

fn is_in(baseline: &Baseline, term: Term) -> bool {
    match term {
        Term::DegreesFrom(from) => baseline.degree >= from,
        _ => baseline.known.contains(&term),
    }
}
