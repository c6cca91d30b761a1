//! The calibration models: bias, scale factor, time correlation, and the faults of the instrument.
