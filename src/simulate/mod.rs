//! A mission, its forces, the instrument, and the recorder dump that comes down.
//!
//! ```text
//! mission (plan) -> trajectory -> forces -> noise -> instrument (bias, scale, range) -> records -> packets -> frames -> playbacks
//!                                   |                     |
//!                                   +--> truth.csv        +--> instrument.json
//! ```
//!
//! Every number follows from the plan and its seed: the same plan flies the same bits. Nothing here judges or calibrates: the
//! simulator shares the wire's writers with the ground, and nothing else.

pub mod autorange;
pub mod calibration;
pub mod expected;
pub mod faults;
pub mod flight;
pub mod forces;
pub mod instrument;
pub mod mission;
pub mod mission_file;
pub mod noise;
pub mod onboard;
pub mod recorder;
pub mod trajectory;
pub mod truth;

#[cfg(test)]
mod flight_tests;

pub use faults::Fault;
pub use flight::{Flight, Second, Sent};
pub use mission::{Mission, MissionConfig};
pub use recorder::{Playback, RecorderConfig, playbacks};

use crate::physics::PhysicsError;

/// Why a mission cannot be flown.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SimulateError {
    /// A value that no mission can have.
    #[error("{name} is {found}; expected {expected}")]
    Value {
        /// What it is called in the mission file.
        name: &'static str,
        /// What was found.
        found: String,
        /// What would do.
        expected: &'static str,
    },
    /// The mission file does not read.
    #[error("the mission file does not read: {0}")]
    File(String),
    /// The physics refuses.
    #[error(transparent)]
    Physics(#[from] PhysicsError),
}

/// A generator for one purpose: the seed of the mission, and a stream of its own, so that one purpose never disturbs another.
pub(crate) fn generator(seed: u64, purpose: Purpose) -> rand_chacha::ChaCha8Rng {
    use rand::SeedableRng;
    let mut generator = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(purpose as u64);
    generator
}

/// What random numbers are drawn for. The order is part of what a seed means.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    /// Attitude wobble.
    Wobble = 1,
    /// Gaussian noise of X; Y and Z follow.
    White = 2,
    /// Bursts of X; Y and Z follow.
    Bursts = 5,
    /// Temperature.
    Temperature = 8,
    /// Clocks, bus voltage.
    Housekeeping = 9,
    /// Table jitter.
    Jitter = 10,
    /// The recorder and the link.
    Recorder = 11,
    /// What the plan leaves to chance.
    Plan = 12,
}
