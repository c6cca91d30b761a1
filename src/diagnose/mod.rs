//! A recording against its simulation: the noise, where they differ, what was left out, how the fit improves.
//!
//! The way of a case: [`case`] (read, checked) -> [`scene`] (residual and physics) -> [`noise`] and [`design`] (whitened columns)
//! -> [`catalogue`] and [`open_form`] (what may be missing) -> [`search`] and [`solve`] (sets, weighed), in [`order`] at the noise
//! that the record asks for -> [`null_table`] or [`bootstrap`] (how surprising) -> [`trial`] (does it predict) -> [`remains`] and
//! `joint` (what it leaves) -> [`verdict`] with [`model`] and [`locate`] (what is said) -> [`answer`], [`report`].

pub mod analysis;
pub mod answer;
pub mod axes;
pub mod bootstrap;
pub mod bursts;
pub mod case;
pub mod catalogue;
pub mod constancy;
pub mod design;
mod earlier;
pub mod error;
pub mod instants;
mod joint;
mod keys;
pub mod live;
pub mod locate;
pub mod measure;
pub mod measured;
pub mod model;
pub mod noise;
pub mod null_table;
pub mod open_form;
mod optimise;
pub mod orbit;
pub mod order;
mod plates;
pub mod poses;
pub mod recorder;
pub mod remains;
pub mod report;
pub mod scene;
pub mod search;
mod seldom;
pub mod separating;
pub mod series;
pub mod solve;
pub mod trial;
pub mod verdict;
mod whiteness;

pub use analysis::{Analysis, Settings, analyse, diagnose};
pub use answer::Diagnosis;
