//! `case.toml`, read and checked.

use jiff::Timestamp;

use super::one_line;
use crate::diagnose::error::CaseError;
use crate::diagnose::keys::{self, lookup};
use crate::physics::{self, Vec3};

/// `case.toml`, checked. What other kinds add stays in `table`.
#[derive(Debug, Clone)]
pub struct Header {
    /// The case's id.
    pub id: String,
    /// UTC at instrument clock 0.
    pub epoch_utc: Timestamp,
    /// Lift-off, instrument clock.
    pub liftoff_clock_s: f64,
    /// Span asked for, instrument clock.
    pub span_s: [f64; 2],
    /// The vehicle.
    pub vehicle: Vehicle,
    /// Physics the simulation claims to include: tested, not believed.
    pub includes: Vec<String>,
    /// Kind of recording.
    pub kind: String,
    /// File names: recording, simulation, ancillary, events.
    pub files: Files,
    /// Everything `case.toml` said.
    pub table: toml::Table,
}

/// Names of the files of a case, as `case.toml` gives them; empty where it gives none.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Files {
    /// Recording.
    pub recording: String,
    /// Simulation.
    pub simulation: String,
    /// Ancillary data.
    pub ancillary: String,
    /// Mission log.
    pub events: String,
}

/// The vehicle as the simulation knows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Vehicle {
    /// Mass.
    pub mass_kg: f64,
    /// Drag coefficient.
    pub drag_coefficient: f64,
    /// Projected area along body X, Y, Z.
    pub area_m2: [f64; 3],
    /// Sensor from the centre of gravity, body axes.
    pub sensor_offset_m: [f64; 3],
    /// Solar radiation coefficient.
    pub srp_coefficient: f64,
}

/// Farthest that a sensor may be from the centre of gravity, m.
const OFFSET_MAX_M: f64 = 100.0;

impl Vehicle {
    /// As its surface forces see it.
    pub fn for_physics(&self) -> physics::vehicle::Vehicle {
        physics::vehicle::Vehicle {
            mass_kg: self.mass_kg,
            drag_coefficient: self.drag_coefficient,
            area_m2: Vec3::from(self.area_m2),
            sensor_offset_m: Vec3::from(self.sensor_offset_m),
            srp_coefficient: self.srp_coefficient,
        }
    }

    /// From `[vehicle]`; where a recording is compared with a simulation of it, all but the coefficient of radiation must be there.
    fn of(table: &toml::Table, needed: bool) -> Result<Self, CaseError> {
        let number = |key: &str, usual: f64| {
            if needed && lookup(table, key).is_none() {
                return Err(wrong(key, "a finite number", None));
            }
            number_or(table, key, usual)
        };
        let triple = |key: &str, usual: [f64; 3]| {
            if needed && lookup(table, key).is_none() {
                return Err(wrong(key, "three finite numbers", None));
            }
            triple_or(table, key, usual)
        };
        let vehicle = Self {
            mass_kg: number("vehicle.mass_kg", 104_000.0)?,
            drag_coefficient: number("vehicle.drag_coefficient", 2.2)?,
            area_m2: triple("vehicle.area_m2", [64.1, 255.0, 367.0])?,
            sensor_offset_m: triple("vehicle.sensor_offset_m", [0.0; 3])?,
            srp_coefficient: number_or(table, "vehicle.srp_coefficient", 1.3)?,
        };
        let refused = |key: &str, expected: &'static str| Err(wrong(key, expected, lookup(table, key)));
        if vehicle.mass_kg <= 0.0 {
            return refused("vehicle.mass_kg", "positive");
        }
        if !(0.1..=10.0).contains(&vehicle.drag_coefficient) {
            return refused("vehicle.drag_coefficient", "between 0.1 and 10");
        }
        if vehicle.area_m2.iter().any(|area| *area <= 0.0) {
            return refused("vehicle.area_m2", "three positive areas");
        }
        if vehicle.sensor_offset_m.iter().any(|offset| offset.abs() > OFFSET_MAX_M) {
            return refused("vehicle.sensor_offset_m", "within 100 m of the centre of gravity");
        }
        if vehicle.srp_coefficient < 0.0 {
            return refused("vehicle.srp_coefficient", "not negative");
        }
        Ok(vehicle)
    }
}

/// What must be said of the vehicle, each with an example.
pub const NEEDED: [(&str, &str); 4] = [
    ("vehicle.mass_kg", "104500"),
    ("vehicle.drag_coefficient", "2.2"),
    ("vehicle.area_m2", "[64.1, 255.0, 367.0]"),
    ("vehicle.sensor_offset_m", "[-1.5, 0.1, 0.6]"),
];

/// The keys of a case of accelerations.
pub const KEYS: [&str; 16] = [
    "case.id",
    "case.epoch_utc",
    "case.liftoff_clock_s",
    "case.start_s",
    "case.end_s",
    "vehicle.mass_kg",
    "vehicle.drag_coefficient",
    "vehicle.area_m2",
    "vehicle.sensor_offset_m",
    "vehicle.srp_coefficient",
    "simulation.file",
    "simulation.includes",
    "recording.file",
    "recording.kind",
    "ancillary.file",
    "ancillary.events",
];

impl Header {
    /// The dotted keys that the format does not have, and that nothing reads: one that is mistyped is among them.
    pub fn unknown_keys(&self) -> Vec<String> {
        keys::unknown(&self.table, &KEYS)
    }

    /// Parse `case.toml`; `set` are `key=value` overrides of dotted keys.
    pub fn parse(text: &str, set: &[String]) -> Result<Self, CaseError> {
        let mut table: toml::Table =
            text.parse().map_err(|e: toml::de::Error| CaseError::Toml(one_line(&e.to_string())))?;
        for item in set {
            keys::set(&mut table, item).ok_or_else(|| CaseError::Key {
                key: item.into(),
                expected: "key=value",
                found: item.into(),
            })?;
        }
        let kind = string(&table, "recording.kind")?;
        let of_a_vehicle = matches!(kind.as_str(), "acceleration_csv" | "recorder_dump");
        let vehicle = Vehicle::of(&table, of_a_vehicle)?;
        let epoch = moment(&table, "case.epoch_utc")
            .or_else(|e| if of_a_vehicle { Err(e) } else { Ok("1970-01-01T00:00:00Z".into()) })?;
        let epoch_utc = epoch.parse().map_err(|_| CaseError::Key {
            key: "case.epoch_utc".into(),
            expected: "a UTC time such as 1994-07-08T12:53:01Z",
            found: epoch,
        })?;
        let [start_s, end_s] =
            [number_or(&table, "case.start_s", f64::NEG_INFINITY)?, number_or(&table, "case.end_s", f64::INFINITY)?];
        if end_s <= start_s {
            return Err(CaseError::Span { start_s, end_s });
        }
        // A calibration counts from lift-off.
        if kind == "recorder_dump" && lookup(&table, "case.liftoff_clock_s").is_none() {
            return Err(wrong("case.liftoff_clock_s", "a finite number", None));
        }
        Ok(Self {
            id: string(&table, "case.id")?,
            epoch_utc,
            liftoff_clock_s: number_or(&table, "case.liftoff_clock_s", 0.0)?,
            span_s: [start_s, end_s],
            vehicle,
            includes: match lookup(&table, "simulation.includes") {
                None => Vec::new(),
                claims => {
                    let texts = keys::texts(&table, "simulation.includes");
                    texts.ok_or_else(|| wrong("simulation.includes", "a list of texts", claims))?
                }
            },
            kind,
            files: Files {
                recording: string(&table, "recording.file").unwrap_or_default(),
                simulation: string(&table, "simulation.file").unwrap_or_default(),
                ancillary: string(&table, "ancillary.file").unwrap_or_default(),
                events: match lookup(&table, "ancillary.events") {
                    None => String::new(),
                    Some(_) => string(&table, "ancillary.events")?,
                },
            },
            table,
        })
    }

    /// Unix time of an instrument clock.
    pub fn unix_s(&self, clock_s: f64) -> f64 {
        self.epoch_utc.as_millisecond() as f64 / 1000.0 + clock_s
    }
}

fn wrong(key: &str, expected: &'static str, found: Option<&toml::Value>) -> CaseError {
    CaseError::Key { key: key.into(), expected, found: found.map_or("nothing".to_string(), |v| v.to_string()) }
}

fn string(table: &toml::Table, key: &str) -> Result<String, CaseError> {
    let value = lookup(table, key);
    value.and_then(|v| v.as_str()).map(str::to_string).ok_or_else(|| wrong(key, "a text", value))
}

/// A text, or an instant as TOML itself has it.
fn moment(table: &toml::Table, key: &str) -> Result<String, CaseError> {
    let written = lookup(table, key).and_then(toml::Value::as_datetime);
    written.map_or_else(|| string(table, key), |at| Ok(at.to_string()))
}

fn number(value: &toml::Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).filter(|x| x.is_finite())
}

fn number_or(table: &toml::Table, key: &str, default: f64) -> Result<f64, CaseError> {
    match lookup(table, key) {
        None => Ok(default),
        Some(value) => number(value).ok_or_else(|| wrong(key, "a finite number", Some(value))),
    }
}

fn triple_or(table: &toml::Table, key: &str, default: [f64; 3]) -> Result<[f64; 3], CaseError> {
    let Some(value) = lookup(table, key) else { return Ok(default) };
    let numbers: Option<Vec<f64>> = value.as_array().and_then(|a| a.iter().map(number).collect());
    numbers.and_then(|n| n.try_into().ok()).ok_or_else(|| wrong(key, "three finite numbers", Some(value)))
}
