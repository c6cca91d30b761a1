//! Whitened columns and the evidence of a set of them.
//!
//! Given the noise everything is linear: d = X b + c + n, with b ~ N(m, prior), a constant c per axis without prior, and
//! n whitened. The log evidence ratio of X against nothing is then
//! 1/2 (y + m)' (A + I)^-1 (y + m) - 1/2 m'm - 1/2 log det (A + I), A = X'X and y = X'd, the columns scaled by their prior
//! size (Kennedy and O'Hagan 2001 for why sizes need priors). Not here: what the columns mean.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::noise::{AxisNoise, Loudness, Schedule, Whitener, dot};
use super::scene::Axes;
use crate::math::shared_work;

/// A regressor before whitening: a series for every axis it acts on.
pub type Raw = [Option<Vec<f64>>; 3];

/// One axis of a whitened regressor: `factor` times what is shared with the same regressor of other sizes.
#[derive(Debug, Clone)]
struct Part {
    first: usize,
    whitened: Arc<Vec<f64>>,
    /// Its products with what is nuisance on this axis.
    nuisance: Vec<f64>,
    factor: f64,
}

/// A whitened regressor, the constant of every axis projected out of every product.
#[derive(Debug, Clone, Default)]
pub struct Column {
    parts: [Option<Part>; 3],
    /// Mean of the prior of its coefficient, in prior sizes.
    mean: f64,
}

impl Column {
    /// Inner product after projection.
    pub fn dot(&self, other: &Column) -> f64 {
        let mut sum = 0.0;
        for (a, b) in self.parts.iter().zip(&other.parts) {
            let (Some(a), Some(b)) = (a, b) else { continue };
            let first = a.first.max(b.first);
            let end = (a.first + a.whitened.len()).min(b.first + b.whitened.len());
            let product = if first < end {
                dot(&a.whitened[first - a.first..end - a.first], &b.whitened[first - b.first..end - b.first])
            } else {
                0.0
            };
            let nuisance: f64 = a.nuisance.iter().zip(&b.nuisance).map(|(a, b)| a * b).sum();
            sum += a.factor * b.factor * (product - nuisance);
        }
        sum
    }

    /// This column times `factor`.
    pub fn times(&self, factor: f64) -> Column {
        let mut out = self.clone();
        out.parts.iter_mut().flatten().for_each(|part| part.factor *= factor);
        out.mean /= factor;
        out
    }

    /// The same about another prior mean, in prior sizes.
    pub fn about(self, mean: f64) -> Column {
        Column { mean, ..self }
    }

    /// This column less another times `factor`.
    pub fn less(&self, other: &Column, factor: f64) -> Column {
        let mut out = self.clone();
        for (a, b) in out.parts.iter_mut().zip(&other.parts) {
            let Some(b) = b else { continue };
            let (first, end) = match a {
                Some(a) => (a.first.min(b.first), (a.first + a.whitened.len()).max(b.first + b.whitened.len())),
                None => (b.first, b.first + b.whitened.len()),
            };
            let mut whitened = vec![0.0; end - first];
            let mut nuisance = vec![0.0; b.nuisance.len()];
            let mut add = |part: &Part, factor: f64| {
                whitened[part.first - first..].iter_mut().zip(&*part.whitened).for_each(|(x, y)| *x += factor * y);
                nuisance.iter_mut().zip(&part.nuisance).for_each(|(x, y)| *x += factor * y);
            };
            if let Some(a) = &*a {
                add(a, a.factor);
            }
            add(b, -factor * b.factor);
            *a = Some(Part { first, whitened: Arc::new(whitened), nuisance, factor: 1.0 });
        }
        out
    }

    /// Whitened values of one axis with the share of what is nuisance removed; zero where the column is absent.
    pub fn projected(&self, axis: usize, frame: &Frame) -> Vec<f64> {
        let Some(p) = &self.parts[axis] else { return vec![0.0; frame.windows()] };
        let mut values = vec![0.0; frame.windows()];
        values[p.first..p.first + p.whitened.len()].copy_from_slice(&p.whitened);
        for (series, product) in frame.nuisance[axis].iter().zip(&p.nuisance) {
            values.iter_mut().zip(series).for_each(|(x, u)| *x -= product * u);
        }
        values.iter_mut().for_each(|x| *x *= p.factor);
        values
    }
}

/// A series on one axis and its prior size.
#[derive(Debug, Clone, Copy)]
pub struct OnAxis<'a> {
    /// The body axis.
    pub axis: usize,
    /// The series at the windows.
    pub series: &'a [f64],
    /// Its prior size.
    pub size: f64,
}

/// Series of an axis that are whitened side by side.
const LANES: usize = 4;

impl Column {
    fn of(parts: impl IntoIterator<Item = (usize, Part)>) -> Self {
        let mut column = Self::default();
        for (axis, part) in parts {
            column.parts[axis] = Some(part);
        }
        column
    }
}

/// First window in which a series is not zero, and one past the last.
fn span(series: &[f64]) -> [usize; 2] {
    let first = series.iter().position(|x| *x != 0.0).unwrap_or(series.len());
    [first, series.iter().rposition(|x| *x != 0.0).map_or(first, |i| i + 1)]
}

/// The noise of all axes turned into filters, and the data behind them.
#[derive(Clone)]
pub struct Frame {
    whiteners: Arc<[Whitener; 3]>,
    /// What is nuisance on each axis, whitened: the constant, of unit norm, and the errors all windows share, orthogonal to it and to
    /// each other, each as far as the data and not its prior decide it.
    nuisance: Arc<[Vec<Vec<f64>>; 3]>,
    /// Log restricted likelihood but for the data's share.
    log_det: f64,
    /// The whitened residual.
    pub data: Column,
    /// Log restricted likelihood of no effect at all.
    pub log_null: f64,
}

impl Frame {
    /// From the noise of the three axes and the residual.
    pub fn new(noise: &[AxisNoise; 3], schedule: &Schedule, loudness: &[Loudness; 3], residual_ng: &Axes) -> Self {
        let whiteners: [Whitener; 3] = std::array::from_fn(|k| Whitener::new(&noise[k], schedule, &loudness[k]));
        let mut log_det = 0.0;
        let nuisance = std::array::from_fn(|k| {
            let mut one = whiteners[k].whiten(&vec![1.0; schedule.len()]);
            let norm = dot(&one, &one).sqrt();
            one.iter_mut().for_each(|x| *x /= norm);
            log_det -= 0.5 * whiteners[k].log_det() + norm.ln();
            let (shared, decided) = shared_errors(&whiteners[k], &one, &schedule.shared_ng[k]);
            log_det -= decided;
            std::iter::once(one).chain(shared).collect()
        });
        let (whiteners, nuisance) = (Arc::new(whiteners), Arc::new(nuisance));
        Self { whiteners, nuisance, log_det, data: Column::default(), log_null: log_det }.with_data(residual_ng)
    }

    /// A residual less the likeliest of the errors that all windows share.
    pub fn less_shared_errors(&self, residual_ng: &Axes, shared_ng: &[Vec<Vec<f64>>; 3]) -> Axes {
        std::array::from_fn(|k| {
            let mut left = residual_ng[k].clone();
            let beside = |series: &Vec<f64>| beside_one(&self.whiteners[k], &self.nuisance[k][0], series);
            let (data, columns) = (beside(&left), shared_ng[k].iter().map(beside).collect::<Vec<_>>());
            let m = columns.len();
            let normal = DMatrix::from_fn(m, m, |i, j| dot(&columns[i], &columns[j])) + DMatrix::identity(m, m);
            let right = DVector::from_fn(m, |i, _| dot(&columns[i], &data));
            let Some(normal) = Cholesky::new(normal).filter(|_| m > 0) else { return left };
            for (size, series) in normal.solve(&right).iter().zip(&shared_ng[k]) {
                left.iter_mut().zip(series).for_each(|(x, error)| *x -= size * error);
            }
            left
        })
    }

    fn windows(&self) -> usize {
        self.nuisance[0][0].len()
    }

    /// The same filters, another residual.
    pub fn with_data(&self, residual_ng: &Axes) -> Self {
        let data = self.column(&std::array::from_fn(|k| Some(residual_ng[k].clone())), 1.0);
        let log_null = self.log_det - 0.5 * data.dot(&data);
        Self { data, log_null, ..self.clone() }
    }

    /// Whiten a regressor, scaled by its prior size.
    pub fn column(&self, raw: &Raw, size: f64) -> Column {
        if let [Some(x), Some(y), Some(z)] = raw
            && [x, y, z].into_iter().all(|series| span(series) == [0, series.len()])
        {
            let whitened = Whitener::whiten_three(&self.whiteners, [x, y, z]);
            return Column::of(whitened.into_iter().enumerate().map(|(k, w)| (k, self.part(k, 0, w, size))));
        }
        let on_axes = raw.iter().enumerate().filter_map(|(axis, series)| Some((axis, series.as_ref()?)));
        Column::of(on_axes.map(|(axis, series)| {
            let span = span(series);
            let [whitened] = self.whiteners[axis].whiten_spans([series], [span]);
            (axis, self.part(axis, span[0], whitened, size))
        }))
    }

    /// Whiten many regressors, each by its series on the axes it acts on: those of an axis side by side.
    pub fn columns(&self, many: &[Vec<OnAxis>]) -> Vec<Column> {
        let spans: Vec<Vec<[usize; 2]>> =
            shared_work::map(many, |parts| parts.iter().map(|part| span(part.series)).collect());
        let flat: Vec<(usize, OnAxis, [usize; 2])> = many
            .iter()
            .zip(spans)
            .enumerate()
            .flat_map(|(owner, (parts, spans))| parts.iter().zip(spans).map(move |(part, span)| (owner, *part, span)))
            .collect();
        let mut order: Vec<usize> = (0..flat.len()).collect();
        order.sort_by_key(|i| (flat[*i].1.axis, flat[*i].2));
        let groups: Vec<&[usize]> =
            order.chunk_by(|a, b| flat[*a].1.axis == flat[*b].1.axis).flat_map(|axis| axis.chunks(LANES)).collect();
        let parts = shared_work::map(&groups, |group| {
            // A group that is not full whitens its first series again in the lanes left over.
            let lanes: [usize; LANES] = std::array::from_fn(|l| group[if l < group.len() { l } else { 0 }]);
            let axis = flat[group[0]].1.axis;
            let whitened = self.whiteners[axis].whiten_spans(lanes.map(|i| flat[i].1.series), lanes.map(|i| flat[i].2));
            let whitened = lanes.into_iter().zip(whitened).take(group.len());
            whitened.map(|(i, w)| self.part(axis, flat[i].2[0], w, flat[i].1.size)).collect::<Vec<Part>>()
        });
        let mut columns = vec![Column::default(); many.len()];
        for (i, part) in order.iter().zip(parts.into_iter().flatten()) {
            let (owner, OnAxis { axis, .. }, _) = flat[*i];
            columns[owner].parts[axis] = Some(part);
        }
        columns
    }

    fn part(&self, axis: usize, first: usize, whitened: Vec<f64>, size: f64) -> Part {
        let products = self.nuisance[axis].iter();
        let nuisance = products.map(|u| dot(&whitened, &u[first..first + whitened.len()])).collect();
        Part { first, whitened: Arc::new(whitened), nuisance, factor: size }
    }

    /// Whiten a scalar on one axis.
    pub fn scalar(&self, axis: usize, series: &[f64], size: f64) -> Column {
        self.columns(&[vec![OnAxis { axis, series, size }]]).swap_remove(0)
    }
}

/// A series whitened, and made orthogonal to the whitened constant, which is of unit norm.
fn beside_one(whitener: &Whitener, one: &[f64], series: &[f64]) -> Vec<f64> {
    let mut whitened = whitener.whiten(series);
    let constant = dot(&whitened, one);
    whitened.iter_mut().zip(one).for_each(|(x, one)| *x -= constant * one);
    whitened
}

/// Whitened errors that all windows share, made orthogonal to the constant and to each other, each by the root of the share of it
/// that the data decide; and what they take from the log likelihood.
fn shared_errors(whitener: &Whitener, one: &[f64], shared_ng: &[Vec<f64>]) -> (Vec<Vec<f64>>, f64) {
    let whitened: Vec<Vec<f64>> = shared_ng.iter().map(|series| beside_one(whitener, one, series)).collect();
    let m = whitened.len();
    if m == 0 {
        return (Vec::new(), 0.0);
    }
    let eigen = DMatrix::from_fn(m, m, |i, j| dot(&whitened[i], &whitened[j])).symmetric_eigen();
    let mut decided = 0.0;
    let mut series = Vec::new();
    for (j, energy) in eigen.eigenvalues.iter().enumerate().filter(|(_, energy)| **energy > 1e-6) {
        decided += 0.5 * (1.0 + energy).ln();
        let scale = (1.0 + energy).sqrt().recip();
        let mut sum = vec![0.0; one.len()];
        for (i, w) in whitened.iter().enumerate() {
            let factor = scale * eigen.eigenvectors[(i, j)];
            sum.iter_mut().zip(w).for_each(|(sum, w)| *sum += factor * w);
        }
        series.push(sum);
    }
    (series, decided)
}

/// Normal equations of columns beside those chosen.
pub struct Normal {
    a: DMatrix<f64>,
    y: DVector<f64>,
    /// Prior means, in prior sizes.
    mean: DVector<f64>,
}

/// Inverse square of how much wider a prior is taken where it must not decide: six times.
const WIDE: f64 = 0.03;

impl Normal {
    /// Log evidence gained by these columns, their prior sizes all multiplied by `scale`.
    pub fn gain(&self, scale: f64) -> f64 {
        let n = self.y.len();
        let a = &self.a * (scale * scale) + DMatrix::identity(n, n);
        match Cholesky::new(a) {
            Some(c) => {
                let mean = &self.mean / scale;
                let y = &self.y * scale + &mean;
                let half = c.l_dirty().solve_lower_triangular(&y).unwrap_or_else(|| DVector::zeros(n));
                let volume = (0..n).map(|i| c.l_dirty()[(i, i)].ln()).sum::<f64>();
                0.5 * (half.norm_squared() - mean.norm_squared()) - volume
            }
            None => f64::NEG_INFINITY,
        }
    }

    /// The normal equations of the same columns over this part of a record and another.
    pub fn and(&self, other: &Normal) -> Normal {
        Normal { a: &self.a + &other.a, y: &self.y + &other.y, mean: self.mean.clone() }
    }

    /// What the columns explain at most, their sizes free: half the chi square.
    pub fn explained(&self) -> f64 {
        self.free_fit().map_or(0.0, |(explained, _)| explained)
    }

    /// The same, with the sizes in units of their priors; `None` where rounding defeats it.
    pub fn free_fit(&self) -> Option<(f64, DVector<f64>)> {
        let n = self.y.len();
        let jitter = 1e-9 * self.a.diagonal().max().max(1e-300);
        let sizes = Cholesky::new(&self.a + DMatrix::identity(n, n) * jitter)?.solve(&self.y);
        Some((0.5 * sizes.dot(&self.y), sizes))
    }

    /// Posterior mean of the sizes in units of their priors.
    pub fn posterior_mean(&self) -> DVector<f64> {
        let n = self.y.len();
        Cholesky::new(&self.a + DMatrix::identity(n, n))
            .map_or_else(|| DVector::zeros(n), |c| c.solve(&(&self.y + &self.mean)))
    }

    /// Whitened energy that a prediction from this part of a record is expected to miss of the series fitted to all of it, in the
    /// part `unseen`: the posterior means of nested data differ by the fall of the posterior covariance. The priors are taken far
    /// wider than they are, so that an effect several times its usual size is not thought to be known before it is seen.
    pub fn expected_miss(&self, unseen: &Normal) -> f64 {
        let n = self.y.len();
        if n == 0 {
            return 0.0;
        }
        let covariance = |a: &DMatrix<f64>| Cholesky::new(a + DMatrix::identity(n, n) * WIDE).map(|c| c.inverse());
        match (covariance(&self.a), covariance(&(&self.a + &unseen.a))) {
            (Some(seen), Some(all)) => (&unseen.a * (seen - all)).trace(),
            _ => f64::INFINITY,
        }
    }

    /// Log evidence gained by column `i` alone.
    pub fn gain_of(&self, i: usize, scale: f64) -> f64 {
        let one_more = scale * scale * self.a[(i, i)] + 1.0;
        let mean = self.mean[i] / scale;
        0.5 * ((scale * self.y[i] + mean).powi(2) / one_more - mean * mean - one_more.ln())
    }
}

/// Columns already chosen: what is left for one more.
pub struct Chosen<'a> {
    columns: Vec<&'a Column>,
    data: Column,
    cholesky: Option<Cholesky<f64, Dyn>>,
    reduced: DVector<f64>,
    /// Log evidence of the chosen columns against none.
    pub log_evidence: f64,
}

impl<'a> Chosen<'a> {
    /// Choose linear columns and columns of fixed amplitude one.
    pub fn new(frame: &Frame, columns: Vec<&'a Column>, fixed: &[&Column]) -> Self {
        let means = columns.iter().map(|c| c.mean).collect();
        Self::about(frame, columns, means, fixed)
    }

    /// Choose linear columns, all prior means zero.
    pub fn about_nothing(frame: &Frame, columns: Vec<&'a Column>) -> Self {
        let means = vec![0.0; columns.len()];
        Self::about(frame, columns, means, &[])
    }

    fn about(frame: &Frame, columns: Vec<&'a Column>, means: Vec<f64>, fixed: &[&Column]) -> Self {
        let mut data = frame.data.clone();
        for column in fixed {
            data = data.less(column, 1.0);
        }
        let mut log_evidence =
            if fixed.is_empty() { 0.0 } else { 0.5 * (frame.data.dot(&frame.data) - data.dot(&data)) };
        let n = columns.len();
        if n == 0 {
            return Self { columns, data, cholesky: None, reduced: DVector::zeros(0), log_evidence };
        }
        let mut a = DMatrix::identity(n, n);
        for i in 0..n {
            for j in 0..=i {
                let product = columns[i].dot(columns[j]);
                a[(i, j)] += product;
                if i != j {
                    a[(j, i)] += product;
                }
            }
        }
        let y = DVector::from_iterator(n, columns.iter().zip(&means).map(|(c, mean)| c.dot(&data) + mean));
        // A + I is positive definite but for rounding: a jitter of its size keeps a column of zeros harmless.
        let cholesky = Cholesky::new(a.clone()).or_else(|| {
            let jitter = 1e-10 * a.diagonal().max();
            Cholesky::new(a + DMatrix::identity(n, n) * jitter)
        });
        let Some(cholesky) = cholesky else {
            return Self { columns, data, cholesky: None, reduced: DVector::zeros(0), log_evidence: f64::NEG_INFINITY };
        };
        let reduced = cholesky.l_dirty().solve_lower_triangular(&y).unwrap_or_else(|| DVector::zeros(n));
        let means: f64 = means.iter().map(|mean| mean * mean).sum();
        let volume = (0..n).map(|i| cholesky.l_dirty()[(i, i)].ln()).sum::<f64>();
        log_evidence += 0.5 * (reduced.norm_squared() - means) - volume;
        Self { columns, data, cholesky: Some(cholesky), reduced, log_evidence }
    }

    fn overlap(&self, column: &Column) -> DVector<f64> {
        let products = DVector::from_iterator(self.columns.len(), self.columns.iter().map(|c| c.dot(column)));
        match &self.cholesky {
            Some(c) => c.l_dirty().solve_lower_triangular(&products).unwrap_or(products),
            None => products,
        }
    }

    /// Log evidence gained by adding linear columns.
    pub fn gain(&self, columns: &[Column]) -> f64 {
        self.normal(columns).gain(1.0)
    }

    /// The normal equations of more linear columns beside those chosen.
    pub fn normal(&self, columns: &[Column]) -> Normal {
        let n = columns.len();
        let overlaps: Vec<DVector<f64>> = columns.iter().map(|c| self.overlap(c)).collect();
        let y = DVector::from_iterator(
            n,
            columns.iter().zip(&overlaps).map(|(c, o)| c.dot(&self.data) - o.dot(&self.reduced)),
        );
        let mut a = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                a[(i, j)] = columns[i].dot(&columns[j]) - overlaps[i].dot(&overlaps[j]);
                a[(j, i)] = a[(i, j)];
            }
        }
        let mean = DVector::from_iterator(n, columns.iter().map(|c| c.mean));
        Normal { a, y, mean }
    }

    /// Log evidence gained by adding a column of fixed amplitude one.
    pub fn gain_fixed(&self, column: &Column) -> f64 {
        let overlap = self.overlap(column);
        column.dot(&self.data) - overlap.dot(&self.reduced) - 0.5 * (column.dot(column) - overlap.dot(&overlap))
    }

    /// What is left of a column beside those chosen: its squared norm, and its product with what is left of the data.
    pub fn left_in(&self, column: &Column) -> (f64, f64) {
        let overlap = self.overlap(column);
        (column.dot(column) - overlap.norm_squared(), column.dot(&self.data) - overlap.dot(&self.reduced))
    }

    /// Posterior mean and covariance of the scaled coefficients.
    pub fn posterior(&self) -> (DVector<f64>, DMatrix<f64>) {
        match &self.cholesky {
            Some(c) => {
                let mean = c
                    .l_dirty()
                    .tr_solve_lower_triangular(&self.reduced)
                    .unwrap_or_else(|| DVector::zeros(self.columns.len()));
                (mean, c.inverse())
            }
            None => (DVector::zeros(0), DMatrix::zeros(0, 0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A prior about one is a prior about nothing of what the whole column leaves.
    #[test]
    fn a_prior_about_a_mean_is_one_about_nothing_of_what_the_mean_leaves() {
        let n = 400;
        let clock: Vec<f64> = (0..n).map(|i| 25.0 * f64::from(i)).collect();
        let noise =
            [AxisNoise { white_ng: 50.0, short_ng: 5.0, short_tau_s: 100.0, slow_ng: 8.0, slow_tau_s: 3000.0 }; 3];
        let loudness = std::array::from_fn(|_| Loudness::even(vec![1.0; clock.len()]));
        let wave = |rate: f64| -> Vec<f64> { (0..n).map(|i| 30.0 * (rate * f64::from(i)).sin()).collect() };
        let (term, other) = (wave(0.05), wave(0.07));
        let residual = |share: f64| -> Axes {
            std::array::from_fn(|_| term.iter().zip(&other).map(|(x, y)| share * x + 0.3 * y).collect())
        };
        let frame = |share: f64| Frame::new(&noise, &Schedule::new(&clock), &loudness, &residual(share));
        // The recording has 0.85 of the term; less the whole of it, -0.15.
        let (all, less) = (frame(0.85), frame(-0.15));
        let whole = full_column(&all, &term, 0.1);
        let beside = full_column(&all, &other, 1.0);
        let likelihood = less.log_null - all.log_null;
        let about_one = Chosen::new(&all, vec![&whole.clone().about(10.0), &beside], &[]).log_evidence;
        let about_nothing = Chosen::new(&less, vec![&whole, &beside], &[]).log_evidence;
        assert!((about_one - about_nothing - likelihood).abs() < 1e-6 * about_one.abs(), "{about_one} {about_nothing}");

        let grown = Chosen::new(&all, vec![&beside], &[]).normal(&[whole.clone().about(10.0)]);
        let first = Chosen::new(&all, vec![&beside], &[]).log_evidence;
        assert!((first + grown.gain(1.0) - about_one).abs() < 1e-6 * about_one.abs());
        assert!((grown.gain(1.0) - grown.gain_of(0, 1.0)).abs() < 1e-9 * about_one.abs());
        // Three times the size is the column three times as large.
        let wider = full_column(&all, &term, 0.3).about(10.0 / 3.0);
        let other_way = Chosen::new(&all, vec![&beside], &[]).normal(&[wider]).gain(1.0);
        assert!((grown.gain(3.0) - other_way).abs() < 1e-6 * other_way.abs());
        let size = 0.1 * grown.posterior_mean()[0];
        assert!(0.85 < size && size < 1.0, "between what the data say and what the prior does: {size}");
    }

    fn full_column(frame: &Frame, series: &[f64], size: f64) -> Column {
        frame.column(&std::array::from_fn(|_| Some(series.to_vec())), size)
    }

    /// Of an error that all windows share the data decide the share that their energy has beside its prior, and no column along it
    /// explains more than what is left.
    #[test]
    fn an_error_that_all_windows_share_is_no_finding() {
        let n = 400;
        let clock: Vec<f64> = (0..n).map(|i| 25.0 * f64::from(i)).collect();
        let noise =
            [AxisNoise { white_ng: 50.0, short_ng: 5.0, short_tau_s: 100.0, slow_ng: 0.5, slow_tau_s: 3000.0 }; 3];
        let loudness = std::array::from_fn(|_| Loudness::even(vec![1.0; clock.len()]));
        let drift: Vec<f64> = (0..n).map(|i| 40.0 * f64::from(i) / f64::from(n)).collect();
        // The recording is the drift, two of its own errors large, on y.
        let residual: Axes =
            std::array::from_fn(|k| drift.iter().map(|x| if k == 1 { 2.0 * x } else { 0.0 }).collect());
        let alone = Frame::new(&noise, &Schedule::new(&clock), &loudness, &residual);
        let shared = [Vec::new(), vec![drift.clone()], Vec::new()];
        let known = Frame::new(&noise, &Schedule::new(&clock).with_shared(shared), &loudness, &residual);
        let column = |frame: &Frame| frame.scalar(1, &drift, 1.0);
        let (free, bound) = (column(&alone), column(&known));
        let energy = free.dot(&free);
        assert!((bound.dot(&bound) - energy / (1.0 + energy)).abs() < 1e-6 * energy, "{energy} {}", bound.dot(&bound));
        // A drift of 2 is 2^2/2 against the prior of 1 and nothing against the data: the likelihood falls by that and by the volume.
        let log_ratio = known.log_null - alone.log_null;
        let expected = 0.5 * 4.0 * energy - 0.5 * 4.0 * energy / (1.0 + energy) - 0.5 * (1.0 + energy).ln();
        assert!((log_ratio - expected).abs() < 1e-6 * expected.abs(), "{log_ratio} {expected}");
        // Taken from the residual it leaves the share that the prior holds back, and a constant.
        let [x, left, _] = known.less_shared_errors(&residual, &[Vec::new(), vec![drift.clone()], Vec::new()]);
        let kept = 2.0 / (1.0 + energy);
        assert!(x == residual[0]);
        assert!(left.iter().zip(&drift).all(|(left, drift)| (left - kept * drift).abs() < 1e-6 * 40.0));
    }
}
