//! A velocity step of one satellite: looked for at every epoch by the columns it would have, then fitted with its instant.
//!
//! It belongs to one arc and is no common cause. It is claimed only where it leaves what the stated accuracy allows, and is
//! larger than what an unlisted push gains over the arc, or leaves nothing else: four free numbers take something off any odd arc. Not here: terms that push all the time (`search`).

use nalgebra::{DMatrix, DVector, Matrix6, Vector3};

use super::arc::{Arc, ArcFit, Impulse, solve};
use super::search::{Level, Problem, SCORE_MIN, UNLISTED_M_S2, covariance, independent, residual};
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
}

/// The level with velocity steps in the arcs that ask for one beyond what the best common term gives them (`rivals`: rms
/// that each arc would keep with it), or nothing.
pub fn step(problem: &Problem, level: &Level, rivals: &[f64]) -> Option<Level> {
    let mut next = level.clone();
    let mut any = false;
    for (i, arc) in problem.arcs.iter().enumerate() {
        let fit = &level.fits[i];
        let was = fit.rms_m(0..arc.fitted);
        if fit.impulse.is_some() || was <= problem.rms_max_m() || rivals[i] <= problem.rms_max_m() {
            continue;
        }
        let Some(tried) = fitted(problem, level, i) else { continue };
        let is = tried.rms_m(0..arc.fitted);
        let small = tried.impulse.is_none_or(|impulse| impulse.dv_m_s.norm() < least_m_s(arc));
        // What leaves nothing but the stated error of so much more is no push that lasts, however small.
        let clean = is <= CLEAN * 3f64.sqrt() * problem.sigma_m && is < CLEAN_LEFT * was;
        if (small && !clean) || is > LEFT_MAX * was {
            continue;
        }
        let enough = is <= problem.rms_max_m() || (is < PROVISIONAL * was && is < PROVISIONAL * rivals[i]);
        if enough && score(arc, &tried, [was, is]) > SCORE_MIN {
            next.fits[i] = tried;
            any = true;
        }
    }
    any.then_some(next)
}

/// Take out the velocity steps that did not leave what the stated accuracy allows in the end.
pub fn unproven(problem: &Problem, level: &Level) -> Vec<usize> {
    let odd = |i: &usize| {
        let (arc, fit) = (&problem.arcs[*i], &level.fits[*i]);
        fit.impulse.is_some() && fit.rms_m(0..arc.fitted) > problem.rms_max_m()
    };
    (0..problem.arcs.len()).filter(odd).collect()
}

/// What was found, with the errors of the last level.
pub fn found(problem: &Problem, level: &Level) -> Vec<Manoeuvre> {
    (0..problem.arcs.len()).filter_map(|i| described(problem, level, i)).collect()
}

/// Smallest velocity step that can be claimed in an arc, m/s.
fn least_m_s(arc: &Arc) -> f64 {
    UNLISTED_TIMES * UNLISTED_M_S2 * (arc.t_s[arc.fitted - 1] - arc.t_s[0])
}

fn score(arc: &Arc, with: &ArcFit, [was, is]: [f64; 2]) -> f64 {
    let n = independent(&residual(arc, with), 6);
    let tried = arc.fitted as f64;
    2.0 * n * (was / is.max(1e-300)).ln() - UNKNOWNS * n.ln() - 2.0 * tried.ln()
}

/// The best instant among the epochs by linear columns, then a full fit from there.
fn fitted(problem: &Problem, level: &Level, i: usize) -> Option<ArcFit> {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    if arc.fitted < 2 * EDGE_EPOCHS + 8 {
        return None;
    }
    let active: usize = fit.coefficients.iter().map(|(term, _)| term.parameters().len()).sum();
    let mut base = fit.partials.view((0, 0), (3 * arc.fitted, 6 + active)).into_owned();
    for mut column in base.column_iter_mut() {
        let norm = column.norm().max(1e-300);
        column /= norm;
    }
    let q = base.qr().q();
    let y = residual(arc, fit);
    let y = &y - &q * q.tr_mul(&y);
    let tried = (EDGE_EPOCHS..arc.fitted - EDGE_EPOCHS).filter_map(|k| {
        let columns = columns(arc, fit, k)?;
        let columns = &columns - &q * q.tr_mul(&columns);
        let step = solve(&columns, &y)?;
        let left = (&y - columns * &step).norm_squared();
        Some((k, step, left))
    });
    let (k, step, left) = tried.min_by(|a, b| a.2.total_cmp(&b.2))?;
    // Linear columns see an orbit that is still bent to the step: only what is far from enough is turned away here.
    if left > 0.25 * y.norm_squared() {
        return None;
    }
    let mut from = fit.clone();
    // Half a spacing before the epoch: the instant is free on both sides.
    let at_s = 0.5 * (arc.t_s[k] + arc.t_s[k - 1]);
    from.impulse = Some(Impulse { at_s, dv_m_s: Vector3::new(step[0], step[1], step[2]) });
    Some(problem.fit_arc(arc, &level.baseline, Some(&from)))
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

fn described(problem: &Problem, level: &Level, i: usize) -> Option<Manoeuvre> {
    let (arc, fit) = (&problem.arcs[i], &level.fits[i]);
    let impulse = fit.impulse?;
    let mut bare = fit.clone();
    bare.impulse = None;
    let without = problem.fit_arc(arc, &level.baseline, Some(&bare));
    let rms_m = [without.rms_m(0..arc.fitted), fit.rms_m(0..arc.fitted)];
    let active: usize = fit.coefficients.iter().map(|(term, _)| term.parameters().len()).sum();
    let last = fit.partials.ncols() - 4;
    let used: Vec<usize> = (0..6 + active).chain(last..last + 4).collect();
    let covariance = covariance(problem, arc, fit, &used)?;
    let of = |direction: &Vector3<f64>| {
        let mut weights = DVector::zeros(used.len());
        for axis in 0..3 {
            weights[6 + active + axis] = direction[axis];
        }
        (impulse.dv_m_s.dot(direction), weights.dot(&(&covariance * &weights)).max(0.0).sqrt())
    };
    let at = 6 + active + 3;
    let at_sigma_s = covariance[(at, at)].max(0.0).sqrt();
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
    Some(Manoeuvre {
        arc: i,
        impulse,
        dv_m_s: of(&impulse.dv_m_s.normalize()),
        rtn_m_s: [0, 1, 2].map(turned),
        at_sigma_s,
        score: score(arc, fit, rms_m),
        rms_m,
    })
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
