//! Range, window, bias, scale factor, axes: from decoded records to calibrated body-axis samples.

pub mod calibration;
