//! Whether what a hypothesis leaves is white behind the filter of its noise. Where it is not, the noise is another one than was fitted:
//! errors are wider, and evidence is worth less.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::scene::Axes;

/// A remaining autocorrelation this unlikely makes the errors wider.
const WHITENESS_P: f64 = 1e-3;
/// Lags looked at.
const LAGS: usize = 20;

/// What is not white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coloured {
    /// Probability that white noise has as much autocorrelation.
    pub p: f64,
    /// By how much errors are wider.
    pub widening: f64,
}

/// By how much the errors of a whitened series are wider, where it is not white, by Ljung and Box 1978. Too few values do not say.
pub fn coloured(whitened: &[f64]) -> Option<Coloured> {
    let energy: f64 = whitened.iter().map(|x| x * x).sum();
    if whitened.len() <= 2 * LAGS || energy == 0.0 {
        return None;
    }
    let n = whitened.len() as f64;
    let of_lag = |lag: usize| {
        let r = whitened.iter().zip(&whitened[lag..]).map(|(a, b)| a * b).sum::<f64>() / energy;
        r * r / (n - lag as f64)
    };
    let q = n * (n + 2.0) * (1..=LAGS).map(of_lag).sum::<f64>();
    let degrees = LAGS as f64;
    let p = ChiSquared::new(degrees).map_or(1.0, |chi2| chi2.sf(q));
    (p < WHITENESS_P).then(|| Coloured { p, widening: (q / degrees).sqrt() })
}

/// The most by which the errors of any axis are wider; 1 where all are white.
pub fn widening(whitened: &Axes) -> f64 {
    whitened.iter().map(|axis| of_axis(axis)).fold(1.0, f64::max)
}

/// How much louder than white what is left is under a whitened signal: the mean over the axes, each with the energy that the signal has there.
/// An axis on which it has none says nothing of it.
pub fn louder_under(whitened: &Axes, signal: &Axes) -> f64 {
    let energy = signal.each_ref().map(|axis| axis.iter().map(|x| x * x).sum::<f64>());
    let all: f64 = energy.iter().sum();
    let louder = |(axis, energy): (&Vec<f64>, &f64)| energy * of_axis(axis).powi(2);
    if all > 0.0 { whitened.iter().zip(&energy).map(louder).sum::<f64>() / all } else { 1.0 }
}

fn of_axis(whitened: &[f64]) -> f64 {
    coloured(whitened).map_or(1.0, |coloured| coloured.widening)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn what_is_white_widens_nothing_and_what_keeps_a_fifth_of_itself_does() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut told = [0; 2];
        for _ in 0..200 {
            let white: Vec<f64> = (0..4000).map(|_| StandardNormal.sample(&mut rng)).collect();
            let mut last = 0.0;
            let follows = white.iter().map(|x| {
                last = 0.2 * last + x;
                last
            });
            let coloured_one: Vec<f64> = follows.collect();
            told[0] += usize::from(coloured(&white).is_some());
            told[1] += usize::from(coloured(&coloured_one).is_some_and(|coloured| coloured.widening > 1.5));
        }
        // One in a thousand is expected of the first.
        assert!(told[0] <= 3, "{told:?}");
        assert_eq!(told[1], 200);
        assert_eq!(widening(&[vec![0.0, 1.0, -1.0], vec![1.0, -1.0, 0.0], vec![0.5, 0.1, 0.2]]), 1.0);
    }

    #[test]
    fn a_signal_is_judged_by_the_axes_it_is_on() {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let white: Vec<f64> = (0..4000).map(|_| StandardNormal.sample(&mut rng)).collect();
        let follows: Vec<f64> = white.windows(2).map(|pair| pair[1] + 0.3 * pair[0]).collect();
        let left = [white[1..].to_vec(), follows.clone(), white[1..].to_vec()];
        let louder = coloured(&follows).unwrap().widening.powi(2);
        assert!(louder > 1.5);
        let on = |amplitudes: [f64; 3]| amplitudes.map(|amplitude| vec![amplitude; left[0].len()]);
        assert_eq!(louder_under(&left, &on([1.0, 0.0, 0.5])), 1.0);
        assert_eq!(louder_under(&left, &on([0.0, 2.0, 0.0])), louder);
        assert!((louder_under(&left, &on([1.0, 1.0, 0.0])) - 0.5 * (1.0 + louder)).abs() < 1e-9);
        assert_eq!(louder_under(&left, &on([0.0; 3])), 1.0);
    }
}
