//! A recording against its simulation: the noise, where they differ, what was left out, how the fit improves.

pub mod orbit;
