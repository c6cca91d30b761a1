//! The plan of a mission: everything that decides how it goes, and its check before the flight.

use crate::physics::Vec3;
use crate::physics::density::Activity;
use crate::physics::orbit::Elements;
use crate::physics::vehicle::Vehicle;
use crate::units::MissionTime;

use super::SimulateError;
use super::calibration::CalibrationPlan;
use super::faults::Fault;
use super::flight::Flight;
use super::forces::{ForceModel, Forces};
use super::instrument::{Instrument, TemperaturePlan};
use super::noise::NoisePlan;
use super::trajectory::{AttitudeHold, Hold, Trajectory};

/// Longest mission that will be flown, h: the instrument clock's 32 bits would hold more, no machine's patience.
pub const HOURS_MAX: f64 = 24.0 * 60.0;

/// The plan of a mission.
#[derive(Debug, Clone)]
pub struct MissionConfig {
    /// Seed of everything random.
    pub seed: u64,
    /// Instrument clock of the first record, whole seconds, a multiple of 10.
    pub start_clock_s: u32,
    /// Length, h.
    pub hours: f64,
    /// How the clock relates to lift-off and UTC.
    pub time: MissionTime,
    /// Orbit at the start.
    pub orbit: Elements,
    /// Attitudes, in order of time; the first holds from the start.
    pub attitudes: Vec<AttitudeHold>,
    /// Length of a manoeuvre from one attitude to the next, s.
    pub manoeuvre_s: f64,
    /// Amplitude of the attitude control's wobble, rad.
    pub wobble_rad: f64,
    /// The vehicle.
    pub vehicle: Vehicle,
    /// What drives the atmosphere.
    pub activity: Activity,
    /// Which forces act.
    pub forces: ForceModel,
    /// The instrument.
    pub instrument: Instrument,
    /// Temperature of the sensor.
    pub temperature: TemperaturePlan,
    /// Vibration: white noise, bursts, crew.
    pub noise: NoisePlan,
    /// Calibrations.
    pub calibration: CalibrationPlan,
    /// Spans with quiet asserted: instrument clock from, to, s.
    pub quiet: Vec<(u32, u32)>,
    /// Drift of the Orbiter's clock against the instrument's, parts per million.
    pub clock_drift_ppm: f64,
    /// Jitter of the Orbiter's clock in the records, s.
    pub clock_jitter_s: f64,
    /// Whether the on-board estimator is the flight one, which drops one point more at the high end.
    pub one_sided_on_board: bool,
    /// Faults to plant.
    pub faults: Vec<Fault>,
}

impl MissionConfig {
    /// A mission like STS-65: its orbit and noise, attitudes every some hours, from ten minutes after lift-off.
    pub fn sts65(seed: u64, hours: f64) -> Self {
        let time = MissionTime::sts65();
        let start_clock_s = 14_400;
        Self {
            seed,
            start_clock_s,
            hours,
            time,
            orbit: Elements::from_heights(
                300e3,
                304e3,
                28.45_f64.to_radians(),
                229.0_f64.to_radians(),
                57.0_f64.to_radians(),
            ),
            attitudes: default_attitudes(start_clock_s, hours),
            manoeuvre_s: 600.0,
            wobble_rad: 3e-3,
            vehicle: Vehicle::sts65(),
            activity: Activity::july_1994(),
            forces: ForceModel::default(),
            instrument: Instrument::sts65(),
            temperature: TemperaturePlan::default(),
            noise: NoisePlan::sts65(),
            calibration: CalibrationPlan::default(),
            quiet: Vec::new(),
            clock_drift_ppm: 2.7,
            clock_jitter_s: 0.002,
            one_sided_on_board: true,
            faults: Vec::new(),
        }
    }

    /// Instrument clock of the end, s.
    pub fn end_clock_s(&self) -> u32 {
        self.start_clock_s + (self.hours * 3600.0).round() as u32
    }

    /// Everything that keeps this plan from being flown.
    pub fn problems(&self) -> Vec<SimulateError> {
        let mut problems = Vec::new();
        let mut expect = |ok: bool, name: &'static str, found: String, expected: &'static str| {
            if !ok {
                problems.push(SimulateError::Value { name, found, expected });
            }
        };
        let hours = self.hours;
        expect(hours > 0.0 && hours <= HOURS_MAX, "hours", hours.to_string(), "more than 0 and at most 1440");
        let start = self.start_clock_s;
        expect(start.is_multiple_of(10), "start_clock_s", start.to_string(), "a multiple of 10 s");
        expect(!self.attitudes.is_empty(), "attitudes", "empty".into(), "one attitude at least");
        let ordered = self.attitudes.is_sorted_by(|a, b| a.from_clock_s < b.from_clock_s);
        expect(ordered, "attitudes", "not in order of time".into(), "clocks that rise");
        expect(self.manoeuvre_s >= 10.0, "manoeuvre_s", self.manoeuvre_s.to_string(), "10 s at least");
        let mass = self.vehicle.mass_kg;
        expect(mass > 0.0 && mass.is_finite(), "vehicle.mass_kg", mass.to_string(), "a positive mass");
        let wobble = self.wobble_rad;
        expect((0.0..0.1).contains(&wobble), "wobble_rad", wobble.to_string(), "0 to 0.1 rad");
        let drift = self.clock_drift_ppm;
        expect(drift.abs() <= 1000.0, "clock_drift_ppm", drift.to_string(), "at most 1000 ppm either way");
        let interval = self.calibration.interval_s;
        expect(
            interval >= 3600,
            "calibration.interval_s",
            interval.to_string(),
            "an hour at least, a calibration takes 37 minutes",
        );
        problems.extend(self.instrument.problems());
        problems
    }
}

/// Attitudes as flown on long missions: a hold of some hours, then another.
fn default_attitudes(start_clock_s: u32, hours: f64) -> Vec<AttitudeHold> {
    const HOLDS: [(Hold, [f64; 3]); 6] = [
        (Hold::LocalVertical, [0.0, -90.0, 0.0]),
        (Hold::LocalVertical, [90.0, 0.0, 90.0]),
        (Hold::Inertial, [30.0, 40.0, 0.0]),
        (Hold::LocalVertical, [0.0, 90.0, 0.0]),
        (Hold::LocalVertical, [180.0, 0.0, 180.0]),
        (Hold::LocalVertical, [0.0, 0.0, 0.0]),
    ];
    // 17 h: no whole number of orbits, days or calibrations.
    let every_s = 17.0 * 3600.0;
    let count = (hours * 3600.0 / every_s).ceil().max(1.0) as usize;
    (0..count)
        .map(|k| {
            let (hold, euler_deg) = HOLDS[k % HOLDS.len()];
            let euler_rad = Vec3::from(euler_deg.map(f64::to_radians));
            AttitudeHold { from_clock_s: f64::from(start_clock_s) + k as f64 * every_s, hold, euler_rad }
        })
        .collect()
}

/// A plan that can be flown, with its trajectory and forces prepared.
pub struct Mission {
    pub(crate) config: MissionConfig,
    pub(crate) forces: Forces,
}

impl Mission {
    /// Checks the plan and prepares trajectory and forces.
    ///
    /// # Errors
    /// Everything wrong with the plan, at once.
    pub fn new(config: MissionConfig) -> Result<Self, Vec<SimulateError>> {
        let problems = config.problems();
        if !problems.is_empty() {
            return Err(problems);
        }
        let forces = Trajectory::new(&config)
            .and_then(|trajectory| Forces::new(&config, trajectory))
            .map_err(|error| vec![SimulateError::Physics(error)])?;
        Ok(Self { config, forces })
    }

    /// The plan.
    pub fn config(&self) -> &MissionConfig {
        &self.config
    }

    /// Forces and trajectory.
    pub fn forces(&self) -> &Forces {
        &self.forces
    }

    /// Flies the mission: an iterator over its seconds.
    pub fn fly(&self) -> Flight<'_> {
        Flight::new(&self.config, &self.forces)
    }
}
