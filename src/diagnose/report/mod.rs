//! The answer on paper: one self-contained HTML page with its figures inside, and each figure as an SVG beside it.
//!
//! A figure gets numbers and gives text; nothing here computes what the answer is, and nothing writes a file.

pub(in crate::diagnose) mod figures;
pub(in crate::diagnose) mod page;
mod reduce;
pub(in crate::diagnose) mod sentence;

pub use sentence::sentence;

use super::answer::Diagnosis;
use crate::paper::{Figures, Report};

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

/// Draws the report of an answer. A figure that cannot be drawn is left out and named on the page.
pub fn report(diagnosis: &Diagnosis, plates: &Plates) -> Report {
    let figures = Figures::of([
        ("residual.svg", figures::residual(plates)),
        ("after.svg", figures::after(plates)),
        ("covariates.svg", figures::covariates(plates)),
        ("spectrum.svg", figures::spectrum(plates)),
        ("ladder.svg", figures::ladder(plates)),
    ]);
    let html = page::page(diagnosis, plates, &figures);
    Report { html, figures: figures.shown }
}

#[cfg(test)]
mod tests;
