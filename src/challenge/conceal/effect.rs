//! The catalogue's effects as the generator makes them: sizes drawn, signatures computed on the 5 s grid.
//!
//! Signatures are what the recording has and the simulation lacks. The equations are the case format's, written here a second
//! time on purpose: a sign error in the analyser's regressors must not hide in the concealed cases too.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha12Rng;

use super::draw::{between, direction, log_between, normal, pick};
use super::flight::{Flight, STEP_S};
use super::force::{self, Air, Series, WHOLE_AIR};

/// Every id a concealed `acceleration_csv` case can lack.
pub const IDS: [&str; 21] = [
    "gravity_gradient",
    "rotation",
    "cg_offset",
    "mass_shift",
    "aerodynamic_drag",
    "diurnal_bulge",
    "atmosphere_corotation",
    "solar_radiation_pressure",
    "vent_leak",
    "water_dump",
    "evaporator_venting",
    "thruster_residual",
    "crew_activity",
    "magnetic_sensitivity",
    "scale_factor",
    "misalignment",
    "temperature_bias",
    "bias_drift",
    "bias_step",
    "time_offset",
    "thermospheric_wind",
];

const AXES: [&str; 3] = ["x", "y", "z"];
/// The largest scale error a flight could have: a few per cent to a quarter are known, generously more.
pub const SCALE_ERROR_MAX: f64 = 0.35;

/// The kind of event an effect needs in the log, if any.
pub fn event_needed(id: &str) -> Option<&'static str> {
    match id {
        "water_dump" => Some("water_dump"),
        "evaporator_venting" => Some("evaporator"),
        "thruster_residual" => Some("thruster"),
        "mass_shift" => Some("mass_change"),
        _ => None,
    }
}

/// Whether the effect accelerates the vehicle; the others are the sensor's.
pub fn is_acceleration(id: &str) -> bool {
    !is_instrumental(id) && !matches!(id, "magnetic_sensitivity" | "temperature_bias" | "bias_drift" | "bias_step")
}

/// Whether the effect works on whatever else the sensor feels.
fn is_instrumental(id: &str) -> bool {
    matches!(id, "scale_factor" | "misalignment" | "time_offset")
}

/// The parts of the signal before anything is left out, on the 5 s grid.
#[derive(Debug, Clone)]
pub struct Signal {
    /// What the simulation holds, ng.
    pub simulated: Series,
    /// Its drag, ng.
    pub drag: Series,
    /// The air its drag was computed in.
    pub air: Air,
}

impl Signal {
    /// The simulation of a flight that lacks these effects.
    pub fn without(flight: &Flight, lacking: &[Drawn]) -> Self {
        let lacks = |id: &str| lacking.iter().any(|e| e.id == id);
        let r = flight.vehicle.sensor_offset_m;
        let air = Air {
            corotation: if lacks("atmosphere_corotation") { 0.0 } else { 1.0 },
            bulge: if lacks("diurnal_bulge") { 0.0 } else { 1.0 },
            ..WHOLE_AIR
        };
        let drag = force::drag(flight, air);
        let mut simulated = drag.clone();
        if !lacks("gravity_gradient") {
            simulated = force::plus(&simulated, &force::gravity_gradient(flight, &r));
        }
        if !lacks("rotation") {
            simulated = force::plus(&simulated, &force::rotation(flight, &r));
        }
        Self { simulated, drag, air }
    }
}

/// One effect with its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// Catalogue id.
    pub id: &'static str,
    /// Parameters by their names in the case format.
    pub parameters: Vec<(String, f64)>,
    /// The axis of a scale factor.
    pub axis: Option<&'static str>,
}

impl Drawn {
    /// Draws the numbers of one effect; its size is set later, by [`Drawn::resized`].
    pub fn draw(rng: &mut ChaCha12Rng, id: &'static str, flight: &Flight) -> Self {
        let mut p: Vec<(String, f64)> = Vec::new();
        let mut axis = None;
        let span = |rng: &mut ChaCha12Rng| flight.start_s + between(rng, 0.1, 0.8) * flight.length_s;
        match id {
            "gravity_gradient" | "rotation" | "atmosphere_corotation" => p.push(("fraction".into(), 1.0)),
            "aerodynamic_drag" => p.push(("fraction".into(), if rng.random_bool(0.5) { 0.2 } else { -0.2 })),
            "diurnal_bulge" => p.push(("amplitude".into(), flight.bulge)),
            "solar_radiation_pressure" => p.push(("coefficient".into(), 1.3)),
            "cg_offset" | "mass_shift" => {
                if id == "mass_shift" {
                    let onset =
                        flight.events.iter().find(|e| e.kind == "mass_change").map_or(flight.start_s, |e| e.clock_s);
                    p.push(("onset_s".into(), onset));
                }
                triple(&mut p, ["dx_m", "dy_m", "dz_m"], direction(rng) * 0.3);
            }
            "magnetic_sensitivity" => {
                for i in AXES {
                    for j in AXES {
                        p.push((format!("k{i}{j}_ng_per_t"), 1e6 * normal(rng)));
                    }
                }
            }
            "scale_factor" => {
                axis = Some(*pick(rng, &AXES));
                p.push(("fraction".into(), if rng.random_bool(0.5) { 0.1 } else { -0.1 }));
            }
            "misalignment" => triple(&mut p, ["rx_rad", "ry_rad", "rz_rad"], direction(rng) * 0.05),
            "temperature_bias" => {
                triple(&mut p, ["slope_x_ng_per_c", "slope_y_ng_per_c", "slope_z_ng_per_c"], direction(rng) * 50.0);
                p.push(("lag_s".into(), if rng.random_bool(0.6) { 0.0 } else { between(rng, 300.0, 28_800.0) }));
            }
            "time_offset" => p.push(("offset_s".into(), if rng.random_bool(0.5) { 60.0 } else { -60.0 })),
            "thermospheric_wind" => {
                let heading = between(rng, 0.0, std::f64::consts::TAU);
                p.push(("along_m_s".into(), 200.0 * heading.cos()));
                p.push(("cross_m_s".into(), 200.0 * heading.sin()));
            }
            "vent_leak" => {
                p.push(("onset_s".into(), span(rng)));
                p.push(("tau_s".into(), log_between(rng, 3_000.0, 30_000.0)));
                push(&mut p, rng);
            }
            "bias_step" => {
                p.push(("onset_s".into(), span(rng)));
                push(&mut p, rng);
            }
            "bias_drift" => {
                p.push(("tau_s".into(), log_between(rng, 20_000.0, 120_000.0)));
                push(&mut p, rng);
            }
            _ => push(&mut p, rng),
        }
        Self { id, parameters: p, axis }
    }

    /// One number.
    pub fn number(&self, name: &str) -> f64 {
        self.parameters.iter().find(|(n, _)| n == name).map_or(0.0, |(_, x)| *x)
    }

    /// The same effect, larger by a factor: everything but its times and words. What has no size (a whole term) stays.
    pub fn resized(&self, factor: f64) -> Self {
        let mut other = self.clone();
        if self.has_size() {
            for (name, x) in &mut other.parameters {
                if !matches!(name.as_str(), "onset_s" | "tau_s" | "lag_s") {
                    *x *= factor;
                }
            }
        }
        other
    }

    /// Whether it acts in the instrument, on everything the sensor feels.
    pub fn is_instrumental(&self) -> bool {
        is_instrumental(self.id)
    }

    /// Whether the effect can be smaller or larger.
    pub fn has_size(&self) -> bool {
        !matches!(self.id, "gravity_gradient" | "rotation" | "atmosphere_corotation" | "diurnal_bulge")
    }

    /// The largest factor at which its size is still one a flight could have (sizes of `effects.md`, generously).
    pub fn factor_max(&self) -> f64 {
        let largest = |names: &[&str]| names.iter().map(|n| self.number(n).powi(2)).sum::<f64>().sqrt().max(1e-12);
        let push_ng = |limit: f64| limit / largest(&["ax_ng", "ay_ng", "az_ng"]);
        match self.id {
            "aerodynamic_drag" => 0.6 / largest(&["fraction"]),
            "scale_factor" => SCALE_ERROR_MAX / largest(&["fraction"]),
            "solar_radiation_pressure" => 12.0 / largest(&["coefficient"]),
            "cg_offset" => 1.5 / largest(&["dx_m", "dy_m", "dz_m"]),
            "mass_shift" => 0.8 / largest(&["dx_m", "dy_m", "dz_m"]),
            "misalignment" => 0.2 / largest(&["rx_rad", "ry_rad", "rz_rad"]),
            "temperature_bias" => 160.0 / largest(&["slope_x_ng_per_c", "slope_y_ng_per_c", "slope_z_ng_per_c"]),
            "time_offset" => 120.0 / largest(&["offset_s"]),
            "magnetic_sensitivity" => 4.0,
            "thermospheric_wind" => 600.0 / largest(&["along_m_s", "cross_m_s"]),
            "water_dump" => push_ng(1500.0),
            "thruster_residual" => push_ng(500.0),
            "evaporator_venting" => push_ng(250.0),
            "crew_activity" => push_ng(80.0),
            "bias_step" => push_ng(250.0),
            _ => push_ng(500.0),
        }
    }

    /// What the recording has and `total` (the signal with everything so far) lacks, ng.
    pub fn signature(&self, flight: &Flight, signal: &Signal, total: &[Vector3<f64>]) -> Series {
        let n = flight.times_s.len();
        let gated = |gate: Vec<f64>| -> Series { gate.into_iter().map(|g| self.push_ng() * g).collect() };
        let since = |onset: f64| flight.times_s.iter().map(move |t| t - onset);
        match self.id {
            "gravity_gradient" => force::gravity_gradient(flight, &flight.vehicle.sensor_offset_m),
            "rotation" => force::rotation(flight, &flight.vehicle.sensor_offset_m),
            "cg_offset" => apparent(flight, &self.shift_m()),
            "mass_shift" => {
                let onset = self.number("onset_s");
                let full = apparent(flight, &self.shift_m());
                since(onset).zip(full).map(|(t, a)| a * step(t)).collect()
            }
            "aerodynamic_drag" => signal.drag.iter().map(|a| a * self.number("fraction")).collect(),
            "diurnal_bulge" => {
                let cos_psi = force::bulge_cosine(flight);
                signal.drag.iter().zip(cos_psi).map(|(a, c)| a * (self.number("amplitude") * c)).collect()
            }
            "atmosphere_corotation" => {
                let turning = force::drag(flight, Air { corotation: 1.0, ..signal.air });
                force::minus(&turning, &signal.drag)
            }
            "thermospheric_wind" => {
                let wind_m_s = [self.number("along_m_s"), self.number("cross_m_s")];
                force::minus(&force::drag(flight, Air { wind_m_s, ..signal.air }), &signal.drag)
            }
            "solar_radiation_pressure" => {
                force::solar_radiation(flight).into_iter().map(|a| a * self.number("coefficient")).collect()
            }
            "vent_leak" => {
                let tau = self.number("tau_s");
                gated(since(self.number("onset_s")).map(|t| step(t) * (-t.max(0.0) / tau).exp()).collect())
            }
            "bias_step" => gated(since(self.number("onset_s")).map(step).collect()),
            "bias_drift" => gated(since(flight.start_s).map(|t| (-t / self.number("tau_s")).exp()).collect()),
            "water_dump" => gated(force::during(flight, "water_dump")),
            "evaporator_venting" => gated(force::during(flight, "evaporator")),
            "thruster_residual" => gated(force::during(flight, "thruster")),
            "crew_activity" => gated(force::during(flight, "crew_sleep").into_iter().map(|s| 1.0 - s).collect()),
            "magnetic_sensitivity" => {
                let k = nalgebra::Matrix3::from_fn(|i, j| self.number(&format!("k{}{}_ng_per_t", AXES[i], AXES[j])));
                force::field_t(flight).into_iter().map(|b| k * b).collect()
            }
            "scale_factor" => {
                let axis = AXES.iter().position(|a| Some(*a) == self.axis).unwrap_or(0);
                let only = |a: &Vector3<f64>| Vector3::from_fn(|i, _| if i == axis { a[i] } else { 0.0 });
                total.iter().map(|a| only(a) * self.number("fraction")).collect()
            }
            "misalignment" => {
                let turn = Vector3::new(self.number("rx_rad"), self.number("ry_rad"), self.number("rz_rad"));
                total.iter().map(|a| a.cross(&turn)).collect()
            }
            "temperature_bias" => {
                let slope = Vector3::from_fn(|i, _| self.number(&format!("slope_{}_ng_per_c", AXES[i])));
                let lag = self.number("lag_s") / STEP_S;
                (0..n).map(|k| slope * (flight.temperature_at(k as f64 - lag) - flight.temperature_c[0])).collect()
            }
            "time_offset" => {
                let lag = self.number("offset_s") / STEP_S;
                (0..n).map(|k| at_vector(total, k as f64 - lag) - total[k]).collect()
            }
            _ => vec![Vector3::zeros(); n],
        }
    }

    fn push_ng(&self) -> Vector3<f64> {
        Vector3::new(self.number("ax_ng"), self.number("ay_ng"), self.number("az_ng"))
    }

    fn shift_m(&self) -> Vector3<f64> {
        Vector3::new(self.number("dx_m"), self.number("dy_m"), self.number("dz_m"))
    }
}

/// T d: gravity gradient and rotation of a displaced sensor, ng.
pub fn apparent(flight: &Flight, d: &Vector3<f64>) -> Series {
    force::plus(&force::gravity_gradient(flight, d), &force::rotation(flight, d))
}

/// A series between its points, its ends held.
pub fn at(series: &[f64], place: f64) -> f64 {
    let place = place.clamp(0.0, (series.len() - 1) as f64);
    let k = (place as usize).min(series.len() - 2);
    series[k] + (series[k + 1] - series[k]) * (place - k as f64)
}

/// The same of vectors.
pub fn at_vector(series: &[Vector3<f64>], place: f64) -> Vector3<f64> {
    let place = place.clamp(0.0, (series.len() - 1) as f64);
    let k = (place as usize).min(series.len() - 2);
    series[k] + (series[k + 1] - series[k]) * (place - k as f64)
}

/// 0 before, 1 after, the covered part of the grid's step at the edge.
fn step(since_s: f64) -> f64 {
    (since_s / STEP_S + 0.5).clamp(0.0, 1.0)
}

fn triple(p: &mut Vec<(String, f64)>, names: [&str; 3], v: Vector3<f64>) {
    p.extend(names.iter().zip(v.iter()).map(|(n, x)| ((*n).to_string(), *x)));
}

fn push(p: &mut Vec<(String, f64)>, rng: &mut ChaCha12Rng) {
    triple(p, ["ax_ng", "ay_ng", "az_ng"], direction(rng) * 100.0);
}
