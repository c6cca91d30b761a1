//! The bias law of one axis and range, fitted to its two-position measurements:
//! bias(t, T) = A1 + A2 exp(-t/t0) + A3 exp(-t/t1) + A4 T [Rice 1996], t in hours since lift-off.
//!
//! Six figures cannot be had from six hours. The fit is therefore regularised by what was seen before: every coefficient but
//! A1 is expected to be about as large as its published size at most, and the time constants to lie where the published ones
//! lie. What the measurements do not determine stays at that expectation *with its width in the covariance*, so that the band
//! widens where nothing is known instead of a law running wild. Which of the figures the measurements themselves carry is
//! told by [`BiasFit::carried`].
//!
//! The fit is Levenberg-Marquardt over A1..A4, ln t0, ln t1 from several starts, each start a linear solution at fixed time
//! constants. The measurement farthest from the law of all others is set aside, one at a time, while it is beyond [`OUTLIER_SIGMA`]; those
//! left that are far from it lose weight (Huber).

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Matrix6, SMatrix, VecStorage, Vector6};

use super::apply::BiasLaw;

/// Figures of the law.
pub const PARAMETERS: usize = 6;
/// Beyond so many standard errors from the law given by all others, a measurement is an outlier and is not used. A normal
/// error does that once in 5e8; the measurements' own tails are heavier by far less than would matter.
pub const OUTLIER_SIGMA: f64 = 6.0;
/// Weight starts to fall here, standard errors.
const HUBER_SIGMA: f64 = 3.0;
/// Chi squared by which one must be above all others to be the outlier: odds of twenty.
const CLEARLY: f64 = 6.0;
/// Measurements that are tried without, to find the outlier: as many as a day has, in which a large one bends the law most.
const SUSPECTS: usize = 8;
/// Of so many measurements one may be set aside.
const ASIDE_ONE_OF: usize = 3;
/// Reweighting passes.
const PASSES: usize = 6;
/// Hours over which a drift that the law does not describe is taken to forget itself.
const DRIFT_MEMORY_H: f64 = 12.0;

/// One measurement as the fit sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Hours since lift-off.
    pub met_h: f64,
    /// Sensor temperature, C.
    pub temperature_c: f64,
    /// Bias, counts.
    pub counts: f64,
    /// Its standard error, counts.
    pub sigma_counts: f64,
}

/// What is expected of the law before anything is measured: zero with these widths, and time constants around centres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expectation {
    /// Widths of A2, A3 (counts) and A4 (counts per C).
    pub widths: [f64; 3],
    /// Centres of t0 and t1, hours.
    pub t_h: [f64; 2],
    /// Widths of ln t0 and ln t1.
    pub ln_t_widths: [f64; 2],
}

impl Expectation {
    /// Sizes of A2, A3, A4 by axis and range A, B, C in counts. From the fitted constants of Rice 1996; where the print is not
    /// legible (A2 of X and Y in range C) the size is that of range B in ng. Only sizes: signs and values are not used.
    const SIZES: [[[f64; 3]; 3]; 3] = [
        [[4.82, 6.95, 0.27], [209.1, 100.4, 2.92], [2090.0, 904.0, 27.07]],
        [[98.26, 6.54, 0.75], [47.0, 8.0, 0.73], [617.0, 108.8, 4.0]],
        [[20.58, 8.55, 0.2], [30.08, 15.86, 0.4], [385.1, 183.3, 4.89]],
    ];

    /// The published sizes; time constants around the published ones' middle, as wide as they spread.
    pub fn published(axis: usize, range: usize) -> Self {
        Self { widths: Self::SIZES[axis][range], t_h: [7.0, 120.0], ln_t_widths: [0.7, 1.2] }
    }
}

/// A fitted law, its covariance, and how well it describes the measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct BiasFit {
    /// The law.
    pub law: BiasLaw,
    /// Covariance of A1, A2, A3, A4, ln t0, ln t1.
    pub covariance: [[f64; PARAMETERS]; PARAMETERS],
    /// By how much each of them is away from where it was expected before anything was measured, and the width of that: of A1 nothing
    /// was expected.
    pub departures: [(f64, f64); PARAMETERS],
    /// Variance of what the law does not describe, squared counts, and the clock span of support in hours since lift-off.
    pub drift_variance: f64,
    /// First and last measurement used, hours since lift-off.
    pub span_h: [f64; 2],
    /// Which figures the measurements determine better than the expectation did (their width at least halved).
    pub carried: [bool; PARAMETERS],
    /// Figures the measurements carry in all: the trace of the share of information that is theirs.
    pub figures_carried: f64,
    /// Weight of each measurement: 1 in full, 0 an outlier.
    pub weights: Vec<f64>,
    /// By how much each of the six figures moves where a measurement reads a count more: a row a measurement.
    pub answers: Vec<[f64; PARAMETERS]>,
    /// Measured less fitted, counts.
    pub residuals: Vec<f64>,
    /// The residual of each against the law given by all others, in standard errors.
    pub deleted_sigmas: Vec<f64>,
    /// Chi squared of the measurements used over their degrees of freedom; 1 when there are none to spare.
    pub chi2_reduced: f64,
    /// Root mean square residual of the measurements used, counts.
    pub residual_rms: f64,
    /// Share of the measurements' variance, each by its error, that the law describes.
    pub r_squared: Option<f64>,
    /// Measurements used less figures carried.
    pub degrees_of_freedom: f64,
}

impl BiasFit {
    /// Derivatives of the bias by the six figures.
    fn gradient(law: &BiasLaw, met_h: f64, temperature_c: f64) -> [f64; PARAMETERS] {
        let [x0, x1] = law.t_h.map(|t_h| met_h / t_h);
        let [e0, e1] = [x0, x1].map(|x| (-x).exp());
        [1.0, e0, e1, temperature_c, law.a[1] * e0 * x0, law.a[2] * e1 * x1]
    }

    /// Derivatives of the bias by the six figures at a time, hours since lift-off, and a temperature, C.
    pub fn gradient_at(&self, met_h: f64, temperature_c: f64) -> [f64; PARAMETERS] {
        Self::gradient(&self.law, met_h, temperature_c)
    }

    /// Bias and its standard error, counts; and whether the time is beyond the measurements.
    pub fn at(&self, met_h: f64, temperature_c: f64) -> (f64, f64, bool) {
        let g = Self::gradient(&self.law, met_h, temperature_c);
        let counts = self.law.a[0] + self.law.a[1] * g[1] + self.law.a[2] * g[2] + self.law.a[3] * temperature_c;
        let mut variance = 0.0;
        for (row, gi) in self.covariance.iter().zip(&g) {
            variance += gi * row.iter().zip(&g).map(|(c, gj)| c * gj).sum::<f64>();
        }
        let outside = met_h < self.span_h[0] || met_h > self.span_h[1];
        (counts, (variance.max(0.0) + self.drift_variance).sqrt(), outside)
    }

    /// What the covariance leaves open, as independent errors of unit size: the bias each makes at a time, hours since lift-off, and
    /// a temperature, C, in counts.
    pub fn open_errors(&self) -> impl Fn(f64, f64) -> [f64; PARAMETERS] + '_ {
        let covariance = Matrix6::from_fn(|i, j| self.covariance[i][j]);
        let eigen = covariance.symmetric_eigen();
        move |met_h, temperature_c| {
            let g = Vector6::from(Self::gradient(&self.law, met_h, temperature_c));
            std::array::from_fn(|j| eigen.eigenvalues[j].max(0.0).sqrt() * eigen.eigenvectors.column(j).dot(&g))
        }
    }

    /// The form that the measurements support, in words.
    pub fn form(&self) -> &'static str {
        let [_, a2, a3, a4, ..] = self.carried;
        match (a2, a3, a4) {
            (false, false, false) => "A1",
            (false, false, true) => "A1 + A4 T",
            (true, false, false) => "A1 + A2 exp(-t/t0)",
            (false, true, false) => "A1 + A3 exp(-t/t1)",
            (true, false, true) => "A1 + A2 exp(-t/t0) + A4 T",
            (false, true, true) => "A1 + A3 exp(-t/t1) + A4 T",
            (true, true, false) => "A1 + A2 exp(-t/t0) + A3 exp(-t/t1)",
            (true, true, true) => "A1 + A2 exp(-t/t0) + A3 exp(-t/t1) + A4 T",
        }
    }

    /// Why not more than that form.
    pub fn reason(&self) -> String {
        let names = ["A1", "A2", "A3", "A4", "t0", "t1"];
        let held: Vec<&str> = names.iter().zip(self.carried).filter(|(_, carried)| !carried).map(|(n, _)| *n).collect();
        let used = self.weights.iter().filter(|weight| **weight > 0.0).count();
        let span_h = self.span_h[1] - self.span_h[0];
        if held.is_empty() {
            return format!("{used} measurements over {span_h:.1} h determine all six figures");
        }
        format!(
            "{used} measurements over {span_h:.1} h carry {:.1} of six figures; {} stay at their expectation, their width is in \
             the covariance",
            self.figures_carried,
            held.join(", ")
        )
    }
}

/// Residuals of measurements and expectation, each over its standard error.
struct Problem<'a> {
    points: &'a [Point],
    weights: &'a [f64],
    expectation: &'a Expectation,
    centre: f64,
    theta: DVector<f64>,
}

/// Width of A1 around the first measurements, counts: wide enough never to matter.
const A1_WIDTH: f64 = 1e5;

fn law_of(theta: &DVector<f64>) -> BiasLaw {
    BiasLaw { a: [theta[0], theta[1], theta[2], theta[3]], t_h: [theta[4].exp(), theta[5].exp()] }
}

impl Problem<'_> {
    /// Standard error widened by the weight.
    fn sigma(&self, n: usize) -> f64 {
        self.points[n].sigma_counts / self.weights[n].sqrt()
    }

    fn expected(&self) -> [(f64, f64); PARAMETERS] {
        let e = self.expectation;
        [
            (self.centre, A1_WIDTH),
            (0.0, e.widths[0]),
            (0.0, e.widths[1]),
            (0.0, e.widths[2]),
            (e.t_h[0].ln(), e.ln_t_widths[0]),
            (e.t_h[1].ln(), e.ln_t_widths[1]),
        ]
    }

    /// The linear solution at given time constants, and its objective.
    fn linear(&self, ln_t: [f64; 2]) -> Option<(DVector<f64>, f64)> {
        let law = BiasLaw { a: [0.0; 4], t_h: ln_t.map(f64::exp) };
        let mut normal = SMatrix::<f64, 4, 4>::zeros();
        let mut right = SMatrix::<f64, 4, 1>::zeros();
        for (n, point) in self.points.iter().enumerate().filter(|(n, _)| self.weights[*n] > 0.0) {
            let g = BiasFit::gradient(&law, point.met_h, point.temperature_c);
            let row = SMatrix::<f64, 4, 1>::from_column_slice(&g[..4]) / self.sigma(n);
            normal += row * row.transpose();
            right += row * ((point.counts - self.centre) / self.sigma(n));
        }
        for (n, (_, width)) in self.expected().iter().take(4).enumerate() {
            normal[(n, n)] += width.powi(-2);
        }
        let solution = normal.cholesky()?.solve(&right);
        let theta = DVector::from_iterator(
            6,
            [solution[0] + self.centre, solution[1], solution[2], solution[3], ln_t[0], ln_t[1]],
        );
        let at = Problem { theta: theta.clone(), ..*self };
        Some((theta, at.residuals()?.norm_squared()))
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ResidualStorage = VecStorage<f64, Dyn, nalgebra::U1>;
    type JacobianStorage = VecStorage<f64, Dyn, Dyn>;
    type ParameterStorage = VecStorage<f64, Dyn, nalgebra::U1>;

    fn set_params(&mut self, theta: &DVector<f64>) {
        self.theta.copy_from(theta);
    }

    fn params(&self) -> DVector<f64> {
        self.theta.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let law = law_of(&self.theta);
        let points = self.points.iter().enumerate().map(|(n, point)| {
            if self.weights[n] == 0.0 {
                return 0.0;
            }
            (law.counts(point.met_h, point.temperature_c) - point.counts) / self.sigma(n)
        });
        let expected =
            self.expected().into_iter().zip(self.theta.iter()).map(|((centre, width), x)| (x - centre) / width);
        let all: Vec<f64> = points.chain(expected).collect();
        all.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(all))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let law = law_of(&self.theta);
        let mut jacobian = DMatrix::zeros(self.points.len() + PARAMETERS, PARAMETERS);
        for (n, point) in self.points.iter().enumerate().filter(|(n, _)| self.weights[*n] > 0.0) {
            let g = BiasFit::gradient(&law, point.met_h, point.temperature_c);
            for (column, value) in g.iter().enumerate() {
                jacobian[(n, column)] = value / self.sigma(n);
            }
        }
        for (n, (_, width)) in self.expected().iter().enumerate() {
            jacobian[(self.points.len() + n, n)] = 1.0 / width;
        }
        Some(jacobian)
    }
}

/// Time constants, hours, from which the search starts.
const STARTS_H: [[f64; 3]; 2] = [[2.5, 6.5, 12.0], [30.0, 120.0, 400.0]];

/// The least objective over all starts at the given weights.
fn minimise(
    points: &[Point],
    weights: &[f64],
    expectation: &Expectation,
    centre: f64,
    warm: Option<&DVector<f64>>,
) -> Option<DVector<f64>> {
    let problem = Problem { points, weights, expectation, centre, theta: DVector::zeros(PARAMETERS) };
    let mut starts: Vec<(DVector<f64>, f64)> = Vec::new();
    if let Some(theta) = warm {
        starts.push((theta.clone(), 0.0));
    } else {
        for t0 in STARTS_H[0] {
            starts.extend(STARTS_H[1].iter().filter_map(|t1| problem.linear([t0.ln(), t1.ln()])));
        }
        starts.sort_by(|a, b| a.1.total_cmp(&b.1));
        starts.truncate(3);
    }
    let solver = LevenbergMarquardt::new().with_patience(30).with_tol(1e-10);
    starts
        .into_iter()
        .map(|(theta, _)| solver.minimize(Problem { theta, ..problem }))
        .filter(|(_, report)| report.objective_function.is_finite())
        .min_by(|a, b| a.1.objective_function.total_cmp(&b.1.objective_function))
        .map(|(problem, _)| problem.theta)
}

/// Information of the measurements alone, and the covariance with the expectation.
fn information(points: &[Point], weights: &[f64], law: &BiasLaw) -> Matrix6<f64> {
    let mut information = Matrix6::zeros();
    for (point, weight) in points.iter().zip(weights) {
        let g = Vector6::from(BiasFit::gradient(law, point.met_h, point.temperature_c)) / point.sigma_counts;
        information += g * g.transpose() * *weight;
    }
    information
}

/// Fits the law; None without a measurement.
pub fn fit(points: &[Point], expectation: &Expectation) -> Option<BiasFit> {
    let mut values: Vec<f64> = points.iter().map(|point| point.counts).collect();
    let centre = crate::math::robust::median(&mut values)?;
    let fitted = |weights: &[f64], warm: Option<&DVector<f64>>| {
        let theta = minimise(points, weights, expectation, centre, warm)?;
        Some((judge(points, weights, expectation, &theta)?, theta))
    };
    let mut weights = vec![1.0; points.len()];
    let (mut judged, mut theta) = fitted(&weights, None)?;
    // One at a time: a large error bends the law until good measurements are as far from it.
    for _ in 0..points.len() / ASIDE_ONE_OF {
        let left = |n: usize| {
            let mut without = weights.clone();
            without[n] = 0.0;
            let theta = minimise(points, &without, expectation, centre, None)?;
            let problem = Problem { points, weights: &without, expectation, centre, theta };
            Some((problem.residuals()?.norm_squared(), n))
        };
        let mut without: Vec<(f64, usize)> = suspects(&judged.deleted_sigmas, &weights).filter_map(left).collect();
        without.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some((least, worst)) = without.first().copied() else { break };
        let with = Problem { points, weights: &weights, expectation, centre, theta: theta.clone() };
        let gained = with.residuals()?.norm_squared() - least;
        // Where setting aside another does as well, neither is the one: the scatter widens the errors then.
        let is_the_one = without.get(1).is_none_or(|next| next.0 - least > CLEARLY);
        if gained < OUTLIER_SIGMA * OUTLIER_SIGMA || !is_the_one {
            break;
        }
        weights[worst] = 0.0;
        (judged, theta) = fitted(&weights, None)?;
    }
    for _ in 0..PASSES {
        let next: Vec<f64> = judged.deleted_sigmas.iter().zip(&weights).map(|(z, held)| weight_of(*z, *held)).collect();
        let settled = next.iter().zip(&weights).all(|(a, b)| (a - b).abs() < 0.01);
        if settled {
            break;
        }
        let restart = next.iter().zip(&weights).any(|(a, b)| (*a == 0.0) != (*b == 0.0));
        weights = next;
        (judged, theta) = fitted(&weights, (!restart).then_some(&theta))?;
    }
    Some(judged)
}

/// The measurements with a vote that are farthest from the law of all others, where any is beyond the outlier's bound.
fn suspects(deleted_sigmas: &[f64], weights: &[f64]) -> impl Iterator<Item = usize> {
    let voting = (0..deleted_sigmas.len()).filter(|n| weights[*n] > 0.0);
    let mut by_size: Vec<(f64, usize)> = voting.map(|n| (deleted_sigmas[n].abs(), n)).collect();
    by_size.sort_by(|a, b| b.0.total_cmp(&a.0));
    let any = by_size.first().is_some_and(|(largest, _)| *largest > OUTLIER_SIGMA);
    by_size.truncate(if any { SUSPECTS } else { 0 });
    by_size.into_iter().map(|(_, n)| n)
}

/// Huber's weight; a measurement set aside before has none beyond the outlier's bound.
fn weight_of(deleted_sigma: f64, held: f64) -> f64 {
    match deleted_sigma.abs() {
        z if z > OUTLIER_SIGMA && held == 0.0 => 0.0,
        z if z > HUBER_SIGMA => HUBER_SIGMA / z,
        _ => 1.0,
    }
}

/// Everything that follows from a solution.
fn judge(points: &[Point], weights: &[f64], expectation: &Expectation, theta: &DVector<f64>) -> Option<BiasFit> {
    let law = law_of(theta);
    let problem = Problem { points, weights, expectation, centre: 0.0, theta: theta.clone() };
    let theirs = information(points, weights, &law);
    let widths = problem.expected().map(|(_, width)| width);
    let expected = Matrix6::from_diagonal(&Vector6::from(widths.map(|width| width.powi(-2))));
    let covariance = (theirs + expected).try_inverse()?;
    let figures_carried = (covariance * theirs).trace();
    let carried = std::array::from_fn(|n| covariance[(n, n)].sqrt() < 0.5 * widths[n]);
    let residuals: Vec<f64> = points.iter().map(|p| p.counts - law.counts(p.met_h, p.temperature_c)).collect();
    let deleted_sigmas = points
        .iter()
        .zip(&residuals)
        .zip(weights)
        .map(|((point, residual), weight)| {
            let g = Vector6::from(BiasFit::gradient(&law, point.met_h, point.temperature_c));
            let variance = point.sigma_counts.powi(2);
            let of_law = (g.transpose() * covariance * g)[0];
            // Without its own vote: residual / (1 - h), variance s^2 / (1 - h).
            let leverage = (weight * of_law / variance).min(0.999);
            if *weight > 0.0 {
                residual / (variance * (1.0 - leverage)).sqrt()
            } else {
                residual / (variance + of_law).sqrt()
            }
        })
        .collect();
    let answer = |(point, weight): (&Point, &f64)| -> [f64; PARAMETERS] {
        let g = Vector6::from(BiasFit::gradient(&law, point.met_h, point.temperature_c));
        (covariance * g * (weight / point.sigma_counts.powi(2))).into()
    };
    let mut departures = problem.expected();
    departures.iter_mut().zip(theta.iter()).for_each(|(expected, figure)| expected.0 = figure - expected.0);
    departures[0].0 = 0.0;
    let mut fit = BiasFit {
        answers: points.iter().zip(weights).map(answer).collect(),
        departures,
        law,
        covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
        drift_variance: 0.0,
        span_h: span(points, weights)?,
        carried,
        figures_carried,
        weights: weights.to_vec(),
        residuals,
        deleted_sigmas,
        chi2_reduced: 1.0,
        residual_rms: 0.0,
        r_squared: None,
        degrees_of_freedom: 0.0,
    };
    fit.describe(points);
    Some(fit)
}

fn span(points: &[Point], weights: &[f64]) -> Option<[f64; 2]> {
    let used = || points.iter().zip(weights).filter(|(_, weight)| **weight > 0.0).map(|(point, _)| point.met_h);
    Some([used().min_by(f64::total_cmp)?, used().max_by(f64::total_cmp)?])
}

impl BiasFit {
    /// Goodness of fit, and what the misfit adds to the errors.
    fn describe(&mut self, points: &[Point]) {
        let used: Vec<usize> = (0..points.len()).filter(|n| self.weights[*n] > 0.0).collect();
        let count = used.len() as f64;
        let square = |n: &usize| self.residuals[*n].powi(2);
        self.residual_rms = (used.iter().map(square).sum::<f64>() / count).sqrt();
        // Weighted, so that a measurement worth nothing does not decide.
        let weight = |n: &usize| points[*n].sigma_counts.powi(-2);
        let all: f64 = used.iter().map(weight).sum();
        let mean = used.iter().map(|n| weight(n) * points[*n].counts).sum::<f64>() / all;
        let total: f64 = used.iter().map(|n| weight(n) * (points[*n].counts - mean).powi(2)).sum();
        let left: f64 = used.iter().map(|n| weight(n) * square(n)).sum();
        self.r_squared = (count > 2.0 && total > 0.0).then(|| 1.0 - left / total);
        self.degrees_of_freedom = count - self.figures_carried;
        if self.degrees_of_freedom >= 1.0 {
            let chi2: f64 = used.iter().map(|n| square(n) / points[*n].sigma_counts.powi(2)).sum();
            self.chi2_reduced = chi2 / self.degrees_of_freedom;
        }
        // More scatter than the errors explain, beyond what chance gives (3 sigma of chi squared): the errors are wrong as a
        // whole, or the law is. The first widens the covariance, the second shows in neighbours and is a drift of its own.
        let chance = 1.0 + 3.0 * (2.0 / self.degrees_of_freedom.max(1.0)).sqrt();
        if self.chi2_reduced > chance {
            for value in self.covariance.as_flattened_mut() {
                *value *= self.chi2_reduced;
            }
            self.drift_variance = self.drift(points, &used);
        }
    }

    /// Covariance of residuals of neighbours closer than [`DRIFT_MEMORY_H`], when it is significant.
    fn drift(&self, points: &[Point], used: &[usize]) -> f64 {
        let pairs: Vec<f64> = used
            .windows(2)
            .filter(|pair| points[pair[1]].met_h - points[pair[0]].met_h < DRIFT_MEMORY_H)
            .map(|pair| self.residuals[pair[0]] * self.residuals[pair[1]])
            .collect();
        if pairs.len() < 8 {
            return 0.0;
        }
        let count = pairs.len() as f64;
        let mean = pairs.iter().sum::<f64>() / count;
        let sd = (pairs.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / count).sqrt();
        if mean > 3.0 * sd / count.sqrt() { mean } else { 0.0 }
    }
}

#[cfg(test)]
mod tests;
