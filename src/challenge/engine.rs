//! The project's own analyser as the one under test: it gets files through the real reader, or a directory, and nothing else.

use super::run::{Analyser, Material};
use crate::diagnose::case::{Case, Header};
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
    let file = |name: &str| match material {
        Material::Files(files) => files.iter().find(|(n, _)| n == name).map(|(_, octets)| octets.clone()),
        Material::Directory(path) => std::fs::read(path.join(name)).ok(),
    };
    let header = file("case.toml").and_then(|octets| String::from_utf8(octets).ok()).ok_or("there is no case.toml")?;
    let header = Header::parse(&header, &[]).map_err(|e| e.to_string())?;
    recorder::case(header, file).map_err(|e| e.to_string())
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
