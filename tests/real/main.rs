//! Real recordings, measured by others; skipped, loudly, where they are not at hand.

mod made;
mod orbits;
mod sensors;

use std::collections::BTreeMap;
use std::path::PathBuf;

use oare_ground::diagnose::measured::{self, Answer, MeasuredCase};

/// The folder of real recordings, or nothing, said plainly.
fn data(folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("OARE_REAL_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/real")), PathBuf::from);
    let path = root.join(folder);
    if path.exists() {
        return Some(path);
    }
    println!("SKIPPED: no real recordings at {} (set OARE_REAL_DATA)", path.display());
    None
}

/// Diagnose one of the folders with some keys overridden.
fn diagnose(folder: &str, overrides: &[&str]) -> Option<Answer> {
    let dir = data(folder)?;
    let text = std::fs::read_to_string(dir.join("case.toml")).expect("case.toml");
    let overrides: Vec<String> = overrides.iter().map(|s| (*s).to_owned()).collect();
    let case = MeasuredCase::parse(&text, &overrides).expect("a case");
    let read = |name: String| {
        let text = std::fs::read_to_string(dir.join(&name)).expect("a file of the case");
        (name, text)
    };
    let files: BTreeMap<String, String> = case.files().into_iter().map(read).collect();
    Some(measured::diagnose(&case, &files).expect("an answer"))
}

/// Ids of the effects, in order.
fn ids(answer: &Answer) -> Vec<&str> {
    answer.effects.iter().map(|e| e.id.as_str()).collect()
}
