//! The truth of a concealed case, as `truth.json` has it on the open cases; ours carry the seed and the deleted effect beside it.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

/// What was left out of a case's simulation. Extra keys of other generators are ignored.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Truth {
    /// The case's id.
    pub case: String,
    /// clean, slow, one, two, unknown, single, deleted.
    pub kind: String,
    /// Id to parameters by name; a word (an axis) may be among them.
    #[serde(default)]
    pub effects: BTreeMap<String, BTreeMap<String, serde_json::Value>>,
    /// Matched-filter SNR of each.
    #[serde(default)]
    pub snr: BTreeMap<String, f64>,
    /// SNR left when the catalogue's effects imitate the only one best.
    #[serde(default)]
    pub snr_left: BTreeMap<String, f64>,
    /// Ids the record cannot tell from the truth.
    #[serde(default)]
    pub confusable: Vec<String>,
    /// RMS of each part, ng.
    #[serde(default)]
    pub part_rms_ng: BTreeMap<String, [f64; 3]>,
    /// Standard deviation of the noise as drawn, ng.
    #[serde(default)]
    pub noise_ng: [f64; 3],
    /// Slow noise per axis, ng, and its correlation time, s.
    #[serde(default, deserialize_with = "of_this_shape", skip_serializing_if = "Option::is_none")]
    pub slow_noise: Option<([f64; 3], f64)>,
    /// The effect to be deleted from the analyser's catalogue before the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deleted: Option<String>,
    /// Seed that draws the case again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

/// `None` where another generator says it in another shape.
fn of_this_shape<'de, D: Deserializer<'de>, T: DeserializeOwned>(value: D) -> Result<Option<T>, D::Error> {
    Ok(serde_json::from_value(serde_json::Value::deserialize(value)?).ok())
}

impl Truth {
    /// The ids of the truth, sorted.
    pub fn ids(&self) -> Vec<&str> {
        self.effects.keys().map(String::as_str).collect()
    }

    /// The weakest effect's SNR; 0 on a clean case.
    pub fn snr_min(&self) -> f64 {
        let least = self.snr.values().copied().fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 0.0 }
    }

    /// Other effects leave less than this of the truth, or there is nothing to confuse.
    pub fn is_identifiable(&self) -> bool {
        self.confusable.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_noise_that_another_generator_says_otherwise_is_no_error() {
        let of =
            |slow: &str| serde_json::from_str::<Truth>(&format!(r#"{{"case":"a","kind":"slow","slow_noise":{slow}}}"#));
        assert_eq!(of("[[1.0,2.0,3.0],600.0]").unwrap().slow_noise, Some(([1.0, 2.0, 3.0], 600.0)));
        assert_eq!(of(r#"{"x":{"ng":20.0,"tau_s":600.0}}"#).unwrap().slow_noise, None);
        assert_eq!(of("20.0").unwrap().slow_noise, None);
        assert!(of("").is_err());
    }
}
