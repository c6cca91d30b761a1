//! A recording against its simulation: the noise, where they differ, what was left out, how the fit improves.

pub mod answer;
pub mod case;
pub mod error;
pub mod measure;
pub mod noise;
mod optimise;
pub mod report;
