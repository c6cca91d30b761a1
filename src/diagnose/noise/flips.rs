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

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const SIGMA_NG: f64 = 15.0;
    /// No figure is away from where it was expected; all of them may be far, but for the two time constants.
    const WIDTHS_NG: [f64; PARAMETERS] = [1e5, 100.0, 100.0, 10.0, 0.7, 1.2];

    /// Sixteen flips in three days, less a law fitted to them as widely as these widths allow.
    fn flips(
        away_ng: impl Fn(usize) -> f64,
        normal: &mut impl FnMut() -> f64,
    ) -> (Vec<Flip>, [(f64, f64); PARAMETERS]) {
        const FLIPS: usize = 16;
        let gradient = |i: usize| {
            let met_h = 10.0 + 4.5 * i as f64;
            let [early, late] = [(-met_h / 12.0).exp(), (-met_h / 120.0).exp()];
            [1.0, early, late, (met_h / 4.0).sin(), 60.0 * early * met_h / 12.0, 60.0 * late * met_h / 120.0]
        };
        let law = DMatrix::from_fn(FLIPS, PARAMETERS, |i, j| gradient(i)[j] * WIDTHS_NG[j]);
        let figures = DVector::from_fn(PARAMETERS, |j, _| if j == 0 { 1e-3 } else { 1.0 } * normal());
        let measured = DVector::from_fn(FLIPS, |i, _| SIGMA_NG * normal() + away_ng(i)) + &law * &figures;
        let inverse =
            (law.tr_mul(&law) / SIGMA_NG.powi(2) + DMatrix::identity(PARAMETERS, PARAMETERS)).try_inverse().unwrap();
        let fitted = inverse * law.tr_mul(&measured) / SIGMA_NG.powi(2);
        let rest = &measured - &law * &fitted;
        let flip = |i: usize| Flip {
            clock_s: 16_200.0 * i as f64,
            rest_ng: rest[i],
            sigma_ng: SIGMA_NG,
            gradient_ng: gradient(i),
        };
        let mut departures = std::array::from_fn(|j| (fitted[j] * WIDTHS_NG[j], WIDTHS_NG[j]));
        departures[0].0 = 0.0;
        ((0..FLIPS).map(flip).collect(), departures)
    }

    /// The size of a step after the tenth flip that the flips say, and its standard error.
    fn step(flips: &Flips) -> (f64, f64) {
        let seen = flips.filtered(&std::array::from_fn::<f64, 16, _>(|i| if i < 10 { 0.0 } else { 1.0 }));
        let information: f64 = seen.iter().map(|x| x * x).sum();
        let product: f64 = seen.iter().zip(&flips.rest).map(|(a, b)| a * b).sum();
        (product / information, information.sqrt().recip())
    }

    /// Of steps of 100 ng, and of none, with a random walk beside them and without.
    #[test]
    fn what_flips_say_of_a_step_holds_within_its_error() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        for (walk_ng, size_ng) in [(0.0, 0.0), (0.0, 100.0), (8.0, 0.0), (8.0, 100.0)] {
            let (mut within, mut squares, mut numbers) = (0, 0.0, 0);
            let mut sigma = 0.0;
            for _ in 0..400 {
                let mut walk = [0.0; 16];
                (1..16).for_each(|i| walk[i] = walk[i - 1] + walk_ng * normal());
                let away = |i: usize| walk[i] + if i < 10 { 0.0 } else { size_ng };
                let (flips, departures) = flips(away, &mut normal);
                let flips = Flips::new(&flips, &departures);
                let (found_ng, sigma_ng) = step(&flips);
                within += usize::from((found_ng - size_ng).abs() < 2.0 * sigma_ng);
                squares += flips.rest.iter().map(|x| x * x).sum::<f64>();
                numbers += flips.rest.len();
                sigma += sigma_ng / 400.0;
            }
            println!("walk {walk_ng}, step {size_ng}: {within} of 400 within two errors of {sigma:.0} ng");
            assert!(within >= 370, "walk {walk_ng}, step {size_ng}: {within}");
            if size_ng == 0.0 {
                let mean = squares / f64::from(numbers as u32);
                assert!((0.6..1.15).contains(&mean), "numbers of mean square {mean}");
            }
        }
    }

    #[test]
    fn one_flip_that_is_off_says_little() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(9);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        for off in [0, 7, 15] {
            let away = |i: usize| if i == off { 40.0 * SIGMA_NG } else { 0.0 };
            let (flips, departures) = flips(away, &mut normal);
            let flips = Flips::new(&flips, &departures);
            let energy: f64 = flips.rest.iter().map(|x| x * x).sum();
            assert!(energy < 60.0, "off at {off}: {energy}");
        }
    }

    #[test]
    fn laws_of_an_axis_stand_side_by_side() {
        let one = Flips { rows: vec![vec![1.0, 2.0]], rest: vec![0.5] };
        let other = Flips { rows: vec![vec![3.0], vec![4.0]], rest: vec![0.1, 0.2] };
        let both: Flips = [&one, &other].into_iter().collect();
        assert_eq!(both.filtered(&[10.0, 1.0, 100.0]), [12.0, 300.0, 400.0]);
        assert_eq!(both.rest, [0.5, 0.1, 0.2]);
    }
}
