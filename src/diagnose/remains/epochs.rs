//! Does something come the same time after what recurs, or at even distances of its own? Neither need have a shape that any dictionary has:
//! a valve that opens an hour after each dump of water, a heater or a counter with a clock of its own. Slow noise takes most of what
//! goes up and down for itself; what is sharp in it, the jumps of a sawtooth or a push of some minutes, is left behind its filter at every one of
//! the instants, faint in each.

use super::grid::Grid;
use super::line::tail;
use super::stack::{Common, Stack};
use super::{Remains, mostly, sharing};
use crate::diagnose::answer::Interval;
use crate::diagnose::case::WINDOW_STRIDE_S;
use crate::diagnose::instants::Recurring;
use crate::math::robust::median;
use crate::math::shared_work;

/// Places that are added up after what recurs: half a minute to half an hour.
const WIDTHS_AFTER: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Delays that are looked at, s: what follows sooner is the catalogue's own push, or dies away after it.
const DELAYS_S: [f64; 2] = [200.0, 9000.0];
/// Places that are added up at even distances, in a record of no more places than [`PLACES`]; of a longer one as many times more.
const WIDTHS_EVENLY: [usize; 3] = [8, 16, 32];
const PLACES: usize = 12_000;
/// Shortest distance, s, also in widths, and the fewest in a record.
const SHORTEST_S: f64 = 1000.0;
const APART: f64 = 2.5;
const CYCLES_MIN: f64 = 3.0;
/// Epochs begin so many times in a width.
const STEPS: usize = 4;
/// Fewest epochs, and the largest share that one may have: what happens once does not recur.
const EPOCHS_MIN: usize = 3;
const SHARE_MAX: f64 = 0.5;
/// Most intervals that are told one by one.
const TOLD: usize = 64;

/// Epochs that have something in common: places they begin at, how many are added up, and what.
struct Found {
    places: Vec<usize>,
    width: usize,
    common: Common,
}

impl Found {
    /// The larger of it and of what is common to other epochs, if they share it.
    fn or(best: Option<Self>, stack: &Stack, places: impl Iterator<Item = usize> + Clone) -> Option<Self> {
        let common = stack.common(places.clone());
        let more = common.epochs >= EPOCHS_MIN && best.as_ref().is_none_or(|best| common.power > best.common.power);
        if !more || stack.largest_share(&common, places.clone()) > SHARE_MAX {
            return best;
        }
        Some(Self { places: places.collect(), width: stack.width, common })
    }

    fn begins_s(&self, first_s: f64, epoch: usize) -> f64 {
        first_s + self.places[epoch] as f64 * WINDOW_STRIDE_S
    }

    fn length_s(&self) -> f64 {
        self.width as f64 * WINDOW_STRIDE_S
    }

    /// Told in words, of so many trials.
    fn remains(&self, trials: usize, scale_ng: [f64; 3], first_s: f64, words: (String, String)) -> Remains {
        let amplitude: [f64; 3] = std::array::from_fn(|k| self.common.mean[k].abs() * scale_ng[k]);
        let epoch = |i: usize| {
            let start_s = self.begins_s(first_s, i);
            Interval { start_s, end_s: start_s + self.length_s(), why: "it comes again".into() }
        };
        let told = if self.places.len() <= TOLD { self.places.len() } else { 0 };
        Remains {
            probability: (tail(3.0, self.common.power) * trials as f64).min(1.0),
            energy: self.common.power - 3.0,
            form: words.0,
            axis: mostly(amplitude),
            axes: sharing(amplitude),
            location: words.1,
            intervals: (0..told).map(epoch).collect(),
            period_s: None,
        }
    }
}

/// The one with more in common, the first of equals, each with what it is of.
fn louder<T>(best: (Found, T), next: (Found, T)) -> (Found, T) {
    if next.0.common.power > best.0.common.power { next } else { best }
}

/// What comes the same time after what recurs.
pub(super) fn delayed(grid: &Grid, scale_ng: [f64; 3], first_s: f64, recurring: &[Recurring]) -> Option<Remains> {
    let stacks = shared_work::map(&WIDTHS_AFTER, |width| Stack::new(grid, *width));
    let mut trials = 0;
    let mut best: Option<(Found, (f64, &Recurring))> = None;
    for after in recurring {
        let at: Vec<f64> = after.at_s.iter().map(|t| (t - first_s) / WINDOW_STRIDE_S).collect();
        let mut apart: Vec<f64> = at.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let apart = median(&mut apart).unwrap_or(0.0);
        // What is longer than they are apart is there all the time.
        for stack in stacks.iter().filter(|stack| 2.0 * stack.width as f64 <= apart) {
            let [first, last] = DELAYS_S.map(|s| (s / WINDOW_STRIDE_S) as usize);
            let delays = (first..last).step_by((stack.width / STEPS).max(1));
            trials += delays.len();
            let found = delays.filter_map(|delay| {
                let places = at.iter().map(move |place| place.round() as usize + delay);
                Found::or(None, stack, places).map(|found| (found, (delay as f64 * WINDOW_STRIDE_S, after)))
            });
            best = best.into_iter().chain(found).reduce(louder);
        }
    }
    let (found, (delay_s, Recurring { what, .. })) = best?;
    let epochs = found.common.epochs;
    let words = (
        format!("a push {delay_s:.0} s after every {what}, about {:.0} s long", found.length_s()),
        format!("the same time after every {what}, {epochs} of them"),
    );
    Some(found.remains(trials, scale_ng, first_s, words))
}

/// What comes at even distances.
pub(super) fn evenly(grid: &Grid, scale_ng: [f64; 3], first_s: f64) -> Option<Remains> {
    let all = grid.record + 1.0;
    let coarser = (grid.record as usize).div_ceil(PLACES).max(1);
    let mut trials = 0;
    let mut best: Option<(Found, f64)> = None;
    for width in WIDTHS_EVENLY.map(|width| width * coarser) {
        let stack = Stack::new(grid, width);
        // From one to the next, the last epoch is moved by a width, half of it either way.
        let [shortest, longest] = [(SHORTEST_S / WINDOW_STRIDE_S).max(APART * width as f64), all / CYCLES_MIN];
        let next = |period: &f64| Some(period * (1.0 + width as f64 / all)).filter(|next| *next <= longest);
        let periods: Vec<f64> = std::iter::successors(Some(shortest), next).collect();
        let of_period = |i: usize| {
            let period = periods[i];
            let phases = (0..period as usize).step_by(width / STEPS);
            let epochs = |phase: usize| {
                let of = move |n: usize| phase + (n as f64 * period).round() as usize;
                (0..).map(of).take_while(|place| (*place as f64) < all)
            };
            (phases.len(), phases.fold(None, |best, phase| Found::or(best, &stack, epochs(phase))))
        };
        let of_periods = shared_work::map_range(periods.len(), of_period);
        trials += of_periods.iter().map(|(tried, _)| tried).sum::<usize>();
        let found = of_periods.into_iter().zip(&periods).filter_map(|((_, found), period)| Some((found?, *period)));
        best = best.into_iter().chain(found).reduce(louder);
    }
    let (found, period) = best?;
    let period_s = period * WINDOW_STRIDE_S;
    let (epochs, begins_s) = (found.common.epochs, found.begins_s(first_s, 0));
    let words = (
        format!("a jump or a push every {period_s:.0} s"),
        format!("at even distances, {epochs} of them, the first at {begins_s:.0} s"),
    );
    Some(Remains { period_s: Some(period_s), ..found.remains(trials, scale_ng, first_s, words) })
}

#[cfg(test)]
mod tests {
    use super::super::grid::tests::{clock, coloured, white};
    use super::*;
    use crate::diagnose::scene::Axes;

    fn grid(clock: &[f64], axes: &Axes) -> Grid {
        Grid::new(clock, axes).unwrap()
    }

    /// Instants at no even distance.
    fn entries() -> Recurring {
        let at_s = (0..60).map(|i| 1500.0 + 2000.0 * f64::from(i) + 700.0 * (1.7 * f64::from(i)).sin()).collect();
        Recurring { what: "start of a pump".into(), at_s }
    }

    #[test]
    fn what_follows_an_hour_later_is_found() {
        let clock = clock(5200);
        for seed in 0..5 {
            let mut axes = white(seed, clock.len());
            for (i, t) in clock.iter().enumerate() {
                let is_on = entries().at_s.iter().any(|at| (3600.0..3800.0).contains(&(t - at)));
                axes[1][i] += if is_on { 0.5 } else { 0.0 };
            }
            let found = delayed(&grid(&clock, &axes), [1.0; 3], clock[0], &[entries()]).unwrap();
            assert!(found.probability < 1e-5 && found.axis == "mostly y", "{seed}: {found:?}");
            let [start, length]: [f64; 2] = ["a push ", ", about "].map(|before| {
                let rest = found.form.split_once(before).unwrap().1;
                rest.split(' ').next().unwrap().parse().unwrap()
            });
            assert!((start - 3600.0).abs() <= 50.0 && (100.0..=400.0).contains(&length), "{found:?}");
        }
    }

    #[test]
    fn jumps_at_even_distances_are_found() {
        let clock = clock(5200);
        for (seed, period_s) in [(0, 16_512.0), (1, 7026.0), (2, 3300.0)] {
            let mut axes = white(seed, clock.len());
            // Behind the filter of slow noise: a quarter of an hour.
            for (i, t) in clock.iter().enumerate() {
                axes[2][i] += if t.rem_euclid(period_s) < 900.0 { 0.9 } else { 0.0 };
            }
            let found = evenly(&grid(&clock, &axes), [1.0; 3], clock[0]).unwrap();
            assert!(found.probability < 1e-4 && found.axis == "mostly z", "{seed}: {found:?}");
            assert!((found.period_s.unwrap() / period_s - 1.0).abs() < 0.01, "{seed}: {found:?}");
        }
    }

    /// One burst a hundred times as sure as any of these would be.
    #[test]
    fn what_happens_once_does_not_come_again() {
        let clock = clock(5200);
        let mut axes = white(3, clock.len());
        for (i, t) in clock.iter().enumerate() {
            axes[0][i] += if (60_000.0..60_800.0).contains(t) { 3.0 } else { 0.0 };
        }
        let grid = grid(&clock, &axes);
        for found in [delayed(&grid, [1.0; 3], clock[0], &[entries()]), evenly(&grid, [1.0; 3], clock[0])] {
            assert!(found.as_ref().is_none_or(|found| found.probability > 1e-3), "{found:?}");
        }
    }

    /// Forty records of each: a probability below a thousandth has one chance in twelve among them.
    #[test]
    fn noise_does_not_come_again_white_or_not() {
        let clock = clock(5200);
        let mut least = [1.0_f64; 2];
        for seed in 0..40 {
            for axes in [white(seed, clock.len()), coloured(seed, clock.len(), 1.4)] {
                let grid = grid(&clock, &axes);
                let asked = [delayed(&grid, [1.0; 3], clock[0], &[entries()]), evenly(&grid, [1.0; 3], clock[0])];
                for (least, found) in least.iter_mut().zip(asked) {
                    *least = least.min(found.map_or(1.0, |found| found.probability));
                }
            }
        }
        assert!(least.iter().all(|p| *p > 1e-3), "{least:?}");
    }
}
