//! Is there an oscillation for a while? What rings once, or runs for an hour, is no line of the whole record: the least probable part of it.

use std::ops::Range;

use super::Remains;
use super::grid::Tapered;
use super::parts::{APART, Beside, Oscillation, Parts, STEPS};
use crate::diagnose::answer::Interval;
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::math::shared_work;

/// An oscillation for a while, and its places.
type Passing = (Oscillation, Range<usize>);

/// The least probable oscillation in any part of the record.
pub(super) fn passing(parts: &[Parts], scale_ng: [f64; 3], noise: Beside, first_s: f64) -> Option<Remains> {
    let of_each = shared_work::map(parts, |parts| least_probable(parts, noise));
    let trials: usize = of_each.iter().map(|(trials, _)| trials).sum();
    let (found, places) = of_each.into_iter().filter_map(|(_, found)| found).reduce(first_least)?;
    let form = format!("an oscillation for a while, its period about {:.0} s", found.period_s);
    let location = "an oscillation that is not there all the time".into();
    let [start_s, end_s] = [places.start, places.end].map(|place| first_s + place as f64 * WINDOW_STRIDE_S);
    let when = Interval { start_s, end_s, why: "the oscillation".into() };
    Some(found.remains(trials, scale_ng, (form, location), vec![when]))
}

/// How many lines of how many parts were looked at, and the least probable of those that decay in such a time.
fn least_probable(parts: &Parts, noise: Beside) -> (usize, Option<Passing>) {
    let decay = parts.decay;
    let power_of = |part: &Tapered, i: usize| (0..3).map(|k| part.power(k, i)).sum::<f64>();
    let of_line = |i: usize| {
        // Beside the noise fitted, which is the same in all of them.
        let loudest = parts.all.iter().max_by(|a, b| power_of(a, i).total_cmp(&power_of(b, i)))?;
        let away = |part: &&Tapered| part.from.abs_diff(loudest.from) > APART * decay;
        let others: Vec<&Tapered> = parts.all.iter().filter(away).collect();
        let sure_as = Parts::sure_as(others.len())?;
        let power: [f64; 3] = std::array::from_fn(|k| loudest.power(k, i));
        let alone = std::array::from_fn(|k| power[k] / loudest.beside(k, power[k]).max(1.0));
        let places = loudest.from.saturating_sub(decay / STEPS)..loudest.from + APART * decay;
        Some((parts.oscillation(i, (power, alone), (&others, sure_as), noise), places))
    };
    let trials = parts.all.len() * parts.lines.len();
    (trials, (0..parts.lines.len()).filter_map(of_line).reduce(first_least))
}

fn first_least(best: Passing, next: Passing) -> Passing {
    if next.0.log_tail < best.0.log_tail { next } else { best }
}

#[cfg(test)]
mod tests {
    use super::super::grid::Grid;
    use super::super::grid::tests::{clock, coloured, resonant, white};
    use super::super::parts::of_all_decays;
    use super::*;
    use crate::diagnose::scene::Axes;

    fn found(clock: &[f64], axes: &Axes) -> Remains {
        let noise = Beside::Usual { memory_s: [0.0; 3] };
        Grid::new(clock, axes).and_then(|grid| passing(&of_all_decays(&grid), [1.0; 3], noise, clock[0])).unwrap()
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
