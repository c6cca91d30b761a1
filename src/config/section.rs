//! One table of a TOML text, read key by key; what is wrong is noted and a default taken, so that all faults are found.

use std::fmt::Debug;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use toml::Value;

use super::Fault;

/// A table being read: keys are taken out, and what is left at the end is unknown.
pub struct Section<'a> {
    path: String,
    table: toml::Table,
    /// Whether the text has it: an absent table is read as an empty one.
    written: bool,
    faults: &'a mut Vec<Fault>,
}

impl<'a> Section<'a> {
    /// Begins to read a table.
    pub fn new(path: &str, table: toml::Table, faults: &'a mut Vec<Fault>) -> Self {
        Self { path: path.into(), table, written: true, faults }
    }

    /// Reads a table within this one; an absent table is an empty one.
    pub fn section<T>(&mut self, key: &str, read: impl FnOnce(&mut Section<'_>) -> T) -> T {
        let written = self.table.contains_key(key);
        let table = match self.table.remove(key) {
            None => toml::Table::new(),
            Some(Value::Table(table)) => table,
            Some(other) => {
                self.fault(key, format!("found {other}; expected a table, [{key}]"));
                toml::Table::new()
            }
        };
        let mut section = Section { written, ..Section::new(&self.place(key), table, self.faults) };
        let value = read(&mut section);
        section.finish();
        value
    }

    /// Notes the keys that nobody asked for.
    pub fn finish(self) {
        let prefix = if self.path.is_empty() { String::new() } else { format!("{}.", self.path) };
        for (key, _) in self.table {
            let sentence = "no such key; check the spelling and the table it stands in".into();
            self.faults.push(Fault { place: format!("{prefix}{key}"), sentence });
        }
    }

    fn place(&self, key: &str) -> String {
        if self.path.is_empty() { key.into() } else { format!("{}.{key}", self.path) }
    }

    /// Notes a fault at a key.
    pub fn fault(&mut self, key: &str, sentence: String) {
        self.faults.push(Fault { place: self.place(key), sentence });
    }

    /// Notes a fault of the table as a whole.
    pub fn fault_here(&mut self, sentence: String) {
        self.faults.push(Fault { place: self.path.clone(), sentence });
    }

    /// Notes a fault at a key unless the condition holds.
    pub fn check(&mut self, key: &str, holds: bool, sentence: impl FnOnce() -> String) {
        if !holds {
            self.fault(key, sentence());
        }
    }

    /// A text.
    pub fn text(&mut self, key: &str) -> Option<String> {
        match self.table.remove(key)? {
            Value::String(text) => Some(text),
            other => {
                self.fault(key, format!("found {other}; expected a text in quotes"));
                None
            }
        }
    }

    /// A file that is there, or with `folder_too` a folder; a relative path starts in `folder`.
    pub fn existing(&mut self, key: &str, folder: &Path, folder_too: bool) -> Option<PathBuf> {
        let named = self.text(key)?;
        let path = folder.join(&named);
        let is_there = path.is_file() || (folder_too && path.is_dir());
        self.check(key, is_there, || {
            let what = if folder_too { "neither a file nor a folder" } else { "no such file" };
            format!("found {named:?}; there is {what} at {}", path.display())
        });
        is_there.then_some(path)
    }

    /// Whether the text has this table, be it empty.
    pub fn is_written(&self) -> bool {
        self.written
    }

    /// Whether a key is there.
    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    /// True or false.
    pub fn flag(&mut self, key: &str, standard: bool) -> bool {
        match self.table.remove(key) {
            None => standard,
            Some(Value::Boolean(flag)) => flag,
            Some(other) => {
                self.fault(key, format!("found {other}; expected true or false"));
                standard
            }
        }
    }

    /// A whole number within limits.
    pub fn integer(&mut self, key: &str, standard: i64, limits: RangeInclusive<i64>) -> i64 {
        match self.table.remove(key) {
            None => standard,
            Some(Value::Integer(number)) if limits.contains(&number) => number,
            Some(other) => {
                self.fault(key, format!("found {other}; expected a whole number {}", between(&limits)));
                standard
            }
        }
    }

    /// A number within limits.
    pub fn number(&mut self, key: &str, standard: f64, limits: RangeInclusive<f64>) -> f64 {
        match self.table.remove(key) {
            None => standard,
            Some(value) => match as_number(&value).filter(|number| limits.contains(number)) {
                Some(number) => number,
                None => {
                    self.fault(key, format!("found {value}; expected a number {}", between(&limits)));
                    standard
                }
            },
        }
    }

    /// Three numbers within limits.
    pub fn numbers(&mut self, key: &str, numbers: &mut [f64; 3], limits: RangeInclusive<f64>) {
        let Some(value) = self.table.remove(key) else { return };
        let found: Option<Vec<f64>> = value.as_array().map(|list| list.iter().filter_map(as_number).collect());
        match found.filter(|found| found.iter().all(|number| limits.contains(number))).map(<[f64; 3]>::try_from) {
            Some(Ok(found)) => *numbers = found,
            _ => self.fault(key, format!("found {value}; expected three numbers {}", between(&limits))),
        }
    }

    /// A time span in seconds.
    pub fn seconds(&mut self, key: &str, standard_s: f64, limits_s: RangeInclusive<f64>) -> Duration {
        Duration::from_secs_f64(self.number(key, standard_s, limits_s))
    }

    /// A text that means something.
    pub fn parsed<T: FromStr>(&mut self, key: &str, expected: &str) -> Option<T> {
        let text = self.text(key)?;
        let parsed = text.parse().ok();
        self.check(key, parsed.is_some(), || format!("found {text:?}; expected {expected}"));
        parsed
    }

    /// A list of texts that mean something.
    pub fn parsed_list<T: FromStr>(&mut self, key: &str, expected: &str) -> Vec<T> {
        let list = match self.table.remove(key) {
            None => return Vec::new(),
            Some(Value::Array(list)) => list,
            Some(other) => {
                self.fault(key, format!("found {other}; expected a list, [\"...\"]"));
                return Vec::new();
            }
        };
        let mut parsed = Vec::new();
        for item in list {
            match item.as_str().and_then(|text| text.parse().ok()) {
                Some(value) => parsed.push(value),
                None => self.fault(key, format!("found {item}; expected {expected}")),
            }
        }
        parsed
    }
}

fn as_number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(number) => Some(*number),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    }
}

fn between<T: Debug>(limits: &RangeInclusive<T>) -> String {
    format!("from {:?} to {:?}", limits.start(), limits.end())
}
