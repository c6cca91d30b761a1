//! The project's own analyser as the one under test: it gets texts through the real reader, or a directory, and nothing else.

use std::path::Path;

use super::run::{Analyser, Material};
use crate::diagnose::case::{Case, Header, Texts};
use crate::diagnose::{Settings, analyse};

/// The analyser with its settings.
#[derive(Debug, Clone, Default)]
pub struct Engine {
    /// Bootstrap replicates; 0 takes the table of nulls.
    pub bootstraps: usize,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Analyser for Engine {
    fn answer(&self, material: &Material, deleted: Option<&str>) -> Result<serde_json::Value, String> {
        let text = |name: &str| match material {
            Material::Texts(files) => files.iter().find(|(n, _)| n == name).map(|(_, text)| text.clone()),
            Material::Directory(path) => read(path, name),
        };
        let header = text("case.toml").ok_or("there is no case.toml")?;
        let header = Header::parse(&header, &[]).map_err(|e| e.to_string())?;
        if header.kind != "acceleration_csv" {
            return Err(format!("recording kind {} is not scored here", header.kind));
        }
        let files = header.files.clone();
        let texts = Texts {
            recording: text(&files.recording),
            simulation: text(&files.simulation),
            ancillary: text(&files.ancillary),
            events: text(&files.events),
        };
        let case = Case::from_texts(header, &texts).map_err(|e| e.to_string())?;
        let settings = Settings {
            seed: self.seed,
            bootstraps: self.bootstraps,
            without: deleted.map(str::to_string).into_iter().collect(),
            ..Settings::default()
        };
        let analysis = analyse(&case, &settings).map_err(|e| e.to_string())?;
        serde_json::to_value(&analysis.diagnosis).map_err(|e| e.to_string())
    }
}

fn read(directory: &Path, name: &str) -> Option<String> {
    if name.is_empty() {
        return None;
    }
    std::fs::read_to_string(directory.join(name)).ok()
}
