//! Likelihood of a series in red noise: a slow wander (first-order Gauss-Markov) beside white noise, both estimated.
//!
//! The wander is a competitor of every effect: what a slow covariate explains must be explained better than a wander does
//! it, so that agreement counts at every time scale and not only as many times as the residual has independent values.

use nalgebra::{DMatrix, DVector};

/// Time constants of the wander, in samples: from white to longer than any series.
const MEMORIES: [f64; 9] = [0.5, 2.0, 5.0, 12.0, 30.0, 75.0, 180.0, 450.0, 1_100.0];
/// White variance over that of the wander.
const WHITES: [f64; 8] = [0.0, 0.002, 0.01, 0.04, 0.15, 0.6, 3.0, 15.0];

/// Twice the log likelihood (up to a constant of the length) of `values` about the columns of `design`, at the best wander.
pub fn twice_log_likelihood(values: &[f64], design: &DMatrix<f64>) -> f64 {
    let grid = MEMORIES.iter().flat_map(|memory| WHITES.iter().map(move |white| (*memory, *white)));
    grid.map(|(memory, white)| at(values, design, (-1.0 / memory).exp(), white)).fold(f64::NEG_INFINITY, f64::max)
}

fn at(values: &[f64], design: &DMatrix<f64>, rho: f64, white: f64) -> f64 {
    let (n, k) = design.shape();
    let mut rows = DMatrix::zeros(n, k);
    let mut y = DVector::zeros(n);
    let mut state = DVector::<f64>::zeros(k + 1);
    let (mut variance, mut log_det) = (1.0, 0.0);
    // A Kalman filter whitens values and columns alike.
    for i in 0..n {
        let innovation = variance + white;
        let (scale, gain) = (innovation.sqrt().recip(), variance / innovation);
        log_det += innovation.ln();
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
    let Some(solution) = rows.tr_mul(&rows).cholesky().map(|c| c.solve(&rows.tr_mul(&y))) else {
        return f64::NEG_INFINITY;
    };
    let left = (&y - &rows * solution).norm_squared().max(f64::MIN_POSITIVE);
    -(n as f64 * (left / n as f64).ln() + log_det)
}
