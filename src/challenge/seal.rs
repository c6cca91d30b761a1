//! Commitments: the hash of every truth is published before any case is analysed, and checked when it is revealed.
//!
//! `SHA-256(nonce || truth as compact JSON)`. The nonce keeps the truth from being guessed out of the hash.

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::conceal::Truth;

/// A truth that has been committed to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seal {
    /// The case.
    pub id: String,
    /// Hash, hexadecimal.
    pub hash: String,
    /// What was hashed before the truth, hexadecimal; revealed with it.
    pub nonce: String,
}

/// A truth that is not the one committed to.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("case {id}: the truth hashes to {found}, and {expected} was committed to")]
pub struct BrokenSeal {
    /// The case.
    pub id: String,
    /// Hash published.
    pub expected: String,
    /// Hash of what was revealed.
    pub found: String,
}

impl Seal {
    /// Commits to a truth.
    pub fn new(truth: &Truth, nonce: [u8; 16]) -> Self {
        let nonce = hex(&nonce);
        Self { id: truth.case.clone(), hash: hash(truth, &nonce), nonce }
    }

    /// Checks a revealed truth against the commitment.
    pub fn check(&self, truth: &Truth) -> Result<(), BrokenSeal> {
        let found = hash(truth, &self.nonce);
        if found == self.hash {
            return Ok(());
        }
        Err(BrokenSeal { id: self.id.clone(), expected: self.hash.clone(), found })
    }
}

/// One hash over all commitments in their order: what a run announces first.
pub fn root(seals: &[Seal]) -> String {
    let mut hasher = Sha256::new();
    for seal in seals {
        hasher.update(seal.id.as_bytes());
        hasher.update(b" ");
        hasher.update(seal.hash.as_bytes());
        hasher.update(b"\n");
    }
    hex(&hasher.finalize())
}

/// SHA-256 of nonce and truth as compact JSON.
pub(super) fn hash(truth: &impl Serialize, nonce: &str) -> String {
    // A truth is maps of numbers and words: it always serialises.
    let text = serde_json::to_string(truth).unwrap_or_default();
    hex(&Sha256::new().chain_update(nonce).chain_update(text).finalize())
}

pub(super) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_changed_truth_breaks_its_seal() {
        let mut truth = Truth { case: "one-1".into(), kind: "one".into(), ..Truth::default() };
        let seal = Seal::new(&truth, [7; 16]);
        assert_eq!(seal.check(&truth), Ok(()));
        truth.kind = "two".into();
        assert!(seal.check(&truth).is_err());
    }
}
