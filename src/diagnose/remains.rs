//! Whether structure remains when the best hypothesis has been taken away, even of a form that no dictionary has.
//!
//! Two questions to the whitened residual, which is white and independent from axis to axis where the hypothesis is whole:
//! do the axes move together in some band of periods (the test of a correlation matrix against unity, exact; a push
//! along one direction of the body at whatever instants does that), and is there a line, of constant or of steadily drifting
//! period? Not here: what it could be.

use nalgebra::{Matrix3, SymmetricEigen};
use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use statrs::function::beta::{beta_reg, ln_beta};

use super::case::WINDOW_STRIDE_S;
use super::scene::Axes;

/// Shortest period at which the axes are compared, s: what is faster is the crew's.
const TOGETHER_S: f64 = 400.0;
/// Shortest period of a line that is looked for, s, and the fewest cycles in the record.
const LINE_S: f64 = 200.0;
const CYCLES_MIN: usize = 8;
/// Lines of the spectrum in the narrowest band in which the axes are compared: fewer numbers than that correlate by chance.
const LINES_MIN: usize = 4;
/// Drifts of a line looked for: cycles by which its phase departs from that of a steady one over the record, and their spacing.
const DRIFT_CYCLES: f64 = 100.0;
const DRIFT_STEP: f64 = 0.75;

/// Structure that remains.
#[derive(Debug, Clone, PartialEq)]
pub struct Remains {
    /// Probability that white, independent residuals show as much, all questions counted.
    pub probability: f64,
    /// Its whitened energy: the square of its signal-to-noise ratio, about.
    pub energy: f64,
    /// In words: its form.
    pub form: String,
    /// In words: its axis or direction, body axes.
    pub axis: String,
    /// Axes with a share in it.
    pub axes: Vec<String>,
    /// In words: where it lives.
    pub location: String,
}

/// What remains in `whitened` residuals at the windows centred on `clock_s`; `scale_ng` is the noise of each axis. The least
/// probable of all that was asked.
pub fn strongest(clock_s: &[f64], whitened: &Axes, scale_ng: [f64; 3]) -> Option<Remains> {
    let grid = Grid::new(clock_s, whitened)?;
    [together(&grid, scale_ng), line(&grid, scale_ng)]
        .into_iter()
        .flatten()
        .min_by(|a, b| a.probability.total_cmp(&b.probability))
        .map(|r| Remains { probability: (2.0 * r.probability).min(1.0), ..r })
}

/// The residuals on an even grid, zero where there is no window.
struct Grid {
    series: [Vec<Complex64>; 3],
    /// Mean square of each series over its windows.
    variance: [f64; 3],
    windows: f64,
    /// Places from the first window to the last.
    record: f64,
    fft: std::sync::Arc<dyn Fft<f64>>,
}

impl Grid {
    fn new(clock_s: &[f64], whitened: &Axes) -> Option<Self> {
        let (first, last) = (*clock_s.first()?, *clock_s.last()?);
        let place = |t: &f64| ((t - first) / WINDOW_STRIDE_S).round() as usize;
        let record = place(&last) as f64;
        let length = (place(&last) + 1).next_power_of_two();
        // A record of a few minutes has no bands; one of years is not of this kind.
        if clock_s.len() < 200 || length > 1 << 20 {
            return None;
        }
        let mut variance = [0.0; 3];
        let series = std::array::from_fn(|k| {
            let mut out = vec![Complex64::ZERO; length];
            for (t, x) in clock_s.iter().zip(&whitened[k]) {
                out[place(t)] += x;
            }
            variance[k] = whitened[k].iter().map(|x| x * x).sum::<f64>() / clock_s.len() as f64;
            out
        });
        let fft = FftPlanner::new().plan_fft_forward(length);
        variance.iter().all(|v| *v > 0.0).then_some(Self {
            series,
            variance,
            windows: clock_s.len() as f64,
            record,
            fft,
        })
    }

    fn length(&self) -> usize {
        self.series[0].len()
    }

    fn span_s(&self) -> f64 {
        self.length() as f64 * WINDOW_STRIDE_S
    }

    /// Spectra of the series, their phase turned back by that of a line that drifts by so many cycles; unit mean square.
    fn spectra(&self, drift_cycles: f64) -> [Vec<Complex64>; 3] {
        let turn = |i: usize| Complex64::cis(-std::f64::consts::TAU * drift_cycles * (i as f64 / self.record).powi(2));
        let turns: Vec<Complex64> = (0..self.length()).map(turn).collect();
        std::array::from_fn(|k| {
            let norm = (self.windows * self.variance[k]).sqrt().recip();
            let mut out: Vec<Complex64> = self.series[k].iter().zip(&turns).map(|(x, t)| x * t * norm).collect();
            self.fft.process(&mut out);
            out
        })
    }
}

/// Upper tail of a chi square.
fn tail(degrees: f64, x: f64) -> f64 {
    ChiSquared::new(degrees).map_or(1.0, |d| d.sf(x))
}

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
fn together(grid: &Grid, scale_ng: [f64; 3]) -> Option<Remains> {
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
    })
}

/// Axes that carry at least a twentieth of the energy.
fn sharing(amplitude: [f64; 3]) -> Vec<String> {
    let total: f64 = amplitude.iter().map(|a| a * a).sum();
    let named = ["x", "y", "z"].iter().zip(amplitude);
    named.filter(|(_, a)| a * a > 0.05 * total).map(|(name, _)| (*name).to_string()).collect()
}

/// Is there a line?
fn line(grid: &Grid, scale_ng: [f64; 3]) -> Option<Remains> {
    let n = grid.length();
    let last = ((grid.span_s() / LINE_S) as usize).min(n / 2 - 1);
    let steps = (DRIFT_CYCLES / DRIFT_STEP) as i32;
    let mut best: Option<(f64, usize, f64, [f64; 3])> = None;
    for step in -steps..=steps {
        let cycles = f64::from(step) * DRIFT_STEP;
        let spectra = grid.spectra(cycles);
        // The line keeps at least a fifth of its first frequency.
        let least = -2.0 * cycles * grid.span_s() / (0.8 * grid.record * WINDOW_STRIDE_S);
        for m in CYCLES_MIN.max(least.ceil() as usize)..=last {
            let power: [f64; 3] = std::array::from_fn(|k| 2.0 * spectra[k][m].norm_sqr());
            let sum: f64 = power.iter().sum();
            if best.as_ref().is_none_or(|b| sum > b.0) {
                best = Some((sum, m, cycles, power));
            }
        }
    }
    let (energy, m, cycles, power) = best?;
    let trials = f64::from(2 * steps + 1) * (last + 1 - CYCLES_MIN) as f64;
    let amplitude: [f64; 3] = std::array::from_fn(|k| power[k].sqrt() * scale_ng[k]);
    let loudest = (0..3).max_by(|a, b| amplitude[*a].total_cmp(&amplitude[*b])).unwrap_or(0);
    let period = |x: f64| (m as f64 / grid.span_s() + 2.0 * cycles * x / (grid.record * WINDOW_STRIDE_S)).recip();
    Some(Remains {
        probability: (tail(6.0, energy) * trials).min(1.0),
        energy,
        form: format!("an oscillation, its period {:.0} s at first and {:.0} s at last", period(0.0), period(1.0)),
        axis: format!("mostly {}", ["x", "y", "z"][loudest]),
        axes: sharing(amplitude),
        location: "a line of the spectrum, of its own period".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    fn white(seed: u64, n: usize) -> Axes {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        std::array::from_fn(|_| (0..n).map(|_| StandardNormal.sample(&mut rng)).collect())
    }

    fn clock(n: usize) -> Vec<f64> {
        (0..n).filter(|i| i % 170 > 4).map(|i| 1000.0 + WINDOW_STRIDE_S * i as f64).collect()
    }

    /// The exact probability against Bartlett's chi square (1950) of three degrees where that is good, and against counting.
    #[test]
    fn a_correlation_matrix_near_unity_is_as_probable_as_counted() {
        for (n, x) in [(60.0, 0.9), (60.0, 0.7), (200.0, 0.9)] {
            let bartlett = tail(3.0, -(n - 11.0 / 6.0) * f64::ln(x));
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
    fn white_residuals_leave_nothing() {
        let clock = clock(5000);
        // A hundred records: a probability below a thousandth has one chance in ten among them.
        let least = (0..100)
            .filter_map(|seed| strongest(&clock, &white(seed, clock.len()), [1.0; 3]).map(|r| r.probability))
            .fold(1.0, f64::min);
        assert!(least > 1e-3, "{least}");
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

    #[test]
    fn an_oscillation_of_drifting_period_is_a_line() {
        let clock = clock(5000);
        let mut axes = white(9, clock.len());
        for (i, t) in clock.iter().enumerate() {
            let x = (t - clock[0]) / 125_000.0;
            // From 125 000/90 = 1389 s to 125 000/140 = 893 s; an amplitude of a fifth of the noise: SNR 10.
            axes[1][i] += 0.2 * (std::f64::consts::TAU * (90.0 * x + 25.0 * x * x)).sin();
        }
        let found = strongest(&clock, &axes, [1.0; 3]).unwrap();
        assert!(found.probability < 1e-6 && found.axis == "mostly y", "{found:?}");
    }
}
