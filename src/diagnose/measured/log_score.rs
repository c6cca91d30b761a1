//! The log score of predictions of which nobody says how well they ought to be: orbits hours ahead, blocks and poses that were left out.
//!
//! Each unit (arc, block, pose) is one draw from a Student t distribution of four degrees of freedom, whose scale is what the same
//! prediction misses the other units by: one unit that is out of the order costs a bounded amount.

use super::spread::median;

/// Degrees of freedom: heavy tails.
const DEGREES: f64 = 4.0;
/// Median of the size of a draw at scale 1.
const MEDIAN: f64 = 0.7407;
/// Units from which the others say what to expect of one.
const UNITS_MIN: usize = 3;

/// By how much the log score of each unit rises from one prediction to another; `before` and `after` are the sizes of what they miss
/// the units by, in one unit of measurement. None of fewer than three units, or where one is missed by nothing at all.
pub fn rises(before: &[f64], after: &[f64]) -> Option<Vec<f64>> {
    if before.len() < UNITS_MIN || before.len() != after.len() {
        return None;
    }
    let rises: Vec<f64> = scores(after).zip(scores(before)).map(|(after, before)| after - before).collect();
    rises.iter().all(|rise| rise.is_finite()).then_some(rises)
}

fn scores(missed: &[f64]) -> impl Iterator<Item = f64> {
    (0..missed.len()).map(|unit| {
        let others = missed.iter().enumerate().filter(|(other, _)| *other != unit).map(|(_, size)| *size);
        let scale = median(others) / MEDIAN;
        -scale.ln() - 0.5 * (DEGREES + 1.0) * (missed[unit] / scale).powi(2).mul_add(1.0 / DEGREES, 1.0).ln()
    })
}

/// Sum over the units, and its standard error from how they differ.
pub fn gain(rises: &[f64]) -> [f64; 2] {
    let n = rises.len() as f64;
    let sum: f64 = rises.iter().sum();
    let spread = rises.iter().map(|rise| (rise - sum / n).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    [sum, (n * spread).sqrt()]
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn a_prediction_ten_times_as_good_gains_a_factor_of_ten_a_unit_and_another_no_better_gains_nothing() {
        let rng = &mut ChaCha8Rng::seed_from_u64(4);
        let mut errors = |size: f64| -> Vec<f64> {
            (0..400).map(|_| Distribution::<f64>::sample(&StandardNormal, rng).abs() * size).collect()
        };
        let (before, after, other) = (errors(10.0), errors(1.0), errors(1.0));
        let [better, error] = gain(&rises(&before, &after).unwrap());
        assert!((better - 400.0 * 10f64.ln()).abs() < 3.0 * error && error < 40.0, "{better} {error}");
        let [same, error] = gain(&rises(&after, &other).unwrap());
        assert!(same.abs() < 3.0 * error, "{same} {error}");
    }

    #[test]
    fn one_unit_that_is_worse_by_far_does_not_outweigh_the_rest() {
        let before = [5.0, 6.0, 5.5, 4.5, 5.2];
        assert!(gain(&rises(&before, &[0.05, 0.06, 0.055, 0.045, 5.2]).unwrap())[0] > 0.0);
        assert_eq!(rises(&before[..2], &before[..2]), None);
        assert_eq!(rises(&before, &[0.0; 5]), None);
    }
}
