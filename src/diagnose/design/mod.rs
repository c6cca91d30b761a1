//! Whitened columns and the evidence of a set of them.
//!
//! Given the noise everything is linear: d = X b + c + n, with b ~ N(m, prior), a constant c per axis without prior, and
//! n whitened. The log evidence ratio of X against nothing is then
//! 1/2 (y + m)' (A + I)^-1 (y + m) - 1/2 m'm - 1/2 log det (A + I), A = X'X and y = X'd, the columns scaled by their prior
//! size (Kennedy and O'Hagan 2001 for why sizes need priors). Here are the columns and the noise behind which they stand; the
//! evidence is in `chosen`. Not here: what the columns mean.

mod chosen;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};

pub use chosen::{Choices, Chosen, Normal};

use crate::diagnose::noise::{AxisNoise, Flips, Loudness, Schedule, Stretch, Whitener, dot};
use crate::diagnose::scene::{Axes, Measured};
use crate::math::rms::about_mean;
use crate::math::shared_work;

pub use crate::diagnose::axes::Raw;

/// One axis of a whitened regressor: `factor` times what is shared with the same regressor of other sizes.
#[derive(Debug, Clone)]
struct Part {
    first: usize,
    /// In single precision, since a bank of them is read many times over: rounding takes 6e-8 of each value, the same in every
    /// product of the column.
    whitened: Arc<Vec<f32>>,
    /// Its products with what is nuisance on this axis.
    nuisance: Vec<f64>,
    /// What flips of the table see of it, behind their filter; empty where they see nothing.
    flips: Vec<f64>,
    factor: f64,
}

impl Part {
    /// The same with a bias at the flips.
    fn seen_by(self, flips: &Flips, at_flips: Stretch) -> Self {
        if at_flips.values.is_empty() {
            return self;
        }
        let bias_ng = [&vec![0.0; at_flips.first], at_flips.values].concat();
        Self { flips: flips.filtered(&bias_ng), ..self }
    }
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
        sum + self.dot_at_flips(other)
    }

    /// What flips see of both, as a product.
    fn dot_at_flips(&self, other: &Column) -> f64 {
        let parts = self.parts.iter().zip(&other.parts).filter_map(|(a, b)| Some((a.as_ref()?, b.as_ref()?)));
        let product = |(a, b): (&Part, &Part)| -> f64 { a.flips.iter().zip(&b.flips).map(|(a, b)| a * b).sum() };
        parts.map(|(a, b)| a.factor * b.factor * product((a, b))).sum()
    }

    /// Whether this is another view of the same whitened series at the same size.
    fn is(&self, other: &Column) -> bool {
        self.parts.iter().zip(&other.parts).all(|parts| match parts {
            (Some(a), Some(b)) => Arc::ptr_eq(&a.whitened, &b.whitened) && a.factor == b.factor,
            (None, None) => true,
            _ => false,
        })
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
            let mut flips = vec![0.0; b.flips.len().max(a.as_ref().map_or(0, |a| a.flips.len()))];
            let mut add = |part: &Part, factor: f64| {
                let values = part.whitened.iter().map(|y| f64::from(*y));
                whitened[part.first - first..].iter_mut().zip(values).for_each(|(x, y)| *x += factor * y);
                nuisance.iter_mut().zip(&part.nuisance).for_each(|(x, y)| *x += factor * y);
                flips.iter_mut().zip(&part.flips).for_each(|(x, y)| *x += factor * y);
            };
            if let Some(a) = &*a {
                add(a, a.factor);
            }
            add(b, -factor * b.factor);
            *a = Some(Part {
                first,
                whitened: Arc::new(whitened.iter().map(|x| *x as f32).collect()),
                nuisance,
                flips,
                factor: 1.0,
            });
        }
        out
    }

    /// Whitened values of one axis with the share of what is nuisance removed; zero where the column is absent.
    pub fn projected(&self, axis: usize, frame: &Frame) -> Vec<f64> {
        let Some(p) = &self.parts[axis] else { return vec![0.0; frame.windows()] };
        let mut values = vec![0.0; frame.windows()];
        values[p.first..].iter_mut().zip(&*p.whitened).for_each(|(x, w)| *x = f64::from(*w));
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
    /// The series.
    pub series: Stretch<'a>,
    /// Its prior size.
    pub size: f64,
}

/// Series of an axis that are whitened side by side.
const LANES: usize = 8;

impl Column {
    fn of(parts: impl IntoIterator<Item = (usize, Part)>) -> Self {
        let mut column = Self::default();
        for (axis, part) in parts {
            column.parts[axis] = Some(part);
        }
        column
    }
}

/// The noise of all axes turned into filters, and the data behind them.
#[derive(Clone)]
pub struct Frame {
    whiteners: Arc<[Whitener; 3]>,
    /// What is nuisance on each axis, whitened: the constant, of unit norm, and the errors all windows share, orthogonal to it and to
    /// each other, each as far as the data and not its prior decide it.
    nuisance: Arc<[Vec<Vec<f64>>; 3]>,
    /// What was measured of the bias beside the windows.
    flips: Arc<[Flips; 3]>,
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
        let flips = Arc::new(schedule.flips.clone());
        let nothing = Self { whiteners, nuisance, flips, log_det, data: Column::default(), log_null: log_det };
        nothing.with_data(residual_ng).and_flips(&schedule.flips)
    }

    /// The same filters, other measurements of windows and bias.
    pub fn with_measured(&self, measured: &Measured) -> Self {
        self.with_data(&measured.residual_ng).and_flips(&measured.flips)
    }

    /// The same data with what flips say.
    fn and_flips(mut self, flips: &[Flips; 3]) -> Self {
        if flips.iter().all(|flips| flips.rest.is_empty()) {
            return self;
        }
        for (part, flips) in self.data.parts.iter_mut().flatten().zip(flips) {
            part.flips.clone_from(&flips.rest);
        }
        self.log_null = self.log_det - 0.5 * self.data.dot(&self.data);
        self
    }

    /// The same filters before a column.
    pub fn before(&self, data: Column) -> Self {
        let log_null = self.log_det - 0.5 * data.dot(&data);
        Self { data, log_null, ..self.clone() }
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

    /// Windows of the record.
    pub fn windows(&self) -> usize {
        self.nuisance[0][0].len()
    }

    /// The same filters, another series at the windows, of which flips see nothing.
    pub fn with_data(&self, residual_ng: &Axes) -> Self {
        // The constant is nuisance, however large: it goes before rounding can make anything of it.
        self.before(self.column(&residual_ng.each_ref().map(|series| Some(about_mean(series))), 1.0))
    }

    /// Whiten a regressor, scaled by its prior size.
    pub fn column(&self, raw: &Raw, size: f64) -> Column {
        let [x, y, z] = raw.each_ref().map(|series| series.as_ref().map(|series| Stretch::of(series)));
        if let (Some(x), Some(y), Some(z)) = (x, y, z)
            && [x, y, z].iter().all(|series| series.values.len() == self.windows())
        {
            let whitened = Whitener::whiten_three(&self.whiteners, [x.values, y.values, z.values]);
            return Column::of(whitened.into_iter().enumerate().map(|(k, w)| (k, self.part(k, 0, w, size))));
        }
        let on_axes = [x, y, z].into_iter().enumerate().filter_map(|(axis, series)| Some((axis, series?)));
        Column::of(on_axes.map(|(axis, series)| {
            let (at_windows, at_flips) = series.split_at(self.windows());
            let [whitened] = self.whiteners[axis].whiten_stretches([at_windows]);
            (axis, self.part(axis, at_windows.first, whitened, size).seen_by(&self.flips[axis], at_flips))
        }))
    }

    /// Whiten many regressors, each by its series on the axes it acts on: those of an axis side by side.
    pub fn columns(&self, many: &[Vec<OnAxis>]) -> Vec<Column> {
        let flat: Vec<(usize, OnAxis)> =
            many.iter().enumerate().flat_map(|(owner, parts)| parts.iter().map(move |part| (owner, *part))).collect();
        let mut order: Vec<usize> = (0..flat.len()).collect();
        order.sort_by_key(|i| {
            let OnAxis { axis, series, .. } = flat[*i].1;
            let (at_windows, _) = series.split_at(self.windows());
            (axis, at_windows.first, at_windows.values.len())
        });
        let groups: Vec<&[usize]> =
            order.chunk_by(|a, b| flat[*a].1.axis == flat[*b].1.axis).flat_map(|axis| axis.chunks(LANES)).collect();
        let parts = shared_work::map(&groups, |group| {
            // A group that is not full whitens its first series again in the lanes left over.
            let lanes: [OnAxis; LANES] = std::array::from_fn(|l| flat[group[if l < group.len() { l } else { 0 }]].1);
            let axis = lanes[0].axis;
            let halves = lanes.map(|lane| lane.series.split_at(self.windows()));
            let whitened = self.whiteners[axis].whiten_stretches(halves.map(|(at_windows, _)| at_windows));
            let whitened = lanes.into_iter().zip(halves).zip(whitened).take(group.len());
            let part = |((lane, (at_windows, at_flips)), w): ((OnAxis, (Stretch, Stretch)), Vec<f32>)| {
                self.part(axis, at_windows.first, w, lane.size).seen_by(&self.flips[axis], at_flips)
            };
            whitened.map(part).collect::<Vec<Part>>()
        });
        let mut columns = vec![Column::default(); many.len()];
        for (i, part) in order.iter().zip(parts.into_iter().flatten()) {
            let (owner, OnAxis { axis, .. }) = flat[*i];
            columns[owner].parts[axis] = Some(part);
        }
        columns
    }

    fn part(&self, axis: usize, first: usize, whitened: Vec<f32>, size: f64) -> Part {
        let products = self.nuisance[axis].iter();
        let nuisance = products.map(|u| dot(&whitened, &u[first..first + whitened.len()])).collect();
        Part { first, whitened: Arc::new(whitened), nuisance, flips: Vec::new(), factor: size }
    }

    /// Whiten a scalar on one axis.
    pub fn scalar(&self, axis: usize, series: &[f64], size: f64) -> Column {
        self.columns(&[vec![OnAxis { axis, series: Stretch::of(series), size }]]).swap_remove(0)
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
