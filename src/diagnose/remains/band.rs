//! Is what is left louder about some period than its noise?

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::grid::Grid;
use crate::diagnose::noise::Schedule;
use crate::diagnose::search::Left;

/// A band reaches from its middle by this share of its frequency to either side, and so does the step to the next.
const REACH: f64 = 0.125;
/// Probability at or below which white noise is not so loud in any band of an axis.
const CHANCE: f64 = 1e-3;

/// The period, s, between two, about which each axis of what a hypothesis leaves is louder than the noise fitted to it: the least probable
/// of white noise, where it is improbable at all.
pub fn loud_about_s(left: &Left, schedule: &Schedule, between_s: [f64; 2]) -> [Option<f64>; 3] {
    Grid::new(&schedule.clock_s, &left.whitened).map_or([None; 3], |grid| of_grid(&grid, between_s))
}

fn of_grid(grid: &Grid, [shortest_s, longest_s]: [f64; 2]) -> [Option<f64>; 3] {
    let last = grid.span_s() / shortest_s;
    let middles = std::iter::successors(Some(grid.span_s() / longest_s), |m| Some(m * (1.0 + REACH)));
    let bands: Vec<[usize; 2]> = middles
        .take_while(|m| *m <= last)
        .map(|m| [(m * (1.0 - REACH)).ceil() as usize, ((m * (1.0 + REACH)) as usize).min(grid.length() / 2 - 1)])
        .filter(|[low, high]| 0 < *low && low < high)
        .collect();
    grid.spectra(0.0).map(|spectrum| {
        let probability = |[low, high]: [usize; 2]| {
            let power: f64 = spectrum[low..=high].iter().map(|x| x.norm_sqr()).sum();
            // Two numbers a line of the spectrum, as far as the windows fill the grid.
            let filled = grid.windows / grid.length() as f64;
            let degrees = 2.0 * (high - low + 1) as f64 * filled;
            ChiSquared::new(degrees).map_or(1.0, |d| d.sf(2.0 * filled * power))
        };
        let ([low, high], least) =
            bands.iter().map(|band| (*band, probability(*band))).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (least * bands.len() as f64 <= CHANCE).then(|| 2.0 * grid.span_s() / (low + high) as f64)
    })
}

#[cfg(test)]
mod tests {
    use super::super::grid::tests::{clock, coloured, white};
    use super::*;

    const BETWEEN_S: [f64; 2] = [100.0, 2400.0];

    #[test]
    fn a_band_louder_than_the_noise_is_where_it_was_made() {
        let clock = clock(5000);
        for seed in 0..10 {
            let grid = Grid::new(&clock, &coloured(seed, clock.len(), 2.0)).unwrap();
            for about_s in of_grid(&grid, BETWEEN_S) {
                assert!(about_s.is_some_and(|s| (1100.0..2000.0).contains(&s)), "{seed}: {about_s:?}");
            }
        }
    }

    /// Two hundred records of three axes: one in a thousand axes is allowed, and more than four of six hundred come in one lot of 2,500.
    #[test]
    fn white_noise_is_loud_nowhere() {
        let clock = clock(2000);
        let loud = |seed| {
            let grid = Grid::new(&clock, &white(seed, clock.len())).unwrap();
            of_grid(&grid, BETWEEN_S).iter().flatten().count()
        };
        let all: usize = (0..200).map(loud).sum();
        assert!(all <= 4, "{all}");
    }
}
