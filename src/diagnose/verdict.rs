//! From weighed hypotheses to what is said: consistent, explained, ambiguous or unexplained, with its figures.

use super::answer::{
    Alternative, Diagnosis, EffectAnswer, Fit, FitLevel, Hypothesis, Located, ParameterAnswer, UpperLimit, Verdict,
};
use super::catalogue::{self, Effect, WHOLE};
use super::design::{Chosen, Column, Frame};
use super::locate;
use super::model::{self, MemberFit};
use super::remains::{self, Remains};
use super::scene::{Axes, Scene};
use super::search::{self, Entry, Family, Set, Weighed};
use super::separating;
use super::solve::{Library, Solution};
use crate::math::rms::rms_about_mean;

/// Log odds by which an open form must beat the best listed set.
const OPEN_MARGIN: f64 = 3.0;
/// Log odds within which another set is as good, and the smaller of two nested sets is preferred.
const EQUAL: f64 = 2.3;
/// Log odds within which a set that does not hold the best one, nor is held by it, cannot be told from it: sets whose signatures
/// differ by an SNR of three come within this in more than half of all records.
const RIVAL: f64 = 5.0;
/// Posterior below which an alternative is not mentioned.
const MENTION: f64 = 0.004;
/// A remaining autocorrelation this unlikely makes the errors wider.
const WHITENESS_P: f64 = 1e-3;

/// Share of the allowed false alarms that goes to the evidence; the rest goes to what remains after it.
const EVIDENCE_SHARE: f64 = 0.8;
/// What remains overturns an explanation when it has more than this share of the energy explained.
const REMAINS_SHARE: f64 = 0.03;

/// What the answer rests on.
struct Best<'a> {
    weighed: &'a Weighed,
    frame: Frame,
    set: Set,
    fits: Vec<MemberFit>,
    contributions: Vec<Axes>,
}

/// Names of a set, for people and for `cannot_tell_apart`.
fn ids(library: &Library, set: &Set) -> Vec<String> {
    set.members
        .iter()
        .map(|m| match library.entries[m.entry].family {
            Family::Listed(effect) => effect.id.to_string(),
            Family::Open(i) => library.atoms[i].forms[m.theta[0] as usize].formula.clone(),
        })
        .collect()
}

fn effect_of(entries: &[Entry], set: &Set, i: usize) -> Option<&'static Effect> {
    match entries[set.members[i].entry].family {
        Family::Listed(effect) => Some(effect),
        Family::Open(_) => None,
    }
}

/// The answer, the claimed series at the windows, and the ladder of evidence.
pub fn conclude(
    scene: &Scene,
    library: &Library,
    solution: &Solution,
    probability: f64,
    claim: f64,
) -> (Diagnosis, Axes, Vec<(String, f64)>) {
    let null = solution.null.log_posterior;
    let mut ladder: Vec<(String, f64)> = solution
        .listed
        .iter()
        .chain(&solution.open)
        .map(|w| (ids(library, &w.set).join(" + "), w.log_posterior - null))
        .collect();
    ladder.push(("nothing".into(), 0.0));
    ladder.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut notes = Vec::new();
    if scene.case.windows_too_rough > 0 {
        notes.push(format!(
            "{} windows are left out: the simulation changes too fast there for its own grid",
            scene.case.windows_too_rough
        ));
    }
    let listed = credible(scene, library, &solution.listed, &mut notes);
    let top = |sets: &[&Weighed]| sets.first().map_or(f64::NEG_INFINITY, |w| w.log_posterior);
    let open: Vec<&Weighed> = solution.open.iter().collect();
    let refused = solution.listed.first().map_or(f64::NEG_INFINITY, |w| w.log_posterior) - top(&listed) > OPEN_MARGIN;
    let open_wins = top(&open) - top(&listed).max(null) > OPEN_MARGIN;
    let claimed = probability <= EVIDENCE_SHARE * claim
        && top(&listed).max(top(&open)).max(solution.listed.first().map_or(f64::NEG_INFINITY, |w| w.log_posterior))
            > null;
    let verdict = match (claimed, open_wins || refused) {
        (false, _) => Verdict::Consistent,
        (true, true) => Verdict::Unexplained,
        (true, false) => Verdict::Explained,
    };
    let chosen: Option<&Weighed> = match verdict {
        Verdict::Consistent => None,
        Verdict::Unexplained if open_wins => open.first().copied(),
        Verdict::Unexplained => solution.listed.first(),
        _ => Some(simplest(&listed)),
    };
    let (verdict, chosen, remains) = with_remains(scene, library, solution, (verdict, chosen), claim);
    let least = remains.as_ref().map_or(1.0, |r| r.probability);
    let overall = (probability / EVIDENCE_SHARE).min(least / (1.0 - EVIDENCE_SHARE)).min(1.0);
    let mut answer = Diagnosis { verdict, ..Diagnosis::nothing(&scene.case.header.id, overall) };
    answer.located.covariates =
        locate::covariates(solution.singles.iter().map(|(i, score)| (covariate(library, *i), *score)));
    let null_frame = Frame::new(&solution.null.noise, &scene.schedule, &scene.activity, &scene.residual_ng);
    let Some(weighed) = chosen else {
        answer.notes = notes;
        if let Some(r) = remains.filter(|_| verdict == Verdict::Unexplained) {
            answer.located.axes.clone_from(&r.axes);
            answer.hypothesis = Some(of_remains(&r, ""));
        }
        answer.upper_limits = upper_limits(scene, library, &null_frame, &Set::default());
        answer.fit = Some(fit(scene, library, &null_frame, &solution.null, &Set::default(), &mut answer.notes).0);
        return (answer, std::array::from_fn(|_| vec![0.0; scene.schedule.len()]), ladder);
    };
    let frame = Frame::new(&weighed.noise, &scene.schedule, &scene.activity, &scene.residual_ng);
    let mut set = weighed.set.clone();
    set.rewhiten(scene, &frame, &library.entries);
    let (fit, inflation) = fit(scene, library, &frame, weighed, &set, &mut notes);
    let fits = model::parameters(scene, &frame, &library.entries, &set, inflation);
    let contributions = set.contributions(scene, &frame, &library.entries);
    let best = Best { weighed, frame, set, fits, contributions };
    answer.fit = Some(fit);
    let signal = sum(scene, &best.contributions);
    let covariates = std::mem::take(&mut answer.located.covariates);
    answer.located = Located {
        covariates,
        per_orbit_lines: locate::lines(scene, &best.frame),
        ..locate::of_signal(scene, &signal, why_here(&best))
    };
    answer.upper_limits = upper_limits(scene, library, &best.frame, &best.set);
    match verdict {
        Verdict::Unexplained => {
            answer.hypothesis = Some(match remains.filter(|_| !open_wins && !refused) {
                Some(r) => of_remains(&r, &format!(" It remains beside {}.", ids(library, &best.set).join(" + "))),
                None => hypothesis(library, &best, &listed, open_wins),
            });
        }
        _ => name(&mut answer, scene, library, &best, &listed),
    }
    answer.notes = notes;
    (answer, signal, ladder)
}

/// Asks what remains, and lets it overturn the verdict: what an explanation leaves must be small beside what it explains.
fn with_remains<'a>(
    scene: &Scene,
    library: &Library,
    solution: &'a Solution,
    (verdict, chosen): (Verdict, Option<&'a Weighed>),
    claim: f64,
) -> (Verdict, Option<&'a Weighed>, Option<Remains>) {
    let weighed = chosen.unwrap_or(&solution.null);
    let frame = Frame::new(&weighed.noise, &scene.schedule, &scene.activity, &scene.residual_ng);
    let mut set = weighed.set.clone();
    set.rewhiten(scene, &frame, &library.entries);
    let left = search::residual(scene, &frame, &library.entries, &set);
    let after = Frame::new(&weighed.noise, &scene.schedule, &scene.activity, &left);
    let whitened: Axes = std::array::from_fn(|k| after.data.projected(k, &after));
    let remains = remains::strongest(scene.clock_s(), &whitened, weighed.noise.map(|n| n.rms_ng()));
    let explained = 2.0 * (weighed.log_posterior - solution.null.log_posterior);
    let overturns = remains
        .as_ref()
        .is_some_and(|r| r.probability <= (1.0 - EVIDENCE_SHARE) * claim && r.energy > REMAINS_SHARE * explained);
    match verdict {
        Verdict::Consistent | Verdict::Explained if overturns => (Verdict::Unexplained, chosen, remains),
        Verdict::Explained => (verdict, chosen, None),
        _ => (verdict, chosen, remains),
    }
}

fn of_remains(r: &Remains, beside: &str) -> Hypothesis {
    Hypothesis {
        formula: r.form.clone(),
        axis: r.axis.clone(),
        unit: "ng".into(),
        location: format!("{}.{beside}", r.location),
    }
}

/// Listed sets whose sizes can be believed; the others are refused, with the reason.
fn credible<'a>(scene: &Scene, library: &Library, sets: &'a [Weighed], notes: &mut Vec<String>) -> Vec<&'a Weighed> {
    let mut kept = Vec::new();
    for w in sets {
        let frame = Frame::new(&w.noise, &scene.schedule, &scene.activity, &scene.residual_ng);
        let mut set = w.set.clone();
        set.rewhiten(scene, &frame, &library.entries);
        let (mean, covariance) = set.coefficients(&frame, &library.entries);
        let mut next = 0;
        let mut reason = None;
        for (i, m) in set.members.iter().enumerate() {
            let Some(effect) = effect_of(&library.entries, &set, i) else { continue };
            for (k, l) in effect.linear.iter().enumerate().take(m.linear()) {
                if mean[next + k].abs() > l.size_max {
                    reason = Some(format!(
                        "{} is refused: it would need {} = {:.3} {}, and {} is the most that can be believed",
                        effect.id,
                        l.name,
                        mean[next + k],
                        l.unit,
                        l.size_max
                    ));
                }
                let (fraction, doubt) = (mean[next + k], 2.0 * covariance[(next + k, next + k)].max(0.0).sqrt());
                if l.whole && (fraction + doubt < WHOLE[0] || fraction - doubt > WHOLE[1]) {
                    reason = Some(format!(
                        "{} is refused: the term is left out or it is not, and {fraction:.2} of it is neither",
                        effect.id
                    ));
                }
            }
            next += m.linear();
        }
        match reason {
            None => kept.push(w),
            Some(reason) if !notes.contains(&reason) && notes.len() < 3 => notes.push(reason),
            Some(_) => {}
        }
    }
    kept
}

/// The smallest set that is part of the best one and as good.
fn simplest<'a>(listed: &[&'a Weighed]) -> &'a Weighed {
    let best = listed[0];
    let key = best.set.key();
    let nested = |w: &&&Weighed| w.set.members.len() < key.len() && w.set.key().iter().all(|e| key.contains(e));
    listed
        .iter()
        .filter(|w| best.log_posterior - w.log_posterior < EQUAL)
        .filter(nested)
        .min_by_key(|w| w.set.members.len())
        .copied()
        .unwrap_or(best)
}

/// Whether one set holds the other.
fn is_nested(a: &Set, b: &Set) -> bool {
    let (a, b) = (a.key(), b.key());
    a.iter().all(|e| b.contains(e)) || b.iter().all(|e| a.contains(e))
}

fn name(answer: &mut Diagnosis, scene: &Scene, library: &Library, best: &Best, listed: &[&Weighed]) {
    let top = listed[0].log_posterior;
    let total: f64 = listed.iter().map(|w| (w.log_posterior - top).exp()).sum();
    let posterior = |w: &Weighed| (w.log_posterior - top).exp() / total;
    let key = best.set.key();
    answer.effects = effects(library, best, |entry| {
        listed.iter().filter(|w| w.set.key().contains(&entry)).map(|w| posterior(w)).sum()
    });
    let others: Vec<&&Weighed> = listed.iter().filter(|w| w.set.key() != key).collect();
    let rivals: Vec<&&&Weighed> = others
        .iter()
        .filter(|w| best.weighed.log_posterior - w.log_posterior < RIVAL && !is_nested(&w.set, &best.set))
        .collect();
    let twin = step_at_mass_change(scene, library, best);
    if !rivals.is_empty() || twin.is_some() {
        answer.verdict = Verdict::Ambiguous;
        answer.cannot_tell_apart.push(ids(library, &best.set));
        answer.cannot_tell_apart.extend(rivals.iter().map(|w| ids(library, &w.set)));
        let sets: Vec<&Set> = std::iter::once(&best.set).chain(rivals.iter().map(|w| &w.set)).collect();
        let contestants = contestants(library, &sets, twin.is_some());
        answer.cannot_tell_apart.extend(twin);
        answer.separating_observation = separating::cheapest(scene, &best.weighed.noise, &contestants);
    }
    answer.alternatives = others
        .iter()
        .filter(|w| posterior(w) > MENTION && !rivals.iter().any(|r| r.set.key() == w.set.key()))
        .filter(|w| !is_nested(&w.set, &best.set) || w.log_posterior > best.weighed.log_posterior - EQUAL)
        .map(|w| Alternative {
            effects: ids(library, &w.set),
            posterior: posterior(w),
            delta_bic: 2.0 * (best.weighed.log_posterior - w.log_posterior),
        })
        .collect();
}

/// The set with its mass shift taken for a bias step at the same instant, when that fits as well: the instant is no
/// argument for either, since what shifts a mass may shift a bias.
fn step_at_mass_change(scene: &Scene, library: &Library, best: &Best) -> Option<Vec<String>> {
    let entries = &library.entries;
    let i = (0..best.set.members.len())
        .find(|i| effect_of(entries, &best.set, *i).is_some_and(|e| e.id == "mass_shift"))?;
    let step =
        entries[..library.listed].iter().find(|e| matches!(e.family, Family::Listed(e) if e.id == "bias_step"))?;
    let others = Set {
        members: best.set.members.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, m)| m.clone()).collect(),
        score: 0.0,
    };
    let chosen = others.chosen(&best.frame);
    let gain = |entry: &Entry, effect: &Effect, theta: &super::catalogue::Theta| {
        let raws = (effect.signature)(scene, theta).map(|s| s.columns()).unwrap_or_default();
        let columns: Vec<Column> =
            raws.iter().zip(&entry.sizes).map(|(raw, size)| best.frame.column(raw, *size)).collect();
        chosen.normal(&columns).explained()
    };
    let Family::Listed(step_effect) = step.family else { return None };
    let m = &best.set.members[i];
    let shift_effect = effect_of(entries, &best.set, i)?;
    let lacking = gain(&entries[m.entry], shift_effect, &m.theta) - gain(step, step_effect, &m.theta);
    (lacking < RIVAL).then(|| {
        ids(library, &best.set)
            .into_iter()
            .map(|id| if id == "mass_shift" { "bias_step".to_string() } else { id })
            .collect()
    })
}

/// The sets that cannot be told apart, best first, for the observation that would separate them; the last one may be the best
/// with its mass shift taken for a bias step.
fn contestants(library: &Library, sets: &[&Set], has_twin: bool) -> Vec<separating::Rival> {
    let part = |m: &search::Member| match library.entries[m.entry].family {
        Family::Listed(effect) => Some(separating::Part { effect, theta: m.theta }),
        Family::Open(_) => None,
    };
    let mut rivals: Vec<separating::Rival> =
        sets.iter().map(|set| set.members.iter().filter_map(part).collect()).collect();
    if let (true, Some(step)) = (has_twin, catalogue::by_id("bias_step")) {
        let stepping = |p: &separating::Part| match p.effect.id {
            "mass_shift" => separating::Part { effect: step, ..p.clone() },
            _ => p.clone(),
        };
        let twin = rivals[0].iter().map(stepping).collect();
        rivals.push(twin);
    }
    rivals
}

fn effects(library: &Library, best: &Best, posterior: impl Fn(usize) -> f64) -> Vec<EffectAnswer> {
    let mut out = Vec::new();
    for (i, m) in best.set.members.iter().enumerate() {
        let Some(effect) = effect_of(&library.entries, &best.set, i) else { continue };
        out.push(EffectAnswer {
            id: effect.id.into(),
            name: effect.name.into(),
            posterior: posterior(m.entry).min(1.0),
            parameters: best.fits[i]
                .parameters
                .iter()
                .map(|p| ParameterAnswer { name: p.name.into(), value: p.value, sigma: p.sigma, unit: p.unit.into() })
                .collect(),
            axis: best.fits[i].axis.clone(),
            why: effect.why.into(),
            rms_ng: Some(std::array::from_fn(|k| rms_about_mean(&best.contributions[i][k]))),
        });
    }
    out.sort_by(|a, b| b.posterior.total_cmp(&a.posterior));
    out
}

fn why_here(best: &Best) -> &'static str {
    let onset = best.fits.iter().any(|f| f.parameters.iter().any(|p| p.name == "onset_s"));
    if onset { "onset" } else { "largest part of the mismatch" }
}

fn hypothesis(library: &Library, best: &Best, listed: &[&Weighed], open_wins: bool) -> Hypothesis {
    let near = |w: &&Weighed| {
        format!(
            "{} lacks {:.1} in log evidence",
            ids(library, &w.set).join(" + "),
            best.weighed.log_posterior - w.log_posterior
        )
    };
    let fails = listed.iter().take(3).map(near).collect::<Vec<_>>().join("; ");
    if !open_wins {
        return Hypothesis {
            formula: "none".into(),
            axis: "x, y, z".into(),
            unit: "ng".into(),
            location: format!("No credible set of listed effects. {fails}"),
        };
    }
    let mut formula = Vec::new();
    let mut axis = Vec::new();
    let mut location = Vec::new();
    for (i, m) in best.set.members.iter().enumerate() {
        let Family::Open(atom) = library.entries[m.entry].family else { continue };
        let amplitudes: Vec<String> =
            best.fits[i].parameters.iter().map(|p| format!("{:.1}({:.1})", p.value, p.sigma)).collect();
        formula.push(format!(
            "[{}] x {}, scaled to unit deviation",
            amplitudes.join(", "),
            library.atoms[atom].forms[m.theta[0] as usize].formula
        ));
        axis.push(m.axis.map_or("x, y, z", |a| ["x", "y", "z"][a]));
        location.push(library.atoms[atom].location);
    }
    let failing = if fails.is_empty() { String::new() } else { format!(" Near catalogue effects fail: {fails}.") };
    Hypothesis {
        formula: formula.join(" + "),
        axis: axis.join("; "),
        unit: "ng".into(),
        location: format!("It lives in {}.{failing}", location.join(" and ")),
    }
}

fn covariate(library: &Library, entry: usize) -> String {
    match library.entries[entry].family {
        Family::Listed(effect) => effect.id.to_string(),
        Family::Open(i) => library.atoms[i].covariate.to_string(),
    }
}

fn sum(scene: &Scene, parts: &[Axes]) -> Axes {
    let mut total: Axes = std::array::from_fn(|_| vec![0.0; scene.schedule.len()]);
    for part in parts {
        for (t, p) in total.iter_mut().zip(part) {
            t.iter_mut().zip(p).for_each(|(a, b)| *a += b);
        }
    }
    total
}

/// Before and after, and by how much the errors must be widened.
fn fit(
    scene: &Scene,
    library: &Library,
    frame: &Frame,
    weighed: &Weighed,
    set: &Set,
    notes: &mut Vec<String>,
) -> (Fit, f64) {
    let entries = &library.entries;
    let left = search::residual(scene, frame, entries, set);
    let after = Frame::new(&weighed.noise, &scene.schedule, &scene.activity, &left);
    let dof = 3.0 * (scene.schedule.len() as f64 - 1.0);
    let level = |axes: &Axes, f: &Frame, used: f64| FitLevel {
        rms_ng: std::array::from_fn(|k| rms_about_mean(&axes[k])),
        whitened_chi2_per_dof: f.data.dot(&f.data) / (dof - used),
    };
    let used: f64 = set.members.iter().map(|m| m.linear() as f64).sum();
    let mut inflation = 1.0_f64;
    for k in 0..3 {
        let (p, ratio) = whiteness(&after.data.projected(k, &after));
        if p < WHITENESS_P {
            inflation = inflation.max(ratio.sqrt());
            notes.push(format!(
                "the whitened residual of axis {} is not white (p = {p:.1e}): errors are widened by {:.2}",
                ["x", "y", "z"][k],
                ratio.sqrt()
            ));
        }
    }
    let held_out = model::held_out(scene, frame, entries, set, &weighed.noise);
    if !set.members.is_empty() && held_out.log_score_gain <= 0.0 {
        notes.push("the fit does not predict blocks it has not seen".into());
    }
    let fit = Fit {
        noise_floor_ng: std::array::from_fn(|k| weighed.noise[k].rms_ng()),
        before: level(&scene.residual_ng, frame, 0.0),
        after: level(&left, &after, used),
        held_out,
    };
    (fit, inflation)
}

/// Ljung-Box over twenty lags: its p value, and the statistic against what is expected.
fn whiteness(x: &[f64]) -> (f64, f64) {
    const LAGS: usize = 20;
    let n = x.len() as f64;
    let energy: f64 = x.iter().map(|v| v * v).sum();
    let q: f64 = (1..=LAGS)
        .map(|lag| {
            let r: f64 = x.iter().zip(&x[lag..]).map(|(a, b)| a * b).sum::<f64>() / energy;
            r * r / (n - lag as f64)
        })
        .sum::<f64>()
        * n
        * (n + 2.0);
    // Wilson and Hilferty 1931: the cube root of a chi square is nearly normal.
    let k = LAGS as f64;
    let z = ((q / k).cbrt() - (1.0 - 2.0 / (9.0 * k))) / (2.0 / (9.0 * k)).sqrt();
    (0.5 * statrs::function::erf::erfc(z / std::f64::consts::SQRT_2), (q / k).max(1.0))
}

/// 95 % limits on the size of every listed effect that is not claimed, beside what is.
fn upper_limits(scene: &Scene, library: &Library, frame: &Frame, set: &Set) -> Vec<UpperLimit> {
    let chosen = set.chosen(frame);
    let n = scene.schedule.len() as f64;
    let mut out = Vec::new();
    for (index, entry) in library.entries[..library.listed].iter().enumerate() {
        let Family::Listed(effect) = entry.family else { continue };
        if set.members.iter().any(|m| m.entry == index) {
            continue;
        }
        // A dozen of the starting points: the loosest of them is the limit.
        let stride = entry.points.len().div_ceil(12);
        let limits = entry.points.iter().step_by(stride).map(|(_, shape)| {
            let raws = shape.columns();
            let scales: Vec<f64> = raws
                .iter()
                .map(|raw| (raw.iter().flatten().map(|s| rms_about_mean(s).powi(2)).sum::<f64>()).sqrt().max(1e-30))
                .collect();
            let columns: Vec<Column> = raws.iter().zip(&scales).map(|(raw, s)| frame.column(raw, 300.0 / s)).collect();
            let (value, sigma) = conditional(&chosen, &columns);
            value + 1.645 * sigma
        });
        let limit_ng = 300.0 * limits.fold(0.0, f64::max);
        if limit_ng.is_finite() && n > 0.0 {
            out.push(UpperLimit { id: effect.id.into(), limit_ng: (limit_ng * 100.0).round() / 100.0 });
        }
    }
    out
}

/// Size and standard error of the largest of several columns beside those chosen, in units of their prior.
fn conditional(chosen: &Chosen, columns: &[Column]) -> (f64, f64) {
    let mut worst = (0.0_f64, 0.0_f64);
    for column in columns {
        let (a, y) = chosen.left_in(column);
        let (value, sigma) = (y / (a + 1.0), (a + 1.0).sqrt().recip());
        if value.abs() + 1.645 * sigma > worst.0 + 1.645 * worst.1 {
            worst = (value.abs(), sigma);
        }
    }
    worst
}
