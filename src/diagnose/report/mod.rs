//! The answer on paper: one self-contained HTML page with its figures inside, and each figure as an SVG beside it.
//!
//! A figure gets numbers and gives text; nothing here computes what the answer is, and nothing writes a file.

pub(in crate::diagnose) mod figures;
pub(in crate::diagnose) mod page;
mod reduce;
pub(in crate::diagnose) mod sentence;

pub use sentence::sentence;

use super::answer::Diagnosis;

/// Three axes, one value per window.
pub type Axes = [Vec<f64>; 3];

/// What the figures show, window by window.
#[derive(Debug, Clone, Default)]
pub struct Plates {
    /// Window centres, s.
    pub clock_s: Vec<f64>,
    /// Lift-off, s.
    pub liftoff_clock_s: f64,
    /// Recording less simulation, a constant per axis removed, ng.
    pub before_ng: Axes,
    /// The effects' part of it, ng; zeros where nothing is named.
    pub model_ng: Axes,
    /// Part of the Sun seen, 0 to 1.
    pub sunlit: Vec<f64>,
    /// The log: from, to, kind.
    pub events: Vec<(f64, f64, String)>,
    /// What the residual may follow.
    pub covariates: Vec<CovariatePlate>,
    /// Orbital period, s.
    pub period_s: f64,
    /// Sets with their log evidence against nothing, best first.
    pub ladder: Vec<(String, f64)>,
}

/// One quantity beside the residual.
#[derive(Debug, Clone, Default)]
pub struct CovariatePlate {
    /// What it is, for the axis of its panel.
    pub name: String,
    /// Its unit, empty where it has none.
    pub unit: String,
    /// One value per window.
    pub values: Vec<f64>,
}

/// The report: the page, and its figures by file name.
#[derive(Debug, Clone)]
pub struct Report {
    /// `index.html`.
    pub html: String,
    /// Name and SVG text of each figure.
    pub figures: Vec<(&'static str, String)>,
}

/// Draws the report of an answer. A figure that cannot be drawn is left out and named on the page.
pub fn report(diagnosis: &Diagnosis, plates: &Plates) -> Report {
    let drawn = [
        ("residual.svg", figures::residual(plates)),
        ("after.svg", figures::after(plates)),
        ("covariates.svg", figures::covariates(plates)),
        ("spectrum.svg", figures::spectrum(plates)),
        ("ladder.svg", figures::ladder(plates)),
    ];
    let mut figures = Vec::new();
    let mut missing = Vec::new();
    for (name, svg) in drawn {
        match svg {
            Ok(svg) if !svg.is_empty() => figures.push((name, svg)),
            Ok(_) => {}
            Err(reason) => missing.push(format!("{name}: {reason}")),
        }
    }
    let html = page::page(diagnosis, plates, &figures, &missing);
    Report { html, figures }
}

#[cfg(test)]
mod tests;
