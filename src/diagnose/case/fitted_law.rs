//! What a fitted bias law makes of a bias beside it: its measurements see that bias, the law moves with them as far as its form allows,
//! and takes that from every window.

use crate::diagnose::noise::Flips;

/// The fitted bias law of one axis and range, about its solution.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FittedLaw {
    /// Instants of its two-position measurements, s.
    pub measured_s: Vec<f64>,
    /// By how much each of its figures moves with each measurement: a row a figure.
    pub answers: Vec<Vec<f64>>,
    /// What each figure adds to the bias of each window: a row a figure, zero where a window is of another range.
    pub gradients: Vec<Vec<f64>>,
    /// What its measurements say beside it.
    pub flips: Flips,
}

impl FittedLaw {
    /// A bias at the windows less what the law takes of it, which was `measured` at its measurements.
    pub fn take_from(&self, windows: &mut [f64], measured: &[f64]) {
        for (answers, gradient) in self.answers.iter().zip(&self.gradients) {
            let moved: f64 = answers.iter().zip(measured).map(|(answer, bias)| answer * bias).sum();
            windows.iter_mut().zip(gradient).for_each(|(x, g)| *x -= moved * g);
        }
    }

    /// The law at some of the windows.
    pub(super) fn at(&self, windows: &[usize]) -> Self {
        let pick = |gradient: &Vec<f64>| windows.iter().map(|i| gradient[*i]).collect();
        Self { gradients: self.gradients.iter().map(pick).collect(), ..self.clone() }
    }

    /// So many windows more, in which it goes on as in the last.
    pub fn go_on(&mut self, windows: usize) {
        for gradient in &mut self.gradients {
            let now = gradient.last().copied().unwrap_or(0.0);
            gradient.resize(gradient.len() + windows, now);
        }
    }
}
