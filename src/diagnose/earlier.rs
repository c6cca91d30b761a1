//! What a series was before its record began, as far as its cycles tell.
//!
//! A sensor that follows its temperature late feels at first what no log holds. Least squares (with a weak ridge, so that a short
//! record asks for no large cycles) of a constant and the cycles of the orbit and of the day; where the record begins, what the cycles
//! miss goes on, and dies away.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

/// How far back, s: the longest lag that is asked for.
pub const REACH_S: f64 = 28_800.0;
/// The day of the crew, s.
const DAY_S: f64 = 86_400.0;
/// Most values that the cycles are fitted to.
const VALUES_MAX: usize = 1000;
/// Ridge, as a share of the values.
const RIDGE: f64 = 1e-3;
/// Step of what is predicted, s.
const STEP_S: f64 = 60.0;
/// How long what the cycles miss goes on, s; also over how long it is measured.
const GOES_ON_S: f64 = 3600.0;

/// A series on a grid of instants.
#[derive(Debug, Clone)]
pub struct Series {
    /// Instants, s.
    pub grid_s: Vec<f64>,
    /// Values.
    pub values: Vec<f64>,
}

/// A series as recorded, and before that as the cycles of the orbit and of the day have it.
pub fn with_earlier(grid_s: &[f64], series: &[f64], period_s: f64) -> Series {
    let begins_s = grid_s[0];
    let basis = |t: f64| {
        let [(orbit_sin, orbit_cos), (day_sin, day_cos)] =
            [period_s, DAY_S].map(|period| (TAU * (t - begins_s) / period).sin_cos());
        [1.0, orbit_sin, orbit_cos, day_sin, day_cos]
    };
    let stride = grid_s.len().div_ceil(VALUES_MAX);
    let rows: Vec<[f64; 5]> = grid_s.iter().step_by(stride).map(|t| basis(*t)).collect();
    let a = DMatrix::from_fn(rows.len(), 5, |i, j| rows[i][j]);
    let middle = series.iter().sum::<f64>() / series.len() as f64;
    let y = DVector::from_iterator(rows.len(), series.iter().step_by(stride).map(|x| x - middle));
    let mut normal = a.tr_mul(&a);
    for j in 1..5 {
        normal[(j, j)] += RIDGE * rows.len() as f64;
    }
    let found = normal.cholesky().map_or_else(|| DVector::zeros(5), |normal| normal.solve(&a.tr_mul(&y)));
    let cycles = |t: f64| middle + basis(t).iter().zip(&found).map(|(b, x)| b * x).sum::<f64>();
    let beginning = grid_s.iter().zip(series).take_while(|(t, _)| **t < begins_s + GOES_ON_S);
    let (missed, count) = beginning.fold((0.0, 0.0), |(sum, n), (t, x)| (sum + x - cycles(*t), n + 1.0));
    // No jump at the record's first value, and what is missed over its first hour before that.
    let (jump, missed) = (series[0] - cycles(begins_s), missed / f64::max(count, 1.0));
    let steps = (REACH_S / STEP_S).ceil() as usize;
    let before = (1..=steps).rev().map(|k| -(k as f64) * STEP_S);
    let value = |since: f64| {
        let (soon, late) = ((since / (0.1 * GOES_ON_S)).exp(), (since / GOES_ON_S).exp());
        cycles(begins_s + since) + (jump - missed) * soon + missed * late
    };
    let (mut times_s, mut values): (Vec<f64>, Vec<f64>) = before.map(|since| (begins_s + since, value(since))).unzip();
    times_s.extend(grid_s);
    values.extend(series);
    Series { grid_s: times_s, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_go_on_backwards_and_a_constant_stays_one() {
        let grid: Vec<f64> = (0..6500).map(|i| 1000.0 + 20.0 * f64::from(i)).collect();
        let at = |t: f64| 4.0 + 0.9 * (TAU * t / DAY_S + 1.0).sin() + 0.2 * (TAU * t / 5440.0 + 2.0).sin();
        let series: Vec<f64> = grid.iter().map(|t| at(*t)).collect();
        let longer = with_earlier(&grid, &series, 5440.0);
        assert_eq!((longer.grid_s.len(), longer.grid_s[0]), (6500 + 480, 1000.0 - REACH_S));
        assert!(longer.grid_s.is_sorted() && longer.values[480..] == series);
        for (t, x) in longer.grid_s.iter().zip(&longer.values) {
            assert!((x - at(*t)).abs() < 0.03, "{t}: {x} {}", at(*t));
        }
        let constant = with_earlier(&grid, &vec![4.0; grid.len()], 5440.0);
        assert!(constant.values.iter().all(|x| (x - 4.0).abs() < 1e-9));
    }
}
