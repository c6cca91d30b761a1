//! What the poses were found to lack, in words and figures. Not here: how it was found.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::blunder::Blunder;
use super::still::Pose;
use super::{Found, Part, Triad, fit};
use crate::diagnose::answer::{LEAST_PROBABILITY, Located, ParameterAnswer, Verdict};
use crate::diagnose::keys::texts;
use crate::diagnose::measured::answer::{
    ArcAnswer, Effect, Fit, HeldOut, Level, StepAnswer, in_order, parameter, posterior,
};
use crate::diagnose::measured::{Answer, MeasuredCase, log_score};
use crate::math::rms::rms;

/// Chance at or below which a scatter of the poses is called a mismatch.
const CLAIM: f64 = 0.002;

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
pub fn answer(case: &MeasuredCase, poses: &[Pose], blunders: &[Blunder], gravity: f64, found: &Found) -> Answer {
    let (first, last) = (&found.fits[0], &found.fits[found.fits.len() - 1]);
    // One reading's own scatter: poses that disagree by more than that hold something the model lacks.
    let reading = poses.iter().map(|p| p.scatter).sum::<f64>() / poses.len() as f64 * last.scale;
    let chance = chance(last, reading);
    let verdict = match (found.added.is_empty(), last.rms() > reading && chance <= CLAIM) {
        (_, true) => Verdict::Unexplained,
        (true, false) => Verdict::Consistent,
        (false, false) => Verdict::Explained,
    };
    let mut effects = Vec::new();
    for (i, (part, score)) in found.added.iter().enumerate() {
        let (before, with) = (&found.fits[i], &found.fits[i + 1]);
        let mut one = effect(case, last, *part, *score, [before.rms(), with.rms()]);
        one.rms = vec![before.rms_from(with)];
        effects.push(one);
    }
    let effects = in_order(effects);
    let step = |(i, fit): (usize, &Triad)| StepAnswer {
        added: i.checked_sub(1).map(|i| found.added[i].0.id().to_owned()),
        rms: fit.rms(),
        predicted_rms: Some(rms(&missed(&fit.parts, poses, gravity))),
        score: i.checked_sub(1).map(|i| found.added[i].1),
    };
    let level = |fit: &Triad| Level {
        rms: vec![fit.rms()],
        rms_total: fit.rms(),
        whitened_chi2_per_dof: (fit.rms() / reading).powi(2),
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
        fitted_beside: Vec::new(),
        rms_before: first.rms(),
        rms_after: last.rms(),
        predicted_rms: Some(after),
        fitted: poses.len(),
        masked: blunders.len(),
        note: None,
    };
    Answer {
        schema: "oare.diagnosis/1".to_owned(),
        case: case.id.clone(),
        verdict,
        false_alarm_probability: match verdict {
            Verdict::Unexplained => chance,
            _ => (-0.5 * found.added.last().map_or(found.refused, |a| a.1)).exp(),
        }
        .clamp(LEAST_PROBABILITY, 1.0),
        located: Located::default(),
        effects,
        alternatives: Vec::new(),
        hypothesis: None,
        unit: "m/s^2".to_owned(),
        fit: Fit { noise_floor: vec![reading], before: level(first), after: level(last), held_out: Some(held) },
        upper_limits: Vec::new(),
        separating_observation: None,
        cannot_tell_apart: Vec::new(),
        arcs: vec![arc],
        steps: found.fits.iter().enumerate().map(step).collect(),
        notes: notes(poses, blunders),
    }
}

fn notes(poses: &[Pose], blunders: &[Blunder]) -> Vec<String> {
    let found = format!(
        "{} static poses were found (a pose that was knocked and lay as before counts once); the common scale is estimated with every model.",
        poses.len() + blunders.len()
    );
    let left_out = blunders.iter().map(|Blunder { pose, off_m_s2 }| {
        format!(
            "The pose from {:.1} to {:.1} s is left out: its acceleration is off gravity by {off_m_s2:.4} m/s^2, which no model of the triad \
             that fits the others gives.",
            pose.start_s, pose.end_s
        )
    });
    std::iter::once(found).chain(left_out).collect()
}

/// The chance that poses scatter as they do about a model if each is as well known as one of its readings.
fn chance(fit: &Triad, reading: f64) -> f64 {
    let free = fit.residuals.len() as f64 - fit.unknowns.len() as f64;
    let chi2: f64 = fit.residuals.iter().map(|r| (r / reading).powi(2)).sum();
    ChiSquared::new(free).map_or(1.0, |law| law.sf(chi2))
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
