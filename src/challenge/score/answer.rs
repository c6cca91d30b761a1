//! What of `diagnosis.json` is scored.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use crate::challenge::conceal::Truth;
use crate::diagnose::catalogue;

/// An answer, as far as it is scored.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// consistent, explained, ambiguous or unexplained.
    pub verdict: String,
    /// Probability of as much in a record without mismatch.
    #[serde(default)]
    pub false_alarm_probability: Option<f64>,
    /// The statistic behind it.
    #[serde(default)]
    pub statistic: Option<f64>,
    /// Log likelihood of slow noise.
    #[serde(default)]
    pub slow_evidence: Option<f64>,
    /// Named effects, in order.
    #[serde(default)]
    pub effects: Vec<Named>,
    /// Other sets.
    #[serde(default)]
    pub alternatives: Vec<Other>,
    /// Sets that cannot be told apart.
    #[serde(default)]
    pub cannot_tell_apart: Vec<Vec<String>>,
    /// The formula of an unlisted law.
    #[serde(default)]
    pub hypothesis: Option<serde_json::Value>,
    /// Figures of the fit.
    #[serde(default)]
    pub fit: Option<Fit>,
}

impl Answer {
    /// Whether it stands, by its default, in place of an answer that there is not.
    pub(super) fn is_none(&self) -> bool {
        self.verdict.is_empty()
    }
}

/// One named effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Catalogue id.
    pub id: String,
    /// Its numbers.
    #[serde(default)]
    pub parameters: Vec<Number>,
    /// A parameter that is a word.
    #[serde(default)]
    pub axis: Option<String>,
}

/// A number with its standard error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Number {
    /// Name.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub sigma: f64,
}

/// Another set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Other {
    /// Its ids.
    pub effects: Vec<String>,
}

/// Figures of the fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// On data the fit has not seen.
    #[serde(default)]
    pub held_out: Option<HeldOut>,
}

/// Prediction of data left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// Before, ng.
    pub before_rms_ng: [f64; 3],
    /// After, ng.
    pub after_rms_ng: [f64; 3],
    /// As the analyser reckons it.
    pub excess_removed: f64,
}

impl Answer {
    /// The first name given.
    pub fn first(&self) -> Option<&str> {
        let apart = || self.cannot_tell_apart.first().and_then(|set| set.first()).map(String::as_str);
        self.effects.first().map(|e| e.id.as_str()).or_else(apart)
    }

    /// The ids named.
    pub fn named(&self) -> BTreeSet<&str> {
        self.effects.iter().map(|e| e.id.as_str()).collect()
    }

    /// All sets reported: the named one, the alternatives, and those that cannot be told apart. Where nothing is claimed the alternatives
    /// are what comes nearest.
    pub fn sets(&self) -> BTreeSet<BTreeSet<&str>> {
        let others = self.alternatives.iter().map(|a| &a.effects).chain(&self.cannot_tell_apart);
        let others = others.map(|set| set.iter().map(String::as_str).collect());
        others.chain([self.named()]).filter(|set: &BTreeSet<&str>| !set.is_empty()).collect()
    }

    /// What the confusion table calls this answer.
    pub fn word(&self) -> String {
        match (self.verdict.as_str(), self.effects.is_empty()) {
            ("explained" | "ambiguous", false) => {
                let star = if self.verdict == "ambiguous" { " ?" } else { "" };
                format!("{}{star}", self.named().into_iter().collect::<Vec<_>>().join("+"))
            }
            (verdict, _) => format!("({verdict})"),
        }
    }
}

/// Whether a number is chosen among what the log says, and not fitted.
fn is_of_the_log(effect: &str, number: &str) -> bool {
    let nonlinear = catalogue::by_id(effect).map_or(&[][..], |effect| effect.nonlinear);
    nonlinear.iter().any(|p| p.name == number && p.step == 0.0)
}

/// Whether each number of a rightly named set is within two of its own standard errors of the truth.
pub fn within_two_sigma(truth: &Truth, answer: &Answer) -> Vec<(String, bool)> {
    if truth.effects.is_empty() || answer.named() != truth.ids().into_iter().collect::<BTreeSet<_>>() {
        return Vec::new();
    }
    let mut checks = Vec::new();
    for effect in &answer.effects {
        let Some(true_numbers) = truth.effects.get(&effect.id) else { continue };
        if true_numbers.get("axis").and_then(|a| a.as_str()) != effect.axis.as_deref() {
            continue;
        }
        for number in &effect.parameters {
            let Some(expected) = true_numbers.get(&number.name).and_then(serde_json::Value::as_f64) else { continue };
            let away = (number.value - expected).abs();
            let within = away <= 2.0 * number.sigma;
            // A time taken from the log is no estimate, and can only be that of another entry.
            if within && is_of_the_log(&effect.id, &number.name) {
                continue;
            }
            checks.push((format!("{} {}.{}", truth.case, effect.id, number.name), within));
        }
    }
    checks
}
