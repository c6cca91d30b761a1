//! Missions flown into the pure core, without the wire between, and what is asked of them again and again.

use std::collections::BTreeMap;

use oare_ground::ingest::wire::record::Record;
use oare_ground::pipeline::archive::Archive;
use oare_ground::pipeline::calibration::{self, Derived};
use oare_ground::pipeline::window::{Window, Windows, windows};
use oare_ground::pipeline::{Product, Settings, derive};
use oare_ground::simulate::truth::{TrueWindow, TruthBuilder};
use oare_ground::simulate::{Mission, MissionConfig};
use oare_ground::telemetry::AccRecord;

/// A mission's windows, what is derived from them, and the truth.
pub struct Flown {
    /// Windows.
    pub windows: Windows,
    /// What was derived.
    pub derived: Derived,
    /// True windows, by the clock of their start, s.
    pub truth: BTreeMap<u32, TrueWindow>,
    /// The mission.
    pub mission: Mission,
}

impl Flown {
    /// The products.
    pub fn products(&self) -> impl Iterator<Item = Product> {
        let windows: Vec<&Window> = self.windows.values().map(Box::as_ref).collect();
        let (current, corrections) = (self.derived.current(), &self.derived.range_corrections);
        derive::products(&windows, current, corrections, &Settings::sts65().window).into_iter()
    }
}

/// Flies a mission.
pub fn fly(config: MissionConfig) -> Flown {
    fly_altered(config, Some)
}

/// Flies a mission whose second records come down altered, or not at all.
pub fn fly_altered(config: MissionConfig, alter: impl Fn(AccRecord) -> Option<AccRecord>) -> Flown {
    let mission = Mission::new(config).unwrap_or_else(|problems| panic!("{problems:?}"));
    let (mut archive, mut builder, mut truth) = (Archive::default(), TruthBuilder::default(), BTreeMap::new());
    let mut sequence = 0u16;
    for second in mission.fly() {
        truth.extend(builder.take(&second).map(|window| (window.start_clock_s, window)));
        for sent in second.sent.iter().filter(|sent| sent.damage.is_none()) {
            let record = match sent.record.clone() {
                Record::Acc(record) => alter(record).map(Record::Acc),
                other => Some(other),
            };
            if let Some(record) = record {
                archive.add(record, sequence);
            }
            sequence = sequence.wrapping_add(1) & 0x3fff;
        }
    }
    let (windows, derived) = derive_all(&archive);
    Flown { windows, derived, truth, mission }
}

/// Windows of an archive, and what is derived from them.
pub fn derive_all(archive: &Archive) -> (Windows, Derived) {
    let settings = Settings::sts65();
    let mut held = Windows::new();
    let cells: Vec<i64> = archive.cells().collect();
    windows(archive, cells, &settings.window, |cell, window| {
        if let Some(window) = window {
            held.insert(cell, Box::new(window));
        }
    });
    let derived = calibration::derive(archive, &held, &settings, None, None);
    (held, derived)
}

/// How many seeds: a part by default, the whole with `OARE_SEEDS=all`, any number with that number.
pub fn seeds(whole: u64, part: u64) -> u64 {
    match std::env::var("OARE_SEEDS") {
        Ok(number) => number.parse().unwrap_or(whole),
        Err(_) => part,
    }
}
