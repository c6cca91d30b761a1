//! A mission from its file: TOML, every key optional, whatever is left out is as on STS-65. `config/mission.toml` explains them.
//!
//! Reads text, not files. Values are checked with everything else, by [`MissionConfig::problems`].

use serde::Deserialize;

use crate::physics::orbit::Elements;
use crate::physics::{Mat3, Vec3};

use super::SimulateError;
use super::faults::Fault;
use super::forces::Push;
use super::instrument::Instrument;
use super::mission::MissionConfig;
use super::recorder::RecorderConfig;
use super::trajectory::{AttitudeHold, Hold};

/// A mission and the recorder that brings it down.
#[derive(Debug, Clone)]
pub struct MissionFile {
    /// The mission.
    pub mission: MissionConfig,
    /// The recorder.
    pub recorder: RecorderConfig,
}

/// What the command line decides over the file.
#[derive(Debug, Clone, Copy, Default)]
pub struct Overrides {
    /// Seed.
    pub seed: Option<u64>,
    /// Hours.
    pub hours: Option<f64>,
}

/// Reads a mission file.
///
/// # Errors
/// A sentence with the place in the file for what does not read; everything wrong with the values, at once.
pub fn from_toml(text: &str, overrides: Overrides) -> Result<MissionFile, Vec<SimulateError>> {
    let raw: Raw =
        toml::from_str(text).map_err(|error| vec![SimulateError::File(error.to_string().trim().to_owned())])?;
    let file = raw.checked(overrides)?;
    let problems = file.mission.problems();
    if problems.is_empty() { Ok(file) } else { Err(problems) }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Raw {
    seed: Option<u64>,
    hours: Option<f64>,
    start_clock_s: Option<u32>,
    epoch_utc: Option<String>,
    liftoff_clock_s: Option<f64>,
    manoeuvre_s: Option<f64>,
    wobble_rad: Option<f64>,
    clock_drift_ppm: Option<f64>,
    clock_jitter_s: Option<f64>,
    one_sided_on_board: Option<bool>,
    quiet: Option<Vec<(u32, u32)>>,
    orbit: RawOrbit,
    attitude: Vec<RawAttitude>,
    vehicle: RawVehicle,
    atmosphere: RawAtmosphere,
    forces: RawForces,
    instrument: RawInstrument,
    noise: RawNoise,
    calibration: RawCalibration,
    fault: Vec<RawFault>,
    recorder: RawRecorder,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawOrbit {
    perigee_km: Option<f64>,
    apogee_km: Option<f64>,
    inclination_deg: Option<f64>,
    node_deg: Option<f64>,
    perigee_deg: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAttitude {
    from_clock_s: f64,
    hold: RawHold,
    euler_deg: [f64; 3],
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum RawHold {
    Lvlh,
    Inertial,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawVehicle {
    mass_kg: Option<f64>,
    drag_coefficient: Option<f64>,
    area_m2: Option<[f64; 3]>,
    sensor_offset_m: Option<[f64; 3]>,
    srp_coefficient: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawAtmosphere {
    f107: Option<f64>,
    f107_average: Option<f64>,
    ap: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawForces {
    gravity_gradient: Option<f64>,
    rotation: Option<f64>,
    drag: Option<f64>,
    corotation: Option<f64>,
    bulge_amplitude: Option<f64>,
    wind_m_s: Option<(f64, f64)>,
    solar_radiation: Option<f64>,
    magnetic_ng_per_t: Option<[[f64; 3]; 3]>,
    push: Vec<RawPush>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPush {
    from_clock_s: f64,
    seconds: Option<f64>,
    tau_s: Option<f64>,
    body_ng: [f64; 3],
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawInstrument {
    varied: bool,
    radius_m: Option<f64>,
    settling_counts: Option<[f64; 3]>,
    settling_tau_s: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawNoise {
    asleep_ng: Option<[f64; 3]>,
    awake_factor: Option<f64>,
    sleep_h: Option<f64>,
    sleep_begins_met_h: Option<f64>,
    bursts_asleep_per_h: Option<f64>,
    bursts_awake_per_h: Option<f64>,
    burst_ng_max: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawCalibration {
    first_after_s: Option<u32>,
    interval_s: Option<u32>,
    first_id: Option<u16>,
    scale_every: Option<u16>,
}

#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum RawFault {
    RangeMisreport { from_clock_s: Option<u32>, seconds: u32 },
    ScaleAborted { calibration_id: u16, sequence: u8 },
    ElectronicShift { z_counts: f64 },
    TableJitter { calibration_id: Option<u16>, share: f64 },
    MalformedScaleRecord { calibration_id: u16, sequence: u8 },
    ClockJump { at_clock_s: u32, jump_s: f64 },
    Saturation { axis: RawAxis, from_clock_s: f64, seconds: f64 },
    Shutdown { at_clock_s: u32 },
    BiasOutlier { calibration_id: u16, counts: [f64; 3] },
    BiasStep { axis: RawAxis, at_clock_s: u32, ng: f64 },
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum RawAxis {
    X,
    Y,
    Z,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawRecorder {
    messy: bool,
    frames_per_playback: Option<usize>,
    overlap_frames: Option<usize>,
    reversed: Option<f64>,
    inverted: Option<f64>,
    shifted: Option<bool>,
    lost_frames: Option<f64>,
    bit_errors: Option<f64>,
    bursts: Option<usize>,
    slips: Option<usize>,
    damaged_markers: Option<usize>,
    noise: Option<usize>,
    repeats: Option<f64>,
    shuffled: Option<bool>,
}

/// Puts a value there if the file has one.
fn set<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}

impl Raw {
    fn checked(self, overrides: Overrides) -> Result<MissionFile, Vec<SimulateError>> {
        let seed = overrides.seed.or(self.seed).unwrap_or(1);
        let hours = overrides.hours.or(self.hours).unwrap_or(6.0);
        let mut mission = MissionConfig::sts65(seed, hours);
        if let Some(start_clock_s) = self.start_clock_s {
            let shift_s = f64::from(start_clock_s) - f64::from(mission.start_clock_s);
            mission.start_clock_s = start_clock_s;
            mission.attitudes.iter_mut().for_each(|hold| hold.from_clock_s += shift_s);
        }
        if let Some(text) = &self.epoch_utc {
            mission.time.epoch_utc = text.parse().map_err(|_| {
                let (name, expected) = ("epoch_utc", "a UTC instant such as 1994-07-08T12:53:01Z");
                vec![SimulateError::Value { name, found: text.clone(), expected }]
            })?;
        }
        set(&mut mission.time.liftoff_clock_s, self.liftoff_clock_s);
        set(&mut mission.manoeuvre_s, self.manoeuvre_s);
        set(&mut mission.wobble_rad, self.wobble_rad);
        set(&mut mission.clock_drift_ppm, self.clock_drift_ppm);
        set(&mut mission.clock_jitter_s, self.clock_jitter_s);
        set(&mut mission.one_sided_on_board, self.one_sided_on_board);
        set(&mut mission.quiet, self.quiet);
        mission.orbit = self.orbit.elements();
        if !self.attitude.is_empty() {
            mission.attitudes = self.attitude.iter().map(RawAttitude::hold).collect();
        }
        self.vehicle.put(&mut mission);
        set(&mut mission.activity.f107, self.atmosphere.f107);
        set(&mut mission.activity.f107_average, self.atmosphere.f107_average);
        set(&mut mission.activity.ap, self.atmosphere.ap);
        self.forces.put(&mut mission);
        self.instrument.put(&mut mission);
        self.noise.put(&mut mission);
        self.calibration.put(&mut mission);
        mission.faults = self.fault.iter().map(RawFault::fault).collect();
        Ok(MissionFile { mission, recorder: self.recorder.config()? })
    }
}

impl RawOrbit {
    fn elements(&self) -> Elements {
        let sts65 = (300.0, 304.0, 28.45, 229.0, 57.0);
        Elements::from_heights(
            self.perigee_km.unwrap_or(sts65.0) * 1000.0,
            self.apogee_km.unwrap_or(sts65.1) * 1000.0,
            self.inclination_deg.unwrap_or(sts65.2).to_radians(),
            self.node_deg.unwrap_or(sts65.3).to_radians(),
            self.perigee_deg.unwrap_or(sts65.4).to_radians(),
        )
    }
}

impl RawAttitude {
    fn hold(&self) -> AttitudeHold {
        let hold = match self.hold {
            RawHold::Lvlh => Hold::LocalVertical,
            RawHold::Inertial => Hold::Inertial,
        };
        let euler_rad = Vec3::from(self.euler_deg.map(f64::to_radians));
        AttitudeHold { from_clock_s: self.from_clock_s, hold, euler_rad }
    }
}

impl RawVehicle {
    fn put(self, mission: &mut MissionConfig) {
        set(&mut mission.vehicle.mass_kg, self.mass_kg);
        set(&mut mission.vehicle.drag_coefficient, self.drag_coefficient);
        set(&mut mission.vehicle.area_m2, self.area_m2.map(Vec3::from));
        set(&mut mission.vehicle.sensor_offset_m, self.sensor_offset_m.map(Vec3::from));
        set(&mut mission.vehicle.srp_coefficient, self.srp_coefficient);
    }
}

impl RawForces {
    fn put(self, mission: &mut MissionConfig) {
        let forces = &mut mission.forces;
        set(&mut forces.gravity_gradient, self.gravity_gradient);
        set(&mut forces.rotation, self.rotation);
        set(&mut forces.drag, self.drag);
        set(&mut forces.corotation, self.corotation);
        set(&mut forces.bulge_amplitude, self.bulge_amplitude);
        set(&mut forces.wind_m_s, self.wind_m_s);
        set(&mut forces.solar_radiation, self.solar_radiation);
        let rows = self.magnetic_ng_per_t;
        set(&mut forces.magnetic_ng_per_t, rows.map(|m| Mat3::from_fn(|i, j| m[i][j])));
        forces.pushes = self
            .push
            .iter()
            .map(|push| Push {
                from_clock_s: push.from_clock_s,
                until_clock_s: push.seconds.map_or(f64::INFINITY, |seconds| push.from_clock_s + seconds),
                tau_s: push.tau_s,
                body_ng: Vec3::from(push.body_ng),
            })
            .collect();
    }
}

impl RawInstrument {
    fn put(self, mission: &mut MissionConfig) {
        if self.varied {
            mission.instrument = Instrument::sts65().varied(mission.seed);
        }
        set(&mut mission.instrument.radius_m, self.radius_m.map(|radius_m| [radius_m; 3]));
        set(&mut mission.instrument.settling_counts, self.settling_counts);
        set(&mut mission.instrument.settling_tau_s, self.settling_tau_s);
    }
}

impl RawNoise {
    fn put(self, mission: &mut MissionConfig) {
        let noise = &mut mission.noise;
        set(&mut noise.asleep_ng, self.asleep_ng);
        set(&mut noise.awake_factor, self.awake_factor);
        set(&mut noise.sleep_h, self.sleep_h);
        set(&mut noise.sleep_begins_met_h, self.sleep_begins_met_h);
        set(&mut noise.bursts_asleep_per_h, self.bursts_asleep_per_h);
        set(&mut noise.bursts_awake_per_h, self.bursts_awake_per_h);
        set(&mut noise.burst_ng_max, self.burst_ng_max);
    }
}

impl RawCalibration {
    fn put(self, mission: &mut MissionConfig) {
        let plan = &mut mission.calibration;
        set(&mut plan.first_after_s, self.first_after_s);
        set(&mut plan.interval_s, self.interval_s);
        set(&mut plan.first_id, self.first_id);
        set(&mut plan.scale_every, self.scale_every);
    }
}

impl RawFault {
    fn fault(&self) -> Fault {
        match *self {
            Self::RangeMisreport { from_clock_s, seconds } => {
                Fault::RangeMisreport { from_clock_s: from_clock_s.unwrap_or(0), seconds }
            }
            Self::ScaleAborted { calibration_id, sequence } => Fault::ScaleAborted { calibration_id, sequence },
            Self::ElectronicShift { z_counts } => Fault::ElectronicShift { z_counts },
            Self::TableJitter { calibration_id, share } => {
                Fault::TableJitter { calibration_id: calibration_id.unwrap_or(0), share }
            }
            Self::MalformedScaleRecord { calibration_id, sequence } => {
                Fault::MalformedScaleRecord { calibration_id, sequence }
            }
            Self::ClockJump { at_clock_s, jump_s } => Fault::ClockJump { at_clock_s, jump_s },
            Self::Saturation { axis, from_clock_s, seconds } => {
                Fault::Saturation { axis: axis as usize, from_clock_s, seconds }
            }
            Self::Shutdown { at_clock_s } => Fault::Shutdown { at_clock_s },
            Self::BiasOutlier { calibration_id, counts } => Fault::BiasOutlier { calibration_id, counts },
            Self::BiasStep { axis, at_clock_s, ng } => Fault::BiasStep { axis: axis as usize, at_clock_s, ng },
        }
    }
}

impl RawRecorder {
    fn config(self) -> Result<RecorderConfig, Vec<SimulateError>> {
        let mut config = if self.messy { RecorderConfig::messy() } else { RecorderConfig::clean() };
        set(&mut config.frames_per_playback, self.frames_per_playback);
        set(&mut config.overlap_frames, self.overlap_frames);
        set(&mut config.reversed, self.reversed);
        set(&mut config.inverted, self.inverted);
        set(&mut config.shifted, self.shifted);
        set(&mut config.lost_frames, self.lost_frames);
        set(&mut config.bit_errors, self.bit_errors);
        set(&mut config.bursts, self.bursts);
        set(&mut config.slips, self.slips);
        set(&mut config.damaged_markers, self.damaged_markers);
        set(&mut config.noise, self.noise);
        set(&mut config.repeats, self.repeats);
        set(&mut config.shuffled, self.shuffled);
        let problems: Vec<SimulateError> = [
            ("recorder.reversed", config.reversed),
            ("recorder.inverted", config.inverted),
            ("recorder.lost_frames", config.lost_frames),
            ("recorder.bit_errors", config.bit_errors),
            ("recorder.repeats", config.repeats),
        ]
        .into_iter()
        .filter(|(_, chance)| !(0.0..=1.0).contains(chance))
        .map(|(name, chance)| SimulateError::Value { name, found: chance.to_string(), expected: "a chance, 0 to 1" })
        .collect();
        if problems.is_empty() { Ok(config) } else { Err(problems) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_file_is_six_hours_of_sts65() {
        let file = from_toml("", Overrides::default()).unwrap();
        assert_eq!((file.mission.hours, file.mission.seed), (6.0, 1));
        assert_eq!(file.recorder, RecorderConfig::clean());
    }

    #[test]
    fn the_command_line_decides_over_the_file() {
        let overrides = Overrides { seed: Some(9), hours: Some(2.0) };
        let file = from_toml("seed = 3\nhours = 100", overrides).unwrap();
        assert_eq!((file.mission.hours, file.mission.seed), (2.0, 9));
    }

    #[test]
    fn an_unknown_key_is_named_with_its_place() {
        let error = from_toml("hours = 3\nhoors = 4\n", Overrides::default()).unwrap_err();
        let text = error[0].to_string();
        assert!(text.contains("hoors") && text.contains("line 2"), "{text}");
    }

    #[test]
    fn every_wrong_value_is_told_at_once() {
        let error =
            from_toml("hours = -3\nstart_clock_s = 7\n[vehicle]\nmass_kg = 0", Overrides::default()).unwrap_err();
        let text: Vec<String> = error.iter().map(ToString::to_string).collect();
        assert_eq!(text.len(), 3, "{text:?}");
        assert!(text[0].contains("hours is -3"), "{text:?}");
    }

    #[test]
    fn the_explained_example_reads_and_is_what_its_comments_say() {
        let file = from_toml(include_str!("../../config/mission.toml"), Overrides::default()).unwrap();
        let plain = from_toml("", Overrides::default()).unwrap();
        // Every value in the example stands at its default, but for the attitudes, forces and faults it shows.
        assert_eq!(file.mission.instrument, plain.mission.instrument);
        assert_eq!(file.mission.noise, plain.mission.noise);
        assert_eq!(file.mission.calibration, plain.mission.calibration);
        assert_eq!(file.mission.orbit, plain.mission.orbit);
        assert_eq!(file.mission.vehicle, plain.mission.vehicle);
    }
}
