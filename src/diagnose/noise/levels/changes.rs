//! Where the mean of a series changes: the likeliest stretches of even mean, each at a price (PELT, Killick, Fearnhead and Eckley 2012,
//! exact among every so many values), and then each change where the values on both sides scatter least.

use crate::math::robust::median;
use pelt::{Pelt, SegmentCostFunction};
use std::num::NonZero;

/// Values that are taken together before the search, and apart again to place a change; more of very long series.
const TOGETHER: usize = 4;
/// Most bins of those: the search takes time by their square.
const BINS_MAX: usize = 10_000;
/// Chi square by which a change must improve the fit: noise alone reaches it at one of two million places.
const PRICE: f64 = 25.0;
/// Median of the magnitude of a standard normal number.
const OF_A_NORMAL: f64 = 0.6745;

/// The first values of the stretches, 0 among them; noise correlated over fewer values than are taken together is allowed for.
pub fn changes(series: &[f64]) -> Vec<usize> {
    let together = TOGETHER.max(series.len().div_ceil(BINS_MAX));
    let bins: Vec<f64> = series.chunks_exact(together).map(|bin| bin.iter().sum::<f64>() / together as f64).collect();
    let mut steps: Vec<f64> = bins.iter().zip(bins.iter().skip(2)).map(|(a, b)| (b - a).abs()).collect();
    let sigma = median(&mut steps).unwrap_or(0.0) / (OF_A_NORMAL * std::f64::consts::SQRT_2);
    if sigma <= 0.0 {
        return vec![0];
    }
    let Some(jump) = NonZero::new(together) else { return vec![0] };
    // The crate takes no stretch shorter than a jump: with a jump of one it gives nothing but an error.
    let search = Pelt::new().with_jump(jump).with_minimum_segment_length(jump);
    let search = search.with_segment_cost_function(SegmentCostFunction::L2);
    let ends = search.predict(series, PRICE * sigma * sigma * together as f64).unwrap_or_default();
    let inner = ends.split_last().map_or(&[][..], |(_, inner)| inner);
    let begins = std::iter::once(0).chain(inner.iter().copied()).collect();
    placed(&Sums::of(series), begins, together, series.len())
}

/// The same, each moved by less than the values that were taken together to where the values on both sides scatter least.
fn placed(sums: &Sums, mut begins: Vec<usize>, together: usize, n: usize) -> Vec<usize> {
    for i in 1..begins.len() {
        let (from, to) = (begins[i - 1], begins.get(i + 1).copied().unwrap_or(n));
        let near = begins[i].saturating_sub(together).max(from + 1)..(begins[i] + together).min(to);
        let scatter = |at: &usize| sums.scatter(from, *at) + sums.scatter(*at, to);
        begins[i] = near.min_by(|a, b| scatter(a).total_cmp(&scatter(b))).unwrap_or(begins[i]);
    }
    begins
}

/// Sums of values and of their squares up to each.
struct Sums(Vec<[f64; 2]>);

impl Sums {
    fn of(values: &[f64]) -> Self {
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        let mut sums = vec![[0.0; 2]];
        let mut sum = [0.0; 2];
        for x in values.iter().map(|x| x - mean) {
            sum = [sum[0] + x, sum[1] + x * x];
            sums.push(sum);
        }
        Self(sums)
    }

    /// Squares of the values from one to another about their mean.
    fn scatter(&self, begin: usize, end: usize) -> f64 {
        let [sum, squares] = [0, 1].map(|i| self.0[end][i] - self.0[begin][i]);
        squares - sum * sum / (end - begin) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Numbers of which each shares half its samples with the next, two thirds of them noise.
    fn overlapping(seed: u64, n: usize) -> Vec<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let halves: Vec<f64> = (0..=n).map(|_| StandardNormal.sample(&mut rng)).collect();
        halves.windows(2).map(|pair: &[f64]| 0.15 * (pair[0] + pair[1])).collect()
    }

    #[test]
    fn noise_alone_changes_nowhere() {
        for seed in 0..100 {
            assert_eq!(changes(&overlapping(seed, 6000)), [0], "{seed}");
        }
        assert_eq!(changes(&[]), [0]);
        assert_eq!(changes(&[1.0; 400]), [0]);
    }

    #[test]
    fn a_change_in_a_series_of_a_year_is_found() {
        let mut series = overlapping(1, 1_260_000);
        series[400_000..410_000].iter_mut().for_each(|x| *x += 0.3);
        let found = changes(&series);
        assert!(found.len() == 3 && found[1].abs_diff(400_000) < 100 && found[2].abs_diff(410_000) < 100, "{found:?}");
    }

    #[test]
    fn half_an_hour_that_is_louder_is_found_where_it_is() {
        for seed in 0..20 {
            let mut series = overlapping(seed, 6000);
            series[3000..3072].iter_mut().for_each(|x| *x += 0.7);
            series[5000..].iter_mut().for_each(|x| *x -= 0.3);
            let found = changes(&series);
            let near = |a: &usize, b: usize| a.abs_diff(b) <= 6;
            assert!(found.len() == 4 && near(&found[1], 3000) && near(&found[2], 3072), "{seed}: {found:?}");
            assert!(found[3].abs_diff(5000) < 40, "{seed}: {found:?}");
        }
    }
}
