//! The lot over real recordings: a term of the full model is drawn (nothing among the choices) and taken out of the
//! simulation; the analyser gets the recording and what is left of the simulation; then the lot is revealed and scored.
//!
//! Only terms that the full model's own fit sees clearly are drawn; what is not there cannot be removed. The truth of a
//! draw is the name, and the full model's coefficients. Not here: how any of it is found (`diagnose`).

pub mod evidence;
mod subject;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use rayon::prelude::*;
use serde::Serialize;
use sha2::{Digest, Sha256};

pub use subject::Subject;

use super::seal::{hash, hex};
use crate::diagnose::answer::ParameterAnswer;
use crate::diagnose::measured::{Kind, MeasuredCase, MeasuredError};
use crate::ingest::wire::{Pad, PadError};

/// Nothing removed.
pub const NOTHING: &str = "nothing";
/// Coefficients agree when they differ by no more standard errors than this.
const SIGMAS: f64 = 2.0;

/// One drawn lot: committed to before the analysis, revealed after it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Truth {
    /// Number of the draw.
    pub draw: usize,
    /// What it was drawn for, such as `gps-2010 G05`.
    pub subject: String,
    /// Catalogue id of what was taken out, or `nothing`.
    pub removed: String,
    /// The full model's coefficients of it.
    pub coefficients: Vec<ParameterAnswer>,
}

/// One draw, analysed and scored.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// What was committed to.
    pub truth: Truth,
    /// SHA-256 of nonce and truth, published before the analysis.
    pub hash: String,
    /// Revealed with the truth.
    pub nonce: String,
    /// What the analyser named.
    pub named: Vec<String>,
    /// Its verdict.
    pub verdict: String,
    /// Its coefficients.
    pub coefficients: Vec<ParameterAnswer>,
    /// Rms before and after, in the recording's unit.
    pub rms: [f64; 2],
    /// Whether the name (or its absence) is right.
    pub right: bool,
    /// Coefficients within two standard errors of the full model's, of how many.
    pub within: [usize; 2],
}

/// The sum of it.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Score {
    /// Of draws with something removed, how many were named rightly, and how many there are.
    pub removed: [usize; 2],
    /// Of draws with nothing removed, how many were answered with nothing, and how many there are.
    pub nothing: [usize; 2],
    /// Of the coefficients compared, how many were within two standard errors, and how many there are.
    pub coefficients: [usize; 2],
    /// Hash over all commitments, in order.
    pub commitment: String,
}

/// A folder of real cases, read.
pub struct Real {
    /// Cases with their files.
    pub cases: Vec<(MeasuredCase, BTreeMap<String, String>)>,
    /// What draws are made from.
    pub subjects: Vec<Subject>,
}

/// Why the folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RealError {
    /// A file.
    #[error("{}: {source}", path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A PAD file.
    #[error("{}: {source}", path.display())]
    Pad {
        /// Which.
        path: PathBuf,
        /// Why.
        source: PadError,
    },
    /// A case.
    #[error("{}: {source}", path.display())]
    Case {
        /// Which.
        path: PathBuf,
        /// Why.
        source: MeasuredError,
    },
}

/// The folders below `dir` that hold a case of a measured kind.
pub fn folders(dir: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(dir) else { return Vec::new() };
    let holds = |path: &PathBuf| {
        std::fs::read_to_string(path.join("case.toml")).is_ok_and(|text| MeasuredCase::kind_of(&text, &[]).is_some())
    };
    let mut found: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).filter(holds).collect();
    found.sort();
    found
}

/// Read one case and its files.
pub fn read(folder: &Path, overrides: &[String]) -> Result<(MeasuredCase, BTreeMap<String, String>), RealError> {
    let text = |path: PathBuf| std::fs::read_to_string(&path).map_err(|source| RealError::Read { path, source });
    let of_case = |source| RealError::Case { path: folder.to_owned(), source };
    let case = MeasuredCase::parse(&text(folder.join("case.toml"))?, overrides).map_err(of_case)?;
    let mut files = BTreeMap::new();
    for name in case.files() {
        let path = folder.join(&name);
        let header = folder.join(format!("{name}.header"));
        // A file with a header beside it is a PAD file: it is taken as the CSV it stands for.
        let content = if case.kind == Kind::SeriesCsv && header.exists() {
            let data = std::fs::read(&path).map_err(|source| RealError::Read { path: path.clone(), source })?;
            let pad = Pad::read(&text(header)?, &data);
            pad.map_err(|source| RealError::Pad { path, source })?.csv()
        } else {
            text(path)?
        };
        files.insert(name, content);
    }
    Ok((case, files))
}

impl Real {
    /// Read every case below `dir` and fit the full models. `done` is called after each case.
    pub fn read(dir: &Path, done: &(dyn Fn() + Sync)) -> Result<Self, RealError> {
        let mut cases = Vec::new();
        let mut subjects = Vec::new();
        for folder in folders(dir) {
            let (case, files) = read(&folder, &[])?;
            let of_case = |source| RealError::Case { path: folder.clone(), source };
            subjects.extend(subject::subjects(&case, &files).map_err(of_case)?);
            cases.push((case, files));
            done();
        }
        Ok(Self { cases, subjects })
    }

    /// Draw the lots: every subject in turn, so that each satellite, pose set and axis has its share.
    pub fn draw(&self, draws: usize, seed: u64) -> Vec<(usize, Truth, String)> {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut order: Vec<usize> = Vec::new();
        let one = |draw: usize, order: &mut Vec<usize>, rng: &mut ChaCha12Rng| {
            if order.is_empty() {
                order.extend(0..self.subjects.len());
            }
            let which = order.swap_remove(rng.random_range(0..order.len()));
            let subject = &self.subjects[which];
            let lot = rng.random_range(0..=subject.removable.len());
            let (removed, coefficients) =
                subject.removable.get(lot).map_or((NOTHING, Vec::new()), |r| (r.id, r.coefficients.clone()));
            let nonce: u128 = rng.random();
            let truth = Truth { draw, subject: subject.id.clone(), removed: removed.to_owned(), coefficients };
            (which, truth, format!("{nonce:032x}"))
        };
        if self.subjects.is_empty() {
            return Vec::new();
        }
        (0..draws).map(|draw| one(draw, &mut order, &mut rng)).collect()
    }

    /// Analyse every draw and reveal it.
    pub fn run(&self, lots: &[(usize, Truth, String)], done: &(dyn Fn() + Sync)) -> Vec<Outcome> {
        let one = |(which, truth, nonce): &(usize, Truth, String)| {
            let said = self.subjects[*which].analyse(&truth.removed);
            done();
            outcome(truth, nonce, said)
        };
        lots.par_iter().map(one).collect()
    }
}

/// What the analyser said of one subject.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// Names.
    pub named: Vec<String>,
    /// Verdict.
    pub verdict: String,
    /// Coefficients.
    pub coefficients: Vec<ParameterAnswer>,
    /// Rms before and after.
    pub rms: [f64; 2],
}

fn outcome(truth: &Truth, nonce: &str, said: Said) -> Outcome {
    let nothing = truth.removed == NOTHING;
    let right = if nothing { said.named.is_empty() } else { said.named == [truth.removed.clone()] };
    let mut within = [0, 0];
    if right {
        for full in truth.coefficients.iter().filter(|p| p.sigma > 0.0) {
            let Some(found) = said.coefficients.iter().find(|p| p.name == full.name) else { continue };
            within[1] += 1;
            within[0] += usize::from((found.value - full.value).abs() <= SIGMAS * found.sigma.max(full.sigma));
        }
    }
    Outcome {
        truth: truth.clone(),
        hash: hash(truth, nonce),
        nonce: nonce.to_owned(),
        named: said.named,
        verdict: said.verdict,
        coefficients: said.coefficients,
        rms: said.rms,
        right,
        within,
    }
}

/// One hash over all commitments: what a run announces before it analyses.
pub fn commitment(lots: &[(usize, Truth, String)]) -> String {
    let mut hasher = Sha256::new();
    for (_, truth, nonce) in lots {
        hasher.update(hash(truth, nonce).as_bytes());
    }
    hex(&hasher.finalize())
}

/// Count.
pub fn score(outcomes: &[Outcome], commitment: String) -> Score {
    let mut score = Score { commitment, ..Score::default() };
    for outcome in outcomes {
        let place = if outcome.truth.removed == NOTHING { &mut score.nothing } else { &mut score.removed };
        place[0] += usize::from(outcome.right);
        place[1] += 1;
        score.coefficients[0] += outcome.within[0];
        score.coefficients[1] += outcome.within[1];
    }
    score
}
