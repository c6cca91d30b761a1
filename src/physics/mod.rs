//! Orbit, attitude, atmosphere, Sun, geomagnetic and gravity field; one force term a file.

pub mod earth_orientation;
pub mod gravity_field;
pub mod integrator;
pub mod third_body;
