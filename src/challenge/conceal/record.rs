//! From a drawn flight to the files of a case, in the case format's columns and roundings.

use std::fmt::Write;

use nalgebra::Vector3;
use rand_chacha::ChaCha12Rng;

use super::draw::{between, log_between, normal, pick};
use super::flight::{FILE_STRIDE, Flight, MARGIN_S, STEP_S};
use super::noise::Noise;
use super::{Question, force};
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::math::rms::rms_about_mean;

/// Half of a window, in points of the 5 s grid.
const HALF_WINDOW: usize = 5;

/// The grid of window centres, s: every 25 s, the first 25 s into the recording.
pub fn centres_s(flight: &Flight) -> Vec<f64> {
    let windows = (flight.length_s / WINDOW_STRIDE_S) as usize - 1;
    (0..windows).map(|k| flight.start_s + WINDOW_STRIDE_S * (k + 1) as f64).collect()
}

/// Mean over the 50 s window about each centre (trapezoid on the 5 s grid), one series per axis.
pub fn window_means(flight: &Flight, series: &[Vector3<f64>]) -> [Vec<f64>; 3] {
    let windows = centres_s(flight).len();
    let first = ((MARGIN_S + WINDOW_STRIDE_S) / STEP_S) as usize;
    let stride = (WINDOW_STRIDE_S / STEP_S) as usize;
    std::array::from_fn(|axis| {
        (0..windows)
            .map(|w| {
                let k = first + w * stride;
                let inner: f64 = (k - HALF_WINDOW + 1..k + HALF_WINDOW).map(|j| series[j][axis]).sum();
                let ends = 0.5 * (series[k - HALF_WINDOW][axis] + series[k + HALF_WINDOW][axis]);
                (inner + ends) / (2 * HALF_WINDOW) as f64
            })
            .collect()
    })
}

/// How active the crew seems about the middle of the samples that each window is the first to have.
pub fn activity(flight: &Flight, noise: &Noise) -> Vec<f64> {
    let asleep = |t: f64| {
        let nights = flight.events.iter().filter(|e| e.kind == "crew_sleep");
        nights.into_iter().any(|e| t >= e.clock_s && t < e.clock_s + e.duration_s)
    };
    let middles_s = centres_s(flight).into_iter().map(|t| t + 0.5 * WINDOW_STRIDE_S);
    middles_s.map(|t| noise.activity(!asleep(t), t - flight.start_s)).collect()
}

/// Which windows arrive: calibrations every 4.18 h take 16 or 42 minutes, and a few stretches are lost.
pub fn kept(rng: &mut ChaCha12Rng, flight: &Flight) -> Vec<bool> {
    let centres = centres_s(flight);
    let mut lost: Vec<(f64, f64)> = (0..)
        .map(|j| {
            let from = flight.start_s + 600.0 + 15_060.0 * f64::from(j);
            (from, from + if j % 3 == 0 { 2500.0 } else { 950.0 })
        })
        .take_while(|(from, _)| *from < flight.end_s())
        .collect();
    for _ in 0..*pick(rng, &[0, 1, 1, 2, 3]) {
        let from = flight.start_s + between(rng, 0.0, flight.length_s);
        lost.push((from, from + log_between(rng, 600.0, 3200.0)));
    }
    centres.iter().map(|t| !lost.iter().any(|(from, to)| t > from && t < to)).collect()
}

/// The recording of a case: how `case.toml` calls it, its octets, and the noise in it.
pub struct Recording {
    /// `acceleration_csv` or `recorder_dump`.
    pub kind: &'static str,
    /// Name of its file.
    pub file: &'static str,
    /// What is in it.
    pub octets: Vec<u8>,
    /// Standard deviation of the noise in the windows that arrive, ng.
    pub noise_ng: [f64; 3],
}

/// What the sensor feels as calibrated windows, with noise and a constant that a bias fit would leave.
pub fn windows(rng: &mut ChaCha12Rng, question: &Question) -> Recording {
    let Question { flight, felt, noise, kept, .. } = question;
    let activity = activity(flight, noise);
    let means = window_means(flight, felt);
    let drawn: [Vec<f64>; 3] = std::array::from_fn(|axis| noise.series(rng, axis, &activity));
    let bias = Vector3::from_fn(|_, _| 60.0 * normal(rng));
    let dev = deviations(rng, noise, &activity);
    let mut recording = String::from("clock_s,ax_ng,ay_ng,az_ng,dev_x_ng,dev_y_ng,dev_z_ng\n");
    for (w, t) in centres_s(flight).into_iter().enumerate().filter(|(w, _)| kept[*w]) {
        let a: [f64; 3] = std::array::from_fn(|i| means[i][w] + drawn[i][w] + bias[i]);
        let d: [f64; 3] = std::array::from_fn(|i| dev[i][w]);
        row(&mut recording, &format!("{t:.1}"), &[(&a, 2), (&d, 1)]);
    }
    Recording {
        kind: "acceleration_csv",
        file: "recording.csv",
        octets: recording.into_bytes(),
        noise_ng: drawn.map(|axis| rms_about_mean(&kept_of(&axis, kept))),
    }
}

/// Those that arrive.
pub fn kept_of(series: &[f64], kept: &[bool]) -> Vec<f64> {
    series.iter().zip(kept).filter(|(_, kept)| **kept).map(|(x, _)| *x).collect()
}

/// The files of a case, by name: what the simulation expects, ng, and the density it used, kg/m^3, beside the recording.
pub fn files(
    id: &str,
    flight: &Flight,
    recording: Recording,
    simulated: &[Vector3<f64>],
    density_kg_m3: &[f64],
) -> Vec<(String, Vec<u8>)> {
    let toml = case_toml(id, flight, &recording);
    let of = |name: &str, octets: Vec<u8>| (name.to_string(), octets);
    vec![
        of("case.toml", toml.into_bytes()),
        of(recording.file, recording.octets),
        of("simulation.csv", simulation(flight, simulated).into_bytes()),
        of("ancillary.csv", ancillary(flight, density_kg_m3).into_bytes()),
        of("events.csv", events(flight).into_bytes()),
    ]
}

/// Average deviation in each window: about four times the mean's noise, and as scattered as on the open cases.
fn deviations(rng: &mut ChaCha12Rng, noise: &Noise, activity: &[f64]) -> [Vec<f64>; 3] {
    std::array::from_fn(|axis| {
        let mut before = between(rng, 0.1, 1.9);
        let mut level_before = noise.level_ng(axis, activity[0]);
        activity
            .iter()
            .map(|now| {
                let half = between(rng, 0.1, 1.9);
                let level = noise.level_ng(axis, *now);
                let dev = 4.0 * 0.5 * (level * half + level_before * before);
                (before, level_before) = (half, level);
                dev
            })
            .collect()
    })
}

fn row(text: &mut String, first: &str, groups: &[(&[f64], usize)]) {
    text.push_str(first);
    for (values, digits) in groups {
        for value in *values {
            // Writing to a String cannot fail.
            let _ = write!(text, ",{value:.digits$}");
        }
    }
    text.push('\n');
}

fn file_points(flight: &Flight) -> impl Iterator<Item = (usize, String)> {
    (0..flight.times_s.len()).step_by(FILE_STRIDE).map(|k| (k, format!("{:.1}", flight.times_s[k])))
}

fn simulation(flight: &Flight, simulated: &[Vector3<f64>]) -> String {
    let mut text = String::from("clock_s,ax_ng,ay_ng,az_ng\n");
    for (k, t) in file_points(flight) {
        row(&mut text, &t, &[(simulated[k].as_slice(), 3)]);
    }
    text
}

fn ancillary(flight: &Flight, density_kg_m3: &[f64]) -> String {
    let mut text = String::from(
        "clock_s,rx_m,ry_m,rz_m,vx_m_s,vy_m_s,vz_m_s,qw,qx,qy,qz,wx_rad_s,wy_rad_s,wz_rad_s,density_kg_m3,temperature_c\n",
    );
    for (k, t) in file_points(flight) {
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&flight.body[k]);
        let w = flight.rate_rad_s[k];
        row(
            &mut text,
            &t,
            &[(flight.position_m[k].as_slice(), 2), (flight.velocity_m_s[k].as_slice(), 5), (&[q.w, q.i, q.j, q.k], 9)],
        );
        text.pop();
        let _ = writeln!(
            text,
            ",{:.9e},{:.9e},{:.9e},{:.5e},{:.3}",
            w.x, w.y, w.z, density_kg_m3[k], flight.temperature_c[k]
        );
    }
    text
}

fn events(flight: &Flight) -> String {
    let mut text = String::from("clock_s,duration_s,kind,detail\n");
    for event in &flight.events {
        let _ = writeln!(text, "{:.1},{:.1},{},", event.clock_s, event.duration_s, event.kind);
    }
    text
}

fn case_toml(id: &str, flight: &Flight, recording: &Recording) -> String {
    let Recording { kind, file, .. } = recording;
    let v = &flight.vehicle;
    let (a, s) = (v.area_m2, v.sensor_offset_m);
    format!(
        "[case]\nid = \"{id}\"\nepoch_utc = \"{}\"\nliftoff_clock_s = 13800\nstart_s = {:.1}\nend_s = {:.1}\n\n\
         [vehicle]\nmass_kg = {:.1}\ndrag_coefficient = {:.1}\narea_m2 = [{:.1}, {:.1}, {:.1}]\n\
         sensor_offset_m = [{:.4}, {:.4}, {:.4}]\nsrp_coefficient = 1.3\n\n\
         [simulation]\nfile = \"simulation.csv\"\nincludes = [\"gravity_gradient\", \"rotation\", \"aerodynamic_drag\"]\n\n\
         [recording]\nfile = \"{file}\"\nkind = \"{kind}\"\n\n\
         [ancillary]\nfile = \"ancillary.csv\"\nevents = \"events.csv\"\n",
        Flight::mission().epoch_utc,
        flight.start_s,
        flight.end_s(),
        v.mass_kg,
        v.drag_coefficient,
        a.x,
        a.y,
        a.z,
        s.x,
        s.y,
        s.z,
    )
}

/// Density of a simulation's air on the grid, for the ancillary file.
pub fn simulated_density(flight: &Flight, lacks_bulge: bool) -> Vec<f64> {
    let bulge = if lacks_bulge { 0.0 } else { 1.0 };
    force::density(flight, force::Air { bulge, ..force::WHOLE_AIR })
}
