//! A series in red noise: a slow wander beside white noise, both estimated. The wander is a first-order Gauss-Markov process, or flicker
//! noise, a sum of such processes of all memories.
//!
//! The wander is a competitor of every effect: what a slow covariate explains must be explained better than a wander does
//! it. It also sets the standard errors: a covariance is averaged over every wander of a kind that the data allow, each with the
//! weight of its restricted likelihood, because a short series does not tell a long memory from a longer one; of both kinds the wider
//! errors hold.

use nalgebra::{DMatrix, DVector};

/// Time constants of the wander, in samples: from white to longer than any series.
const MEMORIES: [f64; 9] = [0.5, 2.0, 5.0, 12.0, 30.0, 75.0, 180.0, 450.0, 1_100.0];
/// White variance over that of the wander.
const WHITES: [f64; 8] = [0.0, 0.002, 0.01, 0.04, 0.15, 0.6, 3.0, 15.0];
/// Of flicker noise, by their place above: six times as long from one to the next.
const RUNGS: [usize; 5] = [0, 1, 3, 5, 7];
/// Variance of each rung over that of the one before: as much for flicker noise, more on the way to a random walk.
const TILTS: [f64; 2] = [1.0, 2.5];

/// Times of the samples, in units of their usual spacing, as the correlation of every wander from each sample to the next.
#[derive(Debug, Clone, Default)]
pub struct Beat {
    correlations: [Vec<f64>; MEMORIES.len()],
}

impl Beat {
    /// From times in seconds.
    pub fn new(t_s: &[f64]) -> Self {
        let steps: Vec<f64> = t_s.windows(2).map(|w| w[1] - w[0]).collect();
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0).max(1e-12);
        let correlation = |memory: f64| steps.iter().map(|step| (-step / usual / memory).exp()).collect();
        Self { correlations: MEMORIES.map(correlation) }
    }
}

/// A wander of unit variance: processes by their place among the memories, and their shares.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Wander {
    One(usize),
    Flicker(f64),
}

impl Wander {
    fn all() -> impl Iterator<Item = Self> {
        (0..MEMORIES.len()).map(Self::One).chain(TILTS.into_iter().map(Self::Flicker))
    }

    fn shares(self) -> Vec<(usize, f64)> {
        match self {
            Self::One(memory) => vec![(memory, 1.0)],
            Self::Flicker(tilt) => {
                let whole: f64 = (0..RUNGS.len()).map(|rung| tilt.powi(rung as i32)).sum();
                RUNGS.iter().enumerate().map(|(rung, memory)| (*memory, tilt.powi(rung as i32) / whole)).collect()
            }
        }
    }
}

/// A wander, and the white variance over its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    wander: Wander,
    white: f64,
}

impl Noise {
    /// Hardly any wander: what is in it for longer than a few samples is something else.
    pub const QUIET: Self = Self { wander: Wander::One(1), white: 0.6 };
}

fn grid() -> impl Iterator<Item = Noise> {
    Wander::all().flat_map(|wander| WHITES.iter().map(move |white| Noise { wander, white: *white }))
}

/// Twice the log likelihood (up to a constant of the length) of `values` about the columns of `design`, at the best wander.
pub fn twice_log_likelihood(values: &[f64], design: &DMatrix<f64>, beat: &Beat) -> f64 {
    best(values, design, beat).1
}

/// The likeliest wander, and twice its log likelihood.
pub fn best(values: &[f64], design: &DMatrix<f64>, beat: &Beat) -> (Noise, f64) {
    let at = |noise| (noise, in_noise(values, design, beat, noise));
    let nothing = Noise { wander: Wander::One(0), white: 1.0 };
    grid().map(at).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((nothing, f64::NEG_INFINITY))
}

/// Twice the log likelihood in one noise.
pub fn in_noise(values: &[f64], design: &DMatrix<f64>, beat: &Beat, noise: Noise) -> f64 {
    let n = values.len() as f64;
    Whitened::new(values, design, beat, noise).map_or(f64::NEG_INFINITY, |w| -(n * (w.left / n).ln() + w.log_det))
}

/// Covariance of the coefficients that ordinary least squares gives, in this noise.
pub fn covariance(values: &[f64], design: &DMatrix<f64>, beat: &Beat) -> DMatrix<f64> {
    let k = design.ncols();
    let free = (values.len() as f64 - k as f64).max(1.0);
    let normal = design.tr_mul(design);
    let none = || DMatrix::from_diagonal_element(k, k, f64::MAX);
    let Some(inverse) = normal.clone().try_inverse() else { return none() };
    let wandered = beat.correlations.each_ref().map(|correlations| design.tr_mul(&wander_times(design, correlations)));
    let part = |noise: Noise| {
        let w = Whitened::new(values, design, beat, noise)?;
        let weight = -0.5 * (free * (w.left / free).ln() + w.log_det + w.log_det_normal);
        let shares = noise.wander.shares();
        let middle = shares.iter().fold(&normal * noise.white, |sum, (k, share)| sum + &wandered[*k] * *share);
        Some((weight, &inverse * middle * &inverse * (w.left / free)))
    };
    let of_kind = |flicker: bool| -> Vec<(f64, DMatrix<f64>)> {
        let kind = grid().filter(|noise| matches!(noise.wander, Wander::Flicker(_)) == flicker);
        kind.filter_map(part).collect()
    };
    let kinds = [of_kind(false), of_kind(true)];
    let top = kinds.iter().flatten().map(|(weight, _)| *weight).fold(f64::NEG_INFINITY, f64::max);
    if !top.is_finite() {
        return none();
    }
    let averages = kinds.iter().filter_map(|parts| {
        let (mut sum, mut total) = (DMatrix::zeros(k, k), 0.0);
        for (weight, part) in parts {
            sum += part * (weight - top).exp();
            total += (weight - top).exp();
        }
        (total > 0.0).then(|| (total, sum / total))
    });
    let averages: Vec<(f64, DMatrix<f64>)> = averages.collect();
    // What the data hardly tell apart must not make an error smaller.
    let most = averages.iter().map(|(total, _)| *total).fold(0.0, f64::max);
    let likely = averages.into_iter().filter(|(total, _)| *total > UNLIKELY * most).map(|(_, average)| average);
    likely.reduce(|a, b| wider(&a, &b)).unwrap_or_else(none)
}

/// A kind of noise that the data make less likely than another by this is not asked how wide its errors are.
const UNLIKELY: f64 = 0.05;

/// The first of two covariances, each error at least as wide as in the second.
fn wider(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let by: Vec<f64> = a.diagonal().iter().zip(&b.diagonal()).map(|(a, b)| (b / a).max(1.0).sqrt()).collect();
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * by[i] * by[j])
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
    fn new(values: &[f64], design: &DMatrix<f64>, beat: &Beat, noise: Noise) -> Option<Self> {
        match noise.wander.shares()[..] {
            [one] => Self::of([one], values, design, beat, noise.white),
            ref all => Self::of::<{ RUNGS.len() }>(all.try_into().ok()?, values, design, beat, noise.white),
        }
    }

    /// A Kalman filter whitens values and columns alike, for processes by their place among the memories and their shares.
    fn of<const M: usize>(
        shares: [(usize, f64); M],
        values: &[f64],
        design: &DMatrix<f64>,
        beat: &Beat,
        white: f64,
    ) -> Option<Self> {
        let (n, k) = design.shape();
        let mut rows = DMatrix::zeros(n, k);
        let mut y = DVector::zeros(n);
        let mut state = vec![[0.0_f64; M]; k + 1];
        let mut expects = Expects::new(shares.map(|(_, share)| share), white);
        let mut log_det = 0.0;
        for i in 0..n {
            let rho = shares.map(|(memory, _)| beat.correlations[memory].get(i).copied().unwrap_or(0.0));
            expects.go_on(rho);
            log_det += expects.ln_innovation;
            for (j, state) in state.iter_mut().enumerate() {
                let x = if j < k { design[(i, j)] } else { values[i] };
                let new = x - state.iter().sum::<f64>();
                if j < k {
                    rows[(i, j)] = new * expects.scale;
                } else {
                    y[i] = new * expects.scale;
                }
                for a in 0..M {
                    state[a] = rho[a] * (state[a] + expects.gain[a] * new);
                }
            }
        }
        let factor = rows.tr_mul(&rows).cholesky()?;
        let left = (&y - &rows * factor.solve(&rows.tr_mul(&y))).norm_squared().max(f64::MIN_POSITIVE);
        let log_det_normal = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.abs().ln()).sum::<f64>();
        Some(Self { left, log_det, log_det_normal })
    }
}

/// What the filter expects of a sample, whatever the values are.
struct Expects<const M: usize> {
    shares: [f64; M],
    white: f64,
    /// Of the processes, before the next sample.
    variance: [[f64; M]; M],
    /// Correlations that led there, and whether they change it no more.
    rho: [f64; M],
    settled: bool,
    /// Of each process, as a share of what is new in this sample.
    gain: [f64; M],
    /// Over the standard deviation of what is new in this sample, and the logarithm of its variance.
    scale: f64,
    ln_innovation: f64,
}

/// At even times the variances soon change no more: by less than this share of them from one sample to the next.
const SETTLED: f64 = 1e-12;

impl<const M: usize> Expects<M> {
    fn new(shares: [f64; M], white: f64) -> Self {
        let variance = std::array::from_fn(|a| std::array::from_fn(|b| if a == b { shares[a] } else { 0.0 }));
        let nothing = [0.0; M];
        Self { shares, white, variance, rho: nothing, settled: false, gain: nothing, scale: 1.0, ln_innovation: 0.0 }
    }

    /// To the next sample, with so much of every process left at the one after it.
    fn go_on(&mut self, rho: [f64; M]) {
        let close = |a: f64, b: f64| (a - b).abs() <= SETTLED * b.abs();
        if self.settled && rho.iter().zip(&self.rho).all(|(a, b)| close(*a, *b)) {
            return;
        }
        let seen = self.variance.map(|row| row.iter().sum::<f64>());
        let innovation = seen.iter().sum::<f64>() + self.white;
        self.gain = seen.map(|seen| seen / innovation);
        self.scale = innovation.sqrt().recip();
        self.ln_innovation = innovation.ln();
        self.settled = true;
        for a in 0..M {
            for b in 0..M {
                let own = if a == b { self.shares[a] * (1.0 - rho[a] * rho[a]) } else { 0.0 };
                let next = rho[a] * rho[b] * (self.variance[a][b] - self.gain[a] * seen[b]) + own;
                self.settled &= close(next, self.variance[a][b]);
                self.variance[a][b] = next;
            }
        }
        self.rho = rho;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The filter's likelihood is that of the whole covariance matrix, for one process and for a sum of them, across a gap.
    #[test]
    fn the_filter_is_the_inverse_of_the_covariance() {
        let t_s: Vec<f64> = (0..40).map(|i| 10.0 * f64::from(i) + if i > 22 { 170.0 } else { 0.0 }).collect();
        let values: Vec<f64> = t_s.iter().map(|t| (0.013 * t).sin() + (0.9 * t).cos()).collect();
        let design = DMatrix::from_fn(40, 2, |i, j| if j == 0 { 1.0 } else { t_s[i] / 400.0 });
        for noise in grid().filter(|noise| noise.white > 0.0) {
            let covariance = DMatrix::from_fn(40, 40, |i, j| {
                let apart = (t_s[i] - t_s[j]).abs() / 10.0;
                let wander: f64 =
                    noise.wander.shares().iter().map(|(k, share)| share * (-apart / MEMORIES[*k]).exp()).sum();
                wander + if i == j { noise.white } else { 0.0 }
            });
            let cholesky = covariance.cholesky().unwrap();
            let [x, y] = [&design, &DMatrix::from_column_slice(40, 1, &values)].map(|m| cholesky.solve(m));
            let normal = design.tr_mul(&x);
            let right = design.tr_mul(&y);
            let energy = DMatrix::from_column_slice(40, 1, &values).dot(&y);
            let left = energy - right.dot(&normal.clone().cholesky().unwrap().solve(&right));
            let log_det = 2.0 * cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
            let found = Whitened::new(&values, &design, &Beat::new(&t_s), noise).unwrap();
            assert!((found.left / left - 1.0).abs() < 1e-6, "{noise:?}: {} for {left}", found.left);
            assert!((found.log_det - log_det).abs() < 1e-6, "{noise:?}: {} for {log_det}", found.log_det);
        }
    }
}
