//! Medians, and how many independent values a series with memory is worth.

use crate::math::robust;

/// Median; of nothing, zero.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    robust::median(&mut values.into_iter().collect::<Vec<_>>()).unwrap_or(0.0)
}

/// Scatter about the median: 1.4826 times the median absolute deviation.
pub fn scatter(values: &[f64]) -> f64 {
    let centre = median(values.iter().copied());
    robust::MAD_TO_SIGMA * median(values.iter().map(|v| (v - centre).abs()))
}

/// How many samples of a series with memory carry as much as one independent sample: 1 + 2 sum rho_k, summed to the
/// first correlation below `1/sqrt(n)` (pooled over the components of one measurement). Never below one.
pub fn memory(components: &[Vec<f64>]) -> f64 {
    let n = components.iter().map(Vec::len).min().unwrap_or(0);
    let power: f64 = components.iter().flat_map(|c| c.iter().map(|x| x * x)).sum();
    if n < 4 || power <= 0.0 {
        return 1.0;
    }
    let mut sum = 1.0;
    for lag in 1..n / 2 {
        let product = |c: &Vec<f64>| c.windows(lag + 1).map(|w| w[0] * w[lag]).sum::<f64>();
        let rho = components.iter().map(product).sum::<f64>() / power;
        if rho < 1.0 / (n as f64).sqrt() {
            break;
        }
        sum += 2.0 * rho;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_series_that_repeats_each_value_ten_times_is_worth_a_tenth() {
        let mut x = 1.0_f64;
        let white: Vec<f64> = (0..400)
            .map(|_| {
                x = (x * 137.1 + 0.7).fract();
                x - 0.5
            })
            .collect();
        let slow: Vec<f64> = white.iter().flat_map(|v| [*v; 10]).collect();
        assert!(memory(&[white]) < 1.5);
        assert!((memory(&[slow]) - 10.0).abs() < 2.0);
    }
}
