//! Is there an oscillation for a while? What rings after a manoeuvre, or runs for a few hours, is no line of the whole record.

use super::grid::Grid;
use super::line::tail;
use super::{Remains, sharing};
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::math::shared_work;

/// Lengths of the parts of the record that are looked at, half windows: 1.8 h, 3.6 h and 7.1 h; each part begins half a part after
/// the one before.
const LENGTHS: [usize; 3] = [256, 512, 1024];
/// Shortest period that is looked for, s, and the fewest cycles in a part.
const SHORTEST_S: f64 = 200.0;
const CYCLES_MIN: usize = 6;
/// Share of a part that must have been recorded.
const RECORDED: f64 = 0.5;

/// Where and how loud: energy, power per axis, period in seconds, part of the record.
type Passing = (f64, [f64; 3], f64, [usize; 2]);

/// The loudest oscillation in any part of the record, beside what else is in that part: that may be louder than elsewhere.
pub(super) fn passing(grid: &Grid, scale_ng: [f64; 3], first_s: f64) -> Option<Remains> {
    let record = grid.record as usize + 1;
    let parts: Vec<[usize; 2]> = LENGTHS
        .into_iter()
        .filter(|length| *length <= record / 2)
        .flat_map(|length| (0..=record - length).step_by(length / 2).map(move |from| [from, from + length]))
        .collect();
    let asked = shared_work::map(&parts, |part| loudest(grid, *part));
    let trials: usize = asked.iter().map(|(lines, _)| lines).sum();
    let first_loudest = |best: Passing, next: Passing| if next.0 > best.0 { next } else { best };
    let (energy, power, period_s, [from, to]) = asked.into_iter().filter_map(|(_, best)| best).reduce(first_loudest)?;
    let amplitude: [f64; 3] = std::array::from_fn(|k| power[k].sqrt() * scale_ng[k]);
    let loudest = (0..3).max_by(|a, b| amplitude[*a].total_cmp(&amplitude[*b])).unwrap_or(0);
    let at = |place: usize| first_s + place as f64 * WINDOW_STRIDE_S;
    Some(Remains {
        probability: (tail(6.0, energy) * trials as f64).min(1.0),
        energy,
        form: format!("an oscillation for a while, its period about {period_s:.0} s"),
        axis: format!("mostly {}", ["x", "y", "z"][loudest]),
        axes: sharing(amplitude),
        location: "an oscillation that is not there all the time".into(),
        spans_s: vec![[at(from), at(to)]],
        period_s: Some(period_s),
    })
}

/// How many lines of the spectrum of a part were looked at, and the loudest.
fn loudest(grid: &Grid, [from, to]: [usize; 2]) -> (usize, Option<Passing>) {
    let Some(part) = grid.part(from, to).filter(|part| part.windows >= RECORDED * (to - from) as f64) else {
        return (0, None);
    };
    let spectra = part.spectra(0.0);
    // The grid of a part is longer than the part, so that no oscillation falls between two lines.
    let first = CYCLES_MIN * part.length() / (to - from);
    let last = ((part.span_s() / SHORTEST_S) as usize).min(part.length() / 2 - 1);
    let mut best: Option<Passing> = None;
    for m in first..=last {
        let power: [f64; 3] = std::array::from_fn(|k| 2.0 * spectra[k][m].norm_sqr());
        let beats = |x: f64| best.as_ref().is_none_or(|b| x > b.0);
        if !beats(power.iter().sum()) {
            continue;
        }
        // Beside the rest of the part, and beside the lines about it.
        let noise = |k: usize| part.beside(k, power[k]).max(part.loudness(&spectra[k], m));
        let sum = (0..3).map(|k| power[k] / noise(k)).sum();
        if beats(sum) {
            best = Some((sum, power, part.span_s() / m as f64, [from, to]));
        }
    }
    (last + 1 - first.min(last + 1), best)
}

#[cfg(test)]
mod tests {
    use super::super::grid::tests::{clock, coloured, white};
    use super::*;

    #[test]
    fn what_rings_for_a_while_is_found_where_it_rings() {
        let clock = clock(5000);
        let mut found_in = 0;
        for seed in 0..20 {
            let mut axes = white(seed, clock.len());
            // Rings from a third of the record on, and has died away a tenth of it later: SNR 11.
            let began = clock[0] + 40_000.0 + 500.0 * seed as f64;
            for (i, t) in clock.iter().enumerate().filter(|(_, t)| **t > began) {
                let since = t - began;
                axes[2][i] += 1.3 * (-since / 4000.0).exp() * (std::f64::consts::TAU * since / 700.0).sin();
            }
            let found = Grid::new(&clock, &axes).and_then(|grid| passing(&grid, [1.0; 3], clock[0])).unwrap();
            let [from, to] = found.spans_s[0];
            let right = found.probability < 1e-4 && found.axis == "mostly z" && from < began + 8000.0 && to > began;
            found_in += usize::from(right && (found.period_s.unwrap() / 700.0 - 1.0).abs() < 0.1);
        }
        assert!(found_in >= 18, "{found_in} of 20");
    }

    /// Forty records, white, or with three times the power of the noise fitted about a period of 1500 s, or with a part that is half as
    /// loud again: a probability below a ten-thousandth has one chance in eighty among all of them.
    #[test]
    fn noise_is_not_passing_whether_even_or_not() {
        let clock = clock(5000);
        for seed in 0..40 {
            let mut louder = white(seed, clock.len());
            louder.iter_mut().for_each(|axis| axis[1000..1600].iter_mut().for_each(|x| *x *= 1.5));
            for axes in [white(1_000 + seed, clock.len()), coloured(seed, clock.len(), 1.4), louder] {
                let found = Grid::new(&clock, &axes).and_then(|grid| passing(&grid, [1.0; 3], clock[0])).unwrap();
                assert!(found.probability > 1e-4, "{seed}: {found:?}");
            }
        }
    }
}
