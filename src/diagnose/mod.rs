//! A recording against its simulation: the noise, where they differ, what was left out, how the fit improves.

pub mod answer;
pub mod case;
pub mod error;
pub mod measure;
pub mod noise;
pub mod catalogue;
pub mod design;
pub mod scene;
pub mod open_form;
pub mod search;
pub mod solve;
mod optimise;
pub mod report;
