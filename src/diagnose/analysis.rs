//! The analysis of a case from end to end: scene, search, false-alarm probability, verdict, answer.
//!
//! Deterministic: the seed serves the bootstrap alone. Not here: files.

use super::answer::{Diagnosis, Source};
use super::bootstrap::{Bootstrap, Reached};
use super::case::Case;
use super::error::CaseError;
use super::null_table;
use super::order::solve_at_its_order;
use super::plates::plates;
use super::report::Plates;
use super::scene::Scene;
use super::solve::{Library, Solution, null_noise};
use super::verdict::{self, Proof};
use crate::math::shared_work;

/// How to analyse.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Bootstrap replicates; 0 takes the table of nulls.
    pub bootstraps: usize,
    /// Catalogue effects to leave out.
    pub without: Vec<String>,
    /// False-alarm probability at or below which something is claimed.
    pub claim_probability: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { seed: 1, bootstraps: 0, without: Vec::new(), claim_probability: 0.002 }
    }
}

/// The answer, and what its figures show.
#[derive(Debug, Clone)]
pub struct Analysis {
    /// The answer.
    pub diagnosis: Diagnosis,
    /// The figures' numbers.
    pub plates: Plates,
}

/// Analyse a case.
///
/// # Errors
/// [`CaseError`] where the numbers defeat the physics or the estimation.
pub fn analyse(case: &Case, settings: &Settings) -> Result<Analysis, CaseError> {
    let prepared = Prepared::new(case, settings)?;
    let reached = (settings.bootstraps > 0).then(|| prepared.bootstrap().run(settings.bootstraps, || ()));
    Ok(prepared.conclude(reached))
}

/// The answer alone.
///
/// # Errors
/// As [`analyse`].
pub fn diagnose(case: &Case, settings: &Settings) -> Result<Diagnosis, CaseError> {
    analyse(case, settings).map(|a| a.diagnosis)
}

/// A case searched, before the verdict.
pub struct Prepared<'a> {
    scene: Scene<'a>,
    library: Library,
    solution: Solution,
    /// Log posterior odds of the best hypothesis against nothing, as far as they are proof.
    statistic: f64,
    settings: Settings,
}

impl<'a> Prepared<'a> {
    /// Furnish and search.
    ///
    /// # Errors
    /// As [`analyse`].
    pub fn new(case: &'a Case, settings: &Settings) -> Result<Self, CaseError> {
        let mut scene = Scene::new(case)?;
        let (library, noise) =
            shared_work::both(|| Library::new(&scene, &settings.without), || null_noise(&scene, None));
        let Some(solution) = solve_at_its_order(&mut scene, &library, noise, &|| false) else {
            unreachable!("nobody asked to stop")
        };
        let statistic = solution.proven(&scene, &library.entries);
        Ok(Self { scene, library, solution, statistic, settings: settings.clone() })
    }

    /// The bootstrap of this case, under the noise of the best hypothesis: its residual holds no effect.
    pub fn bootstrap(&self) -> Bootstrap<'_> {
        Bootstrap::new(&self.scene, &self.library, self.solution.best().noise, self.settings.seed, self.statistic)
    }

    /// False-alarm probability, from the bootstrap where there was one, else from the table of nulls, and verdict.
    pub fn conclude(&self, reached: Option<Reached>) -> Analysis {
        let table = null_table::false_alarm_probability(self.statistic, self.solution.null.slow_evidence);
        let (probability, source) = match reached {
            // Few replicates cannot show a small probability: then the table decides, and the bootstrap may only forbid.
            Some(r) if r.least <= verdict::asked(self.settings.claim_probability) || r.probability > 3.0 * r.least => {
                (r.probability, Source::Bootstrap)
            }
            _ => (table, Source::NullTable),
        };
        let proof = Proof {
            statistic: self.statistic,
            probability,
            source,
            claim: self.settings.claim_probability,
            chances: 1.0,
        };
        let (mut diagnosis, model_ng, ladder) = verdict::conclude(&self.scene, &self.library, &self.solution, proof);
        if let Some(Reached { least, .. }) = reached.filter(|_| source == Source::NullTable) {
            diagnosis.notes.push(format!(
                "of so few replicates the bootstrap shows no probability below {least:.1e}: the table of nulls gives it"
            ));
        }
        Analysis { plates: plates(&self.scene, &diagnosis, &model_ng, ladder), diagnosis }
    }
}
