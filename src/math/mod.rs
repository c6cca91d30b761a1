//! Robust means, least squares, rotation, spectra and evidence, on slices and matrices only.

pub mod ranked;
pub mod rms;
pub mod robust;
pub mod shared_work;
