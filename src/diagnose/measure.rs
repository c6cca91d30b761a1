//! The recorder's view of anything: the mean over its 50 s window at the recorded instants.
//!
//! Everything compared with the recording passes through here: the simulation and every regressor alike. A mask is
//! a window that is absent from `clock_s`; nothing is ever filled in.

use std::ops::{Add, Mul};

use super::case::HALF_WINDOW_S;

/// How many times as long as the next one a step of the grid may be for a series to be taken as smooth across both.
const ALIKE: f64 = 3.0;

/// Weights of four grid points from `first` on with which a series counts; those there are not count nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Weights {
    first: usize,
    of: [f64; 4],
}

impl Weights {
    /// Their sum over a series.
    fn of(&self, series: &[f64]) -> f64 {
        self.of.iter().zip(&series[self.first..]).map(|(w, x)| w * x).sum()
    }
}

/// The integral from grid point `j` to `t`, at or before the next one, of a series that goes smoothly: by the cubic through both points and
/// their neighbours. A neighbour whose step is much longer or shorter is left out: nothing is smooth across a hole or a jump.
fn integral_until(grid: &[f64], j: usize, t: f64) -> Weights {
    let step = grid[j + 1] - grid[j];
    let is_alike = |other: f64| other < ALIKE * step && step < ALIKE * other;
    let before = j.checked_sub(1).map(|i| grid[j] - grid[i]).filter(|step| is_alike(*step));
    let after = grid.get(j + 2).map(|next| next - grid[j + 1]).filter(|step| is_alike(*step));
    if before == Some(step) && after == Some(step) {
        let u = (t - grid[j]) / step;
        let [u2, u3, u4] = [u * u, u * u * u, 0.25 * u * u * u * u];
        let of = [
            (u3 - u2 - u4) / 6.0,
            u + 0.5 * u4 - u3 / 3.0 - 0.25 * u2,
            0.5 * (u2 + u3 / 3.0 - u4),
            (u4 - 0.5 * u2) / 6.0,
        ];
        return Weights { first: j - 1, of: of.map(|w| w * step) };
    }
    let first = if before.is_some() { j - 1 } else { j };
    let points = &grid[first..j + 2 + usize::from(after.is_some())];
    // Two points of Gauss's rule, exact for a cubic.
    let half = 0.5 * (t - grid[j]);
    let mut of = [0.0; 4];
    for at in [-1.0, 1.0].map(|side| grid[j] + half * (1.0 + side / 3.0_f64.sqrt())) {
        for (i, (w, own)) in of.iter_mut().zip(points).enumerate() {
            let others = points.iter().enumerate().filter(|(other, _)| *other != i);
            *w += half * others.map(|(_, other)| (at - other) / (own - other)).product::<f64>();
        }
    }
    Weights { first, of }
}

/// What cubics miss of the integral over a cell, in fourth differences: the next term of the series.
const NEXT_TERM: f64 = 11.0 / 720.0;

/// Whether the points of a grid are evenly spaced, but for the rounding of a clock.
pub fn is_even(grid: &[f64]) -> bool {
    let step = (grid[grid.len() - 1] - grid[0]) / (grid.len() - 1) as f64;
    grid.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() < 1e-3 * step)
}

/// The fourth difference of five values.
pub fn fourth_difference(x: &[f64]) -> f64 {
    x[0] + x[4] - 4.0 * (x[1] + x[3]) + 6.0 * x[2]
}

/// What [`Measurement`] misses of a series about each grid point where steps are even; nothing is known of it elsewhere.
pub fn missed_by_cubics(grid: &[f64], series: &[f64]) -> Vec<f64> {
    let mut missed = vec![0.0; series.len()];
    for ((missed, x), grid) in missed.iter_mut().skip(2).zip(series.windows(5)).zip(grid.windows(5)) {
        if is_even(grid) {
            *missed = NEXT_TERM * fourth_difference(x);
        }
    }
    missed
}

/// Window means at given instants of a series on a given grid, the series being smooth between its grid points: a cubic through the nearest
/// four. A straight line would take half a percent from a motion of 500 s on a grid of 20 s.
#[derive(Debug, Clone)]
pub struct Measurement {
    first: Vec<u32>,
    start: Vec<u32>,
    weight: Vec<f64>,
}

impl Measurement {
    /// Weights of `grid` for windows centred on `clock_s`.
    pub fn new(grid: &[f64], clock_s: &[f64]) -> Self {
        let mut measurement = Self { first: Vec::with_capacity(clock_s.len()), start: vec![0], weight: Vec::new() };
        let mut cell = 0;
        for &centre in clock_s {
            let [low, high] = [centre - HALF_WINDOW_S, centre + HALF_WINDOW_S];
            while cell > 0 && grid[cell] > low {
                cell -= 1;
            }
            while cell + 2 < grid.len() && grid[cell + 1] <= low {
                cell += 1;
            }
            measurement.push_window(grid, cell, low, high);
        }
        measurement
    }

    /// One window: the integral over it, cell by cell. What lies beyond the grid takes the value at its edge.
    fn push_window(&mut self, grid: &[f64], cell: usize, low: f64, high: f64) {
        let (first, base, last) = (cell.saturating_sub(1), self.weight.len(), grid.len() - 1);
        self.first.push(first as u32);
        let mut add = |at: usize, seconds: f64| {
            let place = base + at - first;
            if self.weight.len() <= place {
                self.weight.resize(place + 1, 0.0);
            }
            self.weight[place] += seconds / (high - low);
        };
        if low < grid[0] {
            add(0, grid[0].min(high) - low);
        }
        if high > grid[last] {
            add(last, high - grid[last].max(low));
        }
        for j in (cell..last).take_while(|j| grid[*j] < high) {
            let [from, to] = [low, high].map(|t| t.clamp(grid[j], grid[j + 1]));
            let [before, until] = [from, to].map(|t| integral_until(grid, j, t));
            for (i, (before, within)) in before.of.iter().zip(until.of).enumerate().filter(|(_, (a, b))| **a != *b) {
                add(until.first + i, within - before);
            }
        }
        self.start.push(self.weight.len() as u32);
    }

    /// Number of windows.
    pub fn windows(&self) -> usize {
        self.first.len()
    }

    /// Window means of `series`, given on the grid.
    pub fn apply(&self, series: &[f64]) -> Vec<f64> {
        (0..self.first.len())
            .map(|i| {
                let weights = &self.weight[self.start[i] as usize..self.start[i + 1] as usize];
                let values = &series[self.first[i] as usize..];
                weights.iter().zip(values).map(|(w, x)| w * x).sum()
            })
            .collect()
    }
}

/// What follows a series with a time constant, the series, of numbers or vectors, being linear between its grid points; it begins as the
/// series does.
pub fn relaxing<T>(grid: &[f64], series: &[T], tau_s: f64) -> Vec<T>
where
    T: Copy + Add<Output = T> + Mul<f64, Output = T>,
{
    let Some(first) = series.first() else { return Vec::new() };
    let mut state = *first;
    let steps = grid.windows(2).zip(series.windows(2)).map(|(t, x)| {
        state = relaxed(state, [x[0], x[1]], t[1] - t[0], tau_s);
        state
    });
    std::iter::once(*first).chain(steps.collect::<Vec<T>>()).collect()
}

/// Where what follows with a time constant comes to from a `state`, while what it follows goes straight `from` one value to another.
pub fn relaxed<T>(state: T, [from, to]: [T; 2], step_s: f64, tau_s: f64) -> T
where
    T: Add<Output = T> + Mul<f64, Output = T>,
{
    let decay = (-step_s / tau_s).exp();
    // Of a ramp over the step, its end counts by `ramp` and its beginning by what is left of the step's own share.
    let ramp = 1.0 - (1.0 - decay) * tau_s / step_s;
    state * decay + to * ramp + from * (1.0 - decay - ramp)
}

/// Window means as [`Measurement`] gives them, at any offset of the clock: one that runs ahead by `ahead_s` labels late. From the integral
/// of the series, since weights serve one offset alone.
pub fn window_means(grid: &[f64], series: &[f64], clock_s: &[f64], ahead_s: f64) -> Vec<f64> {
    let last = grid.len() - 1;
    let mut integral = Vec::with_capacity(grid.len());
    let mut sum = 0.0;
    integral.push(sum);
    for j in 0..last {
        sum += integral_until(grid, j, grid[j + 1]).of(series);
        integral.push(sum);
    }
    // What lies beyond the grid takes the value at its edge.
    let until = |t: f64, cell: &mut usize| {
        if t <= grid[0] {
            return series[0] * (t - grid[0]);
        }
        if t >= grid[last] {
            return sum + series[last] * (t - grid[last]);
        }
        while grid[*cell + 1] < t {
            *cell += 1;
        }
        integral[*cell] + integral_until(grid, *cell, t).of(series)
    };
    let (mut low, mut high) = (0, 0);
    let mean = |t: &f64| {
        let centre = t - ahead_s;
        let inside = until(centre + HALF_WINDOW_S, &mut high) - until(centre - HALF_WINDOW_S, &mut low);
        inside / (2.0 * HALF_WINDOW_S)
    };
    clock_s.iter().map(mean).collect()
}

/// Spans in order, those that overlap or touch made one.
pub fn union(mut spans: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    spans.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut merged: Vec<[f64; 2]> = Vec::new();
    for [from, to] in spans {
        match merged.last_mut() {
            Some(last) if from <= last[1] => last[1] = last[1].max(to),
            _ => merged.push([from, to]),
        }
    }
    merged
}

/// Share of each window that lies inside any of the spans; overlapping spans count each.
pub fn coverage(clock_s: &[f64], spans: &[[f64; 2]]) -> Vec<f64> {
    weighted_coverage(clock_s, spans.iter().map(|span| (*span, 1.0)))
}

/// The same of spans that count for so much each.
pub fn weighted_coverage(clock_s: &[f64], spans: impl IntoIterator<Item = ([f64; 2], f64)>) -> Vec<f64> {
    let mut share = vec![0.0; clock_s.len()];
    for ([from, to], weight) in spans {
        let first = clock_s.partition_point(|t| t + HALF_WINDOW_S <= from);
        for (i, t) in clock_s.iter().enumerate().skip(first) {
            if t - HALF_WINDOW_S >= to {
                break;
            }
            let inside = ((t + HALF_WINDOW_S).min(to) - (t - HALF_WINDOW_S).max(from)).max(0.0);
            share[i] += weight * inside / (2.0 * HALF_WINDOW_S);
        }
    }
    share
}

/// Time constants after which a decaying push counts as gone (6e-6 of it is left).
const DECAYED: f64 = 12.0;

/// Window mean of a push that starts at `onset_s` and decays with `tau_s` (infinite: a step).
pub fn decay(clock_s: &[f64], onset_s: f64, tau_s: f64) -> Vec<f64> {
    clock_s
        .iter()
        .map(|t| {
            let high = t + HALF_WINDOW_S - onset_s;
            let low = (t - HALF_WINDOW_S - onset_s).max(0.0);
            if high <= 0.0 || low > DECAYED * tau_s {
                0.0
            } else if tau_s.is_infinite() {
                (high - low) / (2.0 * HALF_WINDOW_S)
            } else {
                tau_s * ((-low / tau_s).exp() - (-high / tau_s).exp()) / (2.0 * HALF_WINDOW_S)
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rms::rms;
    use crate::physics::Vec3;

    #[test]
    fn a_window_mean_of_a_line_is_its_value_at_the_centre_and_that_of_a_cubic_its_own() {
        let grid: Vec<f64> = (0..50).map(|i| 20.0 * i as f64).collect();
        let clock = [100.0, 107.0, 400.0, 412.5];
        let m = Measurement::new(&grid, &clock);
        let line: Vec<f64> = grid.iter().map(|t| 3.0 * t - 5.0).collect();
        for (value, t) in m.apply(&line).iter().zip(clock) {
            assert!((value - (3.0 * t - 5.0)).abs() < 1e-9, "{value} at {t}");
        }
        let cubic: Vec<f64> = grid.iter().map(|t| (t / 100.0).powi(3) - t / 7.0).collect();
        for (value, t) in m.apply(&cubic).iter().zip(clock) {
            let [low, high] = [t - 25.0, t + 25.0].map(|t: f64| 25.0 * (t / 100.0).powi(4) - t * t / 14.0);
            assert!((value - (high - low) / 50.0).abs() < 1e-9, "{value} at {t}");
        }
        let ones = m.apply(&vec![1.0; 50]);
        assert!(ones.iter().all(|w| (w - 1.0).abs() < 1e-12), "{ones:?}");
    }

    /// A motion of 500 s on a grid of 20 s, even or not, with a hole and at its ends, against the integral of the sine itself.
    #[test]
    fn a_window_mean_of_a_quick_motion_is_its_own_to_some_hundredths_of_a_percent() {
        let even: Vec<f64> = (0..400).map(|i| 20.0 * f64::from(i)).collect();
        let uneven: Vec<f64> = even.iter().enumerate().map(|(i, t)| t + 3.0 * (i as f64).sin()).collect();
        let rate = std::f64::consts::TAU / 500.0;
        for (grid, most) in [(even, 2e-4), (uneven, 4e-4)] {
            let series: Vec<f64> = grid.iter().map(|t| (rate * t).sin()).collect();
            let clock: Vec<f64> = (1..310).map(|i| 100.0 + 25.0 * f64::from(i)).collect();
            let mean = |t: f64| ((rate * (t - 25.0)).cos() - (rate * (t + 25.0)).cos()) / (50.0 * rate);
            for (measured, t) in Measurement::new(&grid, &clock).apply(&series).iter().zip(&clock) {
                assert!((measured - mean(*t)).abs() < most, "{measured} {} at {t}", mean(*t));
            }
            // The first and last windows have no neighbour beyond.
            let ends = [grid[0] + 25.0, grid[399] - 25.0];
            for (measured, t) in Measurement::new(&grid, &ends).apply(&series).iter().zip(ends) {
                assert!((measured - mean(t)).abs() < 2e-3, "{measured} {} at {t}", mean(t));
            }
        }
    }

    /// Motions that are hardly resolved: what is told of what is missed is that, but for a part.
    #[test]
    fn what_cubics_miss_is_known_in_the_main() {
        let grid: Vec<f64> = (0..400).map(|i| 60.0 * f64::from(i)).collect();
        let clock: Vec<f64> = (0..400).map(|i| 300.0 + 25.0 * f64::from(i)).collect();
        for (period_s, left) in [(300.0, 0.6), (600.0, 0.2)] {
            let rate = std::f64::consts::TAU / period_s;
            let series: Vec<f64> = grid.iter().map(|t| (rate * t).sin()).collect();
            let m = Measurement::new(&grid, &clock);
            let mean = |t: f64| ((rate * (t - 25.0)).cos() - (rate * (t + 25.0)).cos()) / (50.0 * rate);
            let off: Vec<f64> = m.apply(&series).iter().zip(&clock).map(|(x, t)| mean(*t) - x).collect();
            let told = m.apply(&missed_by_cubics(&grid, &series));
            let rest: Vec<f64> = off.iter().zip(&told).map(|(off, told)| off - told).collect();
            assert!(rms(&rest) < left * rms(&off), "{period_s}: {} of {}", rms(&rest), rms(&off));
        }
    }

    /// A jump that is written as two rows a millisecond apart stays one: what is beside it takes nothing from it.
    #[test]
    fn a_jump_between_two_near_rows_disturbs_nothing_beside_it() {
        let grid: Vec<f64> = (0..50)
            .map(|i| 20.0 * f64::from(i))
            .flat_map(|t| if t == 500.0 { vec![t, t + 0.001] } else { vec![t] })
            .collect();
        let step: Vec<f64> = grid.iter().map(|t| if *t > 500.0 { 1.0 } else { 0.0 }).collect();
        let seen = Measurement::new(&grid, &[460.0, 475.0, 500.0, 525.1, 540.0]).apply(&step);
        for (seen, expected) in seen.iter().zip([0.0, 0.0, 0.5, 1.0, 1.0]) {
            assert!((seen - expected).abs() < 1e-4, "{seen} {expected}");
        }
    }

    #[test]
    fn the_integral_gives_the_means_that_the_weights_give() {
        let grid: Vec<f64> = (0..400).map(|i| 20.0 * f64::from(i) + f64::from(i % 7)).collect();
        let series: Vec<f64> = grid.iter().map(|t| 80.0 * (t / 900.0).sin() + t % 61.0).collect();
        let clock: Vec<f64> = (0..240).map(|i| 700.0 + 25.3 * f64::from(i)).collect();
        for ahead in [-590.0, -33.3, 0.0, 0.1, 610.0] {
            let shifted: Vec<f64> = clock.iter().map(|t| t - ahead).collect();
            let weighed = Measurement::new(&grid, &shifted).apply(&series);
            let integrated = window_means(&grid, &series, &clock, ahead);
            assert!(weighed.iter().zip(&integrated).all(|(a, b)| (a - b).abs() < 1e-9), "{ahead}");
        }
        assert_eq!(window_means(&[0.0, 10.0], &[2.0, 5.0], &[-100.0, 200.0], 0.0), [2.0, 5.0]);
    }

    #[test]
    fn a_clock_ahead_labels_late() {
        let grid: Vec<f64> = (0..50).map(|i| 20.0 * i as f64).collect();
        assert!((window_means(&grid, &grid, &[300.0], 40.0)[0] - 260.0).abs() < 1e-9);
    }

    #[test]
    fn a_pulse_inside_the_window_counts_by_its_share() {
        assert_eq!(coverage(&[100.0, 125.0, 150.0], &[[110.0, 130.0]]), vec![0.3, 0.4, 0.1]);
        let overlapping = vec![[120.0, 130.0], [110.0, 125.0], [400.0, 410.0]];
        assert_eq!(union(overlapping), [[110.0, 130.0], [400.0, 410.0]]);
        let step = decay(&[100.0, 125.0, 150.0], 125.0, f64::INFINITY);
        assert_eq!(step, vec![0.0, 0.5, 1.0]);
        let slow = decay(&[100.0, 125.0, 150.0], 125.0, 1e9);
        assert!(step.iter().zip(slow).all(|(a, b)| (a - b).abs() < 1e-6));
    }

    /// A step from one grid point to the next is a ramp: what follows it is e^(-t/tau) short of its end, by the mean of that over the ramp.
    #[test]
    fn what_follows_a_step_comes_near_it_exponentially_on_every_axis() {
        let grid_s: Vec<f64> = (0..200).map(|i| 20.0 * f64::from(i)).collect();
        let step: Vec<Vec3> = grid_s.iter().map(|t| Vec3::new(f64::from(u8::from(*t > 1000.0)), 1.0, 0.0)).collect();
        let late = relaxing(&grid_s, &step, 400.0);
        let at = |t: f64| late[(t / 20.0) as usize];
        assert_eq!((at(1000.0).x, at(1000.0).y), (0.0, 1.0));
        let short: f64 =
            (0..20_000).map(|i| (-(400.0 - 0.001 * (f64::from(i) + 0.5)) / 400.0).exp()).sum::<f64>() / 20_000.0;
        assert!((at(1400.0).x - (1.0 - short)).abs() < 1e-9, "{} {short}", at(1400.0).x);
    }
}
