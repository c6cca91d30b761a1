//! How small everything that is not claimed must be.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use crate::diagnose::answer::UpperLimit;
use crate::diagnose::design::{Chosen, Column, Frame, Raw};
use crate::diagnose::search::{Family, Set};
use crate::diagnose::solve::Library;
use crate::math::rms::about_mean;
use crate::math::shared_work;

/// Probability with which an effect stays below its limit.
const PROBABILITY: f64 = 0.95;
/// What each series of an effect may be beforehand, ng rms: as good as anything.
const PRIOR_NG: f64 = 300.0;
/// Starting points asked at most.
const POINTS_MAX: usize = 100;
/// Share of its largest value by which a series must vary to be more than a constant and its rounding.
const ROUNDING: f64 = 1e-9;
/// Degrees of freedom from which on a chi square is as good as a Gaussian here: their quantiles are a ten-thousandth of it apart.
const MANY: f64 = 1e4;

/// 95 % limits on the size of every listed effect that is not claimed, beside what is.
pub fn upper_limits(library: &Library, frame: &Frame, set: &Set) -> Vec<UpperLimit> {
    let chosen = set.chosen(frame);
    let listed: Vec<usize> = (0..library.listed).collect();
    let limit = |index: &usize| {
        let entry = &library.entries[*index];
        let Family::Listed(effect) = entry.family else { return None };
        if set.members.iter().any(|m| m.entry == *index) {
            return None;
        }
        // The loosest of the starting points is the limit.
        let stride = entry.points.len().div_ceil(POINTS_MAX);
        let limits =
            entry.points.iter().step_by(stride).filter_map(|(_, shape)| limit_of(frame, &chosen, &shape.columns()));
        let limit_ng = limits.reduce(f64::max)?;
        limit_ng.is_finite().then(|| UpperLimit { id: effect.id.into(), limit_ng: (limit_ng * 100.0).round() / 100.0 })
    };
    shared_work::map(&listed, limit).into_iter().flatten().collect()
}

/// The same of all series of an effect together, beside what is chosen; none of one that is a constant in this record but for rounding.
fn limit_of(frame: &Frame, chosen: &Chosen, series: &[Raw]) -> Option<f64> {
    let windows = frame.windows();
    let centred: Vec<Raw> =
        series.iter().map(|raw| raw.each_ref().map(|x| x.as_ref().map(|x| about_mean(&x[..windows])))).collect();
    let n = windows as f64;
    let product = |i: usize, j: usize| -> f64 {
        let axes = centred[i].iter().zip(&centred[j]);
        axes.filter_map(|(a, b)| Some(a.as_ref()?.iter().zip(b.as_ref()?).map(|(a, b)| a * b).sum::<f64>())).sum()
    };
    let varies = |i: usize| {
        let largest = series[i].iter().flatten().flatten().fold(0.0_f64, |largest, x| largest.max(x.abs()));
        (product(i, i) / n).sqrt() > ROUNDING * largest
    };
    if !(0..series.len()).all(varies) {
        return None;
    }
    let size: Vec<f64> = (0..series.len()).map(|i| PRIOR_NG / (product(i, i) / n).sqrt()).collect();
    let columns: Vec<Column> = series.iter().zip(&size).map(|(raw, size)| frame.column(raw, *size)).collect();
    let (mean, covariance) = chosen.normal(&columns).posterior();
    let squares = DMatrix::from_fn(series.len(), series.len(), |i, j| size[i] * size[j] * product(i, j) / n);
    Some(quantile_of_square(&mean, &covariance, &squares).sqrt())
}

/// What x' G x stays below with [`PROBABILITY`], x a Gaussian: from a chi square of the same mean and variance (Patnaik 1949), exact
/// for one number about nothing, and for many.
fn quantile_of_square(mean: &DVector<f64>, covariance: &DMatrix<f64>, g: &DMatrix<f64>) -> f64 {
    let spread = g * covariance;
    let pull = g * mean;
    let expected = spread.trace() + mean.dot(&pull);
    let variance = 2.0 * (&spread * &spread).trace() + 4.0 * pull.dot(&(covariance * &pull));
    if !(variance > 0.0) {
        return expected.max(0.0);
    }
    let degrees = 2.0 * expected * expected / variance;
    if degrees > MANY {
        return expected + Normal::standard().inverse_cdf(PROBABILITY) * variance.sqrt();
    }
    ChiSquared::new(degrees).map_or(f64::INFINITY, |chi2| expected / degrees * chi2.inverse_cdf(PROBABILITY))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn a_square_stays_below_its_quantile_as_often_as_it_says() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut draw = || -> f64 { StandardNormal.sample(&mut rng) };
        for (n, away) in [(1, 0.0), (1, 1.0), (1, 6.0), (1, 200.0), (3, 0.0), (3, 2.0), (9, 0.5)] {
            let half = DMatrix::from_fn(n, n, |_, _| draw());
            let covariance = &half * half.transpose() + DMatrix::identity(n, n) * 0.1;
            let root = covariance.clone().cholesky().unwrap().l();
            let mean = DVector::from_fn(n, |_, _| away * draw());
            let other = DMatrix::from_fn(n, n, |_, _| draw());
            let g = &other * other.transpose();
            let limit = quantile_of_square(&mean, &covariance, &g);
            let below = (0..20_000)
                .filter(|_| {
                    let x = &mean + &root * DVector::from_fn(n, |_, _| draw());
                    x.dot(&(&g * &x)) < limit
                })
                .count();
            let share = below as f64 / 20_000.0;
            assert!((share - PROBABILITY).abs() < 0.015, "{n} {away}: {share}");
        }
    }
}
