//! The answer, field by field as `diagnosis.json` has it. Not here: how it is reached, and how it is drawn.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The least false-alarm probability that is told: nothing is known to hold farther out.
pub const LEAST_PROBABILITY: f64 = 1e-12;

/// The answer to one case. `NaN` never appears: what is not known is absent or null. Of a running diagnosis verdict and probability are
/// null while there is no answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Diagnosis {
    /// Always `oare.diagnosis/1`.
    pub schema: String,
    /// The case's id.
    pub case: String,
    /// What is claimed.
    #[schema(value_type = Option<Verdict>)]
    pub verdict: Verdict,
    /// Probability that a record without any mismatch scores as high as this one did.
    #[schema(value_type = Option<f64>)]
    pub false_alarm_probability: f64,
    /// What says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub false_alarm_from: Option<Source>,
    /// The statistic behind it: log posterior odds of the best hypothesis against none, less what they owe to noise that is louder than
    /// the noise fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub statistic: Option<f64>,
    /// Log likelihood of slow noise above that of hardly any, when nothing is left out: what the statistic is compared with depends
    /// on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slow_evidence: Option<f64>,
    /// Where the mismatch is, named or not.
    pub located: Located,
    /// What the simulation lacks, in order of posterior. Empty unless `explained` or `ambiguous`.
    pub effects: Vec<EffectAnswer>,
    /// Other sets that remain possible; where nothing is claimed, those that come nearest.
    pub alternatives: Vec<Alternative>,
    /// A formula for what nothing in the catalogue explains.
    pub hypothesis: Option<Hypothesis>,
    /// Before and after.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fit: Option<Fit>,
    /// How small each effect must be (95 %), where nothing is claimed of it.
    pub upper_limits: Vec<UpperLimit>,
    /// The cheapest observation that would decide between the sets of `cannot_tell_apart`.
    pub separating_observation: Option<SeparatingObservation>,
    /// Sets the record cannot choose between.
    pub cannot_tell_apart: Vec<Vec<String>>,
    /// One entry per satellite, for orbits.
    pub arcs: Vec<Arc>,
    /// What the reader must know before trusting the figures: a failed whiteness gate, a rejected size, a failed placebo.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl Diagnosis {
    /// Nothing is claimed of a case.
    pub fn nothing(case: &str, false_alarm_probability: f64) -> Self {
        Self {
            schema: "oare.diagnosis/1".into(),
            case: case.into(),
            verdict: Verdict::Consistent,
            false_alarm_probability,
            false_alarm_from: None,
            statistic: None,
            slow_evidence: None,
            located: Located { frame: "body".into(), ..Located::default() },
            effects: Vec::new(),
            alternatives: Vec::new(),
            hypothesis: None,
            fit: None,
            upper_limits: Vec::new(),
            separating_observation: None,
            cannot_tell_apart: Vec::new(),
            arcs: Vec::new(),
            notes: Vec::new(),
        }
    }
}

/// Where a false-alarm probability comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Records of noise alone, simulated once.
    NullTable,
    /// Replicates of this record's own noise.
    Bootstrap,
    /// The bound of Ville over all looks at a record that grows.
    Looks,
    /// What remains beside every set, by its own bound.
    Remains,
    /// The calibration of a dump, by its bound for false faults.
    Calibration,
}

impl Source {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::NullTable => "table of nulls",
            Self::Bootstrap => "bootstrap of this record",
            Self::Looks => "bound over all looks so far",
            Self::Remains => "bound of what remains",
            Self::Calibration => "calibration of the dump",
        }
    }
}

/// What is claimed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing is claimed; upper limits say how small each effect must be.
    Consistent,
    /// The named effects account for the mismatch.
    Explained,
    /// Several sets account for it equally.
    Ambiguous,
    /// Structure is there, and nothing in the catalogue fits.
    Unexplained,
}

impl Verdict {
    /// The word that stands for it in every answer.
    pub fn word(self) -> &'static str {
        match self {
            Self::Consistent => "consistent",
            Self::Explained => "explained",
            Self::Ambiguous => "ambiguous",
            Self::Unexplained => "unexplained",
        }
    }
}

/// Where the mismatch is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Located {
    /// Axes that carry it.
    pub axes: Vec<String>,
    /// The frame its direction is steadiest in: body, lvlh, inertial or sun.
    pub frame: String,
    /// Its unit vector there, when one direction dominates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<[f64; 3]>,
    /// When.
    pub intervals: Vec<Interval>,
    /// What it follows.
    pub covariates: Vec<Covariate>,
    /// Lines in cycles per orbit.
    pub per_orbit_lines: Vec<OrbitLine>,
}

/// A span of time and why it is named.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Interval {
    /// From, instrument clock.
    pub start_s: f64,
    /// To, instrument clock.
    pub end_s: f64,
    /// Why.
    pub why: String,
}

/// A covariate the residual follows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Covariate {
    /// Its name.
    pub name: String,
    /// Log evidence ratio of following it against not.
    pub score: f64,
}

/// A line of the spectrum.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OrbitLine {
    /// Frequency.
    pub cycles_per_orbit: f64,
    /// Body axis.
    pub axis: String,
    /// Amplitude.
    pub amplitude_ng: f64,
}

/// One named effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct EffectAnswer {
    /// Catalogue id.
    pub id: String,
    /// Catalogue name.
    pub name: String,
    /// Probability that it is part of the truth, among all sets weighed.
    pub posterior: f64,
    /// What the recording has and the simulation lacks.
    pub parameters: Vec<ParameterAnswer>,
    /// A parameter that is a word: the axis of a scale factor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<String>,
    /// One or two sentences a flight engineer can check.
    pub why: String,
    /// RMS of its contribution, body axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_ng: Option<[f64; 3]>,
}

impl EffectAnswer {
    /// The value of a parameter, where the effect has it.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.parameters.iter().find(|p| p.name == name).map(|p| p.value)
    }
}

/// A number with its standard error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ParameterAnswer {
    /// Name as in the catalogue.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub sigma: f64,
    /// Unit.
    pub unit: String,
}

/// Another possible set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Alternative {
    /// Its ids.
    pub effects: Vec<String>,
    /// Its probability.
    pub posterior: f64,
    /// Twice the log evidence it lacks against the reported set, or against nothing where none is reported; negative where it has more.
    pub delta_bic: f64,
}

/// A formula, never a physical name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Hypothesis {
    /// The formula.
    pub formula: String,
    /// Axis or axes it acts on.
    pub axis: String,
    /// Unit of its value.
    pub unit: String,
    /// Where it lives, and why the nearest catalogue effects fail.
    #[serde(rename = "where")]
    pub location: String,
}

/// Before and after.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Fit {
    /// RMS of the noise alone, by the fitted noise model.
    pub noise_floor_ng: [f64; 3],
    /// Without the effects.
    pub before: FitLevel,
    /// With them.
    pub after: FitLevel,
    /// On data the fit has not seen.
    pub held_out: HeldOut,
    /// Share of the effects predicted in those blocks held out of which the others can say more than half; none where these have too
    /// little of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confirmed: Option<f64>,
    /// Each attitude predicted from all others, where there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_out_attitudes: Option<HeldOut>,
    /// Log evidence by which the effects are above the best placebo: themselves, shifted in time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub above_placebo: Option<f64>,
}

/// RMS and whitened misfit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FitLevel {
    /// Per axis, a constant removed.
    pub rms_ng: [f64; 3],
    /// 1 for a model that leaves noise only.
    pub whitened_chi2_per_dof: f64,
}

/// Prediction of data left out of the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct HeldOut {
    /// How the data were divided.
    pub scheme: String,
    /// Without the effects.
    pub before_rms_ng: [f64; 3],
    /// With them.
    pub after_rms_ng: [f64; 3],
    /// Share of the excess over the noise that the prediction removes.
    pub excess_removed: f64,
    /// Gain of the log predictive density, the error of the fitted amplitudes counted. Where the part fitted says nothing of
    /// them it is that of their prior; `excess_removed` is then small.
    pub log_score_gain: f64,
    /// Its standard error over blocks; none where a single block was predicted.
    pub log_score_gain_se: Option<f64>,
}

/// A limit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UpperLimit {
    /// Catalogue id.
    pub id: String,
    /// RMS over all axes that the effect stays below with 95 % probability.
    pub limit_ng: f64,
}

/// An observation that would decide.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SeparatingObservation {
    /// attitude, table_flip or log.
    pub kind: String,
    /// What to do.
    pub text: String,
    /// Log evidence that it is expected to add for the true set against its nearest rival; None where it could not be simulated.
    pub gain: Option<f64>,
}

/// One satellite's part of an orbit case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = DiagnosisArc)]
pub struct Arc {
    /// Satellite.
    pub id: String,
    /// What is claimed of it.
    pub verdict: Verdict,
    /// Its effects.
    pub effects: Vec<EffectAnswer>,
    /// RMS before, m.
    pub rms_before: f64,
    /// RMS after, m.
    pub rms_after: f64,
    /// RMS of the prediction beyond the fit, m.
    pub predicted_rms: Option<f64>,
}
