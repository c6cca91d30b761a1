//! The fitted set: parameters with their joint covariance.
//!
//! The covariance is that of the linearised joint fit, coefficients and nonlinear parameters together, at the fitted noise.

mod time_constant;

use nalgebra::{DMatrix, DVector};

use super::axes;
use super::catalogue::{Effect, Shape};
use super::design::{Column, Frame, Raw};
use super::scene::{Axes, Scene};
use super::search::{Entry, Family, Set};

/// Standard error of a time that is taken from the log, s: it is kept by people.
const LOG_S: f64 = 1.0;

/// A fitted number.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// Name.
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub sigma: f64,
    /// Unit.
    pub unit: &'static str,
}

/// A member's numbers.
#[derive(Debug, Clone, Default)]
pub struct MemberFit {
    /// Numbers, nonlinear ones first.
    pub parameters: Vec<Fitted>,
    /// The axis of a scale factor.
    pub axis: Option<String>,
}

/// Parameters of every member, the errors multiplied by `inflation`.
pub fn parameters(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set, inflation: f64) -> Vec<MemberFit> {
    let (mean, linear_covariance) = set.coefficients(frame, entries);
    let onsets = onsets(scene, frame, entries, set);
    let mut joint = joint_covariance(scene, frame, entries, set).unwrap_or_else(|| linear_covariance.clone());
    for k in 0..mean.len() {
        let moved: f64 = onsets.iter().flatten().map(|onset| onset.moves[k]).sum();
        joint[(k, k)] = joint[(k, k)].max(linear_covariance[(k, k)] + moved);
    }
    let mut next = 0;
    let mut theta_next = mean.len();
    let mut out = Vec::new();
    for m in &set.members {
        let mut fit = MemberFit::default();
        let Family::Listed(effect) = entries[m.entry].family else {
            for k in 0..m.linear() {
                fit.parameters.push(Fitted {
                    name: "amplitude_ng",
                    value: mean[next + k],
                    sigma: joint[(next + k, next + k)].max(0.0).sqrt() * inflation,
                    unit: "ng",
                });
            }
            next += m.linear();
            out.push(fit);
            continue;
        };
        let first_theta = theta_next;
        for (j, p) in effect.nonlinear.iter().enumerate() {
            if p.name == "axis" {
                fit.axis = Some(["x", "y", "z"][m.theta[j] as usize].to_string());
                continue;
            }
            let sigma = if p.step > 0.0 {
                theta_next += 1;
                // Not finite where a step changes nothing, as for an onset in a hole of the record.
                let curvature = joint.get((theta_next - 1, theta_next - 1)).map(|v| v.max(0.0).sqrt());
                let sigma = curvature.filter(|s| s.is_finite()).unwrap_or(m.theta_sigma[j]);
                // Of several peaks the joint fit sees the curvature of one.
                let sigma = if p.atom.is_some() { sigma.max(m.theta_sigma[j]) } else { sigma };
                sigma * inflation
            } else {
                LOG_S
            };
            let sigma = match &onsets[out.len()] {
                Some(onset) if p.name == "onset_s" => {
                    let scanned = onset.sigma_s * inflation;
                    sigma.min(3.0 * scanned).max(scanned)
                }
                _ => sigma,
            };
            let value = if p.log { m.theta[j].exp() } else { m.theta[j] };
            let sigma = if p.log {
                let follow = follows(&joint, theta_next - 1, first_theta..first_theta + free_of(effect));
                let place = (out.len(), effect, j);
                let scanned =
                    time_constant::error(scene, frame, entries, set, place, (sigma / inflation, follow)).unwrap_or(0.0);
                (value * sigma).max(scanned * inflation)
            } else {
                sigma
            };
            fit.parameters.push(Fitted { name: p.name, value, sigma, unit: p.unit });
        }
        for (k, l) in effect.linear.iter().enumerate().take(m.linear()) {
            fit.parameters.push(Fitted {
                name: l.name,
                value: mean[next + k],
                sigma: joint[(next + k, next + k)].max(0.0).sqrt() * inflation,
                unit: l.unit,
            });
        }
        next += m.linear();
        out.push(fit);
    }
    out
}

/// How many nonlinear numbers of an effect are fitted.
fn free_of(effect: &Effect) -> usize {
    effect.nonlinear.iter().filter(|p| p.step > 0.0).count()
}

/// By how much the other fitted number of a member moves with the one in this row of the covariance; 0 without another.
fn follows(joint: &DMatrix<f64>, row: usize, of_member: std::ops::Range<usize>) -> f64 {
    let slope = |other: usize| Some(joint.get((other, row))? / joint.get((row, row))?);
    of_member.filter(|other| *other != row).find_map(slope).filter(|slope| slope.is_finite()).unwrap_or(0.0)
}

/// Half width of the scan of an onset's posterior, s, and its steps to either side. While the posterior is not low at an end of
/// the scan it is made again twice as wide: an onset inside a hole of the record lies anywhere in it.
const ONSET_SCAN_S: f64 = 600.0;
const ONSET_SCAN_STEPS: i32 = 30;
const ONSET_SCANS: i32 = 7;
/// Half width of the closest scan, s.
const ONSET_FINEST_S: f64 = 1.0;
/// Log posterior below its top that counts as low.
const ONSET_LOW: f64 = 5.0;

/// Errors of onsets beyond which sizes no longer follow them along a straight line, s: a window and its neighbour.
const ONSET_STRAIGHT_S: f64 = 50.0;
/// Onsets looked at for that, of a scan.
const ONSET_LOOKS: usize = 15;

/// What the posterior of an onset says.
struct Onset {
    /// Standard error about the fitted value.
    sigma_s: f64,
    /// By how much it moves the coefficients of the set, mean squares about their fitted values: a push that began anywhere in a hole of
    /// the record had any size that dies down to what is seen after it.
    moves: Vec<f64>,
}

/// Of every member, where its onset is fitted.
fn onsets(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set) -> Vec<Option<Onset>> {
    let is_fitted = |effect: &Effect| effect.nonlinear.first().is_some_and(|p| p.name == "onset_s" && p.step > 0.0);
    let one = |i: usize| match entries[set.members[i].entry].family {
        Family::Listed(effect) if is_fitted(effect) => Some(onset(scene, frame, entries, set, (i, effect))),
        _ => None,
    };
    (0..set.members.len()).map(one).collect()
}

/// The onset of member `i`, from its posterior: one window more or less can decide, so that the curvature at the peak says too little.
fn onset(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set, (i, effect): (usize, &Effect)) -> Onset {
    let others = set.without(i);
    let chosen = others.chosen(frame);
    let sizes = set.members[i].sizes(entries);
    let gain_at = |shift: f64| {
        let mut theta = set.members[i].theta;
        theta[0] += shift;
        let raws = (effect.signature)(scene, &theta)?.columns();
        let columns: Vec<Column> = raws.iter().zip(&sizes).map(|(raw, size)| frame.column(raw, *size)).collect();
        Some(chosen.gain(&columns))
    };
    // Posterior over the scan, its spread about the fit, and whether it is low at both ends.
    let scan = |half_width_s: f64| {
        let step = half_width_s / f64::from(ONSET_SCAN_STEPS);
        let posterior: Vec<(f64, f64)> = (-ONSET_SCAN_STEPS..=ONSET_SCAN_STEPS)
            .map(|s| f64::from(s) * step)
            .filter_map(|shift| Some((shift, gain_at(shift)?)))
            .collect();
        let top = posterior.iter().map(|s| s.1).fold(f64::NEG_INFINITY, f64::max);
        let weight: f64 = posterior.iter().map(|s| (s.1 - top).exp()).sum();
        let squares: f64 = posterior.iter().map(|s| s.0 * s.0 * (s.1 - top).exp()).sum();
        let low = |end: Option<&(f64, f64)>| end.is_none_or(|s| s.1 < top - ONSET_LOW);
        let sigma = if weight > 0.0 { (squares / weight).sqrt() } else { 0.0 };
        let enough = low(posterior.first()) && low(posterior.last());
        let likely = posterior.into_iter().filter(|s| s.1 > top - ONSET_LOW).map(|(s, gain)| (s, (gain - top).exp()));
        (sigma, enough, likely.collect::<Vec<(f64, f64)>>())
    };
    let mut half_width_s = ONSET_SCAN_S;
    let (mut sigma, mut enough, mut likely) = scan(half_width_s);
    for _ in 1..ONSET_SCANS {
        if enough {
            break;
        }
        half_width_s *= 2.0;
        (sigma, enough, likely) = scan(half_width_s);
    }
    if sigma > ONSET_STRAIGHT_S {
        return Onset { sigma_s: sigma, moves: moves(scene, frame, entries, set, i, &likely) };
    }
    // A posterior between two steps of the scan is looked at more closely.
    while sigma < half_width_s / f64::from(ONSET_SCAN_STEPS) && half_width_s > ONSET_FINEST_S {
        half_width_s *= 3.0 / f64::from(ONSET_SCAN_STEPS);
        sigma = scan(half_width_s).0;
    }
    let coefficients = set.members.iter().map(|m| m.linear()).sum();
    Onset { sigma_s: sigma, moves: vec![0.0; coefficients] }
}

/// Mean squares by which the coefficients of a set move with the onset of member `i`; `likely` are its shifts and their weights.
fn moves(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set, i: usize, likely: &[(f64, f64)]) -> Vec<f64> {
    let (fitted, _) = set.coefficients(frame, entries);
    let mut squares = DVector::zeros(fitted.len());
    let mut total = 0.0;
    for (shift, weight) in likely.iter().step_by(likely.len().div_ceil(ONSET_LOOKS)) {
        let mut moved = set.clone();
        moved.members[i].theta[0] += shift;
        moved.rewhiten(scene, frame, entries);
        let away = moved.coefficients(frame, entries).0 - &fitted;
        squares += away.component_mul(&away) * *weight;
        total += weight;
    }
    if total > 0.0 { (squares / total).iter().copied().collect() } else { vec![0.0; fitted.len()] }
}

/// Covariance of all coefficients, then of all free nonlinear parameters, from the linearised joint fit.
fn joint_covariance(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set) -> Option<DMatrix<f64>> {
    let mut columns: Vec<Column> = Vec::new();
    let mut prior: Vec<f64> = Vec::new();
    let (mean, linear) = set.coefficients(frame, entries);
    for m in &set.members {
        let entry = &entries[m.entry];
        let first = columns.len();
        let raws = match entry.family {
            Family::Listed(Effect { exact_at: Some(exact_at), signature, .. }) => {
                let fitted = || (first..first + m.linear()).map(|k| (mean[k], linear[(k, k)].max(1e-12).sqrt()));
                derivatives(&fitted().collect::<Vec<_>>(), |at| (signature)(scene, &exact_at(at)))?
            }
            _ => entry_columns(scene, entry, &m.theta)?,
        };
        for k in 0..m.linear() {
            columns.push(frame.column(&raws[m.axis.unwrap_or(k)], 1.0));
            prior.push((m.scale * entry.sizes[m.axis.unwrap_or(k)]).powi(-2));
        }
    }
    for (i, m) in set.members.iter().enumerate() {
        let Family::Listed(effect) = entries[m.entry].family else { continue };
        for (j, p) in effect.nonlinear.iter().enumerate().filter(|(_, p)| p.step > 0.0) {
            let h = (0.5 * m.theta_sigma[j]).clamp(0.01 * p.step, 2.0 * p.step);
            let at = |sign: f64| {
                let mut moved = set.clone();
                moved.members[i].theta[j] += sign * h;
                member_series(scene, frame, entries, set, &moved, i)
            };
            let (high, low) = (at(1.0), at(-1.0));
            let (high, low, span) = match (high, low) {
                (Some(high), Some(low)) => (high, low, 2.0 * h),
                (Some(high), None) => (high, member_series(scene, frame, entries, set, set, i)?, h),
                (None, Some(low)) => (member_series(scene, frame, entries, set, set, i)?, low, h),
                (None, None) => return None,
            };
            let slope =
                std::array::from_fn(|k| Some(high[k].iter().zip(&low[k]).map(|(a, b)| (a - b) / span).collect()));
            columns.push(frame.column(&slope, 1.0));
            prior.push(0.0);
        }
    }
    let n = columns.len();
    let a = DMatrix::from_fn(n, n, |i, j| columns[i].dot(&columns[j]) + if i == j { prior[i] } else { 0.0 });
    // Scaled to unit diagonal before inversion: the units span twelve orders.
    let scale = DVector::from_iterator(n, (0..n).map(|i| a[(i, i)].max(1e-300).sqrt().recip()));
    let scaled = DMatrix::from_fn(n, n, |i, j| a[(i, j)] * scale[i] * scale[j]);
    let inverse = (scaled + DMatrix::identity(n, n) * 1e-9).try_inverse()?;
    Some(DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

/// Derivatives of a series that is only nearly linear in its coefficients, from a standard error below each of them to one above;
/// `signature` gives the columns that are exact at coefficients.
fn derivatives(fitted: &[(f64, f64)], signature: impl Fn(&[f64]) -> Option<Shape>) -> Option<Vec<Raw>> {
    let series = |k: usize, sign: f64| -> Option<Raw> {
        let mut at: Vec<f64> = fitted.iter().map(|(value, _)| *value).collect();
        at[k] += sign * fitted[k].1;
        let columns = signature(&at)?.columns();
        let sum = |axis: usize| {
            let parts: Vec<(&f64, &Vec<f64>)> =
                at.iter().zip(&columns).filter_map(|(a, c)| Some((a, c[axis].as_ref()?))).collect();
            let windows = parts.first()?.1.len();
            Some((0..windows).map(|i| parts.iter().map(|(a, c)| *a * c[i]).sum()).collect())
        };
        Some(std::array::from_fn(sum))
    };
    (0..fitted.len())
        .map(|k| {
            let (high, low) = (series(k, 1.0)?, series(k, -1.0)?);
            let difference = |(high, low): (Vec<f64>, Vec<f64>)| -> Vec<f64> {
                high.iter().zip(&low).map(|(a, b)| (a - b) / (2.0 * fitted[k].1)).collect()
            };
            let [x, y, z] = std::array::from_fn(|axis| Some(difference((high[axis].clone()?, low[axis].clone()?))));
            Some([x, y, z])
        })
        .collect()
}

/// The columns of an entry at values of its nonlinear parameters, before whitening.
pub fn entry_columns(scene: &Scene, entry: &Entry, theta: &super::catalogue::Theta) -> Option<Vec<Raw>> {
    match entry.family {
        Family::Listed(effect) => (effect.signature)(scene, theta).map(|s| s.columns()),
        Family::Open(_) => entry.points.get(theta[0] as usize).map(|(_, shape)| shape.columns()),
    }
}

/// Series of member `i` of `moved`, with the coefficients of `set`.
fn member_series(scene: &Scene, frame: &Frame, entries: &[Entry], set: &Set, moved: &Set, i: usize) -> Option<Axes> {
    let (mean, _) = set.coefficients(frame, entries);
    let first: usize = set.members[..i].iter().map(|m| m.linear()).sum();
    let m = &moved.members[i];
    let columns = entry_columns(scene, &entries[m.entry], &m.theta)?;
    let mut sum = axes::nothing(scene.schedule.len());
    for j in 0..m.linear().max(1) {
        let factor = if m.linear() == 0 { 1.0 } else { mean[first + j] };
        axes::add_regressor_and_flips(&mut sum, &columns[m.axis.unwrap_or(j)], factor);
    }
    Some(sum)
}
