//! Do the axes move together in some band of periods? The test of a correlation matrix against unity, exact.

use nalgebra::{Matrix3, SymmetricEigen};
use statrs::function::beta::{beta_reg, ln_beta};

use super::grid::Grid;
use super::{Remains, sharing};

/// Shortest period at which the axes are compared, s: what is faster is the crew's.
const TOGETHER_S: f64 = 400.0;
/// Lines of the spectrum in the narrowest band in which the axes are compared: narrower bands are more questions, and answer few.
const LINES_MIN: usize = 4;

/// Probability that the correlation matrix of three independent series has a determinant of `x` or less, from so many numbers each.
///
/// The determinant is distributed as the product of two beta variables, of (n - 1)/2 and 1/2 and of (n - 2)/2 and 1 (Anderson 2003,
/// section 9.3): the integral over the first is elementary.
fn uncorrelated(n: f64, x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    let [a, b] = [(n - 1.0) / 2.0, (n - 2.0) / 2.0];
    if b <= 0.0 {
        return 1.0;
    }
    let beyond = if x > 0.0 { (b * x.ln() - ln_beta(a, 0.5)).exp() * 2.0 * x.sqrt().acos() } else { 0.0 };
    (beta_reg(a, 0.5, x) + beyond).min(1.0)
}

/// Do the axes move together in some band?
pub(super) fn together(grid: &Grid, scale_ng: [f64; 3]) -> Option<Remains> {
    let spectra = grid.spectra(0.0);
    let last = ((grid.span_s() / TOGETHER_S) as usize).min(grid.length() / 2 - 1);
    // Everything slower than a period, and the octaves alone.
    let edges: Vec<usize> = (0..).map(|i| LINES_MIN << i).take_while(|e| *e <= last).collect();
    let bands: Vec<[usize; 2]> =
        edges.iter().map(|e| [1, *e]).chain(edges.windows(2).map(|e| [e[0] + 1, e[1]])).collect();
    let mut best: Option<(f64, [usize; 2], Matrix3<f64>, f64)> = None;
    for &[low, high] in &bands {
        let c = Matrix3::from_fn(|i, j| (low..=high).map(|m| (spectra[i][m] * spectra[j][m].conj()).re).sum::<f64>());
        let r = Matrix3::from_fn(|i, j| c[(i, j)] / (c[(i, i)] * c[(j, j)]).sqrt());
        // Two numbers a line of the spectrum, as far as the windows fill the grid.
        let degrees = 2.0 * (high - low + 1) as f64 * grid.windows / grid.length() as f64;
        let p = uncorrelated(degrees, r.determinant()) * bands.len() as f64;
        let statistic = -(degrees - 11.0 / 6.0) * r.determinant().max(1e-300).ln();
        if best.as_ref().is_none_or(|b| p < b.0) {
            best = Some((p, [low, high], c, statistic));
        }
    }
    let (probability, [low, high], c, energy) = best?;
    let eigen = SymmetricEigen::new(c);
    let v = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let direction = nalgebra::Vector3::from_fn(|k, _| v[k] * scale_ng[k]).normalize();
    Some(Remains {
        probability: probability.min(1.0),
        energy,
        form: "a(t) d, d fixed in the body, a(t) of no listed covariate".into(),
        axis: format!("d = [{:.2}, {:.2}, {:.2}]", direction.x, direction.y, direction.z),
        axes: sharing([direction.x, direction.y, direction.z]),
        location: format!(
            "the three axes move together at periods of {:.0} s to {:.0} s",
            grid.span_s() / high as f64,
            grid.span_s() / low as f64
        ),
        intervals: Vec::new(),
        period_s: None,
    })
}

#[cfg(test)]
mod tests {
    use super::super::grid::tests::{clock, white};
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    /// The exact probability against Bartlett's chi square (1950) of three degrees where that is good, and against counting.
    #[test]
    fn a_correlation_matrix_near_unity_is_as_probable_as_counted() {
        for (n, x) in [(60.0, 0.9), (60.0, 0.7), (200.0, 0.9)] {
            let bartlett = ChiSquared::new(3.0).unwrap().sf(-(n - 11.0 / 6.0) * f64::ln(x));
            let exact = uncorrelated(n, x);
            assert!((exact / bartlett - 1.0).abs() < 0.02, "{n} {x}: {exact} {bartlett}");
        }
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(8);
        let determinant = |_| {
            let m: Matrix3<f64> = (0..8)
                .map(|_| nalgebra::Vector3::from_fn(|_, _| StandardNormal.sample(&mut rng)))
                .map(|v: nalgebra::Vector3<f64>| v * v.transpose())
                .sum();
            Matrix3::from_fn(|i, j| m[(i, j)] / (m[(i, i)] * m[(j, j)]).sqrt()).determinant()
        };
        let drawn: Vec<f64> = (0..20_000).map(determinant).collect();
        for x in [0.05, 0.2, 0.5] {
            let share = drawn.iter().filter(|d| **d <= x).count() as f64 / drawn.len() as f64;
            let expected = uncorrelated(8.0, x);
            assert!((share - expected).abs() < 4.0 * (expected / drawn.len() as f64).sqrt(), "{x}: {share} {expected}");
        }
    }

    #[test]
    fn a_push_that_switches_at_no_logged_instants_moves_the_axes_together() {
        let clock = clock(5000);
        let mut axes = white(7, clock.len());
        for (i, t) in clock.iter().enumerate() {
            let up = (t / 3700.0 + 3.0 * (t / 11_000.0).sin() + 2.0 * (t / 4100.0).cos()).sin() > 0.3;
            for (axis, d) in axes.iter_mut().zip([0.5, -0.4, 0.6]) {
                axis[i] += 0.8 * d * f64::from(up);
            }
        }
        let found = Grid::new(&clock, &axes).and_then(|grid| together(&grid, [1.0; 3])).unwrap();
        assert!(found.probability < 1e-6 && found.axes.len() == 3, "{found:?}");
    }
}
