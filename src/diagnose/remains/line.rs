//! Is there a line in the spectrum, of constant or of steadily drifting period?

use super::grid::Grid;
use super::{Remains, mostly, sharing};
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::math::shared_work;
use rustfft::num_complex::Complex64;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Shortest period of a line that is looked for, s, and the fewest cycles in the record.
pub(super) const LINE_S: f64 = 200.0;
const CYCLES_MIN: usize = 8;
/// Drifts of a line looked for: cycles by which its phase departs from that of a steady one over the record, and their spacing.
const DRIFT_CYCLES: f64 = 100.0;
const DRIFT_STEP: f64 = 0.75;

/// Upper tail of a chi square.
pub(super) fn tail(degrees: f64, x: f64) -> f64 {
    ChiSquared::new(degrees).map_or(1.0, |d| d.sf(x))
}

/// Power, place in the spectrum, drift in cycles, power per axis.
type Line = (f64, usize, f64, [f64; 3]);

/// Is there a line? What is left that is not white is noise to it.
pub(super) fn line(grid: &Grid, scale_ng: [f64; 3]) -> Option<Remains> {
    loudest(grid, scale_ng, |spectrum, m| grid.loudness(spectrum, m))
}

/// The same where nothing but a line is allowed to be louder than white.
pub(super) fn line_beside_white(grid: &Grid, scale_ng: [f64; 3]) -> Option<Remains> {
    loudest(grid, scale_ng, |_, _| 1.0)
}

/// The loudest line beside noise so many times as loud as white, at least 1, in a spectrum about a line of it.
fn loudest(grid: &Grid, scale_ng: [f64; 3], loudness: impl Fn(&[Complex64], usize) -> f64 + Sync) -> Option<Remains> {
    let n = grid.length();
    let last = ((grid.span_s() / LINE_S) as usize).min(n / 2 - 1);
    let steps = (DRIFT_CYCLES / DRIFT_STEP) as i32;
    let loudest_at = |step: &i32| {
        let mut best: Option<Line> = None;
        let cycles = f64::from(*step) * DRIFT_STEP;
        let spectra = grid.spectra(cycles);
        // The line keeps at least a fifth of its first frequency.
        let least = -2.0 * cycles * grid.span_s() / (0.8 * grid.record * WINDOW_STRIDE_S);
        for m in CYCLES_MIN.max(least.ceil() as usize)..=last {
            let power: [f64; 3] = std::array::from_fn(|k| 2.0 * spectra[k][m].norm_sqr());
            let beats = |x: f64| best.as_ref().is_none_or(|b| x > b.0);
            if !beats(power.iter().sum()) {
                continue;
            }
            // Beside what is left that is not white, a line is as much fainter.
            let sum = (0..3).map(|k| power[k] / loudness(&spectra[k], m)).sum();
            if beats(sum) {
                best = Some((sum, m, cycles, power));
            }
        }
        best
    };
    let drifts: Vec<i32> = (-steps..=steps).collect();
    let of_all = shared_work::map(&drifts, loudest_at).into_iter().flatten();
    let first_loudest = |best: Line, next: Line| if next.0 > best.0 { next } else { best };
    let (energy, m, cycles, power) = of_all.reduce(first_loudest)?;
    let trials = f64::from(2 * steps + 1) * (last + 1 - CYCLES_MIN) as f64;
    let amplitude: [f64; 3] = std::array::from_fn(|k| power[k].sqrt() * scale_ng[k]);
    let period = |x: f64| (m as f64 / grid.span_s() + 2.0 * cycles * x / (grid.record * WINDOW_STRIDE_S)).recip();
    Some(Remains {
        probability: (tail(6.0, energy) * trials).min(1.0),
        energy,
        form: format!("an oscillation, its period {:.0} s at first and {:.0} s at last", period(0.0), period(1.0)),
        axis: mostly(amplitude),
        axes: sharing(amplitude),
        location: "a line of the spectrum, of its own period".into(),
        intervals: Vec::new(),
        period_s: Some(period(0.5)),
    })
}

#[cfg(test)]
mod tests {
    use super::super::grid::tests::{clock, coloured, white};
    use super::*;

    #[test]
    fn an_oscillation_of_drifting_period_is_a_line() {
        let clock = clock(5000);
        let mut axes = white(9, clock.len());
        for (i, t) in clock.iter().enumerate() {
            let x = (t - clock[0]) / 125_000.0;
            // From 125 000/90 = 1389 s to 125 000/140 = 893 s; an amplitude of a fifth of the noise: SNR 10.
            axes[1][i] += 0.2 * (std::f64::consts::TAU * (90.0 * x + 25.0 * x * x)).sin();
        }
        let found = Grid::new(&clock, &axes).and_then(|grid| line(&grid, [1.0; 3])).unwrap();
        assert!(found.probability < 1e-6 && found.axis == "mostly y", "{found:?}");
    }

    /// Twenty records with three times the power of the noise fitted about a period of 1500 s: a probability below a ten-thousandth has
    /// one chance in five hundred among them.
    #[test]
    fn noise_that_is_not_white_is_no_line() {
        let clock = clock(5000);
        for seed in 0..20 {
            let axes = coloured(seed, clock.len(), 1.4);
            let found = Grid::new(&clock, &axes).and_then(|grid| line(&grid, [1.0; 3])).unwrap();
            assert!(found.probability > 1e-4, "{seed}: {found:?}");
        }
    }
}
