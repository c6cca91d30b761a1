//! The evidence of columns: of those chosen, and of more beside them.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::{Column, Frame};

/// Normal equations of columns beside those chosen.
#[derive(Clone)]
pub struct Normal {
    a: DMatrix<f64>,
    y: DVector<f64>,
    /// Prior means, in prior sizes.
    mean: DVector<f64>,
}

/// Inverse square of how much wider a prior is taken where it must not decide: six times.
const WIDE: f64 = 0.03;

/// Whitened energy that a prediction is expected to miss: a sum of squares of normal numbers.
pub struct Miss {
    /// Sum of their variances: the mean.
    pub energy: f64,
    /// Sum of the squares of their variances: half the variance.
    squared: f64,
}

impl Miss {
    /// The chance that so much or more is missed: by the chi squared that has its mean and variance.
    pub fn chance(&self, missed: f64) -> f64 {
        if self.energy <= 0.0 {
            return 0.0;
        }
        let each = self.squared / self.energy;
        ChiSquared::new(self.energy / each).map_or(0.0, |chi2| chi2.sf(missed / each))
    }
}

impl Normal {
    /// Of columns beside nothing, before no data.
    pub fn of(columns: &[Column]) -> Self {
        let n = columns.len();
        let mut a = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in 0..=i {
                a[(i, j)] = columns[i].dot(&columns[j]);
                a[(j, i)] = a[(i, j)];
            }
        }
        let mean = DVector::from_iterator(n, columns.iter().map(|c| c.mean));
        Self { a, y: DVector::zeros(n), mean }
    }

    /// The same columns, before data.
    pub fn before(&self, columns: &[Column], data: &Column) -> Self {
        let y = DVector::from_iterator(columns.len(), columns.iter().map(|c| c.dot(data)));
        Self { y, ..self.clone() }
    }

    /// Log evidence gained by the first column at an amplitude of one.
    pub fn gain_at_one(&self) -> f64 {
        self.y[0] - 0.5 * self.a[(0, 0)]
    }

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

    /// Posterior mean and covariance of the sizes in units of their priors.
    pub fn posterior(&self) -> (DVector<f64>, DMatrix<f64>) {
        let n = self.y.len();
        match Cholesky::new(&self.a + DMatrix::identity(n, n)) {
            Some(c) => (c.solve(&(&self.y + &self.mean)), c.inverse()),
            None => (DVector::zeros(n), DMatrix::identity(n, n)),
        }
    }

    /// Posterior mean of the sizes in units of their priors, those taken far wider than they are, as in [`Self::expected_miss`].
    pub fn free_mean(&self) -> DVector<f64> {
        let n = self.y.len();
        let wide = Cholesky::new(&self.a + DMatrix::identity(n, n) * WIDE);
        wide.map_or_else(|| DVector::zeros(n), |c| c.solve(&(&self.y + &self.mean * WIDE)))
    }

    /// Whitened energy that a prediction from this part of a record is expected to miss of the series fitted to all of it, in the
    /// part `unseen`: the posterior means of nested data differ by the fall of the posterior covariance. The priors are taken far
    /// wider than they are, so that an effect several times its usual size is not thought to be known before it is seen.
    pub fn expected_miss(&self, unseen: &Normal) -> Miss {
        let n = self.y.len();
        let covariance = |a: &DMatrix<f64>| Cholesky::new(a + DMatrix::identity(n, n) * WIDE).map(|c| c.inverse());
        match (covariance(&self.a), covariance(&(&self.a + &unseen.a))) {
            (Some(seen), Some(all)) => {
                let miss = &unseen.a * (seen - all);
                Miss { energy: miss.trace(), squared: (&miss * &miss).trace() }
            }
            _ => Miss { energy: f64::INFINITY, squared: f64::INFINITY },
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
    /// Of amplitude one.
    fixed: Vec<&'a Column>,
    /// Less those of amplitude one.
    data: Column,
    cholesky: Option<Cholesky<f64, Dyn>>,
    reduced: DVector<f64>,
    /// Log evidence of the chosen columns against none.
    pub log_evidence: f64,
}

impl<'a> Chosen<'a> {
    /// Choose linear columns and columns of fixed amplitude one.
    pub fn new(frame: &Frame, columns: Vec<&'a Column>, fixed: &[&'a Column]) -> Self {
        let means = columns.iter().map(|c| c.mean).collect();
        Self::about(frame, columns, means, fixed)
    }

    /// Choose linear columns, all prior means zero.
    pub fn about_nothing(frame: &Frame, columns: Vec<&'a Column>) -> Self {
        let means = vec![0.0; columns.len()];
        Self::about(frame, columns, means, &[])
    }

    fn about(frame: &Frame, columns: Vec<&'a Column>, means: Vec<f64>, fixed: &[&'a Column]) -> Self {
        let mut data = frame.data.clone();
        for column in fixed {
            data = data.less(column, 1.0);
        }
        let mut log_evidence =
            if fixed.is_empty() { 0.0 } else { 0.5 * (frame.data.dot(&frame.data) - data.dot(&data)) };
        let n = columns.len();
        let fixed = fixed.to_vec();
        if n == 0 {
            return Self { columns, fixed, data, cholesky: None, reduced: DVector::zeros(0), log_evidence };
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
            let log_evidence = f64::NEG_INFINITY;
            return Self { columns, fixed, data, cholesky: None, reduced: DVector::zeros(0), log_evidence };
        };
        let reduced = cholesky.l_dirty().solve_lower_triangular(&y).unwrap_or_else(|| DVector::zeros(n));
        let means: f64 = means.iter().map(|mean| mean * mean).sum();
        let volume = (0..n).map(|i| cholesky.l_dirty()[(i, i)].ln()).sum::<f64>();
        log_evidence += 0.5 * (reduced.norm_squared() - means) - volume;
        Self { columns, fixed, data, cholesky: Some(cholesky), reduced, log_evidence }
    }

    fn overlap(&self, column: &Column) -> DVector<f64> {
        self.overlap_of(DVector::from_iterator(self.columns.len(), self.columns.iter().map(|c| c.dot(column))))
    }

    /// The same of the products with the columns chosen.
    fn overlap_of(&self, products: DVector<f64>) -> DVector<f64> {
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
        self.reduced(columns, Normal::of(columns).before(columns, &self.data))
    }

    /// The same, from what they are before the data of the frame and beside nothing.
    pub fn beside(&self, columns: &[Column], alone: &Normal) -> Normal {
        self.reduced(columns, self.before_its_data(columns, alone))
    }

    /// Normal equations before the data of the frame, before those less the columns of amplitude one.
    fn before_its_data(&self, columns: &[Column], alone: &Normal) -> Normal {
        let mut normal = alone.clone();
        for column in &self.fixed {
            normal.y.iter_mut().zip(columns).for_each(|(y, c)| *y -= c.dot(column));
        }
        normal
    }

    fn reduced(&self, columns: &[Column], normal: Normal) -> Normal {
        if self.columns.is_empty() {
            return normal;
        }
        self.less_overlaps(&columns.iter().map(|c| self.overlap(c)).collect::<Vec<_>>(), normal)
    }

    /// Normal equations less what the columns chosen have of each column.
    fn less_overlaps(&self, overlaps: &[DVector<f64>], mut normal: Normal) -> Normal {
        for (i, overlap) in overlaps.iter().enumerate() {
            normal.y[i] -= overlap.dot(&self.reduced);
            for (j, other) in overlaps.iter().enumerate() {
                normal.a[(i, j)] -= overlap.dot(other);
            }
        }
        normal
    }

    /// What is left of a column beside those chosen: its squared norm, and its product with what is left of the data.
    pub fn left_in(&self, column: &Column) -> (f64, f64) {
        let overlap = self.overlap(column);
        (column.dot(column) - overlap.norm_squared(), column.dot(&self.data) - overlap.dot(&self.reduced))
    }

    /// Log likelihood that the linear columns gain of what flips say, with the coefficients of all the data.
    pub fn gain_at_flips(&self) -> f64 {
        let (mean, _) = self.posterior();
        let columns = || self.columns.iter().zip(&mean);
        let seen: f64 = columns().map(|(column, size)| size * column.dot_at_flips(&self.data)).sum();
        let own =
            |(a, size): (&&Column, &f64)| -> f64 { columns().map(|(b, other)| size * other * a.dot_at_flips(b)).sum() };
        seen - 0.5 * columns().map(own).sum::<f64>()
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

/// Several choices that the same columns are tried beside: a column which more than one of them has is multiplied once.
pub struct Choices<'a> {
    chosen: Vec<Chosen<'a>>,
    distinct: Vec<&'a Column>,
    /// Where each choice has its columns among them.
    places: Vec<Vec<usize>>,
}

impl<'a> Choices<'a> {
    /// From the choices.
    pub fn new(chosen: Vec<Chosen<'a>>) -> Self {
        let mut distinct: Vec<&Column> = Vec::new();
        let mut place = |column: &'a Column| {
            distinct.iter().position(|other| other.is(column)).unwrap_or_else(|| {
                distinct.push(column);
                distinct.len() - 1
            })
        };
        let places = chosen.iter().map(|choice| choice.columns.iter().map(|c| place(c)).collect()).collect();
        Self { chosen, distinct, places }
    }

    /// [`Chosen::beside`] of each choice of `which`.
    pub fn beside(&self, which: &[usize], columns: &[Column], alone: &Normal) -> Vec<Normal> {
        let mut products: Vec<Option<Vec<f64>>> = vec![None; self.distinct.len()];
        let beside = |choice: &usize| {
            let (chosen, places) = (&self.chosen[*choice], &self.places[*choice]);
            let normal = chosen.before_its_data(columns, alone);
            if places.is_empty() {
                return normal;
            }
            for place in places {
                products[*place]
                    .get_or_insert_with(|| columns.iter().map(|column| self.distinct[*place].dot(column)).collect());
            }
            let overlap = |i: usize| {
                let of_place = |place: &usize| products[*place].as_ref().map_or(0.0, |of_columns| of_columns[i]);
                chosen.overlap_of(DVector::from_iterator(places.len(), places.iter().map(of_place)))
            };
            chosen.less_overlaps(&(0..columns.len()).map(overlap).collect::<Vec<_>>(), normal)
        };
        which.iter().map(beside).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missed_by_chance_has_the_chi_squared_of_its_numbers() {
        // Five per cent of one number, of variance 2, and of three of variance 0.5.
        let one = Miss { energy: 2.0, squared: 4.0 };
        assert!((one.chance(2.0 * 3.8415) - 0.05).abs() < 1e-4, "{}", one.chance(2.0 * 3.8415));
        let three = Miss { energy: 1.5, squared: 0.75 };
        assert!((three.chance(0.5 * 7.8147) - 0.05).abs() < 1e-4, "{}", three.chance(0.5 * 7.8147));
        assert_eq!(Miss { energy: 0.0, squared: 0.0 }.chance(1.0), 0.0);
    }

    /// Two parts of a record that see a coefficient alike: of the fit to both, a prediction from one misses half of its own error in the other.
    #[test]
    fn a_prediction_misses_what_the_unseen_part_adds() {
        let part = Normal { a: DMatrix::from_element(1, 1, 400.0), y: DVector::zeros(1), mean: DVector::zeros(1) };
        let miss = part.expected_miss(&part);
        assert!(
            (miss.energy - 0.5).abs() < 1e-3 && (miss.squared - 0.25).abs() < 1e-3,
            "{} {}",
            miss.energy,
            miss.squared
        );
    }
}
