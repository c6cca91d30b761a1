//! Cases whose recording is a real one of another kind: precise orbits, sensor series with covariates, static poses.
//!
//! `case.toml` to a checked case, its files' texts to an [`Answer`] in the recording's own unit. Not here: files (the
//! command reads them), and the windows of the accelerometer (`diagnose::case`).

pub mod answer;
mod figures;
pub mod log_score;
pub mod page;
pub mod plates;
pub mod spread;

use std::collections::BTreeMap;

use thiserror::Error;

pub use answer::Answer;
pub use plates::Plates;

use crate::diagnose::case::KEYS;
use crate::diagnose::keys::{self, lookup, texts};
use crate::diagnose::orbit::{self, OrbitError};

/// A case of these kinds that cannot be analysed.
#[derive(Debug, Error)]
pub enum MeasuredError {
    /// `case.toml` is not TOML.
    #[error("case.toml: {0}")]
    Toml(String),
    /// A key is missing or of another kind than expected.
    #[error("case.toml: `{key}`: expected {expected}, found {found}")]
    Key {
        /// Dotted key.
        key: String,
        /// What belongs there.
        expected: &'static str,
        /// What was there.
        found: String,
    },
    /// A file that the case names was not given.
    #[error("{file}: the case names this file, but it is not there")]
    MissingFile {
        /// Its name.
        file: String,
    },
    /// A line of a recording.
    #[error("{file}, line {line}: expected {expected}, found {found:?}")]
    Line {
        /// File name.
        file: String,
        /// Line number, from 1.
        line: usize,
        /// What belongs there.
        expected: String,
        /// What was there.
        found: String,
    },
    /// Too little to work on.
    #[error("the recording holds {found} usable {what}, expected at least {expected}")]
    TooFew {
        /// Of what.
        what: &'static str,
        /// How many.
        found: usize,
        /// How many are needed.
        expected: usize,
    },
    /// A precise orbit.
    #[error(transparent)]
    Orbit(#[from] OrbitError),
}

/// What kind the recording is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// SP3 orbits.
    OrbitSp3,
    /// A sensor series with covariates.
    SeriesCsv,
    /// Raw counts of a triad held still in many poses.
    StaticPoses,
}

/// A checked case.
#[derive(Debug, Clone)]
pub struct MeasuredCase {
    /// Its id.
    pub id: String,
    /// What the simulation's author believes it includes.
    pub includes: Vec<String>,
    /// Kind of recording.
    pub kind: Kind,
    /// All of `case.toml`.
    pub table: toml::Table,
}

impl MeasuredCase {
    /// The kind named in a `case.toml` with overrides, if it is one of these.
    pub fn kind_of(text: &str, overrides: &[String]) -> Option<Kind> {
        let mut table: toml::Table = text.parse().ok()?;
        for one in overrides {
            keys::set(&mut table, one)?;
        }
        kind(&table)
    }

    /// From `case.toml` and overrides such as `recording.fit_hours=24`.
    pub fn parse(text: &str, overrides: &[String]) -> Result<Self, MeasuredError> {
        let mut table: toml::Table =
            text.parse().map_err(|e: toml::de::Error| MeasuredError::Toml(e.message().to_owned()))?;
        for one in overrides {
            keys::set(&mut table, one).ok_or_else(|| MeasuredError::Key {
                key: one.clone(),
                expected: "key=value",
                found: one.clone(),
            })?;
        }
        let wrong = |key: &str, expected| MeasuredError::Key {
            key: key.to_owned(),
            expected,
            found: lookup(&table, key).map_or("nothing".to_owned(), ToString::to_string),
        };
        let kind =
            kind(&table).ok_or_else(|| wrong("recording.kind", "\"orbit_sp3\", \"series_csv\" or \"static_poses\""))?;
        let id = lookup(&table, "case.id").and_then(|v| v.as_str()).unwrap_or("unnamed").to_owned();
        let includes = match lookup(&table, "simulation.includes") {
            Some(_) => {
                texts(&table, "simulation.includes").ok_or_else(|| wrong("simulation.includes", "a list of texts"))?
            }
            None => Vec::new(),
        };
        Ok(Self { id, includes, kind, table })
    }

    /// Names of the files the case needs, relative to its folder.
    pub fn files(&self) -> Vec<String> {
        let one = |key: &str| lookup(&self.table, key).and_then(|v| v.as_str()).map(str::to_owned);
        match self.kind {
            Kind::OrbitSp3 => {
                let mut names = texts(&self.table, "recording.files").unwrap_or_default();
                names
                    .extend(["recording.file", "recording.eop", "recording.gravity"].iter().filter_map(|key| one(key)));
                names
            }
            Kind::SeriesCsv | Kind::StaticPoses => one("recording.file").into_iter().collect(),
        }
    }

    /// The dotted keys that cases of its kind do not have, and that nothing reads: one that is mistyped is among them.
    fn unknown_keys(&self) -> Vec<String> {
        let of_its_kind: &[&str] = match self.kind {
            Kind::OrbitSp3 => &["files", "eop", "gravity", "satellites", "position_sigma_m", "fit_hours"],
            Kind::SeriesCsv => &["time.column", "time.format", "values", "controls", "covariates", "spans_h"],
            Kind::StaticPoses => &["columns", "gravity_m_s2", "zero_counts"],
        };
        let of_recording = of_its_kind.iter().map(|key| format!("recording.{key}"));
        let known: Vec<String> = KEYS.iter().map(|key| (*key).to_owned()).chain(of_recording).collect();
        keys::unknown(&self.table, &known.iter().map(String::as_str).collect::<Vec<&str>>())
    }

    /// A number, if the key is there.
    pub fn number(&self, key: &str) -> Result<Option<f64>, MeasuredError> {
        let Some(value) = lookup(&self.table, key) else { return Ok(None) };
        let number = value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).filter(|x| x.is_finite());
        number.map(Some).ok_or_else(|| self.wrong(key, "a finite number"))
    }

    /// A text.
    pub fn text(&self, key: &str) -> Result<String, MeasuredError> {
        let text = lookup(&self.table, key).and_then(|v| v.as_str());
        text.map(str::to_owned).ok_or_else(|| self.wrong(key, "a text"))
    }

    /// An error about a key, with what was found there.
    pub fn wrong(&self, key: &str, expected: &'static str) -> MeasuredError {
        let found = lookup(&self.table, key).map_or("nothing".to_owned(), ToString::to_string);
        MeasuredError::Key { key: key.to_owned(), expected, found }
    }
}

/// Analyse a case; `files` holds the text of every file that [`MeasuredCase::files`] names.
pub fn diagnose(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Answer, MeasuredError> {
    analyse(case, files).map(|(answer, _)| answer)
}

/// The same, with the numbers behind its figures.
pub fn analyse(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<(Answer, Plates), MeasuredError> {
    for name in case.files() {
        if !files.contains_key(&name) {
            return Err(MeasuredError::MissingFile { file: name });
        }
    }
    let (mut answer, plates) = match case.kind {
        Kind::OrbitSp3 => orbit::diagnose(case, files),
        Kind::SeriesCsv => crate::diagnose::series::diagnose(case, files),
        Kind::StaticPoses => crate::diagnose::poses::diagnose(case, files),
    }?;
    let told = |key: String| format!("case.toml: `{key}` is no key of a case of this kind, and is not read");
    answer.notes.splice(0..0, case.unknown_keys().into_iter().map(told));
    Ok((answer, plates))
}

fn kind(table: &toml::Table) -> Option<Kind> {
    match lookup(table, "recording.kind")?.as_str()? {
        "orbit_sp3" => Some(Kind::OrbitSp3),
        "series_csv" => Some(Kind::SeriesCsv),
        "static_poses" => Some(Kind::StaticPoses),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_override_reaches_a_nested_key() {
        let text = "[case]\nid = \"a\"\n[recording]\nkind = \"orbit_sp3\"\nfit_hours = 48.0\n";
        let case = MeasuredCase::parse(text, &["recording.fit_hours=24".to_owned()]).unwrap();
        assert_eq!(case.number("recording.fit_hours").unwrap(), Some(24.0));
    }

    #[test]
    fn a_key_that_nothing_reads_is_found() {
        let text = "[case]\nid = \"a\"\n[recording]\nkind = \"series_csv\"\nposition_sigma = 1.0\ntime = { column = \"t\", unit = \"h\" }\n";
        let case = MeasuredCase::parse(text, &[]).unwrap();
        assert_eq!(case.unknown_keys(), ["recording.position_sigma", "recording.time.unit"]);
    }

    #[test]
    fn a_kind_that_is_not_known_is_quoted() {
        let error = MeasuredCase::parse("[recording]\nkind = \"tea\"\n", &[]).unwrap_err();
        assert!(error.to_string().ends_with("found \"tea\""), "{error}");
    }
}
