//! What the two-position measurements of a bias say beside the law fitted to them: a bias that steps in the sensor leaves them one by one
//! away from any such law, an acceleration does not, since the flip of the table takes it out.
//!
//! Measured = law + drift + error, the figures of the law about where they were expected and as wide as they were, the drift a random walk
//! of unknown speed, the errors independent. Of these the measurements have one covariance, S. What is told is the filter R with
//! R' R = 1/S and what it makes of the measurements: about the law, independent numbers of unit size.

use nalgebra::{DMatrix, DVector};

use crate::math::robust::median;
use crate::pipeline::calibration::bias_law::PARAMETERS;

/// One two-position measurement beside its law, in ng.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flip {
    /// When, s.
    pub clock_s: f64,
    /// Measured less fitted.
    pub rest_ng: f64,
    /// Its standard error.
    pub sigma_ng: f64,
    /// By how much the law moves there with each of its figures.
    pub gradient_ng: [f64; PARAMETERS],
}

/// The flips of an axis behind their filter.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Flips {
    /// The filter: what each number is made of, by flip.
    rows: Vec<Vec<f64>>,
    /// The measurements behind it.
    pub rest: Vec<f64>,
}

/// From so many flips on their own scatter is known.
const SCATTER_FROM: usize = 6;
/// A flip that is so many standard errors away from those on either side counts as if it were no further.
const ALONE_SIGMA: f64 = 3.0;
/// Speeds of a drift that no law describes, ng after a day.
const DRIFTS_NG: [f64; 9] = [0.0, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0, 320.0];
/// Prior odds of a step somewhere, and its size: a step must not be taken for a fast drift, which would then hide it.
const LOG_STEP: f64 = -4.0;
const STEP_NG: f64 = 100.0;
/// Numbers that the law takes to less than this share of their size are not told.
const TAKEN: f64 = 1e-6;
const DAY_S: f64 = 86_400.0;

impl Flips {
    /// Of measurements in order of time; `departures` of the figures of the law, and their widths.
    pub fn new(flips: &[Flip], departures: &[(f64, f64); PARAMETERS]) -> Self {
        let n = flips.len();
        let scatter = scatter(flips);
        let sigma_ng: Vec<f64> = (0..n).map(|i| flips[i].sigma_ng * scatter * alone(flips, i)).collect();
        let law = DMatrix::from_fn(n, PARAMETERS, |i, j| flips[i].gradient_ng[j]);
        let away =
            DVector::from_fn(n, |i, _| flips[i].rest_ng) + &law * DVector::from_fn(PARAMETERS, |j, _| departures[j].0);
        let wide = DMatrix::from_diagonal(&DVector::from_fn(PARAMETERS, |j, _| departures[j].1.powi(2)));
        let but_drift =
            &law * wide * law.transpose() + DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| sigma_ng[i].powi(2)));
        let walk = |i: usize, j: usize| (flips[i].clock_s.min(flips[j].clock_s) - flips[0].clock_s) / DAY_S;
        let with_drift = |drift_ng: f64| &but_drift + DMatrix::from_fn(n, n, |i, j| drift_ng * drift_ng * walk(i, j));
        let likeliest = DRIFTS_NG.iter().filter_map(|drift_ng| {
            let covariance = with_drift(*drift_ng);
            Some((likelihood(&covariance, &away)?, covariance))
        });
        let Some((_, covariance)) = likeliest.max_by(|a, b| a.0.total_cmp(&b.0)) else { return Self::default() };
        let scale = DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| sigma_ng[i].recip()));
        let eigen = (&scale * covariance * &scale).symmetric_eigen();
        let mut told = Self::default();
        for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
            let by = value.max(1.0).sqrt().recip();
            if by * by > TAKEN {
                told.rows.push((0..n).map(|i| by * vector[i] / sigma_ng[i]).collect());
            }
        }
        told.rest = told.filtered(away.as_slice());
        told
    }

    /// A bias at the flips behind the filter.
    pub fn filtered(&self, bias_ng: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|row| row.iter().zip(bias_ng).map(|(r, bias)| r * bias).sum()).collect()
    }

    /// The same flips had they been otherwise: nothing but errors, each number drawn.
    pub fn drawn(&self, mut normal: impl FnMut() -> f64) -> Self {
        Self { rows: self.rows.clone(), rest: self.rest.iter().map(|_| normal()).collect() }
    }
}

/// Those of one law of an axis, and behind them those of the next.
impl<'a> FromIterator<&'a Flips> for Flips {
    fn from_iter<I: IntoIterator<Item = &'a Flips>>(laws: I) -> Self {
        let mut all = Self::default();
        let mut before = 0;
        for law in laws {
            let own = law.rows.first().map_or(0, Vec::len);
            all.rows.iter_mut().for_each(|row| row.resize(before + own, 0.0));
            all.rows.extend(law.rows.iter().map(|row| [vec![0.0; before], row.clone()].concat()));
            all.rest.extend(&law.rest);
            before += own;
        }
        all
    }
}

/// Log likelihood of measurements about their law, with a step after any of them or none.
fn likelihood(covariance: &DMatrix<f64>, away: &DVector<f64>) -> Option<f64> {
    let n = away.len();
    let cholesky = covariance.clone().cholesky()?;
    let half = cholesky.l_dirty().solve_lower_triangular(away)?;
    let log_det: f64 = (0..n).map(|i| cholesky.l_dirty()[(i, i)].ln()).sum();
    let gain = |first: usize| {
        let step = DVector::from_fn(n, |i, _| if i >= first { STEP_NG } else { 0.0 });
        let step = cholesky.l_dirty().solve_lower_triangular(&step)?;
        let one_more = step.norm_squared() + 1.0;
        Some((0.5 * (step.dot(&half).powi(2) / one_more - one_more.ln())).exp())
    };
    let steps = (1..n).filter_map(gain).sum::<f64>() / (n.max(2) - 1) as f64;
    Some((1.0 + LOG_STEP.exp() * steps).ln() - 0.5 * half.norm_squared() - log_det)
}

/// By how much flips scatter beyond their errors, from one to the next: a step shows once in that.
fn scatter(flips: &[Flip]) -> f64 {
    let mut steps: Vec<f64> =
        flips.windows(2).map(|w| (w[1].rest_ng - w[0].rest_ng).abs() / w[1].sigma_ng.hypot(w[0].sigma_ng)).collect();
    match median(&mut steps) {
        Some(step) if flips.len() >= SCATTER_FROM => (step / 0.6745).max(1.0),
        _ => 1.0,
    }
}

/// By how much the error of a flip is larger than told because it stands alone: what is next to it, on either side, is elsewhere.
fn alone(flips: &[Flip], i: usize) -> f64 {
    let first = i.saturating_sub(1).min(flips.len().saturating_sub(3));
    let mut beside: Vec<f64> = flips[first..(first + 3).min(flips.len())].iter().map(|flip| flip.rest_ng).collect();
    let away = median(&mut beside).map_or(0.0, |middle| (flips[i].rest_ng - middle).abs() / flips[i].sigma_ng);
    (away / ALONE_SIGMA).max(1.0)
}
