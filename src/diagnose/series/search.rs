//! Which effects an axis follows: a forward search on the likelihood in red noise, each step checked on blocks that its fit
//! has not seen. Not here: what is said of it (see the room's own file).

use nalgebra::{DMatrix, DVector};

use super::follow::{Equation, Follows, equation};
use super::form::Form;
use super::likely::{likely_delays, likely_lines, likely_pulses, likely_steps};
use super::read::{Axis, CovariateSeries, Series};
use super::red::{self, Beat};
use crate::diagnose::earlier::REACH_S;
use crate::diagnose::measured::{MeasuredCase, MeasuredError};
use crate::math::rms::rms;

/// Evidence needed to claim an effect, over red noise. A second gate follows: it must predict blocks that the fit has not
/// seen. Of 1,000 series of red noise of any memory none passes both (`series::tests`); rarer false alarms are not shown.
pub(super) const SCORE_MIN: f64 = 18.0;
/// A late response must beat the immediate one by this much: its time constant was looked for.
const LATE_MARGIN: f64 = 18.0;
/// Time constants tried for a late response, as parts of the span, beside none at all.
const LAGS: [f64; 8] = [0.0015, 0.003, 0.006, 0.0125, 0.025, 0.05, 0.1, 0.2];
const DRIFTS: [f64; 4] = [0.05, 0.15, 0.5, 5.0];
/// A step or a decay smaller than so many of its own standard errors is nothing to claim, however much likelier it makes the series.
const CLAIMED_SIGMA: f64 = 3.0;
/// Offsets tried against a reference, in samples, either way.
const OFFSETS: [f64; 11] = [0.0, 1.0, 2.0, 4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0];
/// Held-out prediction leaves out blocks of this length in turn, s, or of an eighth of the shortest span.
const HELD_OUT_S: f64 = 6.0 * 3600.0;
/// Where means are rarer, so many of them together.
const HELD_OUT_BLOCKS_MIN: f64 = 4.0;
/// Terms of a model at most, each component of a field one.
const TERMS_MAX: usize = 6;
/// The same of a form, since so many more of them are looked for.
const FORM_SCORE_MIN: f64 = 20.0;
/// Evidence by which a form must be above all effects found: twice the logarithm of odds of twenty.
const FORM_MARGIN: f64 = 6.0;
const GOLDEN: f64 = 0.618_033_988_749_895;

/// Least squares of one axis on a constant per span and some effects.
#[derive(Debug, Clone)]
pub struct Regression {
    /// Coefficient and standard error of each effect, in order.
    pub coefficients: Vec<(f64, f64)>,
    /// What stays.
    pub residuals: Vec<f64>,
    /// What the effects add up to, their constant included.
    pub model: Vec<f64>,
}

impl Regression {
    /// Rms of what stays.
    pub fn rms(&self) -> f64 {
        rms(&self.residuals)
    }

    /// Rms of what another fit of the same axis changes.
    pub fn rms_from(&self, other: &Self) -> f64 {
        rms(&self.residuals.iter().zip(&other.residuals).map(|(a, b)| a - b).collect::<Vec<f64>>())
    }
}

/// Fit a constant per span and the effects, with errors that hold in red noise.
pub fn regress(series: &Series, axis: &Axis, effects: &[Follows]) -> Regression {
    let equation = equation(series, axis, effects);
    let design = design(series, &equation);
    let y = DVector::from_row_slice(&equation.values);
    let Some(inverse) = design.tr_mul(&design).try_inverse() else {
        let coefficients = vec![(0.0, f64::MAX); effects.len()];
        return Regression { coefficients, residuals: axis.values.clone(), model: vec![0.0; axis.values.len()] };
    };
    let solution = inverse * design.tr_mul(&y);
    let residuals: Vec<f64> = (&y - &design * &solution).iter().copied().collect();
    let covariance = red::covariance(&equation.values, &design, &Beat::new(&series.t_s));
    let one = |(j, follows): (usize, &Follows)| {
        let (at, from) = (series.spans + j, if let Follows::Offset(s) = follows { *s } else { 0.0 });
        (from + solution[at], covariance[(at, at)].max(0.0).sqrt())
    };
    let coefficients = effects.iter().enumerate().map(one).collect();
    let model = axis.values.iter().zip(&residuals).map(|(v, r)| v - r).collect();
    Regression { coefficients, residuals, model }
}

/// Constants per span, then the effects about their means.
pub(super) fn design(series: &Series, equation: &Equation) -> DMatrix<f64> {
    let n = series.t_s.len();
    let mut design = DMatrix::zeros(n, series.spans + equation.columns.len());
    for (i, span) in series.span.iter().enumerate() {
        design[(i, *span)] = 1.0;
    }
    for (j, column) in equation.columns.iter().enumerate() {
        let centre = column.iter().sum::<f64>() / n as f64;
        for (i, x) in column.iter().enumerate() {
            design[(i, series.spans + j)] = x - centre;
        }
    }
    design
}

fn likelihood(series: &Series, axis: &Axis, model: &[Follows], beat: &Beat) -> f64 {
    let equation = equation(series, axis, model);
    red::twice_log_likelihood(&equation.values, &design(series, &equation), beat)
}

/// What one axis was found to follow.
#[derive(Debug, Clone)]
pub struct AxisFound {
    /// What its simulation has, estimated with the constant.
    pub included: Vec<Follows>,
    /// Effects with their evidence, in the order found.
    pub effects: Vec<(Follows, f64)>,
    /// Standard error of the number of each effect that does not enter linearly.
    pub inner_sigma: Vec<f64>,
    /// Fits: without, then after each effect.
    pub fits: Vec<Regression>,
    /// Evidence of the strongest candidate refused.
    pub refused: f64,
    /// A form that no effect of the catalogue is, where it is better than all of them: with its evidence and its fit.
    pub form: Option<(Follows, f64, Regression)>,
}

impl AxisFound {
    /// The fit with everything found.
    pub fn last(&self) -> &Regression {
        &self.fits[self.fits.len() - 1]
    }

    /// What the simulation has, and what was found.
    pub fn model(&self) -> Vec<Follows> {
        self.included.iter().copied().chain(self.effects.iter().map(|(f, _)| *f)).collect()
    }
}

/// Search one axis, given what its simulation already has.
pub fn search(series: &Series, axis: &Axis, included: &[Follows]) -> AxisFound {
    let beat = Beat::new(&series.t_s);
    let mut model: Vec<Follows> = included.to_vec();
    let mut scores = Vec::new();
    let mut refused = 0.0;
    // An axis that does not move but for rounding follows nothing.
    let still = regress(series, axis, included).rms() <= axis.rounding();
    for _ in 0..if still { 0 } else { TERMS_MAX } {
        let Step { best, strongest } = step(series, axis, &model, &beat);
        refused = strongest;
        let Some((candidate, score)) = best else { break };
        model.push(candidate);
        scores.push(score);
        refined(series, axis, &mut model, included.len(), &beat);
        refused = 0.0;
    }
    let form = if still { None } else { best_form(series, axis, included, scores.iter().sum(), &beat) };
    if form.is_some() {
        model.truncate(included.len());
        scores.clear();
    }
    let mut fits: Vec<Regression> =
        (0..=scores.len()).map(|n| regress(series, axis, &model[..included.len() + n])).collect();
    let sigma = |i: usize| inner_sigma(series, axis, &model, i, &beat);
    let inner_sigma: Vec<f64> = (included.len()..model.len()).map(sigma).collect();
    let last = scores.len();
    widen(series, axis, &model, included.len(), &inner_sigma, &mut fits[last].coefficients);
    let effects = model[included.len()..].iter().copied().zip(scores).collect();
    AxisFound { included: included.to_vec(), effects, inner_sigma, fits, refused, form }
}

/// The form that an axis follows, where its evidence is that of an effect and above all that were found (`listed`), by odds of twenty.
fn best_form(
    series: &Series,
    axis: &Axis,
    included: &[Follows],
    listed: f64,
    beat: &Beat,
) -> Option<(Follows, f64, Regression)> {
    let pulses = likely_pulses(series, axis, included, beat);
    let lines = likely_lines(series, axis, included, beat);
    let (form, score) = best_of(series, axis, included, [forms(series), pulses, lines].concat(), beat).best?;
    if score < FORM_SCORE_MIN.max(listed + FORM_MARGIN) {
        return None;
    }
    let mut model = [included, &[form]].concat();
    let last = included.len();
    refined(series, axis, &mut model, last, beat);
    let mut fit = regress(series, axis, &model);
    let sigma = inner_sigma(series, axis, &model, last, beat);
    widen(series, axis, &model, last, &[sigma], &mut fit.coefficients);
    // What the noise about it may have made as well is nothing to tell.
    let (value, sigma) = fit.coefficients[last];
    (value.abs() > CLAIMED_SIGMA * sigma).then_some((model[last], score, fit))
}

struct Step {
    best: Option<(Follows, f64)>,
    strongest: f64,
}

fn step(series: &Series, axis: &Axis, model: &[Follows], beat: &Beat) -> Step {
    let has = |id: &str| model.iter().any(|f| f.id() == id);
    let steps = if has("bias_step") { Vec::new() } else { likely_steps(series, axis, model, beat) };
    let delays = if has("temperature_bias") { Vec::new() } else { likely_delays(series, axis, model, beat) };
    let open = |c: &Follows| !model.iter().any(|f| f.excludes(c));
    let all = candidates(series, axis).into_iter().chain(steps).chain(delays).filter(open);
    best_of(series, axis, model, all.collect(), beat)
}

/// The candidate with most evidence of those that have enough of it, earn what they were looked for and predict.
fn best_of(series: &Series, axis: &Axis, model: &[Follows], candidates: Vec<Follows>, beat: &Beat) -> Step {
    let with = |candidate: Follows| [model, &[candidate]].concat();
    let now = likelihood(series, axis, model, beat);
    let charge = (axis.values.len() as f64).ln();
    let score = |c: Follows| likelihood(series, axis, &with(c), beat) - now - c.price() * charge;
    let mut scored: Vec<(Follows, f64)> = candidates.into_iter().map(|c| (c, score(c))).collect();
    let strongest = scored.iter().map(|(_, score)| *score).fold(0.0, f64::max);
    scored.retain(|(_, score)| *score >= SCORE_MIN);
    // A late response has one unknown more than the immediate one to the same covariate, and must earn it.
    let all = scored.clone();
    scored.retain(|(follows, score)| {
        let immediate = follows.immediate();
        all.iter().all(|(other, s)| Some(*other) != immediate || *score > s + LATE_MARGIN)
    });
    scored.sort_by(|a, b| b.1.total_cmp(&a.1));
    // A step or a decay is told beside whatever else moves the axis; what it does not stand out of, its error in red noise says.
    let stands = |candidate: Follows| {
        let (value, sigma) = regress(series, axis, &with(candidate)).coefficients[model.len()];
        !matches!(candidate, Follows::Step(_) | Follows::Drift(_)) || value.abs() > CLAIMED_SIGMA * sigma
    };
    let predicts = |candidate: Follows| {
        let block_s = match candidate {
            // What lasts for a while is foretold by other parts of it.
            Follows::Pulse(_, length_s) => block_s(series).min(0.25 * length_s).max(series.beat_s()),
            _ => block_s(series),
        };
        let [before, after] =
            [model, &with(candidate)].map(|model| rms_missed(missed_in(series, axis, model, block_s)));
        after < before
    };
    let best = scored.into_iter().find(|(candidate, _)| predicts(*candidate) && stands(*candidate));
    Step { best, strongest }
}

/// Every form of every covariate that is no effect of the catalogue, at once and late, and every product of two of them.
fn forms(series: &Series) -> Vec<Follows> {
    let span_s = series.t_s[series.t_s.len() - 1] - series.t_s[0];
    let lags_s: Vec<f64> = [0.0].into_iter().chain(LAGS.map(|part| part * span_s)).collect();
    let of_one = |(k, covariate): (usize, &CovariateSeries)| {
        let is_listed = covariate.is_temperature() || covariate.is_magnetic();
        let listed = |form: &Form| *form == Form::Linear && is_listed;
        let forms = Form::ALL.into_iter().filter(|form| !listed(form));
        let late = |form: Form| if form.may_be_late() { &lags_s[..] } else { &lags_s[..1] };
        forms
            .flat_map(|form| late(form).iter().map(move |lag_s| Follows::Form(form, k, *lag_s)))
            .collect::<Vec<Follows>>()
    };
    let n = series.covariates.len();
    let products = (0..n).flat_map(|k| (k + 1..n).map(move |j| Follows::Product(k, j)));
    series.covariates.iter().enumerate().flat_map(of_one).chain(products).collect()
}

/// What the catalogue has for a series, but steps and delays.
pub fn candidates(series: &Series, axis: &Axis) -> Vec<Follows> {
    let span_s = series.t_s[series.t_s.len() - 1] - series.t_s[0];
    let mut all = Vec::new();
    for (k, _) in series.covariates.iter().enumerate().filter(|(_, c)| c.is_temperature()) {
        all.push(Follows::Temperature(k, 0.0));
        let lags_s = LAGS.iter().map(|part| part * span_s).filter(|lag_s| *lag_s <= REACH_S);
        all.extend(lags_s.map(|lag_s| Follows::Temperature(k, lag_s)));
    }
    let fields = series.covariates.iter().enumerate().filter(|(_, c)| c.is_magnetic());
    all.extend(fields.map(|(k, _)| Follows::Field(k)));
    all.extend(DRIFTS.map(|part| Follows::Drift(part * span_s)));
    if axis.reference.is_some() {
        let beat_s = series.beat_s();
        all.push(Follows::Scale);
        let tried = OFFSETS.iter().map(|o| o * beat_s).filter(|o| *o < 0.1 * span_s);
        all.extend(tried.flat_map(|o| if o == 0.0 { vec![0.0] } else { vec![o, -o] }).map(Follows::Offset));
    }
    all
}

/// Move the inner number of every effect found to where the likelihood is best, one after the other.
fn refined(series: &Series, axis: &Axis, model: &mut [Follows], from: usize, beat: &Beat) {
    let span_s = series.t_s[series.t_s.len() - 1] - series.t_s[0];
    for i in from..model.len() {
        let at = |model: &mut [Follows], s: f64| {
            model[i] = model[i].with_inner(s);
            likelihood(series, axis, model, beat)
        };
        match model[i] {
            // All multiples of a beat were tried, and between two of them it is smooth.
            Follows::Delayed(_, s) => {
                let beat_s = series.beat_s();
                let best = golden((s - beat_s).max(0.0), s + beat_s, 14, &mut |x| at(model, x));
                model[i] = model[i].with_inner(best);
            }
            Follows::Temperature(_, s) | Follows::Drift(s) | Follows::Form(.., s) if s > 0.0 => {
                let longest_s = if model[i].id() == "temperature_bias" { REACH_S } else { f64::INFINITY };
                let high = (s.ln() + 0.7).min(longest_s.ln());
                let log = golden(s.ln() - 0.7, high, 14, &mut |x| at(model, x.exp()));
                model[i] = model[i].with_inner(log.exp());
            }
            Follows::Step(s) => {
                let near = 4.0 * series.beat_s();
                let between = |i: usize| 0.5 * (series.t_s[i - 1] + series.t_s[i]);
                let edges = (1..series.t_s.len()).map(between).filter(|t| (t - s).abs() <= near);
                let best = edges.map(|t| (t, at(model, t))).max_by(|a, b| a.1.total_cmp(&b.1));
                model[i] = Follows::Step(best.map_or(s, |(t, _)| t));
            }
            Follows::Offset(_) => {
                for _ in 0..6 {
                    let next = plain(series, axis, model)[i];
                    let Follows::Offset(now) = model[i] else { break };
                    model[i] = Follows::Offset(next.clamp(-0.2 * span_s, 0.2 * span_s));
                    if (next - now).abs() < 1e-6 * series.beat_s() {
                        break;
                    }
                }
            }
            _ => {}
        }
    }
}

/// Coefficients alone, by least squares.
pub(super) fn plain(series: &Series, axis: &Axis, model: &[Follows]) -> Vec<f64> {
    let equation = equation(series, axis, model);
    let design = design(series, &equation);
    let y = DVector::from_row_slice(&equation.values);
    let Some(inverse) = design.tr_mul(&design).try_inverse() else { return vec![0.0; model.len()] };
    let solution = inverse * design.tr_mul(&y);
    let from = |f: &Follows| if let Follows::Offset(s) = f { *s } else { 0.0 };
    model.iter().enumerate().map(|(j, f)| from(f) + solution[series.spans + j]).collect()
}

/// Where a value is largest between two bounds, by so many golden sections.
pub(super) fn golden(mut low: f64, mut high: f64, steps: usize, value: &mut dyn FnMut(f64) -> f64) -> f64 {
    let (mut a, mut b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
    let (mut fa, mut fb) = (value(a), value(b));
    for _ in 0..steps {
        if fa > fb {
            (high, b, fb) = (b, a, fa);
            a = high - GOLDEN * (high - low);
            fa = value(a);
        } else {
            (low, a, fa) = (a, b, fb);
            b = low + GOLDEN * (high - low);
            fb = value(b);
        }
    }
    0.5 * (low + high)
}

/// How far the inner number may move, either way, before twice the log likelihood has fallen by one.
fn inner_sigma(series: &Series, axis: &Axis, model: &[Follows], i: usize, beat: &Beat) -> f64 {
    let Some(best) = model[i].inner() else { return 0.0 };
    if matches!(model[i], Follows::Offset(_)) {
        return 0.0;
    }
    let beat_s = series.beat_s();
    let top = likelihood(series, axis, model, beat);
    let falls = |s: f64| {
        let mut moved = model.to_vec();
        moved[i] = moved[i].with_inner(s);
        top - likelihood(series, axis, &moved, beat) >= 1.0
    };
    let span_s = series.t_s[series.t_s.len() - 1] - series.t_s[0];
    let reach = |sign: f64| {
        let mut away = 0.25 * beat_s;
        while away < span_s && best + sign * away > 0.0 && !falls(best + sign * away) {
            away *= 1.4;
        }
        away
    };
    let up = reach(1.0);
    let down = if best > 0.0 { reach(-1.0) } else { up };
    // An instant is known to a sample at best, and evenly within it.
    let floor = if matches!(model[i], Follows::Step(_)) { beat_s / 12f64.sqrt() } else { 0.0 };
    (0.5 * (up + down)).max(floor)
}

/// Add to each coefficient's error what the errors of the inner numbers do to it.
fn widen(
    series: &Series,
    axis: &Axis,
    model: &[Follows],
    from: usize,
    sigmas: &[f64],
    coefficients: &mut [(f64, f64)],
) {
    for (k, sigma) in sigmas.iter().enumerate().filter(|(_, sigma)| **sigma > 0.0) {
        let moved = |by: f64| {
            let mut with = model.to_vec();
            let inner = with[from + k].inner().unwrap_or(0.0);
            with[from + k] = with[from + k].with_inner((inner + by).max(1e-3 * series.beat_s()));
            plain(series, axis, &with)
        };
        let (up, down) = (moved(*sigma), moved(-sigma));
        for (j, (_, error)) in coefficients.iter_mut().enumerate() {
            *error = error.hypot(0.5 * (up[j] - down[j]));
        }
    }
}

/// Rms of the prediction of blocks left out in turn, a constant per span known only from the rest.
pub fn held_out(series: &Series, axis: &Axis, effects: &[Follows]) -> f64 {
    rms_missed(missed(series, axis, effects))
}

fn rms_missed(blocks: Option<Vec<(f64, usize)>>) -> f64 {
    blocks.map_or(f64::INFINITY, |blocks| {
        let (squares, n) = blocks.iter().fold((0.0, 0), |(squares, n), block| (squares + block.0, n + block.1));
        (squares / n as f64).sqrt()
    })
}

/// What every block is missed by: sum of squares, and of how many values. None where the rest does not determine the model.
pub fn missed(series: &Series, axis: &Axis, effects: &[Follows]) -> Option<Vec<(f64, usize)>> {
    missed_in(series, axis, effects, block_s(series))
}

/// Length of the blocks that are left out.
fn block_s(series: &Series) -> f64 {
    HELD_OUT_S.max(HELD_OUT_BLOCKS_MIN * series.beat_s()).min(series.shortest_span_s() / 8.0).max(1e-9)
}

fn missed_in(series: &Series, axis: &Axis, effects: &[Follows], block_s: f64) -> Option<Vec<(f64, usize)>> {
    let equation = equation(series, axis, effects);
    let (design, values) = (design(series, &equation), &equation.values);
    let block = |i: usize| ((series.t_s[i] - series.t_s[0]) / block_s) as usize;
    let mut blocks = vec![(0.0, 0); block(values.len() - 1) + 1];
    for left_out in 0..2 {
        let rows =
            |wanted: bool| (0..values.len()).filter(|i| (block(*i) % 2 == left_out) == wanted).collect::<Vec<usize>>();
        let (kept, missed) = (rows(false), rows(true));
        let (x, y) = (design.select_rows(&kept), DVector::from_iterator(kept.len(), kept.iter().map(|i| values[*i])));
        let solution = x.tr_mul(&x).try_inverse()? * x.tr_mul(&y);
        let predicted = design.select_rows(&missed) * solution;
        for (i, p) in missed.iter().zip(predicted.iter()) {
            let (squares, n) = &mut blocks[block(*i)];
            *squares += (values[*i] - p).powi(2);
            *n += 1;
        }
    }
    Some(blocks)
}

/// What the simulation has beside the constant and the reference, with the numbers that its own fit prefers.
pub fn included(case: &MeasuredCase, series: &Series, axis: &Axis) -> Result<Vec<Follows>, MeasuredError> {
    let beat = Beat::new(&series.t_s);
    let mut model = Vec::new();
    for token in case.includes.iter().filter(|t| !matches!(t.as_str(), "constant" | "reference")) {
        let likely = |f: &Follows| likelihood(series, axis, std::slice::from_ref(f), &beat);
        let steps = likely_steps(series, axis, &model, &beat);
        let of_kind =
            candidates(series, axis).into_iter().chain(steps).filter(|c| c.id() == token).map(|c| (c, likely(&c)));
        let of_kind: Vec<(Follows, f64)> = of_kind.collect();
        if token == "magnetic_sensitivity" && !of_kind.is_empty() {
            model.extend(of_kind.into_iter().map(|(field, _)| field));
            continue;
        }
        let Some((follows, _)) = of_kind.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
            return Err(case.wrong(
                "simulation.includes",
                "some of constant, reference, temperature_bias (with a temperature among the covariates), \
                 magnetic_sensitivity (with a field among them), bias_drift, bias_step, \
                 scale_factor and time_offset (with a reference)",
            ));
        };
        model.push(follows);
        refined(series, axis, &mut model, 0, &beat);
    }
    Ok(model)
}
