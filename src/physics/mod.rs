//! Orbit, attitude, atmosphere, Sun, geomagnetic and gravity field; one force term per file.
//!
//! Pure functions of their arguments, in SI: metres, seconds, radians, tesla, m/s^2 inside, nano-g only at the borders.
//! *Inertial* is the true equator and equinox of date. *Body* is the Orbiter's: +X tail to nose, +Y to starboard, +Z down
//! through the belly. Every force is given as the **specific force at the sensor**, what an accelerometer there would read:
//!
//! ```text
//! f = F/m + w x (w x r) + dw/dt x r - G r
//! ```
//!
//! with `r` from the centre of gravity to the sensor, `w` the inertial body rate, `G` the gravity-gradient tensor.

pub mod attitude;
pub mod bulge;
pub mod density;
pub mod drag;
pub mod earth_orientation;
pub mod geodetic;
pub mod gravity_field;
pub mod gravity_gradient;
pub mod integrator;
pub mod magnetic;
pub mod orbit;
pub mod rotation;
pub mod shadow;
pub mod solar_radiation;
pub mod sun;
pub mod third_body;
pub mod time;
pub mod vehicle;

/// A vector of three, SI.
pub type Vec3 = nalgebra::Vector3<f64>;
/// A 3 x 3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;

/// Gravitational parameter of the Earth, m^3/s^2 (the value fixed for the simulations; WGS 84 has ...4418e14 too).
pub const MU_M3_S2: f64 = 3.986_004_418e14;
/// Equatorial radius of the Earth, m (WGS 84).
pub const EARTH_RADIUS_M: f64 = 6_378_137.0;
/// Second zonal harmonic, unnormalised (EGM96).
pub const J2: f64 = 1.082_626_68e-3;
/// Rotation rate of the Earth, rad/s, of the co-rotating atmosphere too.
pub const EARTH_RATE_RAD_S: f64 = 7.292_115_9e-5;

/// What this room cannot compute.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PhysicsError {
    /// The geomagnetic field is tabulated for other years.
    #[error("the geomagnetic field is known for the years 1900 to 2039, not for unix time {unix_s} s")]
    FieldDate {
        /// The time asked for, seconds since 1970 UTC.
        unix_s: f64,
    },
    /// A position that is no place around the Earth.
    #[error("position {r_m:?} m is not around the Earth: expected finite coordinates and a radius above 1000 km")]
    Position {
        /// The position given, m.
        r_m: [f64; 3],
    },
    /// Elements that describe no closed orbit.
    #[error(
        "semi-major axis {semi_major_axis_m} m with eccentricity {eccentricity}: expected a closed orbit, 0 <= e < 1, above the surface"
    )]
    Elements {
        /// Semi-major axis, m.
        semi_major_axis_m: f64,
        /// Eccentricity.
        eccentricity: f64,
    },
    /// A span or step that cannot be integrated.
    #[error("integration over {span_s} s in steps of {step_s} s: expected a finite span and a positive step")]
    Step {
        /// Span, s.
        span_s: f64,
        /// Step, s.
        step_s: f64,
    },
}
