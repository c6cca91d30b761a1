//! Real recordings, measured by others; skipped, loudly, where they are not at hand.

mod made;
mod malformed;
mod orbits;
mod pad;
mod pushes;
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

/// What is left of a least-squares fit is square to what an effect takes away: the squares of the contributions add up to the fall.
fn contributions_add_up(answer: &Answer, within: f64) {
    let mut claimed = 0;
    for arc in answer.arcs.iter().filter(|arc| !arc.effects.is_empty()) {
        let fall = arc.rms_before.powi(2) - arc.rms_after.powi(2);
        let of_effects: f64 = arc.effects.iter().map(|e| e.rms[0].powi(2)).sum();
        assert!((of_effects / fall - 1.0).abs() < within, "{}: {of_effects} of {fall}", arc.id);
        claimed += 1;
    }
    assert!(claimed > 0);
}
