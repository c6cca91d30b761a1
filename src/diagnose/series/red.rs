//! A series in red noise: a slow wander (first-order Gauss-Markov) beside white noise, both estimated.
//!
//! The wander is a competitor of every effect: what a slow covariate explains must be explained better than a wander does
//! it. It also sets the standard errors: a covariance is averaged over every wander that the data allow, each with the
//! weight of its restricted likelihood, because a short series does not tell a long memory from a longer one.

use nalgebra::{DMatrix, DVector};

/// Time constants of the wander, in samples: from white to longer than any series.
const MEMORIES: [f64; 9] = [0.5, 2.0, 5.0, 12.0, 30.0, 75.0, 180.0, 450.0, 1_100.0];
/// White variance over that of the wander.
const WHITES: [f64; 8] = [0.0, 0.002, 0.01, 0.04, 0.15, 0.6, 3.0, 15.0];

/// Times of the samples, in units of their usual spacing.
#[derive(Debug, Clone, Default)]
pub struct Beat {
    steps: Vec<f64>,
}

impl Beat {
    /// From times in seconds.
    pub fn new(t_s: &[f64]) -> Self {
        let steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0).max(1e-12);
        Self { steps: steps.iter().map(|s| s / usual).collect() }
    }

    /// Correlation of the wander from each sample to the next.
    fn correlations(&self, memory: f64) -> Vec<f64> {
        self.steps.iter().map(|step| (-step / memory).exp()).collect()
    }
}

fn grid() -> impl Iterator<Item = Noise> {
    MEMORIES.iter().flat_map(|memory| WHITES.iter().map(move |white| (*memory, *white)))
}

/// A wander's time constant in samples, and the white variance over its own.
pub type Noise = (f64, f64);

/// Twice the log likelihood (up to a constant of the length) of `values` about the columns of `design`, at the best wander.
pub fn twice_log_likelihood(values: &[f64], design: &DMatrix<f64>, beat: &Beat) -> f64 {
    best(values, design, beat).1
}

/// The likeliest wander, and twice its log likelihood.
pub fn best(values: &[f64], design: &DMatrix<f64>, beat: &Beat) -> (Noise, f64) {
    let at = |noise| (noise, in_noise(values, design, beat, noise));
    grid().map(at).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(((1.0, 1.0), f64::NEG_INFINITY))
}

/// Twice the log likelihood in one noise.
pub fn in_noise(values: &[f64], design: &DMatrix<f64>, beat: &Beat, (memory, white): Noise) -> f64 {
    let n = values.len() as f64;
    Whitened::new(values, design, &beat.correlations(memory), white)
        .map_or(f64::NEG_INFINITY, |w| -(n * (w.left / n).ln() + w.log_det))
}

/// Covariance of the coefficients that ordinary least squares gives, in this noise.
pub fn covariance(values: &[f64], design: &DMatrix<f64>, beat: &Beat) -> DMatrix<f64> {
    let k = design.ncols();
    let free = (values.len() as f64 - k as f64).max(1.0);
    let normal = design.tr_mul(design);
    let none = || DMatrix::from_diagonal_element(k, k, f64::MAX);
    let Some(inverse) = normal.clone().try_inverse() else { return none() };
    let mut parts: Vec<(f64, DMatrix<f64>)> = Vec::new();
    for (memory, white) in grid() {
        let correlations = beat.correlations(memory);
        let Some(w) = Whitened::new(values, design, &correlations, white) else { continue };
        let weight = -0.5 * (free * (w.left / free).ln() + w.log_det + w.log_det_normal);
        let middle = design.tr_mul(&wander_times(design, &correlations)) + &normal * white;
        parts.push((weight, &inverse * middle * &inverse * (w.left / free)));
    }
    let top = parts.iter().map(|(weight, _)| *weight).fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return none();
    }
    let mut sum = DMatrix::zeros(k, k);
    let mut total = 0.0;
    for (weight, part) in parts {
        sum += part * (weight - top).exp();
        total += (weight - top).exp();
    }
    sum / total
}

/// The wander's correlation matrix times some columns, by one pass each way.
fn wander_times(columns: &DMatrix<f64>, correlations: &[f64]) -> DMatrix<f64> {
    let (n, k) = columns.shape();
    let mut out = columns.clone();
    for j in 0..k {
        let (mut before, mut after) = (0.0, 0.0);
        for i in 1..n {
            before = correlations[i - 1] * (before + columns[(i - 1, j)]);
            out[(i, j)] += before;
            let back = n - 1 - i;
            after = correlations[back] * (after + columns[(back + 1, j)]);
            out[(back, j)] += after;
        }
    }
    out
}

/// What is left of values about columns once both are white.
struct Whitened {
    left: f64,
    log_det: f64,
    log_det_normal: f64,
}

impl Whitened {
    /// A Kalman filter whitens values and columns alike.
    fn new(values: &[f64], design: &DMatrix<f64>, correlations: &[f64], white: f64) -> Option<Self> {
        let (n, k) = design.shape();
        let mut rows = DMatrix::zeros(n, k);
        let mut y = DVector::zeros(n);
        let mut state = DVector::<f64>::zeros(k + 1);
        let (mut variance, mut log_det) = (1.0, 0.0);
        for i in 0..n {
            let innovation = variance + white;
            let (scale, gain) = (innovation.sqrt().recip(), variance / innovation);
            log_det += innovation.ln();
            let rho = correlations.get(i).copied().unwrap_or(0.0);
            for j in 0..=k {
                let x = if j < k { design[(i, j)] } else { values[i] };
                let new = x - state[j];
                if j < k {
                    rows[(i, j)] = new * scale;
                } else {
                    y[i] = new * scale;
                }
                state[j] = rho * (state[j] + gain * new);
            }
            variance = rho * rho * variance * (1.0 - gain) + 1.0 - rho * rho;
        }
        let factor = rows.tr_mul(&rows).cholesky()?;
        let left = (&y - &rows * factor.solve(&rows.tr_mul(&y))).norm_squared().max(f64::MIN_POSITIVE);
        let log_det_normal = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.abs().ln()).sum::<f64>();
        Some(Self { left, log_det, log_det_normal })
    }
}
