//! A calibrated sensor's series against what its simulation holds (a constant, as a rule): what it follows beside, axis by
//! axis, with controls in which nothing is expected.
//!
//! Everything is judged on block means, against a slow wander as the competitor (`red`): a wander agrees with any slow
//! covariate by chance. Standard errors count as many values as the residual has independent ones (its memory). Not here: orbits, poses.

pub mod read;
mod red;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use self::read::Series;
use crate::diagnose::answer::{Covariate, Located, Verdict};
use crate::diagnose::measured::answer::{
    ArcAnswer, Effect, Fit, HeldOut, Level, Limit, StepAnswer, parameter, posterior,
};
use crate::diagnose::measured::spread::{median, memory};
use crate::diagnose::measured::{Answer, MeasuredCase, MeasuredError};

/// Evidence needed to claim an effect, over red noise. A second gate follows: it must predict blocks that the fit has not
/// seen. Of 100 series of red noise at most one passes both (`series::tests`); rarer false alarms are not shown.
const SCORE_MIN: f64 = 18.0;
/// A late response must beat the immediate one by this much: its time constant was looked for.
const LATE_MARGIN: f64 = 18.0;
/// Time constants tried for a late response, s.
const LAGS_S: [f64; 7] = [0.0, 300.0, 900.0, 1_800.0, 3_600.0, 7_200.0, 14_400.0];
/// Held-out prediction leaves out blocks of this length in turn, s.
const HELD_OUT_S: f64 = 6.0 * 3600.0;
/// What stays is worth saying when it is this many times the scatter from one block to the next.
const LEFT_FACTOR: f64 = 3.0;
const STEPS_MAX: usize = 4;

/// An effect a sensor's series may show.
#[derive(Debug, Clone, PartialEq)]
pub enum Follows {
    /// A temperature (index of the covariate), late by a time constant.
    Temperature(usize, f64),
    /// Exponential decay with this time constant from the start of the data.
    Drift(f64),
    /// A step at this time.
    Step(f64),
}

impl Follows {
    /// The catalogue's name.
    pub fn id(&self) -> &'static str {
        match self {
            Self::Temperature(..) => "temperature_bias",
            Self::Drift(_) => "bias_drift",
            Self::Step(_) => "bias_step",
        }
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Temperature(..) => "Bias follows temperature",
            Self::Drift(_) => "Bias decays",
            Self::Step(_) => "Bias steps",
        }
    }

    fn regressor(&self, series: &Series) -> Vec<f64> {
        match self {
            Self::Temperature(k, lag_s) => late(&series.t_s, &series.covariates[*k].values, *lag_s),
            Self::Drift(tau_s) => series.t_s.iter().map(|t| (-(t - series.t_s[0]) / tau_s).exp()).collect(),
            Self::Step(at_s) => series.t_s.iter().map(|t| f64::from(u8::from(t >= at_s))).collect(),
        }
    }
}

/// First-order lag; a gap restarts it at what is measured then.
fn late(t_s: &[f64], x: &[f64], lag_s: f64) -> Vec<f64> {
    if lag_s == 0.0 {
        return x.to_vec();
    }
    let mut out = Vec::with_capacity(x.len());
    let mut state = x.first().copied().unwrap_or(0.0);
    for (i, value) in x.iter().enumerate() {
        if i > 0 {
            let dt = t_s[i] - t_s[i - 1];
            state = if dt > 4.0 * lag_s { *value } else { state + (value - state) * (1.0 - (-dt / lag_s).exp()) };
        }
        out.push(state);
    }
    out
}

/// Least squares of one axis on a constant and some effects.
#[derive(Debug, Clone)]
pub struct Regression {
    /// Coefficient and standard error of each effect, in order.
    pub coefficients: Vec<(f64, f64)>,
    /// What stays.
    pub residuals: Vec<f64>,
    /// How many blocks carry as much as one independent one.
    pub memory: f64,
    /// Twice the log likelihood in red noise.
    pub likelihood: f64,
}

impl Regression {
    /// Rms of what stays.
    pub fn rms(&self) -> f64 {
        rms(&self.residuals)
    }
}

/// Fit a constant per span and the effects.
pub fn regress(series: &Series, values: &[f64], effects: &[Follows]) -> Regression {
    let design = design(series, effects);
    let y = DVector::from_row_slice(values);
    let constants = series.spans;
    let normal = design.tr_mul(&design);
    let k = design.ncols();
    let inverse = normal.try_inverse().unwrap_or_else(|| DMatrix::from_diagonal_element(k, k, f64::MAX));
    let solution = &inverse * design.tr_mul(&y);
    let residual = &y - &design * &solution;
    let residuals: Vec<f64> = residual.iter().copied().collect();
    let memory = memory(std::slice::from_ref(&residuals));
    let likelihood = red::twice_log_likelihood(values, &design);
    // With memory, what is estimated from the data also leaves the residual with less of it: count independent values.
    let independent = (residuals.len() as f64 / memory).max(k as f64 + 2.0);
    let variance = residual.norm_squared() / residuals.len() as f64 * independent / (independent - k as f64);
    let one = |j: usize| {
        (solution[constants + j], (variance * memory * inverse[(constants + j, constants + j)]).max(0.0).sqrt())
    };
    Regression { coefficients: (0..effects.len()).map(one).collect(), residuals, memory, likelihood }
}

fn design(series: &Series, effects: &[Follows]) -> DMatrix<f64> {
    let n = series.t_s.len();
    let mut design = DMatrix::zeros(n, series.spans + effects.len());
    for (i, span) in series.span.iter().enumerate() {
        design[(i, *span)] = 1.0;
    }
    for (j, effect) in effects.iter().enumerate() {
        let column = effect.regressor(series);
        let centre = column.iter().sum::<f64>() / n as f64;
        for (i, x) in column.iter().enumerate() {
            design[(i, series.spans + j)] = x - centre;
        }
    }
    design
}

/// What one axis was found to follow.
#[derive(Debug, Clone)]
pub struct AxisFound {
    /// Effects with their evidence, in the order found.
    pub effects: Vec<(Follows, f64)>,
    /// Fits: without, then after each effect.
    pub fits: Vec<Regression>,
    /// Evidence of the strongest candidate refused.
    pub refused: f64,
}

/// Search one axis, given what its simulation already has (`included`, estimated with the constant).
pub fn search(series: &Series, values: &[f64], included: &[Follows]) -> AxisFound {
    let mut model: Vec<Follows> = included.to_vec();
    let mut found = AxisFound { effects: Vec::new(), fits: vec![regress(series, values, &model)], refused: 0.0 };
    for _ in 0..STEPS_MAX {
        let now = &found.fits[found.fits.len() - 1];
        let taken = |id: &str| model.iter().any(|f| f.id() == id);
        let mut best: Option<(Follows, f64, Regression)> = None;
        for candidate in candidates(series).into_iter().filter(|c| !taken(c.id())) {
            let mut with = model.clone();
            with.push(candidate.clone());
            let fit = regress(series, values, &with);
            // A late response has one unknown more than an immediate one, and must earn it.
            let price = if matches!(candidate, Follows::Temperature(_, 0.0)) { 1.0 } else { 2.0 };
            let score = evidence(now, &fit, price);
            found.refused = found.refused.max(score);
            with.truncate(model.len() + 1);
            if score < SCORE_MIN || held_out(series, values, &with) >= held_out(series, values, &model) {
                continue;
            }
            let simpler = |b: &(Follows, f64, Regression)| matches!((&b.0, &candidate), (Follows::Temperature(_, lag), Follows::Temperature(..)) if *lag == 0.0);
            let margin = best.as_ref().map_or(0.0, |b| if simpler(b) { LATE_MARGIN } else { 0.0 });
            if best.as_ref().is_none_or(|b| score > b.1 + margin) {
                best = Some((candidate, score, fit));
            }
        }
        let Some((candidate, score, fit)) = best else { break };
        let mut with = model.clone();
        with.push(candidate.clone());
        model = with;
        found.refused = 0.0;
        found.effects.push((candidate, score));
        found.fits.push(fit);
    }
    found
}

fn evidence(before: &Regression, after: &Regression, price: f64) -> f64 {
    after.likelihood - before.likelihood - price * (after.residuals.len() as f64).ln()
}

fn candidates(series: &Series) -> Vec<Follows> {
    let span_s = series.t_s[series.t_s.len() - 1] - series.t_s[0];
    let mut all = Vec::new();
    for (k, covariate) in series.covariates.iter().enumerate().filter(|(_, c)| c.is_temperature()) {
        debug_assert!(covariate.values.len() == series.t_s.len());
        all.extend(LAGS_S.iter().filter(|lag| **lag < 0.2 * span_s).map(|lag| Follows::Temperature(k, *lag)));
    }
    all.extend([0.05, 0.15, 0.5, 5.0].map(|part| Follows::Drift(part * span_s)));
    all.extend((2..38).map(|i| Follows::Step(series.t_s[0] + span_s * f64::from(i) / 40.0)));
    all
}

/// Rms of the prediction of six-hour blocks left out in turn, a constant per span known only from the rest.
pub fn held_out(series: &Series, values: &[f64], effects: &[Follows]) -> f64 {
    let design = design(series, effects);
    let fold = |t: f64| (((t - series.t_s[0]) / HELD_OUT_S) as usize) % 2;
    let mut squares = 0.0;
    for left_out in 0..2 {
        let rows = |wanted: bool| {
            (0..values.len()).filter(|i| (fold(series.t_s[*i]) == left_out) == wanted).collect::<Vec<usize>>()
        };
        let (kept, missed) = (rows(false), rows(true));
        let (x, y) = (design.select_rows(&kept), DVector::from_iterator(kept.len(), kept.iter().map(|i| values[*i])));
        let Some(inverse) = x.tr_mul(&x).try_inverse() else { return f64::INFINITY };
        let solution = inverse * x.tr_mul(&y);
        let predicted = design.select_rows(&missed) * solution;
        squares += missed.iter().zip(predicted.iter()).map(|(i, p)| (values[*i] - p).powi(2)).sum::<f64>();
    }
    (squares / values.len() as f64).sqrt()
}

/// What the simulation has beside the constant, with the covariate that its own fit prefers.
pub fn included(case: &MeasuredCase, series: &Series, values: &[f64]) -> Result<Vec<Follows>, MeasuredError> {
    let mut model = Vec::new();
    for token in &case.includes {
        let of_kind = |c: &Follows| c.id() == token;
        let best = candidates(series).into_iter().filter(of_kind).min_by(|a, b| {
            let rms = |f: &Follows| regress(series, values, std::slice::from_ref(f)).rms();
            rms(a).total_cmp(&rms(b))
        });
        match (token.as_str(), best) {
            ("constant", _) => {}
            (_, Some(follows)) => model.push(follows),
            _ => {
                return Err(
                    case.wrong("simulation.includes", "some of constant, temperature_bias, bias_drift, bias_step")
                );
            }
        }
    }
    Ok(model)
}

/// Analyse a series.
pub fn diagnose(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Answer, MeasuredError> {
    let series = read::series(case, files)?;
    let mut arcs = Vec::new();
    let mut rows = Vec::new();
    for axis in &series.axes {
        let own = if axis.control { Vec::new() } else { included(case, &series, &axis.values)? };
        let found = search(&series, &axis.values, &own);
        arcs.push(arc(&series, axis, &found, &own));
        rows.push((axis, own, found));
    }
    Ok(answer(case, &series, &rows, arcs))
}

fn parameters(
    series: &Series,
    axis: &read::Axis,
    follows: &Follows,
    (value, sigma): (f64, f64),
) -> Vec<crate::diagnose::answer::ParameterAnswer> {
    let unit = &axis.unit;
    match follows {
        Follows::Temperature(k, lag_s) => {
            let per = &series.covariates[*k].unit;
            let mut all = vec![parameter(&format!("slope_{}", axis.name), value, sigma, &format!("{unit}/{per}"))];
            all.push(parameter("lag_s", *lag_s, 0.5 * lag_s.max(LAGS_S[1]), "s"));
            all
        }
        Follows::Drift(tau_s) => vec![
            parameter("tau_s", *tau_s, 0.5 * tau_s, "s"),
            parameter(&format!("a{}", axis.name), value, sigma, unit),
        ],
        Follows::Step(at_s) => {
            let grid = (series.t_s[series.t_s.len() - 1] - series.t_s[0]) / 40.0;
            vec![
                parameter("onset_s", *at_s, 0.5 * grid, "s"),
                parameter(&format!("a{}", axis.name), value, sigma, unit),
            ]
        }
    }
}

fn arc(series: &Series, axis: &read::Axis, found: &AxisFound, own: &[Follows]) -> ArcAnswer {
    let (first, last) = (&found.fits[0], &found.fits[found.fits.len() - 1]);
    let mut effects = Vec::new();
    for (i, (follows, score)) in found.effects.iter().enumerate() {
        let parameters = parameters(series, axis, follows, last.coefficients[own.len() + i]);
        let (was, is) = (found.fits[i].rms(), found.fits[i + 1].rms());
        let with = match follows {
            Follows::Temperature(k, _) => format!(" Covariate: {}.", series.covariates[*k].name),
            _ => String::new(),
        };
        let r2 = 1.0 - (is / was).powi(2);
        let why = format!("{was:.3e} to {is:.3e} {} rms of block means (R2 {r2:.2}).{with}", axis.unit);
        let (id, name) = (follows.id().to_owned(), follows.name().to_owned());
        effects.push(Effect {
            id,
            name,
            posterior: posterior(*score),
            parameters,
            axis: None,
            from_degree: None,
            why,
            rms: vec![is],
        });
    }
    let mut model = own.to_vec();
    model.extend(found.effects.iter().map(|(f, _)| f.clone()));
    let left = last.rms() / short_term(&last.residuals).max(1e-300);
    let removed = 1.0 - (last.rms() / first.rms()).powi(2);
    let note = (left > LEFT_FACTOR && !axis.control).then(|| {
        format!(
            "{:.3e} {} rms stays, {left:.0} times the scatter from block to block ({:.0} % of the variance is explained): something slow is left, and nothing in the catalogue accounts for it.",
            last.rms(),
            axis.unit,
            100.0 * removed
        )
    });
    let verdict = if effects.is_empty() { Verdict::Consistent } else { Verdict::Explained };
    ArcAnswer {
        id: axis.column.clone(),
        verdict,
        effects,
        fitted_beside: Vec::new(),
        rms_before: first.rms(),
        rms_after: last.rms(),
        predicted_rms: Some(held_out(series, &axis.values, &model)),
        fitted: series.t_s.len(),
        masked: series.masked,
        note,
    }
}

/// Scatter from one block to the next, free of everything slow.
fn short_term(values: &[f64]) -> f64 {
    1.4826 * median(values.windows(2).map(|w| (w[1] - w[0]).abs())) / 2f64.sqrt()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

type Row<'a> = (&'a read::Axis, Vec<Follows>, AxisFound);

fn answer(case: &MeasuredCase, series: &Series, rows: &[Row<'_>], arcs: Vec<ArcAnswer>) -> Answer {
    let measured: Vec<&Row<'_>> = rows.iter().filter(|(axis, ..)| !axis.control).collect();
    let mut effects: Vec<Effect> = Vec::new();
    for ((axis, ..), arc) in rows.iter().zip(&arcs).filter(|((axis, ..), _)| !axis.control) {
        for effect in &arc.effects {
            let text = format!("{}: {}", axis.column, effect.why);
            match effects.iter_mut().find(|e| e.id == effect.id) {
                Some(known) => {
                    known.posterior = known.posterior.max(effect.posterior);
                    let new: Vec<_> = effect
                        .parameters
                        .iter()
                        .filter(|p| !known.parameters.iter().any(|k| k.name == p.name))
                        .cloned()
                        .collect();
                    known.parameters.splice(0..0, new);
                    known.parameters.sort_by_key(|p| !(p.name.starts_with("slope") || p.name.starts_with('a')));
                    known.why = format!("{} {text}", known.why);
                    known.rms.extend(&effect.rms);
                }
                None => effects.push(Effect { why: text, ..effect.clone() }),
            }
        }
    }
    let verdict = if effects.is_empty() { Verdict::Consistent } else { Verdict::Explained };
    let last = |found: &AxisFound| found.fits[found.fits.len() - 1].clone();
    let level = |pick: &dyn Fn(&AxisFound) -> Regression| {
        let each: Vec<f64> = measured.iter().map(|(_, _, found)| pick(found).rms()).collect();
        let chi2 = measured
            .iter()
            .map(|(_, _, found)| (pick(found).rms() / short_term(&last(found).residuals).max(1e-300)).powi(2));
        Level {
            rms_total: each.iter().map(|r| r * r).sum::<f64>().sqrt(),
            whitened_chi2_per_dof: median(chi2),
            rms: each,
        }
    };
    let before = level(&|f: &AxisFound| f.fits[0].clone());
    let after = level(&last);
    let held_before: Vec<f64> = measured.iter().map(|(axis, own, _)| held_out(series, &axis.values, own)).collect();
    let held_after: Vec<f64> = arcs
        .iter()
        .zip(rows)
        .filter(|(_, (axis, ..))| !axis.control)
        .filter_map(|(arc, _)| arc.predicted_rms)
        .collect();
    let power = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
    let held = HeldOut {
        scheme: "six-hour blocks, every other one left out in turn".to_owned(),
        excess_removed: 1.0 - power(&held_after) / power(&held_before).max(1e-300),
        before_rms: held_before,
        after_rms: held_after,
    };
    let weakest = measured.iter().flat_map(|(_, _, f)| f.effects.iter().map(|e| e.1)).fold(f64::INFINITY, f64::min);
    let refused = measured.iter().map(|(_, _, f)| f.refused).fold(0.0, f64::max);
    let score = if weakest.is_finite() { weakest } else { refused };
    let unit = rows.first().map_or(String::new(), |(axis, ..)| axis.unit.clone());
    let limit = |(axis, own, found): &&Row<'_>| {
        let covariate = (0..series.covariates.len()).find(|k| series.covariates[*k].is_temperature())?;
        found.effects.is_empty().then(|| {
            let mut model = own.clone();
            model.push(Follows::Temperature(covariate, 0.0));
            let (value, sigma) = regress(series, &axis.values, &model).coefficients[own.len()];
            let unit = format!("{}/{} on {}", axis.unit, series.covariates[covariate].unit, axis.column);
            Limit { id: "temperature_bias".to_owned(), limit: value.abs() + 2.0 * sigma, unit }
        })
    };
    let covariates = measured.iter().flat_map(|(axis, _, found)| {
        found.effects.iter().map(|(f, score)| Covariate { name: format!("{}: {}", axis.column, f.id()), score: *score })
    });
    let notes = arcs.iter().filter_map(|arc| arc.note.as_ref().map(|note| format!("{}: {note}", arc.id)));
    Answer {
        schema: "oare.diagnosis/1".to_owned(),
        case: case.id.clone(),
        verdict,
        false_alarm_probability: (-0.5 * score).exp().clamp(1e-12, 1.0),
        located: Located {
            axes: measured
                .iter()
                .filter(|(_, _, f)| !f.effects.is_empty())
                .map(|(axis, ..)| axis.name.clone())
                .collect(),
            frame: "sensor".to_owned(),
            covariates: covariates.collect(),
            ..Located::default()
        },
        alternatives: Vec::new(),
        hypothesis: None,
        unit,
        fit: Fit {
            noise_floor: measured.iter().map(|(_, _, f)| short_term(&last(f).residuals)).collect(),
            before,
            after,
            held_out: Some(held),
        },
        upper_limits: rows.iter().collect::<Vec<_>>().iter().filter_map(limit).collect(),
        separating_observation: None,
        cannot_tell_apart: Vec::new(),
        steps: Vec::<StepAnswer>::new(),
        notes: notes.collect(),
        effects,
        arcs,
    }
}
