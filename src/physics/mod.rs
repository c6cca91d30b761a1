//! Orbit, attitude, atmosphere, Sun, geomagnetic and gravity field; one force term a file.
