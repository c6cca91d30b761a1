//! Configuration: raw files, checked values, all faults at once.
