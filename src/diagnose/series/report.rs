//! What a series was found to follow, in words and figures: one entry an axis, and all axes together. Not here: how it was
//! found (`search`).

use super::follow::{Follows, equation};
use super::read::{Axis, Series};
use super::search::{AxisFound, SCORE_MIN, candidates, held_out, missed, regress};
use crate::diagnose::answer::{Covariate, Hypothesis, Interval, LEAST_PROBABILITY, Located, ParameterAnswer, Verdict};
use crate::diagnose::measured::answer::{
    ArcAnswer, Effect, Fit, HeldOut, Level, Limit, in_order, parameter, posterior,
};
use crate::diagnose::measured::log_score::{gain, rises};
use crate::diagnose::measured::spread::median;
use crate::diagnose::measured::{Answer, MeasuredCase};
use crate::math::rms::{rms, rms_about_mean};
use crate::math::robust::MAD_TO_SIGMA;

/// Evidence of an effect that is not claimed from which on it is told: odds of five hundred.
const REFUSED_TOLD: f64 = 12.4;

/// What stays is worth saying when it is this many times the scatter from one block to the next.
const LEFT_FACTOR: f64 = 3.0;

/// The answer for all axes.
pub fn answer(case: &MeasuredCase, series: &Series, found: &[AxisFound]) -> Answer {
    let rows: Vec<Row<'_>> = series.axes.iter().zip(found).map(|(axis, found)| Row { series, axis, found }).collect();
    let arcs: Vec<ArcAnswer> = rows.iter().map(Row::arc).collect();
    let measured: Vec<&Row<'_>> = rows.iter().filter(|row| !row.axis.control).collect();
    let effects = common_effects(&rows, &arcs);
    let is = |v: Verdict| arcs.iter().zip(&rows).any(|(arc, row)| !row.axis.control && arc.verdict == v);
    let verdict = match (effects.is_empty(), is(Verdict::Unexplained)) {
        (false, _) => Verdict::Explained,
        (true, true) => Verdict::Unexplained,
        (true, false) => Verdict::Consistent,
    };
    let of_effects = measured.iter().flat_map(|row| row.found.effects.iter().map(|e| e.1));
    let of_forms = measured.iter().filter_map(|row| row.found.form.as_ref().map(|form| form.1));
    let weakest = of_effects.chain(of_forms).fold(f64::INFINITY, f64::min);
    let refused = measured.iter().map(|row| row.found.refused).fold(0.0, f64::max);
    let score = if weakest.is_finite() { weakest } else { refused };
    let notes = arcs.iter().filter_map(|arc| arc.note.as_ref().map(|note| format!("{}: {note}", arc.id)));
    let controls = rows.iter().zip(&arcs).filter(|(row, _)| row.axis.control).filter_map(|(_, arc)| of_control(arc));
    let unread = series.unread.iter().map(|name| {
        format!("{name} cannot be read in most rows, and nothing was asked of it: what is not asked is not excluded.")
    });
    Answer {
        schema: "oare.diagnosis/1".to_owned(),
        case: case.id.clone(),
        verdict,
        // What does not predict, or is smaller than its error, is no proof of anything: such evidence is that of a claim at most.
        false_alarm_probability: match verdict {
            Verdict::Consistent => (-0.5 * score.min(SCORE_MIN)).exp(),
            _ => (-0.5 * score).exp().max(LEAST_PROBABILITY),
        },
        located: located(&measured),
        alternatives: Vec::new(),
        hypothesis: measured
            .iter()
            .filter_map(|row| row.hypothesis())
            .next()
            .filter(|_| verdict == Verdict::Unexplained),
        unit: measured.first().map_or(String::new(), |row| row.axis.unit.clone()),
        fit: fit(&measured),
        upper_limits: rows.iter().flat_map(Row::limits).collect(),
        separating_observation: None,
        cannot_tell_apart: Vec::new(),
        steps: Vec::new(),
        notes: notes.chain(controls).chain(unread).collect(),
        effects: in_order(effects),
        arcs,
    }
}

/// What is said of a control in which something is found.
fn of_control(arc: &ArcAnswer) -> Option<String> {
    let ids: Vec<&str> = arc.effects.iter().map(|effect| effect.id.as_str()).collect();
    let what = match arc.verdict {
        Verdict::Consistent => return None,
        Verdict::Unexplained => "something that no effect of the catalogue is".to_owned(),
        _ => ids.join(" + "),
    };
    Some(format!(
        "{} is a control, in which nothing is expected, and has {what}: whatever moves it may move the measured axes as well, and what is said of \
         them is no better than that.",
        arc.id
    ))
}

/// One axis with what was found in it.
struct Row<'a> {
    series: &'a Series,
    axis: &'a Axis,
    found: &'a AxisFound,
}

impl Row<'_> {
    fn effects(&self) -> Vec<Effect> {
        let one = |(i, (follows, score)): (usize, &(Follows, f64))| {
            let (was, is) = (self.found.fits[i].rms(), self.found.fits[i + 1].rms());
            let with = match follows {
                Follows::Temperature(k, lag_s) if *lag_s > 0.0 => {
                    format!(
                        " Covariate: {}, followed with a time constant, which lag_s is.",
                        self.series.covariates[*k].name
                    )
                }
                Follows::Temperature(k, _) => format!(" Covariate: {}.", self.series.covariates[*k].name),
                Follows::Delayed(k, _) => {
                    format!(" Covariate: {}, as it was lag_s before.", self.series.covariates[*k].name)
                }
                Follows::Field(k) => format!(" Covariate: {}.", self.series.covariates[*k].name),
                _ => String::new(),
            };
            let r2 = 1.0 - (is / was).powi(2);
            let why = format!("{was:.3e} to {is:.3e} {} rms of block means (R2 {r2:.2}).{with}", self.axis.unit);
            let (id, name) = (follows.id().to_owned(), follows.name().to_owned());
            let axis = matches!(follows, Follows::Scale).then(|| self.axis.name.clone());
            let parameters = self.parameters(i, *follows);
            let rms = vec![self.found.fits[i].rms_from(&self.found.fits[i + 1])];
            Effect { id, name, posterior: posterior(*score), parameters, axis, from_degree: None, why, rms }
        };
        let mut effects: Vec<Effect> = Vec::new();
        for effect in self.found.effects.iter().enumerate().map(one) {
            // Components of a field are one effect.
            let Some(same) = effects.iter_mut().find(|other| other.id == effect.id) else {
                effects.push(effect);
                continue;
            };
            same.posterior = same.posterior.max(effect.posterior);
            same.parameters.extend(effect.parameters);
            same.why.push_str(&format!(" {}", effect.why));
            same.rms.iter_mut().zip(effect.rms).for_each(|(all, one)| *all = all.hypot(one));
        }
        effects
    }

    fn parameters(&self, i: usize, follows: Follows) -> Vec<ParameterAnswer> {
        let (value, sigma) = self.found.last().coefficients[self.found.included.len() + i];
        let (unit, name, inner) = (&self.axis.unit, &self.axis.name, self.found.inner_sigma[i]);
        // The catalogue's own names carry the unit they are fixed to.
        let ng = if unit == "ng" { "_ng" } else { "" };
        match follows {
            Follows::Temperature(k, lag_s) | Follows::Delayed(k, lag_s) => {
                let per = &self.series.covariates[k].unit;
                let named = if unit == "ng" && per == "C" { "_ng_per_c" } else { "" };
                vec![
                    parameter(&format!("slope_{name}{named}"), value, sigma, &format!("{unit}/{per}")),
                    parameter("lag_s", lag_s, inner, "s"),
                ]
            }
            Follows::Field(k) => {
                let covariate = &self.series.covariates[k];
                let per = &covariate.unit;
                let named = if unit == "ng" && per == "T" { "_ng_per_t" } else { "" };
                let name = format!("k{name}{}{named}", covariate.component().to_lowercase());
                vec![parameter(&name, value, sigma, &format!("{unit}/{per}"))]
            }
            Follows::Drift(tau_s) => {
                vec![parameter("tau_s", tau_s, inner, "s"), parameter(&format!("a{name}{ng}"), value, sigma, unit)]
            }
            Follows::Step(at_s) => {
                vec![parameter("onset_s", at_s, inner, "s"), parameter(&format!("a{name}{ng}"), value, sigma, unit)]
            }
            Follows::Scale => vec![parameter("fraction", value, sigma, "1")],
            Follows::Offset(_) => vec![parameter("offset_s", value, sigma, "s")],
            Follows::Form(..) | Follows::Product(..) | Follows::Pulse(..) | Follows::Line(..) => Vec::new(),
        }
    }

    fn arc(&self) -> ArcAnswer {
        let (first, last) = (&self.found.fits[0], self.found.last());
        let effects = self.effects();
        let left = last.rms() / self.floor();
        let slow = left > LEFT_FACTOR && !self.axis.control;
        let note = slow.then(|| {
            let removed = 100.0 * (1.0 - (last.rms() / first.rms()).powi(2));
            format!(
                "{:.3e} {} rms is left, {left:.0} times the scatter from block to block ({removed:.0} % of the variance is explained): something slow is left that no covariate accounts for, and is taken as noise.",
                last.rms(),
                self.axis.unit,
            )
        });
        let note = match self.hypothesis() {
            Some(hypothesis) => {
                Some(format!("it follows {} better than any effect of the catalogue.", hypothesis.formula))
            }
            None if effects.is_empty() && self.found.refused > REFUSED_TOLD => Some(format!(
                "the strongest effect tried has an evidence of {:.1}: {SCORE_MIN} and a prediction of blocks left out are asked for, and \
                 nothing is claimed.",
                self.found.refused
            )),
            None => note,
        };
        let verdict = match (effects.is_empty(), &self.found.form) {
            (false, _) => Verdict::Explained,
            (true, Some(_)) => Verdict::Unexplained,
            (true, None) => Verdict::Consistent,
        };
        ArcAnswer {
            id: self.axis.column.clone(),
            verdict,
            effects: in_order(effects),
            fitted_beside: Vec::new(),
            rms_before: first.rms(),
            rms_after: last.rms(),
            predicted_rms: Some(held_out(self.series, self.axis, &self.found.model())),
            fitted: self.series.t_s.len(),
            masked: self.series.masked,
            note,
        }
    }

    /// The formula that it follows, where no effect of the catalogue comes near.
    fn hypothesis(&self) -> Option<Hypothesis> {
        let (form, _, fit) = self.found.form.as_ref()?;
        let (value, sigma) = *fit.coefficients.last()?;
        let words = match form {
            Follows::Form(form, k, lag_s) => {
                let covariate = &self.series.covariates[*k];
                form.words(&covariate.name, &covariate.values, *lag_s)
            }
            Follows::Product(k, j) => {
                let [one, other] = [k, j].map(|k| &self.series.covariates[*k].name);
                format!("({one} - <{one}>) ({other} - <{other}>)")
            }
            Follows::Pulse(from_s, length_s) => format!("(1 from {from_s:.0} s to {:.0} s, else 0)", from_s + length_s),
            Follows::Line(period_s, phase) => {
                let (sign, phase) = if *phase < 0.0 { ('-', -phase) } else { ('+', *phase) };
                format!("sin(2 pi (t - {:.0} s)/{period_s:.0} s {sign} {phase:.2})", self.series.t_s[0])
            }
            _ => return None,
        };
        Some(Hypothesis {
            formula: format!("({value:.3e} +- {sigma:.1e}) {} x {words}", form.unit(&self.axis.unit, self.series)),
            axis: self.axis.name.clone(),
            unit: self.axis.unit.clone(),
            location: format!(
                "In {}, {:.3e} to {:.3e} {} rms: what follows {} so is no effect of the catalogue.",
                self.axis.column,
                self.found.last().rms(),
                fit.rms(),
                self.axis.unit,
                form.of_what(self.series)
            ),
        })
    }

    /// How large what the catalogue has could be, beside what is claimed of it: of each effect the loosest of what was tried, a step at a
    /// quarter, half and three quarters of the record, a decay that is over within it.
    fn limits(&self) -> Vec<Limit> {
        let still = self.found.last().rms() <= self.axis.rounding();
        if still || self.found.form.is_some() {
            return Vec::new();
        }
        let known = self.found.model();
        let t_s = &self.series.t_s;
        let within = |part: f64| t_s[0] + part * (t_s[t_s.len() - 1] - t_s[0]);
        let steps = [0.25, 0.5, 0.75].map(|part| Follows::Step(within(part)));
        let mut limits: Vec<(String, Limit)> = Vec::new();
        for follows in candidates(self.series, self.axis).into_iter().chain(steps) {
            let model = [&known[..], &[follows]].concat();
            let beyond = matches!(follows, Follows::Drift(tau_s) if tau_s > within(1.0) - t_s[0]);
            // Nor has a coefficient of what does not change a limit.
            let column = equation(self.series, self.axis, &[follows]).columns.swap_remove(0);
            let constant = rms_about_mean(&column) <= 1e-9 * rms(&column);
            if beyond || constant || known.iter().any(|has| has.excludes(&follows)) {
                continue;
            }
            let (value, sigma) = regress(self.series, self.axis, &model).coefficients[known.len()];
            let limit = value.abs() + 2.0 * sigma;
            if !limit.is_finite() {
                continue;
            }
            let (unit, of) = (follows.unit(&self.axis.unit, self.series), follows.of_what(self.series));
            let of_covariate = if of == follows.id() { String::new() } else { format!(", of {of}") };
            let unit = format!("{unit} on {}{of_covariate}", self.axis.column);
            let what = format!("{} {of}", follows.id());
            match limits.iter_mut().find(|(other, _)| *other == what) {
                Some((_, loosest)) => loosest.limit = loosest.limit.max(limit),
                None => limits.push((what, Limit { id: follows.id().to_owned(), limit, unit })),
            }
        }
        limits.into_iter().map(|(_, limit)| limit).collect()
    }
}

/// The axes' effects under one name each: what belongs to an axis keeps its own parameter, what they share becomes one.
fn common_effects(rows: &[Row<'_>], arcs: &[ArcAnswer]) -> Vec<Effect> {
    let mut ids: Vec<&str> = Vec::new();
    let measured = || rows.iter().zip(arcs).filter(|(row, _)| !row.axis.control);
    for (_, arc) in measured() {
        ids.extend(arc.effects.iter().map(|e| e.id.as_str()));
    }
    let mut seen: Vec<&str> = Vec::new();
    ids.retain(|id| {
        !seen.contains(id) && {
            seen.push(id);
            true
        }
    });
    let merged = |id: &str| {
        let own: Vec<(&Row<'_>, &Effect)> =
            measured().filter_map(|(row, arc)| Some((row, arc.effects.iter().find(|e| e.id == id)?))).collect();
        let (_, model) = own.first()?;
        let mut parameters: Vec<ParameterAnswer> = Vec::new();
        let mut shared: Vec<ParameterAnswer> = Vec::new();
        let names: Vec<&String> = model.parameters.iter().map(|p| &p.name).collect();
        for (row, effect) in &own {
            for p in &effect.parameters {
                let of_all = matches!(p.name.as_str(), "lag_s" | "tau_s" | "onset_s" | "offset_s");
                match (of_all, p.name == "fraction" && own.len() > 1) {
                    (true, _) => shared.push(p.clone()),
                    (_, true) => {
                        parameters.push(ParameterAnswer { name: format!("fraction_{}", row.axis.name), ..p.clone() })
                    }
                    _ => parameters.push(p.clone()),
                }
            }
        }
        if let Some(name) = names.into_iter().find(|n| shared.iter().any(|s| s.name == **n)) {
            parameters.push(joined(name, &shared));
            let apart = |s: &&ParameterAnswer| s.value != shared[0].value;
            if shared.iter().any(|s| apart(&s)) {
                let per_axis = own.iter().zip(&shared).map(|((row, _), s)| ParameterAnswer {
                    name: name.replace("_s", &format!("_{}_s", row.axis.name)),
                    ..s.clone()
                });
                parameters.extend(per_axis);
            }
        }
        let why: Vec<String> = own.iter().map(|(row, e)| format!("{}: {}", row.axis.column, e.why)).collect();
        Some(Effect {
            posterior: own.iter().map(|(_, e)| e.posterior).fold(0.0, f64::max),
            parameters,
            axis: if own.len() == 1 { model.axis.clone() } else { None },
            why: why.join(" "),
            rms: own.iter().flat_map(|(_, e)| e.rms.clone()).collect(),
            ..(*model).clone()
        })
    };
    ids.into_iter().filter_map(merged).collect()
}

/// One number for all axes: the weighted mean, with the axes' own disagreement in its error.
fn joined(name: &str, each: &[ParameterAnswer]) -> ParameterAnswer {
    let weight = |p: &ParameterAnswer| p.sigma.max(1e-9).powi(-2);
    let total: f64 = each.iter().map(weight).sum();
    let mean = each.iter().map(|p| p.value * weight(p)).sum::<f64>() / total;
    let chi2 = each.iter().map(|p| (p.value - mean).powi(2) * weight(p)).sum::<f64>();
    let excess = (chi2 / (each.len() as f64 - 1.0).max(1.0)).max(1.0);
    parameter(name, mean, (excess / total).sqrt(), &each[0].unit)
}

fn fit(measured: &[&Row<'_>]) -> Fit {
    let level = |rms: Vec<f64>| {
        let chi2: f64 = rms.iter().zip(measured).map(|(rms, row)| (rms / row.floor()).powi(2)).sum();
        Level {
            rms_total: rms.iter().map(|r| r * r).sum::<f64>().sqrt(),
            whitened_chi2_per_dof: chi2 / (measured.len() as f64).max(1.0),
            rms,
        }
    };
    let power = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>();
    let before_rms: Vec<f64> = measured.iter().map(|row| held_out(row.series, row.axis, &row.found.included)).collect();
    let after_rms: Vec<f64> = measured.iter().map(|row| held_out(row.series, row.axis, &row.found.model())).collect();
    let score = log_score(measured);
    let held = HeldOut {
        scheme: "blocks of six hours (four means where they are rarer, an eighth of a shorter span), every other one left out in turn".to_owned(),
        excess_removed: 1.0 - power(&after_rms) / power(&before_rms).max(1e-300),
        log_score_gain: score.map(|[gain, _]| gain),
        log_score_gain_se: score.map(|[_, error]| error),
        before_rms,
        after_rms,
    };
    Fit {
        noise_floor: measured.iter().map(|row| row.floor()).collect(),
        before: level(measured.iter().map(|row| row.found.fits[0].rms()).collect()),
        after: level(measured.iter().map(|row| row.found.last().rms()).collect()),
        held_out: Some(held),
    }
}

/// Log score gained on blocks left out, and its error; the axes of a block, which may err together, are one unit.
fn log_score(measured: &[&Row<'_>]) -> Option<[f64; 2]> {
    let mut total: Vec<f64> = Vec::new();
    for row in measured {
        let sizes = |effects: &[Follows]| -> Option<Vec<(usize, f64)>> {
            let blocks = missed(row.series, row.axis, effects)?.into_iter().enumerate();
            Some(
                blocks.filter(|(_, (_, n))| *n > 0).map(|(i, (squares, n))| (i, (squares / n as f64).sqrt())).collect(),
            )
        };
        let (places, before): (Vec<usize>, Vec<f64>) = sizes(&row.found.included)?.into_iter().unzip();
        let after: Vec<f64> = sizes(&row.found.model())?.into_iter().map(|(_, size)| size).collect();
        let rises = rises(&before, &after)?;
        for (place, rise) in places.into_iter().zip(rises) {
            total.resize(total.len().max(place + 1), 0.0);
            total[place] += rise;
        }
    }
    (!total.is_empty()).then(|| gain(&total))
}

impl Row<'_> {
    fn floor(&self) -> f64 {
        short_term(&self.found.last().residuals).max(self.axis.rounding()).max(1e-300)
    }
}

fn located(measured: &[&Row<'_>]) -> Located {
    let found = |row: &Row<'_>| {
        let form = row.found.form.as_ref().map(|(form, score, _)| (*form, *score));
        row.found.effects.iter().copied().chain(form).collect::<Vec<(Follows, f64)>>()
    };
    let covariates = measured.iter().flat_map(|row| {
        let one = |(f, score): (Follows, f64)| {
            let name = format!("{}: {}", row.axis.column, f.of_what(row.series));
            Covariate { name, score }
        };
        found(row).into_iter().map(one).collect::<Vec<_>>()
    });
    let onset = |row: &&&Row<'_>| {
        let at = row.found.effects.iter().find_map(|(f, _)| if let Follows::Step(s) = f { Some(*s) } else { None })?;
        let end_s = row.series.t_s.last().copied()?;
        Some(Interval { start_s: at, end_s, why: format!("{}: onset", row.axis.column) })
    };
    Located {
        axes: measured.iter().filter(|row| !found(row).is_empty()).map(|row| row.axis.name.clone()).collect(),
        frame: "sensor".to_owned(),
        covariates: covariates.collect(),
        intervals: measured.iter().filter_map(|row| onset(&row)).collect(),
        ..Located::default()
    }
}

/// Scatter from one block to the next, free of everything slow.
fn short_term(values: &[f64]) -> f64 {
    MAD_TO_SIGMA * median(values.windows(2).map(|w| (w[1] - w[0]).abs())) / 2f64.sqrt()
}
