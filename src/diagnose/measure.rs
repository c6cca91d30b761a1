//! The recorder's view of anything: the mean over its 50 s window at the recorded instants.
//!
//! Everything compared with the recording passes through here: the simulation and every regressor alike. A mask is
//! a window that is absent from `clock_s`; nothing is ever filled in.

use std::ops::{Add, Mul};

use super::case::HALF_WINDOW_S;

/// Window means at given instants of a series on a given grid, the series being linear between its grid points.
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

    /// One window: the integrals of the hat functions over it. What lies beyond the grid takes the value at its edge.
    fn push_window(&mut self, grid: &[f64], cell: usize, low: f64, high: f64) {
        self.first.push(cell as u32);
        let base = self.weight.len();
        self.weight.push(0.0);
        let width = high - low;
        let mut j = cell;
        loop {
            let [left, right] = [grid[j], grid[j + 1]];
            let from = if j == 0 { low } else { low.max(left) };
            let to = if j + 2 == grid.len() { high } else { high.min(right) };
            self.weight.push(0.0);
            if to > from {
                let at = ((0.5 * (from + to) - left) / (right - left)).clamp(0.0, 1.0);
                let share = (to - from) / width;
                self.weight[base + j - cell] += share * (1.0 - at);
                self.weight[base + j - cell + 1] += share * at;
            }
            if right >= high || j + 2 >= grid.len() {
                break;
            }
            j += 1;
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
        sum += 0.5 * (series[j] + series[j + 1]) * (grid[j + 1] - grid[j]);
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
        let (j, into) = (*cell, t - grid[*cell]);
        let slope = (series[j + 1] - series[j]) / (grid[j + 1] - grid[j]);
        integral[j] + into * (series[j] + 0.5 * slope * into)
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
    use crate::physics::Vec3;

    #[test]
    fn a_window_mean_of_a_line_is_its_value_at_the_centre_and_of_a_parabola_exceeds_it_as_the_trapezoid_does() {
        let grid: Vec<f64> = (0..50).map(|i| 20.0 * i as f64).collect();
        let clock = [100.0, 107.0, 400.0, 412.5];
        let m = Measurement::new(&grid, &clock);
        let line: Vec<f64> = grid.iter().map(|t| 3.0 * t - 5.0).collect();
        for (value, t) in m.apply(&line).iter().zip(clock) {
            assert!((value - (3.0 * t - 5.0)).abs() < 1e-9, "{value} at {t}");
        }
        let ones = m.apply(&vec![1.0; 50]);
        assert!(ones.iter().all(|w| (w - 1.0).abs() < 1e-12), "{ones:?}");
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
