//! Precise orbits against a list of forces: what is missing from the list, per satellite and for all.

pub mod arc;
pub mod forces;
pub mod sp3;

use thiserror::Error;

use crate::physics::earth_orientation::EarthOrientationError;
use crate::physics::gravity_field::GravityFieldError;

/// An orbit case that cannot be analysed.
#[derive(Debug, Error)]
pub enum OrbitError {
    /// A line of an SP3 file.
    #[error("{file}, line {line}: expected {expected}, found {found:?}")]
    Sp3 {
        /// File name.
        file: String,
        /// Line number, from 1.
        line: usize,
        /// What belongs there.
        expected: &'static str,
        /// What was there.
        found: String,
    },
    /// Nothing to work on.
    #[error("the recording does not hold {what}")]
    Empty {
        /// What was looked for.
        what: String,
    },
    /// A satellite with too few positions.
    #[error("{id} has {found} usable positions to fit, expected at least {expected}")]
    TooFew {
        /// Satellite.
        id: String,
        /// Positions found.
        found: usize,
        /// Positions needed.
        expected: usize,
    },
    /// Earth orientation.
    #[error(transparent)]
    EarthOrientation(#[from] EarthOrientationError),
    /// Gravity field.
    #[error(transparent)]
    Gravity(#[from] GravityFieldError),
}
