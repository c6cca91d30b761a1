//! The answer of cases that are not in nano-g: the same fields as `diagnosis.json` has everywhere, with `unit` beside
//! `fit` and `rms` in place of `rms_ng`.

use serde::Serialize;

use crate::diagnose::answer::{Alternative, Hypothesis, Located, ParameterAnswer, SeparatingObservation, Verdict};

/// The answer to one case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Answer {
    /// Always `oare.diagnosis/1`.
    pub schema: String,
    /// The case's id.
    pub case: String,
    /// What is claimed.
    pub verdict: Verdict,
    /// Chance that a recording without any mismatch would look like this one.
    pub false_alarm_probability: f64,
    /// Where the mismatch is.
    pub located: Located,
    /// What the simulation lacks, in order of posterior.
    pub effects: Vec<Effect>,
    /// Other sets that remain possible.
    pub alternatives: Vec<Alternative>,
    /// A formula for what nothing in the catalogue explains.
    pub hypothesis: Option<Hypothesis>,
    /// Unit of every `rms` here.
    pub unit: String,
    /// Before and after.
    pub fit: Fit,
    /// How small each effect must be where nothing is claimed of it.
    pub upper_limits: Vec<Limit>,
    /// The observation that would decide.
    pub separating_observation: Option<SeparatingObservation>,
    /// Sets the recording cannot choose between.
    pub cannot_tell_apart: Vec<Vec<String>>,
    /// One entry per satellite, axis or set of poses.
    pub arcs: Vec<ArcAnswer>,
    /// The way from before to after, one entry per effect added.
    pub steps: Vec<StepAnswer>,
    /// What a reader must know before trusting the figures.
    pub notes: Vec<String>,
}

/// One named effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Catalogue id.
    pub id: String,
    /// Catalogue name.
    pub name: String,
    /// Probability that it is part of the truth.
    pub posterior: f64,
    /// What the recording has and the simulation lacks.
    pub parameters: Vec<ParameterAnswer>,
    /// A parameter that is a word.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// For `gravity_degree`: the first degree that is lacking.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_degree: Option<usize>,
    /// One or two sentences that can be checked.
    pub why: String,
    /// RMS of its contribution: by what it changes the residual when it joins those before it, everything else fitted anew.
    pub rms: Vec<f64>,
}

/// Before and after, in `unit`.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Fit {
    /// What an individual measurement is good for.
    pub noise_floor: Vec<f64>,
    /// Without the effects.
    pub before: Level,
    /// With them.
    pub after: Level,
    /// On data the fit has not seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out: Option<HeldOut>,
}

/// RMS and misfit.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Level {
    /// Per axis.
    pub rms: Vec<f64>,
    /// Of the whole vector.
    pub rms_total: f64,
    /// 1 for a model that leaves noise only; of poses against the error that their own readings say.
    pub whitened_chi2_per_dof: f64,
}

/// Prediction of data left out of the fit.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct HeldOut {
    /// How the data were divided.
    pub scheme: String,
    /// Without the effects.
    pub before_rms: Vec<f64>,
    /// With them.
    pub after_rms: Vec<f64>,
    /// Share of the excess over the noise that the prediction removes.
    pub excess_removed: f64,
    /// Log score gained on the units left out (see [`super::log_score`]); none of fewer than three.
    pub log_score_gain: Option<f64>,
    /// Its standard error.
    pub log_score_gain_se: Option<f64>,
}

/// A limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Limit {
    /// Catalogue id.
    pub id: String,
    /// RMS that the effect stays below with 95 % probability.
    pub limit: f64,
    /// Its unit.
    pub unit: String,
}

/// One satellite, axis or set of poses.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArcAnswer {
    /// Its name.
    pub id: String,
    /// What is claimed of it.
    pub verdict: Verdict,
    /// Its effects, in order of posterior.
    pub effects: Vec<Effect>,
    /// Terms fitted to it together with all others, where what is left is given no cause, or that it alone does not show.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fitted_beside: Vec<Effect>,
    /// RMS before.
    pub rms_before: f64,
    /// RMS after.
    pub rms_after: f64,
    /// RMS of the prediction beyond the fit.
    pub predicted_rms: Option<f64>,
    /// Epochs used for the fit.
    pub fitted: usize,
    /// Epochs that could not be used.
    pub masked: usize,
    /// A sentence where the verdict needs one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// One step on the way.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StepAnswer {
    /// The effect added; nothing at the start.
    pub added: Option<String>,
    /// RMS after the step (median where there are several arcs).
    pub rms: f64,
    /// RMS of the prediction beyond the fit, likewise.
    pub predicted_rms: Option<f64>,
    /// Evidence for the step: twice the log of the ratio of likelihoods, less the price of its parameters.
    pub score: Option<f64>,
}

/// A parameter.
pub fn parameter(name: &str, value: f64, sigma: f64, unit: &str) -> ParameterAnswer {
    ParameterAnswer { name: name.to_owned(), value, sigma, unit: unit.to_owned() }
}

/// Effects in order of posterior, those that are as likely as they stood.
pub fn in_order(mut effects: Vec<Effect>) -> Vec<Effect> {
    effects.sort_by(|a, b| b.posterior.total_cmp(&a.posterior));
    effects
}

/// Posterior of an effect from its score, with even odds beforehand.
pub fn posterior(score: f64) -> f64 {
    1.0 / (1.0 + (-0.5 * score).exp())
}
