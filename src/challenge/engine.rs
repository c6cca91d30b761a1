//! The project's own analyser as the one under test: it gets files through the real reader, or a directory, and nothing else.

use super::folder;
use super::run::{Analyser, Material};
use crate::diagnose::case::Case;
use crate::diagnose::{Settings, analyse, recorder};

/// The analyser with its settings.
#[derive(Debug, Clone, Default)]
pub struct Engine {
    /// Bootstrap replicates; 0 takes the table of nulls.
    pub bootstraps: usize,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// The case in a material, through the real reader.
///
/// # Errors
/// One sentence: what is missing or wrong.
pub fn read(material: &Material) -> Result<Case, String> {
    let case = match material {
        Material::Files(files) => {
            let file = |name: &str| Ok(files.iter().find(|(n, _)| n == name).map(|(_, octets)| octets.clone()));
            recorder::case(file, &[])
        }
        Material::Directory(path) => folder::case(path, &[]),
    };
    case.map_err(|error| error.to_string())
}

impl Analyser for Engine {
    fn answer(&self, material: &Material, deleted: Option<&str>) -> Result<serde_json::Value, String> {
        let case = read(material)?;
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
