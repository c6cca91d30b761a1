//! The search's outcome in words and figures: a verdict for all arcs and one for each.

use nalgebra::Vector3;

use super::arc::{Arc, ArcFit};
use super::compare;
use super::forces::Term;
use super::formula;
use super::held_out::missed_m;
use super::ladder;
use super::manoeuvre::{self, Manoeuvre};
use super::notes::notes;
use super::own::Own;
use super::search::{
    Estimate, Level, Problem, Search, estimates, evidence, no_worse_foretold, predicted_m, projected_rms_m,
};
use crate::diagnose::answer::{Alternative, Interval, LEAST_PROBABILITY, Located, ParameterAnswer, Verdict};
use crate::diagnose::measured::answer::{
    ArcAnswer, Effect, Fit, HeldOut, Level as FitLevel, Limit, in_order, parameter, posterior,
};
use crate::diagnose::measured::spread::{median, scatter};
use crate::diagnose::measured::{Answer, log_score};

/// Posterior from which on a term that all arcs together show is an effect of one of them.
const SHOWN: f64 = 0.5;

/// Times the stated accuracy from which on what remains of an arc is told: half of what makes it unexplained.
pub(super) const LOUD: f64 = 2.0;

/// Every arc's estimates of every accepted term.
pub type Table = Vec<(Term, f64, Vec<Vec<Estimate>>)>;

/// Put a search into an answer.
pub fn answer(case: &str, problem: &Problem, search: &Search) -> Answer {
    let (first, end) = (&ladder::as_it_stands(problem, search), &search.end());
    let table = table(problem, end);
    let mut arcs: Vec<ArcAnswer> =
        (0..problem.arcs.len()).map(|i| arc_answer(problem, search, [first, end], &table, i)).collect();
    let unexplained = arcs.iter().filter(|arc| arc.verdict == Verdict::Unexplained).count();
    let named: Vec<bool> =
        table.iter().enumerate().map(|(step, (term, ..))| explains(problem, search, &arcs, step, *term)).collect();
    for ((term, ..), _) in table.iter().zip(&named).filter(|(_, named)| !**named) {
        arcs.iter_mut().for_each(|arc| unclaim(arc, term.id()));
    }
    let nothing = !named.contains(&true) && search.manoeuvres.is_empty() && search.own.is_empty();
    // Where nothing is named, a single arc that holds something is no silence.
    let odd = if nothing { unexplained > 0 } else { 2 * unexplained > arcs.len() };
    let verdict = match (nothing, odd || search.unlisted.is_some()) {
        (_, true) => Verdict::Unexplained,
        (true, false) => Verdict::Consistent,
        (false, false) => Verdict::Explained,
    };
    let common = common_effects(problem, search, &table).into_iter().zip(&named);
    let mut effects: Vec<Effect> = common.filter_map(|(effect, named)| named.then_some(effect)).collect();
    // A velocity step of one satellite among many is that satellite's, and named there and here with its name.
    effects.extend(search.manoeuvres.iter().map(|one| manoeuvre_effect(problem, one, problem.arcs.len() > 1)));
    effects.extend(search.own.iter().map(|one| own_effect(problem, end, one, true)));
    let strongest_refused = search.refused.first().map_or(0.0, |(_, score)| *score);
    let of_table = table.iter().zip(&named).filter_map(|((_, score, _), named)| named.then_some(*score));
    let scores = of_table.chain(search.manoeuvres.iter().map(|one| one.score));
    let scores = scores.chain(search.own.iter().map(|one| one.score));
    let weakest = scores.fold(f64::INFINITY, f64::min);
    let false_alarm_probability = match verdict {
        Verdict::Explained => (-0.5 * weakest).exp().clamp(LEAST_PROBABILITY, 1.0),
        Verdict::Unexplained => chance_of_the_odd(problem, search, &arcs),
        _ => (-0.5 * strongest_refused).exp().clamp(0.0, 1.0),
    };
    Answer {
        schema: "oare.diagnosis/1".to_owned(),
        case: case.to_owned(),
        verdict,
        false_alarm_probability,
        located: located(problem, search, &arcs, nothing),
        alternatives: alternatives(search, &table),
        // Where the rest is explained, the arc's own note has what one satellite has for itself.
        hypothesis: if verdict == Verdict::Unexplained { formula::hypothesis(problem, search) } else { None },
        unit: "m".to_owned(),
        fit: fit(problem, first, end),
        upper_limits: limits(problem, search, end),
        separating_observation: None,
        cannot_tell_apart: Vec::new(),
        steps: ladder::steps(problem, search),
        notes: notes(problem, &arcs, search),
        effects: in_order(effects),
        arcs,
    }
}

/// Chance that noise leaves what is unexplained.
fn chance_of_the_odd(problem: &Problem, search: &Search, arcs: &[ArcAnswer]) -> f64 {
    let last = search.last();
    let odd = (0..arcs.len()).filter(|i| arcs[*i].verdict == Verdict::Unexplained);
    let least = odd.map(|i| compare::log_chance(problem, i, &last.fits[i])).fold(0.0, f64::min);
    let of_formula = search.unlisted.as_ref().map_or(0.0, |found| -0.5 * found.score);
    least.min(of_formula).exp().clamp(LEAST_PROBABILITY, 1.0)
}

/// Whether a term explains any arc that asks for it: a push of unknown size that is asked for by arcs alone that stay unexplained with it,
/// or are worse predicted with it, is no name for what is in them.
fn explains(problem: &Problem, search: &Search, arcs: &[ArcAnswer], step: usize, term: Term) -> bool {
    let [before, after] = [step, step + 1].map(|level| &search.levels[level].fits);
    let asks = |i: usize| evidence(&problem.arcs[i], &before[i], term) > 0.0;
    let foretold = |i: usize| no_worse_foretold(&problem.arcs[i], [&before[i], &after[i]]);
    let explained = |i: usize| arcs[i].verdict != Verdict::Unexplained && asks(i) && foretold(i);
    term.is_known_size() || (0..arcs.len()).any(explained)
}

/// A term that is named for no arc stands beside what is.
fn unclaim(arc: &mut ArcAnswer, id: &str) {
    let (unnamed, shown): (Vec<Effect>, Vec<Effect>) =
        std::mem::take(&mut arc.effects).into_iter().partition(|effect| effect.id == id);
    arc.effects = shown;
    arc.fitted_beside.extend(unnamed);
    if arc.effects.is_empty() && arc.verdict == Verdict::Explained {
        arc.verdict = Verdict::Consistent;
    }
}

/// Estimates of every accepted term in every arc.
pub fn table(problem: &Problem, last: &Level) -> Table {
    let of = |term: Term| (0..problem.arcs.len()).map(|i| estimates(problem, last, i, term)).collect();
    last.accepted.iter().map(|(term, score)| (*term, *score, of(*term))).collect()
}

fn effect(term: Term, score: f64, parameters: Vec<ParameterAnswer>, why: String, rms: Vec<f64>) -> Effect {
    let from_degree = match term {
        Term::DegreesFrom(from) => Some(from),
        _ => None,
    };
    let (id, name) = (term.id().to_owned(), term.name().to_owned());
    Effect { id, name, posterior: posterior(score), parameters, axis: None, from_degree, why, rms }
}

fn manoeuvre_effect(problem: &Problem, one: &Manoeuvre, of_many: bool) -> Effect {
    let [radial, along, cross] = one.rtn_m_s;
    let number = |name: &str, (value, sigma): (f64, f64), unit: &str| parameter(name, value, sigma, unit);
    let parameters = vec![
        number("at_s", (one.impulse.at_s, one.at_sigma_s), "s"),
        number("dv_m_s", one.dv_m_s, "m/s"),
        number("radial_m_s", radial, "m/s"),
        number("along_m_s", along, "m/s"),
        number("cross_m_s", cross, "m/s"),
    ];
    let id = &problem.arcs[one.arc].id;
    let why = format!(
        "{}A velocity step takes the 3-D residual of the arc from {:.3} m to {:.3} m{}.",
        if of_many { format!("{id} alone: ") } else { String::new() },
        one.rms_m[0],
        one.rms_m[1],
        if one.of_several { ", the others of the arc fitted beside it" } else { "" }
    );
    Effect {
        id: "manoeuvre".to_owned(),
        name: "Velocity step".to_owned(),
        posterior: posterior(one.score),
        parameters,
        axis: None,
        from_degree: None,
        why,
        // Of a least-squares fit: what is left is square to what is taken away.
        rms: vec![(one.rms_m[0].powi(2) - one.rms_m[1].powi(2)).max(0.0).sqrt()],
    }
}

fn own_effect(problem: &Problem, end: &Level, one: &Own, of_many: bool) -> Effect {
    let names = one.term.parameters();
    let values = estimates(problem, end, one.arc, one.term);
    let parameters = values.iter().zip(names).map(|(e, name)| parameter(name, e.value, e.sigma, one.term.unit()));
    let [was, is] = one.rms_m;
    let why = format!(
        "{}It takes the 3-D residual of the arc from {was:.3} m to {is:.3} m, and no other term does.",
        if of_many { format!("{} alone: ", problem.arcs[one.arc].id) } else { String::new() }
    );
    let rms = vec![(was * was - is * is).max(0.0).sqrt()];
    effect(one.term, one.score, parameters.collect(), why, rms)
}

fn with_degree(term: Term, mut parameters: Vec<ParameterAnswer>) -> Vec<ParameterAnswer> {
    if let Term::DegreesFrom(from) = term {
        parameters.push(parameter("from_degree", from as f64, 0.0, "1"));
    }
    parameters
}

fn common_effects(problem: &Problem, search: &Search, table: &Table) -> Vec<Effect> {
    let one = |(step, (term, score, rows)): (usize, &(Term, f64, Vec<Vec<Estimate>>))| {
        let (before, after) = (&search.levels[step], &search.levels[step + 1]);
        let names = term.parameters();
        let parameters = (0..names.len()).map(|k| common(*term, names[k], rows, k)).collect();
        let (was, is) = (problem.median_rms_m(before), problem.median_rms_m(after));
        let n = problem.arcs.len();
        let wanted = (0..n).filter(|i| evidence(&problem.arcs[*i], &before.fits[*i], *term) > 0.0).count();
        let mut why = format!(
            "With it the 3-D residual of the fit falls from {was:.3} m to {is:.3} m (median of {n}); {wanted} of {n} arcs ask for it."
        );
        if n > 1 && !term.is_known_size() {
            why.push_str(" One value per satellite, in `arcs`; the figure here is their median.");
        }
        effect(*term, *score, with_degree(*term, parameters), why, change_rms(problem, before, after))
    };
    table.iter().enumerate().map(one).collect()
}

/// One value for all arcs: the weighted mean of a term of known size, the median of a satellite's own.
fn common(term: Term, name: &str, rows: &[Vec<Estimate>], k: usize) -> ParameterAnswer {
    let each: Vec<Estimate> = rows.iter().filter_map(|row| row.get(k).copied()).collect();
    let values: Vec<f64> = each.iter().map(|e| e.value).collect();
    let count = (each.len() as f64).max(1.0);
    if each.len() == 1 {
        return parameter(name, each[0].value, each[0].sigma, term.unit());
    }
    if term.is_known_size() {
        let weight: f64 = each.iter().map(|e| e.sigma.powi(-2)).sum();
        let mean = each.iter().map(|e| e.value * e.sigma.powi(-2)).sum::<f64>() / weight;
        // Satellites disagree by more than their own errors say; their scatter is then the error.
        let chi2 = each.iter().map(|e| ((e.value - mean) / e.sigma).powi(2)).sum::<f64>() / (count - 1.0);
        // Satellites of one constellation share what is unlisted: their number does not make the mean better than one.
        let own = median(each.iter().map(|e| e.sigma));
        return parameter(name, mean, (chi2.max(1.0) / weight).sqrt().max(own), term.unit());
    }
    let own = median(each.iter().map(|e| e.sigma));
    let sigma = 1.2533 * scatter(&values).max(own) / count.sqrt();
    parameter(name, median(values), sigma, term.unit())
}

fn arc_answer(problem: &Problem, search: &Search, [first, end]: [&Level; 2], table: &Table, i: usize) -> ArcAnswer {
    let (arc, fit) = (&problem.arcs[i], &end.fits[i]);
    let rms_after = fit.rms_m(0..arc.fitted);
    let mut effects: Vec<Effect> = Vec::new();
    for (step, (term, _, rows)) in table.iter().enumerate() {
        let names = term.parameters();
        let parameters = rows[i].iter().zip(names).map(|(e, name)| parameter(name, e.value, e.sigma, term.unit()));
        let parameters = with_degree(*term, parameters.collect());
        let (before, after) = (&search.levels[step].fits[i], &search.levels[step + 1].fits[i]);
        let (was, is) = (before.rms_m(0..arc.fitted), after.rms_m(0..arc.fitted));
        let why = format!("3-D residual of this arc from {was:.3} m to {is:.3} m.");
        let change = |k: usize| (before.residuals_m[k] - after.residuals_m[k]).norm_squared();
        let rms = ((0..arc.fitted).map(change).sum::<f64>() / arc.fitted as f64).sqrt();
        effects.push(effect(*term, evidence(arc, before, *term), parameters, why, vec![rms]));
    }
    effects
        .extend(search.manoeuvres.iter().filter(|one| one.arc == i).map(|one| manoeuvre_effect(problem, one, false)));
    effects.extend(search.own.iter().filter(|one| one.arc == i).map(|one| own_effect(problem, end, one, false)));
    let left = rms_after > problem.rms_max_m();
    let without = &search.last().fits[i];
    let by_formula = search.unlisted.is_some() && compare::of_arc(problem, i, fit, without) > 0.0;
    let alone = search.alone.iter().find(|one| one.arc == i);
    let (verdict, effects, fitted_beside, note) = if left {
        let note = format!(
            "{} remain where {:.3} m is the most that the stated accuracy allows; nothing in the catalogue that is larger than the pushes that satellites have and no list does removes it.",
            if rms_after.is_finite() {
                format!("{rms_after:.3} m")
            } else {
                "No orbit follows the positions: they".to_owned()
            },
            problem.rms_max_m()
        );
        (Verdict::Unexplained, Vec::new(), effects, Some(note))
    } else if let Some(one) = alone {
        (Verdict::Unexplained, Vec::new(), effects, Some(of_one_alone(problem, end, one)))
    } else if by_formula {
        let was = without.rms_m(0..arc.fitted);
        let note = format!("The push of `hypothesis`, that no catalogue has, takes {was:.3} m to {rms_after:.3} m.");
        (Verdict::Unexplained, Vec::new(), effects, Some(note))
    } else {
        // A term that all arcs together show need not show in each.
        let (shown, beside): (Vec<Effect>, Vec<Effect>) =
            effects.into_iter().partition(|effect| effect.posterior >= SHOWN);
        (if shown.is_empty() { Verdict::Consistent } else { Verdict::Explained }, shown, beside, None)
    };
    ArcAnswer {
        id: arc.id.clone(),
        verdict,
        effects: in_order(effects),
        fitted_beside,
        rms_before: first.fits[i].rms_m(0..arc.fitted),
        rms_after,
        predicted_rms: predicted_m(arc, fit),
        fitted: arc.fitted,
        masked: arc.masked,
        note,
    }
}

/// A push of one satellite that no catalogue has, in words.
fn of_one_alone(problem: &Problem, end: &Level, one: &Own) -> String {
    let Term::Unlisted(term) = one.term else { return String::new() };
    let [formula, axis, _] = formula::said(term, &[estimates(problem, end, one.arc, one.term)]);
    let [was, is] = one.rms_m;
    format!(
        "A push that no catalogue has takes {was:.3} m to {is:.3} m: {axis}, {formula}. No term of the catalogue does as well."
    )
}

/// Median over arcs of the rms along radius, track and normal, m.
fn axis_rms(problem: &Problem, level: &Level) -> Vec<f64> {
    let one = |(arc, fit): (&Arc, &ArcFit)| rtn_rms(arc, |i| fit.residuals_m[i]);
    let each: Vec<[f64; 3]> = problem.arcs.iter().zip(&level.fits).map(one).collect();
    (0..3).map(|k| median(each.iter().map(|rms| rms[k]))).collect()
}

/// The same of what changes from one level to another.
fn change_rms(problem: &Problem, before: &Level, after: &Level) -> Vec<f64> {
    let fits = before.fits.iter().zip(&after.fits);
    let one = |(arc, (was, is)): (&Arc, (&ArcFit, &ArcFit))| rtn_rms(arc, |i| was.residuals_m[i] - is.residuals_m[i]);
    let each: Vec<[f64; 3]> = problem.arcs.iter().zip(fits).map(one).collect();
    (0..3).map(|k| median(each.iter().map(|rms| rms[k]))).collect()
}

fn rtn_rms(arc: &Arc, of: impl Fn(usize) -> Vector3<f64>) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for i in 0..arc.fitted {
        let next = if i + 1 < arc.t_s.len() { i + 1 } else { i - 1 };
        let radial = arc.observed_m[i].normalize();
        let ahead = (arc.observed_m[next] - arc.observed_m[i]) * if next > i { 1.0 } else { -1.0 };
        let normal = radial.cross(&ahead).normalize();
        let r = of(i);
        for (sum, axis) in sum.iter_mut().zip([radial, normal.cross(&radial), normal]) {
            *sum += r.dot(&axis).powi(2);
        }
    }
    sum.map(|s| (s / arc.fitted as f64).sqrt())
}

fn fit(problem: &Problem, first: &Level, last: &Level) -> Fit {
    let level = |level: &Level| {
        let rms_total = problem.median_rms_m(level);
        let whitened_chi2_per_dof = rms_total * rms_total / (3.0 * problem.sigma_m * problem.sigma_m);
        FitLevel { rms: axis_rms(problem, level), rms_total, whitened_chi2_per_dof }
    };
    let held_out = held_out(problem, first, last);
    Fit { noise_floor: vec![problem.sigma_m; 3], before: level(first), after: level(last), held_out }
}

/// Of the arcs that both levels predict.
fn held_out(problem: &Problem, first: &Level, last: &Level) -> Option<HeldOut> {
    let (scheme, before) = missed_m(problem, first);
    let (_, after) = missed_m(problem, last);
    let (before, after): (Vec<f64>, Vec<f64>) = before.into_iter().zip(after).filter_map(|(b, a)| b.zip(a)).unzip();
    if before.is_empty() {
        return None;
    }
    let score = log_score::rises(&before, &after).map(|rises| log_score::gain(&rises));
    let (before_m, after_m) = (median(before), median(after));
    let floor = 3.0 * problem.sigma_m * problem.sigma_m;
    let excess = (before_m * before_m - floor).max(1e-12);
    Some(HeldOut {
        scheme: scheme.to_owned(),
        before_rms: vec![before_m],
        after_rms: vec![after_m],
        excess_removed: ((before_m * before_m - after_m * after_m) / excess).clamp(-1.0, 1.0),
        log_score_gain: score.map(|[gain, _]| gain),
        log_score_gain_se: score.map(|[_, error]| error),
    })
}

fn limits(problem: &Problem, search: &Search, last: &Level) -> Vec<Limit> {
    let one = |(term, _): &(Term, f64)| {
        let each = (0..problem.arcs.len()).filter_map(|i| {
            let estimates = estimates(problem, last, i, *term);
            if estimates.is_empty() {
                return None;
            }
            if term.is_known_size() {
                // The term's size is known: the limit is what the most of it would do that the state does not take.
                let whole_m = projected_rms_m(&problem.arcs[i], &last.fits[i], *term);
                let Estimate { value, sigma } = estimates[0];
                return Some(whole_m * (value.abs() + 2.0 * sigma));
            }
            // Of a cosine and a sine, the amplitude.
            let value: f64 = estimates.iter().map(|e| e.value.powi(2)).sum();
            let sigma: f64 = estimates.iter().map(|e| e.sigma.powi(2)).sum();
            Some(value.sqrt() + 2.0 * sigma.sqrt())
        });
        let unit = if term.is_known_size() { "m" } else { term.unit() };
        Limit { id: term.id().to_owned(), limit: median(each), unit: unit.to_owned() }
    };
    search.refused.iter().map(one).collect()
}

/// What would have been the first term in place of the one that was.
fn alternatives(search: &Search, table: &Table) -> Vec<Alternative> {
    let is_named = |term: &Term| table.iter().any(|(named, ..)| named == term);
    let of_named = search.first_scores.iter().filter(|(term, _)| is_named(term)).map(|(_, score)| *score);
    let Some(best) = of_named.reduce(f64::max) else { return Vec::new() };
    let others = search.first_scores.iter().filter(|(term, score)| !is_named(term) && *score > 0.0 && *score <= best);
    let one = |(term, score): &(Term, f64)| Alternative {
        effects: vec![term.id().to_owned()],
        posterior: posterior(score - best),
        delta_bic: best - score,
    };
    others.take(3).map(one).collect()
}

fn located(problem: &Problem, search: &Search, arcs: &[ArcAnswer], nothing: bool) -> Located {
    let odd: Vec<&ArcAnswer> = arcs.iter().filter(|arc| arc.verdict == Verdict::Unexplained).collect();
    if nothing && odd.is_empty() {
        return Located::default();
    }
    let interval = |arc: &&ArcAnswer| {
        let place = problem.arcs.iter().position(|a| a.id == arc.id)?;
        let own = &problem.arcs[place];
        let left_m = search.last().fits[place].rms_m(0..own.fitted);
        let has_formula = search.unlisted.is_some() || search.alone.iter().any(|one| one.arc == place);
        let of_arc = if has_formula { None } else { manoeuvre::span(problem, &search.end(), place) };
        let Some(([start_s, end_s], would_m)) = of_arc else {
            let why = format!("{}: {left_m:.3} m unexplained", arc.id);
            return Some(Interval { start_s: own.t_s[0], end_s: own.t_s[own.fitted - 1], why });
        };
        let why = format!(
            "{}: {left_m:.3} m unexplained; a push in this span, as two velocity steps, would leave {would_m:.3} m",
            arc.id
        );
        Some(Interval { start_s, end_s, why })
    };
    let axes = ["radial", "along", "cross"].map(str::to_owned).to_vec();
    let kicked = |one: &Manoeuvre| {
        let own = &problem.arcs[one.arc];
        Interval {
            start_s: one.impulse.at_s,
            end_s: own.t_s[own.fitted - 1],
            why: format!("{}: velocity step", own.id),
        }
    };
    let pushed = |one: &Own| {
        let own = &problem.arcs[one.arc];
        Interval {
            start_s: own.t_s[0],
            end_s: own.t_s[own.fitted - 1],
            why: format!("{}: {}", own.id, one.term.name()),
        }
    };
    Located {
        axes,
        frame: "lvlh".to_owned(),
        intervals: odd
            .iter()
            .filter_map(interval)
            .chain(search.manoeuvres.iter().map(kicked))
            .chain(search.own.iter().map(pushed))
            .collect(),
        ..Located::default()
    }
}
