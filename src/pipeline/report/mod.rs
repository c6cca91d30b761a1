//! The mission on paper: one self-contained page with accuracy tables, calibration and histories, its figures inside, and each
//! figure as an SVG beside it. Numbers in, text out; nothing here writes a file.

mod figures;
mod page;
mod plates;

use serde_json::{Value, json};

use super::calibration::accuracy::{SYSTEMATIC_NG, published};
use super::calibration_file::accuracy_json;
use super::station::Station;
use crate::paper::{Drawn, Figures, Report};

/// The report of a mission.
#[derive(Debug, Clone)]
pub struct MissionReport {
    /// On paper.
    pub paper: Report,
    /// `accuracy.json`: the tables for machines.
    pub accuracy: Value,
}

/// Draws the report. A figure that cannot be drawn is left out and named on the page.
pub fn report(station: &Station) -> MissionReport {
    let plates = plates::Plates::of(station);
    let mut drawn: Vec<(String, Drawn)> = Vec::new();
    for bias in &plates.biases {
        drawn.push((format!("bias_{}.svg", bias.range.letter().to_lowercase()), figures::bias(&plates, bias)));
    }
    drawn.push(("scale.svg".into(), figures::scale(&plates)));
    for n in 0..plates.histories.len() {
        drawn.push((format!("history_{:02}.svg", n + 1), figures::history(&plates.histories[n])));
    }
    let figures = Figures::of(drawn);
    let accuracy = json!({
        "axes": accuracy_json(station.derived()),
        "systematic_ng": SYSTEMATIC_NG,
        "published_sts62": {
            "all_counts_and_ng": published::STS62_ALL,
            "quiet_counts_and_ng": published::STS62_QUIET,
            "quiet_statistical_ng": published::STS62_QUIET_STATISTICAL_NG,
        },
    });
    let html = page::page(station, &plates, &figures);
    MissionReport { paper: Report { html, figures: figures.shown }, accuracy }
}
