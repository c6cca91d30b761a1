//! The temperature of a drawn flight's sensor, before its record too: a sensor feels what it was, logged or not.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand_chacha::ChaCha12Rng;

use super::draw::between;
use super::flight::MU_M3_S2;

/// A swing: amplitude, deg C, period, s, and phase.
#[derive(Debug, Clone, Copy)]
struct Swing(f64, f64, f64);

impl Swing {
    fn at(&self, t_s: f64) -> f64 {
        self.0 * (TAU * t_s / self.1 + self.2).sin()
    }
}

/// A daily and an orbital swing and a slow wander about 4 deg C.
#[derive(Debug, Clone)]
pub struct Temperature {
    mean_c: f64,
    day: Swing,
    orbit: Swing,
    wander: [Swing; 3],
}

impl Temperature {
    /// Draws one for an orbit that goes through `position_m`.
    pub fn draw(rng: &mut ChaCha12Rng, position_m: &Vector3<f64>) -> Self {
        let (day_c, orbit_c) = (between(rng, 0.4, 1.3), between(rng, 0.1, 0.35));
        let (day_phase, orbit_phase) = (between(rng, 0.0, TAU), between(rng, 0.0, TAU));
        let wander =
            std::array::from_fn(|_| Swing(between(rng, 0.05, 0.3), between(rng, 15e3, 2e5), between(rng, 0.0, TAU)));
        let orbit_s = TAU * (position_m.norm().powi(3) / MU_M3_S2).sqrt();
        Self {
            mean_c: between(rng, 3.0, 5.0),
            day: Swing(day_c, 86_400.0, day_phase),
            orbit: Swing(orbit_c, orbit_s, orbit_phase),
            wander,
        }
    }

    /// At an instant, deg C.
    pub fn at_c(&self, t_s: f64) -> f64 {
        let slow: f64 = self.wander.iter().map(|swing| swing.at(t_s)).sum();
        self.mean_c + self.day.at(t_s) + self.orbit.at(t_s) + slow
    }
}
