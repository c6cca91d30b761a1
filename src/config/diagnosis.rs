//! What a running diagnosis compares the recording with: which files, and how often.

use std::fs;
use std::path::{Path, PathBuf};

use super::Fault;
use super::section::Section;
use crate::challenge::folder;
use crate::diagnose::case::{Expectation, Header, KEYS, NEEDED, Texts};
use crate::diagnose::catalogue;
use crate::diagnose::error::CaseError;
use crate::diagnose::live::Policy;
use crate::diagnose::recorder;
use crate::units::MissionTime;

/// Which files, and how often.
#[derive(Debug, Clone)]
pub struct DiagnosisConfig {
    /// `case.toml`: the vehicle, and the names of the other files where they are not given here.
    pub case: Option<PathBuf>,
    /// The simulation.
    pub simulation: Option<PathBuf>,
    /// Orbit, attitude and environment.
    pub ancillary: Option<PathBuf>,
    /// The mission log.
    pub events: Option<PathBuf>,
    /// Keys of `case.toml` to override, `key=value`.
    pub set: Vec<String>,
    /// When and how to look.
    pub policy: Policy,
}

/// The section `[diagnosis]`; `None` where there is none.
pub(super) fn read(section: &mut Section<'_>, folder: &Path) -> Option<DiagnosisConfig> {
    if !section.is_written() {
        return None;
    }
    let has_case = section.has("case");
    let case = section.existing("case", folder, true);
    let case = case.map(|path| if path.is_dir() { path.join("case.toml") } else { path });
    let [simulation, ancillary] = ["simulation", "ancillary"].map(|key| {
        section.check(key, has_case || section.has(key), || {
            format!(
                "found nothing; a running diagnosis needs diagnosis.{key} or diagnosis.case, the directory of a case"
            )
        });
        section.existing(key, folder, false)
    });
    let events = section.existing("events", folder, false);
    let standard = Policy::default();
    let policy = Policy {
        search_every_s: section.number("search_every_s", standard.search_every_s, 25.0..=1e7),
        claim_probability: section.number("claim_probability", standard.claim_probability, 1e-12..=0.5),
        without: section.parsed_list("without", "an effect's id"),
    };
    for id in policy.without.iter().filter(|id| catalogue::by_id(id).is_none()) {
        let known = catalogue::ALL.iter().map(|effect| effect.id).collect::<Vec<_>>().join(", ");
        section.fault("without", format!("found {id:?}; the effects are {known}"));
    }
    let set = section.parsed_list("set", "key=value");
    Some(DiagnosisConfig { case, simulation, ancillary, events, set, policy })
}

impl DiagnosisConfig {
    /// Reads and checks the files.
    ///
    /// # Errors
    /// What is wrong with each of them, all at once.
    pub fn expectation(&self, time: &MissionTime) -> Result<Expectation, Vec<Fault>> {
        let mut header = self.header(time)?;
        let folder = self.case.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
        let files = &mut header.files;
        for (named, given) in [
            (&mut files.simulation, &self.simulation),
            (&mut files.ancillary, &self.ancillary),
            (&mut files.events, &self.events),
        ] {
            match given {
                Some(path) => *named = path.display().to_string(),
                None if named.is_empty() => {}
                None => *named = folder.join(&*named).display().to_string(),
            }
        }
        files.recording = "the windows so far".into();
        let mut faults = Vec::new();
        let mut text = |key: &str, name: &str| {
            let octets = if name.is_empty() { Ok(None) } else { folder::octets(Path::new(""), name) };
            let text = octets.and_then(|octets| octets.map(|octets| recorder::text(name, octets)).transpose());
            text.unwrap_or_else(|error| {
                faults.push(at(key, error.to_string()));
                None
            })
        };
        let texts = Texts {
            recording: None,
            simulation: text("simulation", &files.simulation),
            ancillary: text("ancillary", &files.ancillary),
            events: text("events", &files.events),
        };
        let unreadable: Vec<String> = faults.iter().map(|fault| fault.place.clone()).collect();
        if header.epoch_utc != time.epoch_utc {
            let sentence = format!(
                "its epoch_utc is {} and mission.epoch_utc is {}: one clock cannot have two zeros",
                header.epoch_utc, time.epoch_utc
            );
            faults.push(at("case", sentence));
        }
        // A case of windows need not say when it was; the law of the biases counts from there.
        let liftoff_s = header.liftoff_clock_s;
        if liftoff_s != 0.0 && liftoff_s != time.liftoff_clock_s {
            let sentence = format!(
                "its liftoff_clock_s is {liftoff_s} and mission.liftoff_clock_s is {}: the biases of one mission have one age",
                time.liftoff_clock_s
            );
            faults.push(at("case", sentence));
        }
        let files = header.files.clone();
        match Expectation::from_texts(header, &texts) {
            Ok(expectation) if faults.is_empty() => Ok(expectation),
            Ok(_) => Err(faults),
            Err(errors) => {
                let key = |error: &CaseError| match error.file() {
                    Some(file) if *file == files.simulation => "simulation",
                    Some(file) if *file == files.ancillary => "ancillary",
                    Some(file) if *file == files.events => "events",
                    _ => "case",
                };
                let told = errors.iter().map(|error| at(key(error), error.to_string()));
                faults.extend(told.filter(|fault| !unreadable.contains(&fault.place)));
                Err(faults)
            }
        }
    }

    fn header(&self, time: &MissionTime) -> Result<Header, Vec<Fault>> {
        let faults = self.faults_of_set();
        if !faults.is_empty() {
            return Err(faults);
        }
        let text = match &self.case {
            Some(path) => fs::read_to_string(path)
                .map_err(|error| vec![at("case", format!("cannot read {}: {error}", path.display()))])?,
            None => format!(
                "[case]\nid = \"live\"\nepoch_utc = \"{}\"\nliftoff_clock_s = {:?}\n[recording]\nkind = \"recorder_dump\"\n",
                time.epoch_utc, time.liftoff_clock_s
            ),
        };
        let header = Header::parse(&text, &self.set).map_err(|error| {
            let is_set = matches!(&error, CaseError::Key { key, .. } if self.keys_set().any(|set| set == key));
            let file = self.case.as_ref().map_or("case.toml".into(), |path| path.display().to_string());
            vec![at(if is_set { "set" } else { "case" }, error.to_string().replacen("case.toml", &file, 1))]
        })?;
        match header.kind.as_str() {
            "acceleration_csv" | "recorder_dump" => Ok(header),
            kind => Err(vec![at(
                "case",
                format!(
                    "its recording.kind is {kind:?}; a running diagnosis compares acceleration_csv or recorder_dump"
                ),
            )]),
        }
    }

    /// The keys that are overridden.
    fn keys_set(&self) -> impl Iterator<Item = &str> {
        self.set.iter().filter_map(|item| item.split_once('=')).map(|(key, _)| key.trim())
    }

    /// What is wrong with the overrides, and where there is no case, what of the vehicle they lack.
    fn faults_of_set(&self) -> Vec<Fault> {
        let no_item = |item: &&String| !item.contains('=');
        let mut faults: Vec<Fault> = self
            .set
            .iter()
            .filter(no_item)
            .map(|item| at("set", format!("found {item:?}; an override is key=value, such as vehicle.mass_kg=104500")))
            .collect();
        let unknown = self.keys_set().filter(|key| !KEYS.contains(key));
        faults.extend(unknown.map(|key| at("set", format!("found the key {key:?}; the keys are {}", KEYS.join(", ")))));
        let missing = NEEDED.iter().filter(|(key, _)| self.case.is_none() && !self.keys_set().any(|set| set == *key));
        faults.extend(missing.map(|(key, example)| {
            at("set", format!("found no {key}; where diagnosis.case is not given it stands here: \"{key}={example}\""))
        }));
        faults
    }
}

fn at(key: &str, sentence: String) -> Fault {
    Fault { place: format!("diagnosis.{key}"), sentence }
}
