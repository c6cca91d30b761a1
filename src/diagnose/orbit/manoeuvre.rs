//! Velocity steps of one satellite, one to three: looked for at every epoch by the columns they would have, then fitted with their instants.
//!
//! It belongs to one arc and is no common cause. It is claimed only where it leaves what the stated accuracy allows, and is
//! larger than what an unlisted push gains over the arc, or leaves nothing else: four free numbers take something off any odd arc. Not here: terms that push all the time (`search`).

use nalgebra::{DMatrix, DVector, Matrix6, Vector3};

use super::arc::{Arc, ArcFit, Impulse, solve};
use super::forces::Term;
use super::search::{Level, Problem, SCORE_MIN, UNLISTED_M_S2, covariance, independent, left_with_m, residual};
use super::unlisted::pushes;
use crate::physics::earth_orientation::lagrange_weights;

/// Epochs at either end of an arc between which an instant is looked for.
const EDGE_EPOCHS: usize = 4;
/// A velocity step taken before all common terms are known must leave less than this part of the rms.
const PROVISIONAL: f64 = 0.1;
/// In any case what one arc has for itself must leave less than this part.
pub(super) const LEFT_MAX: f64 = 0.2;
/// A step is told from an unlisted push that lasts when it is this many times what such a push gains over the arc.
const UNLISTED_TIMES: f64 = 10.0;
/// One that is smaller must leave the stated accuracy, but for this factor, and less than this part of the rms.
const CLEAN: f64 = 1.5;
const CLEAN_LEFT: f64 = 0.05;
/// Most steps that one arc can have.
const STEPS_MAX: usize = 3;
/// Places from which two are looked for.
const FIRST_PLACES: usize = 12;
/// Epochs by which two are apart at least.
const APART_EPOCHS: usize = 2;
/// Rounds in which each of several instants is looked for again beside the others.
const ROUNDS_MAX: usize = 6;
/// Two that leave less than this part of the squares say where an arc is odd.
const TOLD: f64 = 0.04;
/// A push that lasts and leaves no more than this times what velocity steps leave is likelier than they.
const AS_WELL: f64 = 1.1;
/// Unknowns of a velocity step.
const UNKNOWNS: f64 = 4.0;

/// One found.
#[derive(Debug, Clone)]
pub struct Manoeuvre {
    /// Place of its arc.
    pub arc: usize,
    /// The step.
    pub impulse: Impulse,
    /// Its size, m/s, with standard error.
    pub dv_m_s: (f64, f64),
    /// Along the radius, the track and the normal, m/s, with standard errors.
    pub rtn_m_s: [(f64, f64); 3],
    /// Standard error of its instant, s.
    pub at_sigma_s: f64,
    /// Evidence.
    pub score: f64,
    /// 3-D rms of the arc without it and with it, m.
    pub rms_m: [f64; 2],
    /// Whether the arc has others, which are in both of these.
    pub of_several: bool,
}

/// The level with velocity steps in the arcs that ask for one beyond what the best common term gives them (`rivals`: rms
/// that each arc would keep with it), or nothing.
pub fn step(problem: &Problem, level: &Level, rivals: &[f64]) -> Option<Level> {
    let mut next = level.clone();
    let mut any = false;
    for (i, arc) in problem.arcs.iter().enumerate() {
        let fit = &level.fits[i];
        let was = fit.rms_m(0..arc.fitted);
        if !fit.impulses.is_empty() || was <= problem.rms_max_m() || rivals[i] <= problem.rms_max_m() {
            continue;
        }
        let believed = |count: usize| {
            fitted(problem, level, i, count).filter(|tried| believe(problem, arc, tried, [was, rivals[i]]))
        };
        let is_push = |tried: &ArcFit| pushed_rms_m(problem, level, i) <= AS_WELL * tried.rms_m(0..arc.fitted);
        if let Some(tried) = (1..=STEPS_MAX).find_map(believed).filter(|tried| !is_push(tried)) {
            next.fits[i] = tried;
            any = true;
        }
    }
    any.then_some(next)
}

/// Rms that an arc would keep with the best push that lasts and that no catalogue has, by its columns, m.
fn pushed_rms_m(problem: &Problem, level: &Level, i: usize) -> f64 {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    let terms: Vec<Term> = pushes().map(Term::Unlisted).collect();
    let active = &level.baseline.estimated;
    let wide = arc.fit(&problem.environment, &level.baseline, active, &terms, Some(fit));
    terms.into_iter().map(|term| left_with_m(arc, &wide, term)).fold(f64::INFINITY, f64::min)
}

/// Whether velocity steps explain an arc that kept so much, and would with the best common term.
fn believe(problem: &Problem, arc: &Arc, tried: &ArcFit, [was, rival]: [f64; 2]) -> bool {
    let is = tried.rms_m(0..arc.fitted);
    let small = tried.impulses.iter().any(|impulse| impulse.dv_m_s.norm() < least_m_s(arc));
    // What leaves nothing but the stated error of so much more is no push that lasts, however small.
    let clean = is <= CLEAN * 3f64.sqrt() * problem.sigma_m && is < CLEAN_LEFT * was;
    // Of several small ones no push that changes could be told.
    let alone = tried.impulses.len() == 1;
    if (small && !(clean && alone)) || is > LEFT_MAX * was {
        return false;
    }
    // Several take much from anything: there they must leave what the stated accuracy allows.
    let provisional = alone && is < PROVISIONAL * was && is < PROVISIONAL * rival;
    (is <= problem.rms_max_m() || provisional) && score(arc, tried, tried.impulses.len(), [was, is]) > SCORE_MIN
}

/// Whether any arc has velocity steps that do not leave what the stated accuracy allows in the end, or one that it can do without.
pub fn has_unproven(problem: &Problem, level: &Level) -> bool {
    let odd = |i: usize| {
        let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
        let needless = || described(problem, level, i).iter().any(|one| one.score <= SCORE_MIN);
        !fit.impulses.is_empty() && (fit.rms_m(0..arc.fitted) > problem.rms_max_m() || needless())
    };
    (0..problem.arcs.len()).any(odd)
}

/// What was found, with the errors of the last level.
pub fn found(problem: &Problem, level: &Level) -> Vec<Manoeuvre> {
    (0..problem.arcs.len()).flat_map(|i| described(problem, level, i)).collect()
}

/// Smallest velocity step that can be claimed in an arc, m/s.
fn least_m_s(arc: &Arc) -> f64 {
    UNLISTED_TIMES * UNLISTED_M_S2 * (arc.t_s[arc.fitted - 1] - arc.t_s[0])
}

fn score(arc: &Arc, with: &ArcFit, steps: usize, [was, is]: [f64; 2]) -> f64 {
    let n = independent(&residual(arc, with), 6);
    let (tried, steps) = (arc.fitted as f64, steps as f64);
    2.0 * n * (was / is.max(1e-300)).ln() - steps * (UNKNOWNS * n.ln() + 2.0 * tried.ln())
}

/// The best instants among the epochs by linear columns, then a full fit from there.
fn fitted(problem: &Problem, level: &Level, i: usize, count: usize) -> Option<ArcFit> {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    if arc.fitted < 2 * EDGE_EPOCHS + 8 {
        return None;
    }
    let scan = Scan::new(arc, fit);
    let (places, left) = scan.best(count)?;
    // Linear columns see an orbit that is still bent to the steps: only what is far from enough is turned away here.
    if left > 0.25 * scan.residual.norm_squared() {
        return None;
    }
    let step = solve(&scan.joined(&places), &scan.residual)?;
    let mut from = fit.clone();
    let impulse = |(j, k): (usize, &usize)| Impulse {
        // Half a spacing before the epoch: the instant is free on both sides.
        at_s: 0.5 * (arc.t_s[*k] + arc.t_s[*k - 1]),
        dv_m_s: step.fixed_rows::<3>(3 * j).into_owned(),
    };
    from.impulses = places.iter().enumerate().map(impulse).collect();
    Some(problem.fit_arc(arc, &level.baseline, Some(&from)))
}

/// The span between two velocity steps that would take most off an odd arc, s, and what they would leave, m: where something is to be looked
/// for, whatever it is.
pub fn span(problem: &Problem, level: &Level, i: usize) -> Option<([f64; 2], f64)> {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    if arc.fitted < 2 * EDGE_EPOCHS + 8 || !fit.rms_m(0..arc.fitted).is_finite() {
        return None;
    }
    let scan = Scan::new(arc, fit);
    let (places, left) = scan.best(2)?;
    let left_m = (left / arc.fitted as f64).sqrt();
    (left < TOLD * scan.residual.norm_squared()).then(|| ([arc.t_s[places[0] - 1], arc.t_s[places[1]]], left_m))
}

/// An arc's residual, and the columns of a velocity step at each of its epochs, with all that is fitted projected out.
struct Scan {
    residual: DVector<f64>,
    columns: Vec<(usize, DMatrix<f64>)>,
}

impl Scan {
    fn new(arc: &Arc, fit: &ArcFit) -> Self {
        let active: usize = fit.coefficients.iter().map(|(term, _)| term.parameters().len()).sum();
        let base = fit.partials.view((0, 0), (3 * arc.fitted, 6 + active)).into_owned();
        let q = basis(base);
        let y = residual(arc, fit);
        let at = |k: usize| columns(arc, fit, k).map(|columns| (k, &columns - &q * q.tr_mul(&columns)));
        Self {
            residual: &y - &q * q.tr_mul(&y),
            columns: (EDGE_EPOCHS..arc.fitted - EDGE_EPOCHS).filter_map(at).collect(),
        }
    }

    fn joined(&self, places: &[usize]) -> DMatrix<f64> {
        let mut joined = DMatrix::zeros(self.residual.len(), 3 * places.len());
        for (j, place) in places.iter().enumerate() {
            if let Some((_, own)) = self.columns.iter().find(|(k, _)| k == place) {
                joined.columns_mut(3 * j, 3).copy_from(own);
            }
        }
        joined
    }

    /// The instant that leaves least beside steps at others, with the squares that it leaves.
    fn beside(&self, others: &[usize]) -> Option<(usize, f64)> {
        let q = (!others.is_empty()).then(|| basis(self.joined(others)));
        let without = |m: &DMatrix<f64>| q.as_ref().map_or_else(|| m.clone(), |q| m - q * q.tr_mul(m));
        let y = without(&DMatrix::from_column_slice(self.residual.len(), 1, self.residual.as_slice()))
            .column(0)
            .into_owned();
        let apart = |k: usize| others.iter().all(|other| k.abs_diff(*other) >= APART_EPOCHS);
        let tried = self.columns.iter().filter(|(k, _)| apart(*k)).filter_map(|(k, own)| {
            let own = without(own);
            let step = solve(&own, &y)?;
            Some((*k, (&y - own * step).norm_squared()))
        });
        tried.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The instants of some steps. Each is looked for beside the others in turns, two from many first places: the best of one alone may be
    /// between them.
    fn best(&self, count: usize) -> Option<(Vec<usize>, f64)> {
        let (alone, left) = self.beside(&[])?;
        match count {
            0 | 1 => Some((vec![alone], left)),
            2 => {
                let every = self.columns.len().div_ceil(FIRST_PLACES);
                let firsts = self.columns.iter().step_by(every).map(|(k, _)| *k).chain([alone]);
                let settled = firsts.filter_map(|first| self.settle(vec![first, self.beside(&[first])?.0]));
                settled.min_by(|a, b| a.1.total_cmp(&b.1))
            }
            _ => {
                let (mut places, _) = self.best(count - 1)?;
                places.push(self.beside(&places)?.0);
                self.settle(places)
            }
        }
    }

    /// Each place looked for again beside the others until none is better.
    fn settle(&self, mut places: Vec<usize>) -> Option<(Vec<usize>, f64)> {
        let mut least = f64::INFINITY;
        for _ in 0..ROUNDS_MAX {
            let before = least;
            for j in 0..places.len() {
                let others: Vec<usize> = (0..places.len()).filter(|i| *i != j).map(|i| places[i]).collect();
                let (k, left) = self.beside(&others)?;
                (places[j], least) = (k, left);
            }
            if least >= before {
                break;
            }
        }
        places.sort_unstable();
        Some((places, least))
    }
}

/// Orthonormal columns of the same space.
fn basis(mut columns: DMatrix<f64>) -> DMatrix<f64> {
    for mut column in columns.column_iter_mut() {
        let norm = column.norm().max(1e-300);
        column /= norm;
    }
    columns.qr().q()
}

/// Positions' columns of a velocity step at an epoch: Phi(t, t_k) = Phi(t, t_0) Phi(t_k, t_0)^-1.
fn columns(arc: &Arc, fit: &ArcFit, k: usize) -> Option<DMatrix<f64>> {
    let back: Matrix6<f64> = fit.transitions.get(k)?.try_inverse()?;
    let mut columns = DMatrix::zeros(3 * arc.fitted, 3);
    for i in k..arc.fitted {
        let carried = fit.transitions[i] * back;
        columns.view_mut((3 * i, 0), (3, 3)).copy_from(&carried.fixed_view::<3, 3>(0, 3));
    }
    Some(columns)
}

/// Directions of the radius and of the orbit's normal at an instant, from the positions about it.
fn radial_and_normal(t_s: &[f64], observed_m: &[Vector3<f64>], at_s: f64) -> [Vector3<f64>; 2] {
    const NODES: usize = 8;
    let n = t_s.len();
    let after = t_s.partition_point(|t| *t < at_s).clamp(1, n - 1);
    let first = after.saturating_sub(NODES / 2).min(n.saturating_sub(NODES));
    let near = first..(first + NODES).min(n);
    let nodes: Vec<f64> = t_s[near.clone()].iter().map(|t| t - at_s).collect();
    let weights = lagrange_weights(&nodes, 0.0);
    let position: Vector3<f64> = weights.iter().zip(&observed_m[near]).map(|(w, r)| r * *w).sum();
    [position.normalize(), observed_m[after - 1].cross(&observed_m[after]).normalize()]
}

fn described(problem: &Problem, level: &Level, i: usize) -> Vec<Manoeuvre> {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    if fit.impulses.is_empty() {
        return Vec::new();
    }
    let active: usize = fit.coefficients.iter().map(|(term, _)| term.parameters().len()).sum();
    let first = fit.partials.ncols() - 4 * fit.impulses.len();
    let used: Vec<usize> = (0..6 + active).chain(first..fit.partials.ncols()).collect();
    let Some(covariance) = covariance(problem, arc, fit, &used) else { return Vec::new() };
    let one = |(place, impulse): (usize, &Impulse)| {
        let mut without = fit.clone();
        without.impulses.remove(place);
        let without = problem.fit_arc(arc, &level.baseline, Some(&without));
        let rms_m = [without.rms_m(0..arc.fitted), fit.rms_m(0..arc.fitted)];
        let column = 6 + active + 4 * place;
        let of = |direction: &Vector3<f64>| {
            let mut weights = DVector::zeros(used.len());
            weights.fixed_rows_mut::<3>(column).copy_from(direction);
            (impulse.dv_m_s.dot(direction), weights.dot(&(&covariance * &weights)).max(0.0).sqrt())
        };
        let at_sigma_s = covariance[(column + 3, column + 3)].max(0.0).sqrt();
        let directions = |at_s: f64| {
            let [radial, normal] = radial_and_normal(&arc.t_s, &arc.observed_m, at_s);
            [radial, normal.cross(&radial), normal]
        };
        // The directions turn with the instant, which has an error as well.
        let [there, later] = [impulse.at_s, impulse.at_s + at_sigma_s].map(directions);
        let turned = |k: usize| {
            let (value, sigma) = of(&there[k]);
            (value, sigma.hypot(impulse.dv_m_s.dot(&(later[k] - there[k]))))
        };
        Manoeuvre {
            arc: i,
            impulse: *impulse,
            dv_m_s: of(&impulse.dv_m_s.normalize()),
            rtn_m_s: [0, 1, 2].map(turned),
            at_sigma_s,
            score: score(arc, fit, 1, rms_m),
            rms_m,
            of_several: fit.impulses.len() > 1,
        }
    };
    fit.impulses.iter().enumerate().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A satellite of the navigation systems moves an eighth of a radian between two of its positions.
    #[test]
    fn directions_are_those_of_the_instant_itself() {
        let rate_rad_s = 1.4585e-4;
        let at = |t: f64| 2.656e7 * Vector3::new((rate_rad_s * t).cos(), (rate_rad_s * t).sin(), 0.0);
        let t_s: Vec<f64> = (0..60).map(|i| 900.0 * f64::from(i)).collect();
        let observed_m: Vec<Vector3<f64>> = t_s.iter().map(|t| at(*t)).collect();
        for at_s in [40_000.0, 40_500.0, 900.0, 52_700.0] {
            let [radial, normal] = radial_and_normal(&t_s, &observed_m, at_s);
            assert!((radial - at(at_s).normalize()).norm() < 1e-6, "{at_s}: {radial}");
            assert!((normal - Vector3::z()).norm() < 1e-12, "{at_s}: {normal}");
        }
    }
}
