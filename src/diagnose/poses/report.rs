//! What the poses were found to lack, in words and figures. Not here: how it was found.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::blunder::{Blunder, FarOff};
use super::still::Pose;
use super::structure::Structure;
use super::{Found, Part, Triad, fit, poses_needed};
use crate::diagnose::answer::{Covariate, Hypothesis, Interval, LEAST_PROBABILITY, Located, ParameterAnswer, Verdict};
use crate::diagnose::keys::texts;
use crate::diagnose::measured::answer::{
    ArcAnswer, Effect, Fit, HeldOut, Level, Limit, StepAnswer, in_order, parameter, posterior,
};
use crate::diagnose::measured::{Answer, MeasuredCase, log_score};
use crate::math::rms::rms;

/// Chance at or below which what the poses follow is a mismatch, and a scatter is told.
const CLAIM: f64 = 0.002;

/// Poses that scatter by so many times what their readings say, and of which some are far off or too many parts are not asked, lack something.
const FAR: f64 = 3.0;

/// What was seen of the poses.
pub struct Seen<'a> {
    /// Those used.
    pub poses: &'a [Pose],
    /// What is far off.
    pub far_off: &'a FarOff,
    /// m/s^2.
    pub gravity: f64,
    /// Parts found.
    pub found: &'a Found,
    /// What the fullest model leaves follows.
    pub remains: Option<Structure>,
}

/// Unit of the readings, by the names of their columns.
fn unit(case: &MeasuredCase) -> String {
    let columns = texts(&case.table, "recording.columns").unwrap_or_default();
    let named = columns.iter().find_map(|c| c.strip_prefix("x_")).unwrap_or("counts");
    match named {
        "m_s2" => "m/s^2".to_owned(),
        other => other.to_owned(),
    }
}

fn effect(case: &MeasuredCase, fit: &Triad, part: Part, score: f64, [was, is]: [f64; 2]) -> Effect {
    let values = fit.values(part);
    let unit = if part == Part::Bias { unit(case) } else { part.unit().to_owned() };
    let mut parameters: Vec<ParameterAnswer> =
        (0..3).map(|k| parameter(part.names()[k], values[k].0, values[k].1, &unit)).collect();
    let largest = (0..3).max_by(|a, b| values[*a].0.abs().total_cmp(&values[*b].0.abs())).unwrap_or(0);
    let extra = match part {
        Part::Bias => format!(" In m/s^2 its largest is {:.4}.", values[largest].0 * fit.scale),
        Part::Scale => {
            " The fraction is that of the named axis against the other two; those of all three are beside the common \
                        scale and add to nothing."
                .to_owned()
        }
        Part::NonOrthogonality => " A rigid rotation of the triad cannot show in a magnitude.".to_owned(),
    };
    let why = format!("With it |a| - g falls from {was:.5} to {is:.5} m/s^2 rms.{extra}");
    let axis = (part == Part::Scale).then(|| ["x", "y", "z"][largest].to_owned());
    if part == Part::Scale {
        let (value, sigma) = values[largest];
        // The three add to nothing: the others have minus half of it in the mean.
        let others = 1.0 - 0.5 * value;
        let beyond = (1.0 + value) / others - 1.0;
        parameters.insert(0, parameter("fraction", beyond, 1.5 * sigma / others.powi(2), &unit));
    }
    let (id, name) = (part.id().to_owned(), part.name().to_owned());
    Effect { id, name, posterior: posterior(score), parameters, axis, from_degree: None, why, rms: vec![fit.rms()] }
}

/// The answer.
pub fn answer(case: &MeasuredCase, seen: &Seen) -> Answer {
    let &Seen { poses, far_off, gravity, found, .. } = seen;
    let (first, last) = (&found.fits[0], &found.fits[found.fits.len() - 1]);
    // What a pose's own readings say of its mean; those that never change say nothing.
    let floor = (rms(&poses.iter().map(|p| p.error).collect::<Vec<f64>>()) * last.usual_scale).max(1e-12);
    let remains = seen.remains.as_ref().filter(|r| r.probability <= CLAIM);
    let scatters = scatter_chance(last, poses, floor) <= CLAIM;
    let far = scatters && rms(&last.residuals) > FAR * floor;
    let few = found.added.is_empty() && poses.len() < poses_needed(&Part::ALL);
    let cannot_tell = few || matches!(far_off, FarOff::TooMany(_));
    let odd = remains.is_some() || (far && cannot_tell);
    let verdict = match (found.added.is_empty(), odd) {
        (_, true) => Verdict::Unexplained,
        (true, false) => Verdict::Consistent,
        (false, false) if found.rivals.is_empty() => Verdict::Explained,
        (false, false) => Verdict::Ambiguous,
    };
    let ids = |parts: &[Part]| parts.iter().map(|part| part.id().to_owned()).collect::<Vec<String>>();
    let named: Vec<Part> = found.added.iter().map(|(part, _)| *part).collect();
    let sets = || std::iter::once(&named).chain(&found.rivals).map(|set| ids(set)).collect();
    let mut effects = Vec::new();
    for (i, (part, score)) in found.added.iter().enumerate() {
        let (before, with) = (&found.fits[i], &found.fits[i + 1]);
        let mut one = effect(case, last, *part, *score, [before.rms(), with.rms()]);
        one.rms = vec![before.rms_from(with)];
        effects.push(one);
    }
    let effects = in_order(effects);
    // Where what is left follows something nothing is given a cause.
    let (effects, fitted_beside) = if odd { (Vec::new(), effects) } else { (effects, Vec::new()) };
    let step = |(i, fit): (usize, &Triad)| StepAnswer {
        added: i.checked_sub(1).map(|i| found.added[i].0.id().to_owned()),
        rms: fit.rms(),
        predicted_rms: Some(rms(&missed(&fit.parts, poses, gravity))),
        score: i.checked_sub(1).map(|i| found.added[i].1),
    };
    let level = |fit: &Triad| Level {
        rms: vec![fit.rms()],
        rms_total: fit.rms(),
        whitened_chi2_per_dof: (rms(&fit.residuals) / floor).powi(2),
    };
    let [before, after] = [first, last].map(|fit| missed(&fit.parts, poses, gravity));
    let score = log_score::rises(&before, &after).map(|rises| log_score::gain(&rises));
    let [before, after] = [before, after].map(|missed| rms(&missed));
    let held = HeldOut {
        scheme: "every other pose fitted, the rest predicted, both ways".to_owned(),
        before_rms: vec![before],
        after_rms: vec![after],
        excess_removed: 1.0 - (after / before).powi(2),
        log_score_gain: score.map(|[gain, _]| gain),
        log_score_gain_se: score.map(|[_, error]| error),
    };
    let arc = ArcAnswer {
        id: "poses".to_owned(),
        verdict,
        effects: effects.clone(),
        fitted_beside,
        rms_before: first.rms(),
        rms_after: last.rms(),
        predicted_rms: Some(after),
        fitted: poses.len(),
        masked: far_off.left_out().len(),
        note: None,
    };
    Answer {
        schema: "oare.diagnosis/1".to_owned(),
        case: case.id.clone(),
        verdict,
        false_alarm_probability: match verdict {
            Verdict::Unexplained => remains.map_or_else(|| scatter_chance(last, poses, floor), |r| r.probability),
            _ => (-0.5 * found.added.last().map_or(found.refused, |a| a.1)).exp(),
        }
        .clamp(LEAST_PROBABILITY, 1.0),
        located: if odd { located(remains, far_off) } else { Located::default() },
        effects,
        alternatives: Vec::new(),
        hypothesis: remains.map(|r| hypothesis(r, found)),
        unit: "m/s^2".to_owned(),
        fit: Fit { noise_floor: vec![floor], before: level(first), after: level(last), held_out: Some(held) },
        upper_limits: if verdict == Verdict::Consistent { limits(case, seen) } else { Vec::new() },
        separating_observation: None,
        cannot_tell_apart: if verdict == Verdict::Ambiguous { sets() } else { Vec::new() },
        arcs: vec![arc],
        steps: found.fits.iter().enumerate().map(step).collect(),
        notes: notes(seen, (scatters && !odd).then(|| [rms(&last.residuals), floor])),
    }
}

/// How large each part could be that nothing is claimed of and that so many poses can carry: the largest of its three numbers.
fn limits(case: &MeasuredCase, seen: &Seen) -> Vec<Limit> {
    let has = &seen.found.fits[0].parts;
    let open = Part::ALL.into_iter().filter(|part| !has.contains(part));
    let limit = |part: Part| {
        let parts = [&has[..], &[part]].concat();
        let carried = seen.poses.len() >= poses_needed(&parts);
        let largest =
            |fit: Triad| fit.values(part).iter().map(|(value, sigma)| value.abs() + 2.0 * sigma).fold(0.0, f64::max);
        let unit = if part == Part::Bias { unit(case) } else { part.unit().to_owned() };
        carried.then(|| Limit { id: part.id().to_owned(), limit: largest(fit(&parts, seen.poses, seen.gravity)), unit })
    };
    open.filter_map(limit).collect()
}

/// Where what the poses follow is, and those that are far off.
fn located(remains: Option<&Structure>, far_off: &FarOff) -> Located {
    let follows =
        |r: &Structure| Covariate { name: "direction of gravity in the triad, and time".into(), score: r.energy };
    let mut intervals = Vec::new();
    if let FarOff::TooMany(all) = far_off {
        let off = |b: &Blunder| Interval { start_s: b.pose.start_s, end_s: b.pose.end_s, why: "a pose far off".into() };
        intervals.extend(all.iter().map(off));
    }
    Located {
        axes: remains.map_or(Vec::new(), |r| r.axes.iter().map(|axis| (*axis).to_owned()).collect()),
        frame: "sensor".to_owned(),
        covariates: remains.map(follows).into_iter().collect(),
        intervals,
        ..Located::default()
    }
}

fn hypothesis(remains: &Structure, found: &Found) -> Hypothesis {
    let beside: Vec<&str> = found.added.iter().map(|(part, _)| part.id()).collect();
    let beside = if beside.is_empty() { String::new() } else { format!(" It remains beside {}.", beside.join(" + ")) };
    Hypothesis {
        formula: remains.formula.clone(),
        axis: remains.axes.join(", "),
        unit: "m/s^2".to_owned(),
        location: format!(
            "In |a| - g beside a zero, scales and angles of the axes; d is the direction of gravity's reaction in the triad, t goes from 0 at the \
             first pose to 1 at the last{}.{beside}",
            remains.from_s.map(|s| format!("; it begins at {s:.1} s")).unwrap_or_default()
        ),
    }
}

/// `scatter`, m/s^2: by how much poses scatter about the last fit, and what their readings say, where it is more and follows nothing.
fn notes(seen: &Seen, scatter: Option<[f64; 2]>) -> Vec<String> {
    let poses = seen.poses;
    let mut notes = vec![format!(
        "{} static poses were found (a pose that was knocked and lay as before counts once); the common scale is estimated with every model.",
        poses.len() + seen.far_off.left_out().len()
    )];
    notes.extend(seen.far_off.left_out().iter().map(|Blunder { pose, off_m_s2 }| {
        format!(
            "The pose from {:.1} to {:.1} s is left out: its acceleration is off gravity by {off_m_s2:.4} m/s^2, which no model of the triad \
             that fits the others gives.",
            pose.start_s, pose.end_s
        )
    }));
    if let FarOff::TooMany(all) = seen.far_off {
        notes.push(format!(
            "{} of {} poses are far off what fits the others: too many for blunders, and none is left out.",
            all.len(),
            poses.len()
        ));
    }
    let needed = poses_needed(&Part::ALL);
    if poses.len() < needed {
        notes.push(format!(
            "{} poses cannot carry a zero, scales and angles together, for which {needed} are needed: what is not asked is not excluded.",
            poses.len()
        ));
    }
    if let Some([scatter, floor]) = scatter {
        notes.push(format!(
            "Poses scatter by {scatter:.5} m/s^2, and their own readings say {floor:.5}: what differs from pose to pose without following \
             anything that was asked is taken as their error."
        ));
    }
    notes
}

/// The chance that poses scatter as they do about a model if each is as well known as its own readings say, which is estimated from as many
/// numbers as there are axes of poses.
fn scatter_chance(fit: &Triad, poses: &[Pose], floor: f64) -> f64 {
    let free = fit.residuals.len() as f64 - fit.unknowns.len() as f64;
    let variance = fit.residuals.iter().map(|r| r * r).sum::<f64>() / free;
    FisherSnedecor::new(free, 3.0 * poses.len() as f64).map_or(1.0, |law| law.sf(variance / floor.powi(2)))
}

/// By how much every pose is missed by what is fitted to half of them, the other half, m/s^2.
fn missed(parts: &[Part], poses: &[Pose], gravity: f64) -> Vec<f64> {
    let half = |odd: usize| poses.iter().skip(odd).step_by(2).copied().collect::<Vec<Pose>>();
    let (even, odd) = (half(0), half(1));
    let mut missed = fit(parts, &even, gravity).predict(&odd, gravity);
    missed.extend(fit(parts, &odd, gravity).predict(&even, gravity));
    missed.iter_mut().for_each(|error| *error = error.abs());
    missed
}
