//! What truly was, for those who check the ground: windows of true acceleration, and the true instrument.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::physics::Vec3;

use super::faults::Fault;
use super::flight::Second;
use super::mission::Mission;

/// Seconds of a window.
const WINDOW_S: u32 = 50;
/// Seconds between the starts of two.
const STRIDE_S: u32 = 25;

/// The true quasi-steady acceleration of one 50 s window on the ground's grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueWindow {
    /// Instrument clock of its start, a multiple of 25 s.
    pub start_clock_s: u32,
    /// Mean quasi-steady acceleration at the sensor, body axes, ng.
    pub body_ng: Vec3,
    /// Mean sensor temperature, C.
    pub temperature_c: f64,
    /// Whether all of it was in normal mode.
    pub normal: bool,
}

/// Sums up seconds into windows, two half windows at a time.
#[derive(Debug, Default)]
pub struct TruthBuilder {
    before: Option<Half>,
    half: Option<Half>,
}

#[derive(Debug, Clone, Copy)]
struct Half {
    start_s: u32,
    seconds: u32,
    sum_ng: Vec3,
    sum_c: f64,
    normal: bool,
}

impl TruthBuilder {
    /// Takes the next second; the window it completes, if it does.
    pub fn take(&mut self, second: &Second) -> Option<TrueWindow> {
        if second.clock_s.is_multiple_of(STRIDE_S) {
            self.half =
                Some(Half { start_s: second.clock_s, seconds: 0, sum_ng: Vec3::zeros(), sum_c: 0.0, normal: true });
        }
        let half = self.half.as_mut()?;
        half.seconds += 1;
        half.sum_ng += second.quasi_steady_ng;
        half.sum_c += second.temperature_c;
        half.normal &= second.normal;
        if half.seconds < STRIDE_S {
            return None;
        }
        let done = *half;
        let before = self.before.replace(done)?;
        Some(TrueWindow {
            start_clock_s: before.start_s,
            body_ng: (before.sum_ng + done.sum_ng) / f64::from(WINDOW_S),
            temperature_c: (before.sum_c + done.sum_c) / f64::from(WINDOW_S),
            normal: before.normal && done.normal,
        })
    }
}

/// The windows as a CSV file, body axes.
pub fn truth_csv(windows: &[TrueWindow]) -> String {
    let mut csv = String::from("window_start_clock_s,ax_ng,ay_ng,az_ng,temperature_c,normal\n");
    for window in windows {
        let a = window.body_ng;
        let normal = u8::from(window.normal);
        // Writing into a string cannot fail.
        let _ = writeln!(
            csv,
            "{},{:.3},{:.3},{:.3},{:.3},{normal}",
            window.start_clock_s, a.x, a.y, a.z, window.temperature_c
        );
    }
    csv
}

/// The true instrument, and the faults planted, in the form of the samples' `instrument.json`.
pub fn instrument_json(mission: &Mission) -> String {
    let config = mission.config();
    let instrument = &config.instrument;
    let laws: Vec<Vec<[f64; 6]>> = instrument
        .bias
        .iter()
        .map(|ranges| ranges.iter().map(|l| [l.a1, l.a2, l.a3, l.a4, l.t0_h, l.t1_h]).collect())
        .collect();
    let hours = [config.start_clock_s, config.end_clock_s()].map(|clock_s| config.time.met_h(f64::from(clock_s)));
    let mut value = json!({
        "scale_correction": instrument.scale_correction,
        "bias_law_coefficients": laws,
        "radius_m": instrument.radius_m,
        "resolution_ng": instrument.resolution_ng,
        "settling_counts": instrument.settling_counts,
        "settling_tau_s": instrument.settling_tau_s,
        "time_h": hours,
        "order": "axis x,y,z (OARE axes) by range A,B,C; bias law [A1,A2,A3,A4,t0_h,t1_h], t = hours since lift-off",
    });
    if let Some((from_s, to_s)) = mission.fly().misreported() {
        value["range_misreported"] =
            json!({"from_clock_s": f64::from(from_s), "to_clock_s": f64::from(to_s), "reported": "C", "true": "A"});
    }
    for fault in &config.faults {
        if let Fault::ElectronicShift { z_counts } = fault {
            value["electronic_shift_z_counts"] = json!(z_counts);
        }
    }
    if !config.faults.is_empty() {
        value["faults"] = Value::Array(config.faults.iter().map(|fault| json!(format!("{fault:?}"))).collect());
    }
    serde_json::to_string_pretty(&value).unwrap_or_default()
}
