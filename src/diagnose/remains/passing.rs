//! Is there an oscillation for a while? What rings after a manoeuvre, or runs for an hour, is no line of the whole record.
//!
//! Noise that resonates oscillates too, and may be louder at one period than at those about it; but it does so in every part of the record
//! alike. So what oscillates in one part is measured by what most parts have at the same period, whatever the spectrum.

use super::grid::{Grid, Tapered};
use super::line::{LINE_S, tail};
use super::{Remains, mostly, sharing};
use crate::diagnose::answer::Interval;
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::math::shared_work;
use rustfft::FftPlanner;
use std::ops::Range;

/// Times, in half windows, in which what is looked for decays: 7 min to 3.6 h.
const DECAYS: [usize; 6] = [16, 32, 64, 128, 256, 512];
/// Decay times that a part is long, and parts that begin in a decay time.
const LENGTH: usize = 4;
const STEPS: usize = 4;
/// Decay times after which a part has nothing of another.
const APART: usize = 2;
/// Shortest period that is looked for, s, and longest: below that of the orbit, which any effect leaves in one attitude and not in another.
/// Half an oscillation at least fits in a decay time.
const PERIODS_S: [f64; 2] = [LINE_S, 4000.0];
/// Share of a part's weight that must have been recorded, for its lines to be as narrow as those of the others.
const RECORDED: f64 = 0.5;
/// Share of the parts, the least loud, that say how loud the noise is: what rings several times may fill a quarter of the record.
const LEAST_LOUD: f64 = 0.75;
/// Fewest of those that are independent, which begin a decay time after one another: of fewer, nothing that happens is improbable enough.
const SURE: f64 = 3.0;

/// What an oscillation is measured by.
#[derive(Clone, Copy)]
pub(super) enum Beside {
    /// White noise.
    White,
    /// What most parts of the record have at its period, the noise of each axis forgetting its phase in so many seconds.
    Usual { memory_s: [f64; 3] },
}

/// An oscillation for a while: logarithm of its probability, all axes together, power on each beside the noise there, period, and places.
struct Passing {
    log_tail: f64,
    power: [f64; 3],
    beside: [f64; 3],
    period_s: f64,
    places: Range<usize>,
}

/// The least probable oscillation in any part of the record.
pub(super) fn passing(grid: &Grid, scale_ng: [f64; 3], noise: Beside, first_s: f64) -> Option<Remains> {
    let of_each = shared_work::map(&DECAYS, |decay| least_probable(grid, *decay, noise));
    let trials: usize = of_each.iter().map(|(trials, _)| trials).sum();
    let found = of_each.into_iter().filter_map(|(_, found)| found).reduce(first_least)?;
    // Minus twice the logarithm of three probabilities: a chi square of six degrees (R. A. Fisher).
    let of_one = tail(6.0, -2.0 * found.log_tail);
    let amplitude: [f64; 3] = std::array::from_fn(|k| found.power[k].sqrt() * scale_ng[k]);
    let [start_s, end_s] = [found.places.start, found.places.end].map(|place| first_s + place as f64 * WINDOW_STRIDE_S);
    Some(Remains {
        probability: (of_one * trials as f64).min(1.0),
        energy: 2.0 * found.beside.iter().sum::<f64>(),
        form: format!("an oscillation for a while, its period about {:.0} s", found.period_s),
        axis: mostly(amplitude),
        axes: sharing(amplitude),
        location: "an oscillation that is not there all the time".into(),
        intervals: vec![Interval { start_s, end_s, why: "the oscillation".into() }],
        period_s: Some(found.period_s),
    })
}

/// How many lines of how many parts were looked at, and the least probable of those that decay in such a time.
fn least_probable(grid: &Grid, decay: usize, noise: Beside) -> (usize, Option<Passing>) {
    let (length, decay_s) = (LENGTH * decay, decay as f64 * WINDOW_STRIDE_S);
    let taper: Vec<f64> = (0..length).map(|i| (-(i as f64) / decay as f64).exp()).collect();
    // A grid longer than the part, so that no oscillation falls between two lines.
    let transform = FftPlanner::new().plan_fft_forward(2 * length);
    let period_s = |line: usize| (2 * length) as f64 * WINDOW_STRIDE_S / line as f64;
    let [last, first] = PERIODS_S.map(|period| (period_s(1) / period) as usize);
    let lines = first.max(LENGTH)..last + 1;
    let begins = (0..=grid.record as usize).step_by(decay / STEPS);
    let recorded =
        |from| grid.tapered(from, &taper, &*transform, lines.clone()).filter(|part| part.recorded > RECORDED);
    let parts: Vec<Tapered> = begins.filter_map(recorded).collect();
    let of_line = |(i, line): (usize, usize)| {
        // Beside the noise fitted, which is the same in all of them.
        let loudest = parts.iter().max_by(|a, b| a.power_of(i).total_cmp(&b.power_of(i)))?;
        let away = |part: &&Tapered| part.from.abs_diff(loudest.from) > APART * decay;
        let others: Vec<&Tapered> = parts.iter().filter(away).collect();
        let independent = LEAST_LOUD * others.len() as f64 / STEPS as f64;
        if independent < SURE {
            return None;
        }
        let power: [f64; 3] = std::array::from_fn(|k| loudest.power[k][i]);
        let alone: [f64; 3] = std::array::from_fn(|k| power[k] / loudest.beside(k, power[k]).max(1.0));
        let (beside, log_tail) = match noise {
            Beside::White => (alone, -alone.iter().sum::<f64>()),
            Beside::Usual { memory_s } => {
                let usual = |k: usize| mean(others.iter().map(|part| part.power[k][i]).collect());
                let beside: [f64; 3] = std::array::from_fn(|k| alone[k] / usual(k));
                // An exponential number beside the mean of others, of which none is independent while the noise still knows its phase: an F
                // distribution with two degrees and twice as many as are.
                let as_sure_as = memory_s.map(|m| independent * decay_s / (decay_s + m));
                let log_tail = |k: usize| -as_sure_as[k] * (beside[k] / as_sure_as[k]).ln_1p();
                (beside, (0..3).map(log_tail).sum())
            }
        };
        let places = loudest.from.saturating_sub(decay / STEPS)..loudest.from + APART * decay;
        Some(Passing { log_tail, beside, power, period_s: period_s(line), places })
    };
    let trials = parts.len() * lines.len();
    (trials, lines.enumerate().filter_map(of_line).reduce(first_least))
}

fn first_least(best: Passing, next: Passing) -> Passing {
    if next.log_tail < best.log_tail { next } else { best }
}

/// Mean of exponential numbers from the least of them, the others being known to be no less: as sure as that of so many.
fn mean(mut all: Vec<f64>) -> f64 {
    all.sort_unstable_by(f64::total_cmp);
    let least = ((LEAST_LOUD * all.len() as f64) as usize).max(1);
    (all[..least].iter().sum::<f64>() + (all.len() - least) as f64 * all[least - 1]) / least as f64
}

#[cfg(test)]
mod tests {
    use super::super::grid::tests::{clock, coloured, resonant, white};
    use super::*;
    use crate::diagnose::scene::Axes;

    fn found(clock: &[f64], axes: &Axes) -> Remains {
        let noise = Beside::Usual { memory_s: [0.0; 3] };
        Grid::new(clock, axes).and_then(|grid| passing(&grid, [1.0; 3], noise, clock[0])).unwrap()
    }

    #[test]
    fn what_rings_for_a_while_is_found_where_it_rings() {
        let clock = clock(5000);
        let mut found_in = 0;
        for seed in 0..20 {
            let mut axes = white(seed, clock.len());
            // Rings from a third of the record on, and has died away a tenth of it later: SNR 13.
            let began = clock[0] + 40_000.0 + 500.0 * seed as f64;
            for (i, t) in clock.iter().enumerate().filter(|(_, t)| **t > began) {
                let since = t - began;
                axes[2][i] += 2.0 * (-since / 4000.0).exp() * (std::f64::consts::TAU * since / 700.0).sin();
            }
            let found = found(&clock, &axes);
            let when = &found.intervals[0];
            let about = when.start_s < began + 2000.0 && when.end_s > began;
            let right = found.probability < 1e-4 && found.axis == "mostly z" && about;
            found_in += usize::from(right && (found.period_s.unwrap() / 700.0 - 1.0).abs() < 0.1);
        }
        assert!(found_in >= 18, "{found_in} of 20");
    }

    /// Fifteen records of each kind: white, or with three times the power of the noise fitted about a period of 1500 s, or ringing about one of
    /// 900 s all the time, or with a part that is half as loud again. A probability below a ten-thousandth has one chance in 160 among all.
    #[test]
    fn noise_is_not_passing_whether_even_or_not() {
        let clock = clock(5000);
        for seed in 0..15 {
            let mut louder = white(seed, clock.len());
            louder.iter_mut().for_each(|axis| axis[1000..1600].iter_mut().for_each(|x| *x *= 1.5));
            let narrow = resonant(2_000 + seed, clock.len(), 4.0, 900.0, 4000.0);
            for axes in [white(1_000 + seed, clock.len()), coloured(seed, clock.len(), 1.4), narrow, louder] {
                let found = found(&clock, &axes);
                assert!(found.probability > 1e-4, "{seed}: {found:?}");
            }
        }
    }
}
