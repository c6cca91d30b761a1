//! The instrument as it truly is: bias laws, scale factors, radius of the table, settling transient, temperature.
//!
//! The ground never sees this; it is written beside a dump as the truth to be recovered. Constants are those of STS-65 where the
//! report shows them. Where it does not show them legibly the simulator flies values of its own, marked so: they say nothing about
//! the real instrument.

use crate::telemetry::{Axis, Range};
use crate::units::NG_PER_UG;

use super::noise::Wander;
use super::{Purpose, SimulateError};

/// bias(t, T) = A1 + A2 exp(-t/t0) + A3 exp(-t/t1) + A4 T, counts; t in hours since lift-off, T in C.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasLaw {
    /// Constant, counts.
    pub a1: f64,
    /// First decay, counts.
    pub a2: f64,
    /// Second decay, counts.
    pub a3: f64,
    /// Counts per degree.
    pub a4: f64,
    /// Time of the first decay, h.
    pub t0_h: f64,
    /// Time of the second decay, h.
    pub t1_h: f64,
}

impl BiasLaw {
    const fn new(a1: f64, a2: f64, a3: f64, a4: f64, t0_h: f64, t1_h: f64) -> Self {
        Self { a1, a2, a3, a4, t0_h, t1_h }
    }

    /// The bias, counts.
    pub fn counts(&self, met_h: f64, temperature_c: f64) -> f64 {
        self.a1 + self.a2 * (-met_h / self.t0_h).exp() + self.a3 * (-met_h / self.t1_h).exp() + self.a4 * temperature_c
    }
}

/// Tables by axis (x, y, z of the instrument) and range (A, B, C).
pub type ByAxisAndRange<T> = [[T; 3]; 3];

/// The true instrument.
#[derive(Debug, Clone, PartialEq)]
pub struct Instrument {
    /// Bias laws.
    pub bias: ByAxisAndRange<BiasLaw>,
    /// Scale correction SF_C: actual over nominal.
    pub scale_correction: ByAxisAndRange<f64>,
    /// Nominal resolution SF_N, ng per count.
    pub resolution_ng: ByAxisAndRange<f64>,
    /// Radius of the table's turn, m.
    pub radius_m: [f64; 3],
    /// Settling transient at the start of the opposite position, range C, targets of Y and Z, counts.
    pub settling_counts: [f64; 3],
    /// Its decay, s.
    pub settling_tau_s: f64,
}

/// Full scales by axis and range, ug [PIMS; report].
const FULL_SCALE_UG: ByAxisAndRange<f64> =
    [[10_000.0, 1_000.0, 100.0], [25_000.0, 1_970.0, 150.0], [25_000.0, 1_970.0, 150.0]];

impl Instrument {
    /// The instrument of STS-65 (raw-telemetry A1 in range C). A2, t0 and t1 of X and Y in range C and t1 of Y are not legible in
    /// the report: those numbers are the simulator's.
    pub fn sts65() -> Self {
        Self {
            bias: [
                [
                    BiasLaw::new(5.33, 4.82, 6.95, 0.266, 5.0, 400.0),
                    BiasLaw::new(-231.5, -209.1, 100.4, 2.92, 5.75, 500.0),
                    BiasLaw::new(-2241.7, -2010.0, 904.0, 27.07, 6.1, 520.0),
                ],
                [
                    BiasLaw::new(28.67, -98.26, -6.54, -0.751, 1.5, 9.5),
                    BiasLaw::new(25.23, -47.0, 5.08, -0.732, 6.8, 75.0),
                    BiasLaw::new(48.9, -455.0, 108.8, -1.12, 9.3, 82.0),
                ],
                [
                    BiasLaw::new(173.62, 20.58, -8.55, 0.039, 10.4, 46.8),
                    BiasLaw::new(232.78, 30.08, -15.86, -0.369, 11.8, 220.0),
                    BiasLaw::new(1511.8, 385.1, -183.3, -4.89, 12.6, 130.0),
                ],
            ],
            scale_correction: [[1.072, 1.06, 1.025], [1.158, 1.164, 1.172], [1.113, 1.128, 1.131]],
            resolution_ng: FULL_SCALE_UG.map(|ranges| ranges.map(|ug| ug * NG_PER_UG / 32_768.0)),
            radius_m: [0.1016; 3],
            settling_counts: [0.0, -3000.0, -110.0],
            settling_tau_s: 6.0,
        }
    }

    /// The same without the settling transient.
    pub fn without_settling(self) -> Self {
        Self { settling_counts: [0.0; 3], ..self }
    }

    /// Another instrument of the same make: every bias amplitude, decay and scale factor off by a few parts in a hundred, drawn
    /// from a seed.
    pub fn varied(mut self, seed: u64) -> Self {
        use rand::RngExt;
        let mut random = super::generator(seed, Purpose::Plan);
        let mut near = |value: f64, share: f64| value * (1.0 + random.random_range(-share..share));
        for law in self.bias.as_flattened_mut() {
            law.a1 = near(law.a1, 0.1);
            law.a2 = near(law.a2, 0.3);
            law.a3 = near(law.a3, 0.3);
            law.a4 = near(law.a4, 0.3);
            law.t0_h = near(law.t0_h, 0.2);
            law.t1_h = near(law.t1_h, 0.2);
        }
        for correction in self.scale_correction.as_flattened_mut() {
            *correction = near(*correction, 0.02);
        }
        self
    }

    /// Nanog per count as it truly is.
    pub fn ng_per_count(&self, axis: Axis, range: Range) -> f64 {
        self.resolution_ng[axis.index()][range.index()] * self.scale_correction[axis.index()][range.index()]
    }

    /// The bias, counts.
    pub fn bias_counts(&self, axis: Axis, range: Range, met_h: f64, temperature_c: f64) -> f64 {
        self.bias[axis.index()][range.index()].counts(met_h, temperature_c)
    }

    /// Everything about it that no instrument can have.
    pub(crate) fn problems(&self) -> Vec<SimulateError> {
        let positive = |name, value: f64| {
            (!(value > 0.0 && value.is_finite())).then(|| SimulateError::Value {
                name,
                found: value.to_string(),
                expected: "a positive number",
            })
        };
        let laws = self.bias.as_flattened();
        laws.iter()
            .flat_map(|law| [positive("instrument.bias t0_h", law.t0_h), positive("instrument.bias t1_h", law.t1_h)])
            .chain(self.scale_correction.as_flattened().iter().map(|v| positive("instrument.scale_correction", *v)))
            .chain(self.resolution_ng.as_flattened().iter().map(|v| positive("instrument.resolution_ng", *v)))
            .chain(self.radius_m.iter().map(|v| positive("instrument.radius_m", *v)))
            .chain([positive("instrument.settling_tau_s", self.settling_tau_s)])
            .flatten()
            .collect()
    }
}

/// The sensor's temperature: a level, a decay after switching on, a day's swing, an orbit's, and wandering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TemperaturePlan {
    /// Level, C.
    pub level_c: f64,
    /// Above the level at lift-off, C, and how long that takes to go, h.
    pub decay: (f64, f64),
    /// Half the daily swing, C.
    pub daily_c: f64,
    /// Half the swing with the orbit, C.
    pub orbital_c: f64,
    /// Standard deviation of the wandering, C, and its correlation time, h.
    pub wander: (f64, f64),
}

impl Default for TemperaturePlan {
    fn default() -> Self {
        Self { level_c: 3.2, decay: (4.0, 30.0), daily_c: 0.6, orbital_c: 0.05, wander: (0.3, 3.0) }
    }
}

/// Seconds between the points of the wandering.
const WANDER_STEP_S: f64 = 60.0;

/// The temperature as the mission goes on.
pub struct Temperature {
    plan: TemperaturePlan,
    wander: Wander,
    from_c: f64,
    to_c: f64,
    next_s: f64,
}

impl Temperature {
    /// From a mission's start.
    pub fn new(plan: TemperaturePlan, seed: u64, start_clock_s: f64) -> Self {
        let (sigma, tau_h) = plan.wander;
        let mut wander = Wander::new(sigma, tau_h * 3600.0, WANDER_STEP_S, seed, Purpose::Temperature);
        let (from_c, to_c) = (wander.step(), wander.step());
        Self { plan, wander, from_c, to_c, next_s: start_clock_s + WANDER_STEP_S }
    }

    /// At an instant, which must not go back, C. `met_h` is mission elapsed time.
    pub fn at(&mut self, clock_s: f64, met_h: f64) -> f64 {
        while clock_s > self.next_s {
            self.from_c = self.to_c;
            self.to_c = self.wander.step();
            self.next_s += WANDER_STEP_S;
        }
        let share = 1.0 - (self.next_s - clock_s) / WANDER_STEP_S;
        let wander = self.from_c + (self.to_c - self.from_c) * share;
        let (above_c, tau_h) = self.plan.decay;
        self.plan.level_c
            + above_c * (-met_h / tau_h).exp()
            + self.plan.daily_c * (std::f64::consts::TAU * met_h / 24.0).sin()
            + self.plan.orbital_c * (std::f64::consts::TAU * met_h * 60.0 / 90.5).sin()
            + wander
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resolutions_are_the_published_ones() {
        // 305.18, 30.518, 3.0518; 762.94, 60.12, 4.5776 ng/count.
        let instrument = Instrument::sts65();
        assert_eq!(instrument.resolution_ng[0][2], 3.051_757_812_5);
        assert_eq!(instrument.resolution_ng[1], [762.939_453_125, 60.119_628_906_25, 4.577_636_718_75]);
    }

    #[test]
    fn the_law_at_lift_off_is_the_sum_of_its_constants() {
        let law = Instrument::sts65().bias[2][2];
        assert!((law.counts(0.0, 10.0) - (1511.8 + 385.1 - 183.3 - 48.9)).abs() < 1e-9);
    }

    #[test]
    fn a_varied_instrument_is_another_and_can_be_flown() {
        let varied = Instrument::sts65().varied(5);
        assert_ne!(varied, Instrument::sts65());
        assert_eq!(varied, Instrument::sts65().varied(5));
        assert!(varied.problems().is_empty());
    }
}
