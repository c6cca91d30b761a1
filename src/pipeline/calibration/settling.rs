//! The settling of the sensor after the table's stop: counts += S exp(-t/tau) in the opposite position of the Y-Z calibration.
//!
//! Found from the samples: every opposite position gives S at a trial tau by weighted least squares over its seconds (a level
//! and the decay), all positions together choose tau, and the mean of S over its error says whether there is a transient at
//! all. What the trimmed mean would have been left with is the skew.

use super::sequence::{Hold, POSITION_TENTHS};
use crate::math::robust::{MAD_TO_SIGMA, TrimLaw, median};
use crate::math::shared_work::map;
use crate::telemetry::Axis;
use crate::units::Clock;

/// A transient smaller than this many of its errors is none.
pub const DETECTION_SIGMA: f64 = 6.0;
/// Trial time constants, s: from one second to half a position.
const TAUS_S: [f64; 25] = [
    1.5, 1.8, 2.1, 2.5, 2.9, 3.3, 3.7, 4.1, 4.5, 4.9, 5.2, 5.5, 5.8, 6.1, 6.4, 6.8, 7.2, 7.7, 8.3, 9.0, 10.0, 11.5,
    13.5, 16.0, 20.0,
];
/// Means of one second are correlated: variance of a fit over that of independent seconds.
const CORRELATION: f64 = 1.5;
/// The same with Huber's loss of efficiency.
const INFLATION: f64 = 1.1 * CORRELATION;
/// Length of a position, s.
const POSITION_S: f64 = POSITION_TENTHS as f64 / 10.0;
/// Residuals beyond so many scatters lose weight.
const HUBER: f64 = 1.5;

/// The transient of one axis and range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transient {
    /// S, counts.
    pub amplitude_counts: f64,
    /// Its standard error.
    pub amplitude_sigma: f64,
    /// tau, s.
    pub tau_s: f64,
    /// Change of S tau with one standard error of tau, S following, counts s.
    pub area_with_tau: f64,
    /// What it would leave in a measured bias, counts, and the error of that.
    pub skew_counts: [f64; 2],
    /// Positions it was found in.
    pub positions: usize,
    /// Over which clocks.
    pub span: [Clock; 2],
}

impl Transient {
    /// The transient at a time since the start of the step, counts.
    pub fn counts(&self, t_s: f64) -> f64 {
        self.amplitude_counts * (-t_s / self.tau_s).exp()
    }

    /// Error it leaves in a two-position bias once taken away, counts: common to all measurements. Half that of the transient's mean
    /// over the position, from its amplitude at this tau and from tau.
    pub fn bias_sigma(&self) -> f64 {
        0.5 * (self.amplitude_sigma * self.tau_s).hypot(self.area_with_tau) / POSITION_S
    }

    /// Whether there is one.
    pub fn is_real(&self) -> bool {
        self.amplitude_counts.abs() > DETECTION_SIGMA * self.amplitude_sigma
    }
}

/// One position: means of its seconds.
struct Position {
    seconds: Vec<(f64, f64)>,
    weights: Vec<f64>,
    scatter: f64,
}

impl Position {
    fn new(hold: &Hold<'_>, axis: Axis) -> Option<Self> {
        let start = hold.began?.tenths();
        let seconds: Vec<(f64, f64)> = hold
            .records
            .iter()
            .map(|record| {
                let mean = record.counts.iter().map(|s| f64::from(s[axis.index()])).sum::<f64>() / 10.0;
                ((record.clock.tenths() - start) as f64 / 10.0 + 0.45, mean)
            })
            .collect();
        (seconds.len() >= 20).then(|| {
            let weights = vec![1.0; seconds.len()];
            Self { seconds, weights, scatter: 1.0 }
        })
    }

    /// S and its variance in units of the scatter's, at a tau.
    fn amplitude(&self, tau_s: f64) -> (f64, f64, f64) {
        let (mut w, mut we, mut wee, mut wy, mut wey) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((t, y), weight) in self.seconds.iter().zip(&self.weights) {
            let e = (-t / tau_s).exp();
            w += weight;
            we += weight * e;
            wee += weight * e * e;
            wy += weight * y;
            wey += weight * e * y;
        }
        let determinant = w * wee - we * we;
        let s = (w * wey - we * wy) / determinant;
        (s, w / determinant, (wy - s * we) / w)
    }

    /// Sum of squares at a tau and amplitude, the level free, over the scatter squared.
    fn misfit(&self, tau_s: f64, amplitude: f64) -> f64 {
        let of = |t: f64, y: f64| y - amplitude * (-t / tau_s).exp();
        let pairs = || self.seconds.iter().zip(&self.weights);
        let total: f64 = self.weights.iter().sum();
        let level = pairs().map(|((t, y), w)| w * of(*t, *y)).sum::<f64>() / total;
        pairs().map(|((t, y), w)| w * (of(*t, *y) - level).powi(2)).sum::<f64>() / self.scatter.powi(2)
    }

    /// Weights and scatter from the residuals at a tau.
    fn reweigh(&mut self, tau_s: f64) {
        for _ in 0..3 {
            let (s, _, level) = self.amplitude(tau_s);
            let residuals: Vec<f64> = self.seconds.iter().map(|(t, y)| y - level - s * (-t / tau_s).exp()).collect();
            let mut sizes: Vec<f64> = residuals.iter().map(|r| r.abs()).collect();
            self.scatter = (MAD_TO_SIGMA * median(&mut sizes).unwrap_or(1.0)).max(0.2);
            for (weight, residual) in self.weights.iter_mut().zip(&residuals) {
                *weight = (HUBER * self.scatter / residual.abs().max(1e-9)).min(1.0);
            }
        }
    }
}

/// The weighted mean of S over positions, and its error: from the positions' errors, or their scatter where that is larger.
fn mean_amplitude(positions: &[Position], tau_s: f64) -> (f64, f64) {
    let each: Vec<(f64, f64)> = positions
        .iter()
        .map(|p| {
            let (s, variance, _) = p.amplitude(tau_s);
            (s, variance * p.scatter.powi(2) * INFLATION)
        })
        .collect();
    let weight: f64 = each.iter().map(|(_, v)| 1.0 / v).sum();
    let mean = each.iter().map(|(s, v)| s / v).sum::<f64>() / weight;
    let chi2: f64 = each.iter().map(|(s, v)| (s - mean).powi(2) / v).sum();
    let reduced = if each.len() > 1 { chi2 / (each.len() - 1) as f64 } else { 1.0 };
    (mean, (reduced.max(1.0) / weight).sqrt())
}

/// The common time constant.
#[derive(Debug, Clone, Copy)]
struct Tau {
    /// Of least misfit, s.
    tau_s: f64,
    /// Standard error of its logarithm.
    ln_sigma: f64,
}

/// The transients of Y and Z in their common opposite positions, with one tau; None without a position of which it is known when it began.
pub fn find(holds: &[&Hold<'_>], law: &TrimLaw, samples_min: usize) -> Option<[Transient; 2]> {
    let axes = [Axis::Y, Axis::Z];
    let mut positions = axes.map(|axis| holds.iter().filter_map(|hold| Position::new(hold, axis)).collect::<Vec<_>>());
    if positions[0].is_empty() {
        return None;
    }
    positions.as_mut_slice().iter_mut().flatten().for_each(|p| p.reweigh(6.0));
    let Tau { tau_s, .. } = best_tau(&positions);
    positions.as_mut_slice().iter_mut().flatten().for_each(|p| p.reweigh(tau_s));
    let Tau { tau_s, ln_sigma } = best_tau(&positions);
    let span = [holds[0].start(), holds[holds.len() - 1].last()];
    Some(std::array::from_fn(|n| {
        let (amplitude_counts, amplitude_sigma) = mean_amplitude(&positions[n], tau_s);
        let area = |ln_step: f64| {
            let tau_s = tau_s * ln_step.exp();
            mean_amplitude(&positions[n], tau_s).0 * tau_s
        };
        let mut transient = Transient {
            amplitude_counts,
            amplitude_sigma,
            tau_s,
            area_with_tau: 0.5 * (area(ln_sigma) - area(-ln_sigma)),
            skew_counts: [0.0; 2],
            positions: positions[n].len(),
            span,
        };
        transient.skew_counts = skew(&transient, holds, axes[n], law, samples_min);
        transient
    }))
}

/// The tau of least misfit over all positions, between the trial values by a parabola; its error from how fast the misfit rises. At
/// the end of the trial values the error is the step to the next one.
fn best_tau(positions: &[Vec<Position>; 2]) -> Tau {
    let misfit = |of_axis: &Vec<Position>, tau_s: f64| {
        let (amplitude, _) = mean_amplitude(of_axis, tau_s);
        of_axis.iter().map(|p| p.misfit(tau_s, amplitude)).sum::<f64>()
    };
    let misfits = map(&TAUS_S, |tau_s| positions.iter().map(|of_axis| misfit(of_axis, *tau_s)).sum::<f64>());
    let best = (0..TAUS_S.len()).min_by(|a, b| misfits[*a].total_cmp(&misfits[*b])).unwrap_or(0);
    let inner = best.clamp(1, TAUS_S.len() - 2);
    let [x0, x1, x2] = [inner - 1, inner, inner + 1].map(|n| TAUS_S[n].ln());
    let [y0, y1, y2] = [inner - 1, inner, inner + 1].map(|n| misfits[n]);
    let (before, after) = ((y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1));
    let curvature = (after - before) / (x2 - x0);
    if best != inner || curvature <= 0.0 {
        return Tau { tau_s: TAUS_S[best], ln_sigma: 0.5 * (x2 - x0) };
    }
    let middle = 0.5 * (x0 + x1) - 0.5 * before / curvature;
    Tau { tau_s: middle.clamp(x0, x2).exp(), ln_sigma: (INFLATION / curvature).sqrt() }
}

/// Half the difference that taking the transient away makes to the trimmed mean, and its error over positions.
fn skew(transient: &Transient, holds: &[&Hold<'_>], axis: Axis, law: &TrimLaw, samples_min: usize) -> [f64; 2] {
    let skews: Vec<f64> = holds
        .iter()
        .filter_map(|hold| {
            let raw = hold.mean(axis, samples_min)?;
            let freed = hold.mean_without(axis, law, samples_min, Some(&|t_s| transient.counts(t_s)))?;
            Some(0.5 * (raw.mean - freed.mean))
        })
        .collect();
    if skews.is_empty() {
        return [0.0; 2];
    }
    let count = skews.len() as f64;
    let mean = skews.iter().sum::<f64>() / count;
    let scatter = skews.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (count * (count - 1.0).max(1.0));
    [mean, scatter.sqrt().hypot(transient.bias_sigma())]
}
