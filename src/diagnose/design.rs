//! Whitened columns and the evidence of a set of them.
//!
//! Given the noise everything is linear: d = X b + c + n, with b ~ N(0, prior), a constant c per axis without prior, and
//! n whitened. The log evidence ratio of X against nothing is then
//! 1/2 y' (A + I)^-1 y - 1/2 log det (A + I), A = X'X and y = X'd, the columns scaled by their prior size (Kennedy and
//! O'Hagan 2001 for why sizes need priors). Not here: what the columns mean.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::noise::{AxisNoise, Schedule, Whitener, dot};
use super::scene::Axes;

/// A regressor before whitening: a series for every axis it acts on.
pub type Raw = [Option<Vec<f64>>; 3];

#[derive(Debug, Clone)]
struct Part {
    first: usize,
    whitened: Vec<f64>,
    constant: f64,
}

/// A whitened regressor, the constant of every axis projected out of every product.
#[derive(Debug, Clone, Default)]
pub struct Column {
    parts: [Option<Part>; 3],
}

impl Column {
    /// Inner product after projection.
    pub fn dot(&self, other: &Column) -> f64 {
        let mut sum = 0.0;
        for (a, b) in self.parts.iter().zip(&other.parts) {
            let (Some(a), Some(b)) = (a, b) else { continue };
            let first = a.first.max(b.first);
            let end = (a.first + a.whitened.len()).min(b.first + b.whitened.len());
            if first < end {
                sum += dot(&a.whitened[first - a.first..end - a.first], &b.whitened[first - b.first..end - b.first]);
            }
            sum -= a.constant * b.constant;
        }
        sum
    }

    /// This column times `factor`.
    pub fn times(&self, factor: f64) -> Column {
        let mut out = self.clone();
        for part in out.parts.iter_mut().flatten() {
            part.whitened.iter_mut().for_each(|x| *x *= factor);
            part.constant *= factor;
        }
        out
    }

    /// This column less another times `factor`.
    pub fn less(&self, other: &Column, factor: f64) -> Column {
        let mut out = self.clone();
        for (a, b) in out.parts.iter_mut().zip(&other.parts) {
            let Some(b) = b else { continue };
            let part = a.get_or_insert_with(|| Part { first: b.first, whitened: Vec::new(), constant: 0.0 });
            let first = part.first.min(b.first);
            let end = (part.first + part.whitened.len()).max(b.first + b.whitened.len());
            let mut whitened = vec![0.0; end - first];
            whitened[part.first - first..part.first - first + part.whitened.len()].copy_from_slice(&part.whitened);
            for (x, y) in whitened[b.first - first..].iter_mut().zip(&b.whitened) {
                *x -= factor * y;
            }
            *part = Part { first, whitened, constant: part.constant - factor * b.constant };
        }
        out
    }

    /// Whitened values of one axis with the constant's share removed; empty where the column is absent.
    pub fn projected(&self, axis: usize, frame: &Frame) -> Vec<f64> {
        match &self.parts[axis] {
            Some(p) => {
                let value = |i: usize| i.checked_sub(p.first).and_then(|j| p.whitened.get(j)).copied().unwrap_or(0.0);
                frame.ones[axis].iter().enumerate().map(|(i, o)| value(i) - p.constant * o).collect()
            }
            None => vec![0.0; frame.ones[axis].len()],
        }
    }
}

/// The noise of all axes turned into filters, and the data behind them.
pub struct Frame {
    whiteners: [Whitener; 3],
    ones: Axes,
    /// The whitened residual.
    pub data: Column,
    /// Log restricted likelihood of no effect at all.
    pub log_null: f64,
}

impl Frame {
    /// From the noise of the three axes and the residual.
    pub fn new(noise: &[AxisNoise; 3], schedule: &Schedule, activity: &Axes, residual_ng: &Axes) -> Self {
        let whiteners: [Whitener; 3] = std::array::from_fn(|k| Whitener::new(&noise[k], schedule, &activity[k]));
        let mut log_null = 0.0;
        let ones = std::array::from_fn(|k| {
            let mut one = whiteners[k].whiten(&vec![1.0; schedule.len()]);
            let norm = dot(&one, &one).sqrt();
            one.iter_mut().for_each(|x| *x /= norm);
            log_null -= 0.5 * whiteners[k].log_det() + norm.ln();
            one
        });
        let mut frame = Self { whiteners, ones, data: Column::default(), log_null };
        frame.data = frame.column(&std::array::from_fn(|k| Some(residual_ng[k].clone())), 1.0);
        frame.log_null -= 0.5 * frame.data.dot(&frame.data);
        frame
    }

    /// Whiten a regressor, scaled by its prior size.
    pub fn column(&self, raw: &Raw, size: f64) -> Column {
        let whole = |s: &Vec<f64>| s.first().is_some_and(|x| *x != 0.0) && s.last().is_some_and(|x| *x != 0.0);
        if let [Some(x), Some(y), Some(z)] = raw
            && [x, y, z].into_iter().all(whole)
        {
            let whitened = Whitener::whiten_three(&self.whiteners, [x, y, z]);
            return Column { parts: self.whole_parts(whitened, [size; 3]).map(Some) };
        }
        Column { parts: std::array::from_fn(|k| raw[k].as_ref().map(|series| self.part(k, series, size))) }
    }

    /// Whiten a scalar on one axis.
    pub fn scalar(&self, axis: usize, series: &[f64], size: f64) -> Column {
        let mut column = Column::default();
        column.parts[axis] = Some(self.part(axis, series, size));
        column
    }

    /// Whiten a scalar on each axis: three columns.
    pub fn scalars(&self, series: &[f64], sizes: &[f64; 3]) -> [Column; 3] {
        let ends = [series.first(), series.last()];
        let parts = if ends.iter().all(|x| x.is_some_and(|x| *x != 0.0)) {
            self.whole_parts(Whitener::whiten_three(&self.whiteners, [series; 3]), *sizes)
        } else {
            std::array::from_fn(|k| self.part(k, series, sizes[k]))
        };
        let mut axis = 0;
        parts.map(|part| {
            let mut column = Column::default();
            column.parts[axis] = Some(part);
            axis += 1;
            column
        })
    }

    fn whole_parts(&self, whitened: [Vec<f64>; 3], sizes: [f64; 3]) -> [Part; 3] {
        let mut axis = 0;
        whitened.map(|mut whitened| {
            whitened.iter_mut().for_each(|x| *x *= sizes[axis]);
            let constant = dot(&whitened, &self.ones[axis]);
            axis += 1;
            Part { first: 0, whitened, constant }
        })
    }

    fn part(&self, axis: usize, series: &[f64], size: f64) -> Part {
        let first = series.iter().position(|x| *x != 0.0).unwrap_or(series.len());
        let last = series.iter().rposition(|x| *x != 0.0).map_or(first, |i| i + 1);
        let mut whitened = self.whiteners[axis].whiten_span(series, first, last);
        whitened.iter_mut().for_each(|x| *x *= size);
        let constant = dot(&whitened, &self.ones[axis][first..first + whitened.len()]);
        Part { first, whitened, constant }
    }

    /// Predictive standard deviations of an axis.
    pub fn predictive_sd(&self, axis: usize) -> Vec<f64> {
        self.whiteners[axis].predictive_sd()
    }
}

/// Normal equations of columns beside those chosen.
pub struct Normal {
    a: DMatrix<f64>,
    y: DVector<f64>,
}

impl Normal {
    /// Log evidence gained by these columns, their prior sizes all multiplied by `scale`.
    pub fn gain(&self, scale: f64) -> f64 {
        let n = self.y.len();
        let a = &self.a * (scale * scale) + DMatrix::identity(n, n);
        match Cholesky::new(a) {
            Some(c) => {
                let y = &self.y * scale;
                let half = c.l_dirty().solve_lower_triangular(&y).unwrap_or_else(|| DVector::zeros(n));
                0.5 * half.norm_squared() - (0..n).map(|i| c.l_dirty()[(i, i)].ln()).sum::<f64>()
            }
            None => f64::NEG_INFINITY,
        }
    }

    /// What the columns explain at most, their sizes free: half the chi square.
    pub fn explained(&self) -> f64 {
        let n = self.y.len();
        let jitter = 1e-9 * self.a.diagonal().max().max(1e-300);
        let half = Cholesky::new(&self.a + DMatrix::identity(n, n) * jitter)
            .and_then(|c| c.l_dirty().solve_lower_triangular(&self.y));
        half.map_or(0.0, |h| 0.5 * h.norm_squared())
    }

    /// Log evidence gained by column `i` alone.
    pub fn gain_of(&self, i: usize, scale: f64) -> f64 {
        let one_more = scale * scale * self.a[(i, i)] + 1.0;
        0.5 * (scale * self.y[i]).powi(2) / one_more - 0.5 * one_more.ln()
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
        let y = DVector::from_iterator(n, columns.iter().map(|c| c.dot(&data)));
        // A + I is positive definite but for rounding: a jitter of its size keeps a column of zeros harmless.
        let cholesky = Cholesky::new(a.clone()).or_else(|| {
            let jitter = 1e-10 * a.diagonal().max();
            Cholesky::new(a + DMatrix::identity(n, n) * jitter)
        });
        let Some(cholesky) = cholesky else {
            return Self { columns, data, cholesky: None, reduced: DVector::zeros(0), log_evidence: f64::NEG_INFINITY };
        };
        let reduced = cholesky.l_dirty().solve_lower_triangular(&y).unwrap_or_else(|| DVector::zeros(n));
        log_evidence += 0.5 * reduced.norm_squared() - (0..n).map(|i| cholesky.l_dirty()[(i, i)].ln()).sum::<f64>();
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
        Normal { a, y }
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
