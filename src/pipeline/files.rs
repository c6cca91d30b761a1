//! The product files: `windows.csv`, `calibration.json`, `anomalies.json`, `ledger.json`.
//!
//! The first three are byte-identical for every order, repetition and chunking of the same playbacks.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::calibration::Anomaly;
pub use super::calibration_file::{calibration_json, known_json, version_json};
use super::ledger::{Account, PlaybackAccount, SecondSet};
use super::product::{Component, Product};
use super::settings::Settings;
use super::station::Station;
use crate::telemetry::Range;

/// The columns of `windows.csv`.
pub const WINDOW_COLUMNS: [&str; 31] = [
    "window_start_clock_s",
    "met_s",
    "utc",
    "ax_ng",
    "ay_ng",
    "az_ng",
    "sigma_ax_ng",
    "sigma_ay_ng",
    "sigma_az_ng",
    "sigma_sys_ax_ng",
    "sigma_sys_ay_ng",
    "sigma_sys_az_ng",
    "mean_ax_ng",
    "mean_ay_ng",
    "mean_az_ng",
    "q_x",
    "q_y",
    "q_z",
    "trim_x",
    "trim_y",
    "trim_z",
    "range_x",
    "range_y",
    "range_z",
    "samples",
    "temperature_c",
    "mode",
    "quality",
    "calibration",
    "revision",
    "known_since_clock_s",
];

/// Every window, a row each, in order.
pub fn windows_csv(station: &Station) -> String {
    let mut csv = WINDOW_COLUMNS.join(",");
    csv.push('\n');
    for product in station.products() {
        window_row(&mut csv, product, station.settings());
    }
    csv
}

/// One row of `windows.csv`, with its line end.
pub fn window_row(csv: &mut String, product: &Product, settings: &Settings) {
    let clock_s = product.start.seconds();
    let utc = settings.time.utc(clock_s);
    let _ = write!(csv, "{clock_s:.1},{:.1},{utc:.3}", settings.time.met_s(clock_s));
    let figures: [fn(&Component) -> f64; 4] = [|c| c.trimmed_ng, |c| c.sigma_ng, |c| c.sigma_sys_ng, |c| c.mean_ng];
    let cells = figures.into_iter().flat_map(|figure| product.acceleration.each(figure));
    cells.for_each(|ng| number_cell(csv, ng, 3));
    product.q.iter().for_each(|q| number_cell(csv, *q, 4));
    product.trim.iter().for_each(|trim| number_cell(csv, *trim, 4));
    product.range.iter().for_each(|range| word_cell(csv, range.map_or("", Range::letter)));
    let _ = write!(csv, ",{}", product.samples);
    number_cell(csv, product.temperature_c, 3);
    let (mode, quality) = (product.mode.word(), product.quality);
    let _ = writeln!(
        csv,
        ",{mode},{quality},{},{},{:.1}",
        product.calibration,
        product.revision,
        product.known_since.seconds()
    );
}

/// A number with so many decimals; never a negative zero.
fn number_cell(csv: &mut String, value: Option<f64>, decimals: usize) {
    csv.push(',');
    if let Some(value) = value {
        let _ = write!(csv, "{:.decimals$}", rounded(value, decimals));
    }
}

fn word_cell(csv: &mut String, word: &str) {
    csv.push(',');
    csv.push_str(word);
}

/// Rounded to so many decimals; negative zero becomes zero.
pub fn rounded(value: f64, decimals: usize) -> f64 {
    let scale = 10f64.powi(decimals as i32);
    (value * scale).round() / scale + 0.0
}

/// `anomalies.json`.
pub fn anomalies_json(station: &Station) -> Value {
    Value::Array(station.derived().anomalies.iter().map(anomaly_json).collect())
}

/// One anomaly.
pub fn anomaly_json(anomaly: &Anomaly) -> Value {
    json!({
        "kind": anomaly.kind.word(),
        "from_clock_s": anomaly.from.seconds(),
        "to_clock_s": anomaly.to.seconds(),
        "axes": anomaly.axes.iter().map(|axis| axis.letter()).collect::<Vec<_>>(),
        "value": anomaly.value,
        "sigma": anomaly.sigma,
        "unit": anomaly.unit,
        "sentence": anomaly.sentence,
    })
}

/// `ledger.json`.
pub fn ledger_json(station: &Station) -> Value {
    let ledger = station.ledger();
    let mut total = account_json(&ledger.total(), &ledger.seconds);
    total.insert("frame_conflicts".into(), json!(ledger.frame_conflicts));
    let playbacks: Vec<Value> = ledger.playbacks().map(|(_, playback)| playback_json(playback)).collect();
    json!({"total": total, "playbacks": playbacks})
}

/// The account of one playback.
pub fn playback_json(playback: &PlaybackAccount) -> Value {
    let mut account = account_json(&playback.account, &playback.seconds);
    account.insert("direction".into(), json!(playback.sense.map(|sense| sense.direction_word())));
    account.insert("polarity".into(), json!(playback.sense.map(|sense| sense.polarity_word())));
    account.insert("bit_offset".into(), json!(playback.bit_offset));
    Value::Object(account)
}

fn account_json(account: &Account, seconds: &SecondSet) -> Map<String, Value> {
    let refused: Map<String, Value> =
        account.frames_refused.iter().map(|(reason, n)| (reason.word().into(), json!(n))).collect();
    let gaps: Vec<[f64; 2]> = seconds.gaps().iter().map(|(from, to)| [*from as f64, *to as f64]).collect();
    let value = json!({
        "bits_in": account.bits_in,
        "frames_found": account.frames_found,
        "frames_new": account.frames_new,
        "frames_repeated": account.frames_repeated,
        "frames_refused": refused,
        "packets": account.packets,
        "packets_refused": account.packets_refused,
        "seconds_covered": seconds.len(),
        "gaps": gaps,
    });
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
