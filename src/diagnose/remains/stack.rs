//! Superposed epochs (Chree 1913): whitened residuals at equal times after many instants are added up, where what is common to all of them
//! grows with their number and noise with its root.

use super::grid::Grid;
use crate::math::robust::{MAD_TO_SIGMA, median};

/// Share of an epoch that must have been recorded.
const RECORDED: f64 = 0.5;

/// Sums over so many places from each place of the grid on.
pub(super) struct Stack {
    /// Places that are added up.
    pub width: usize,
    sums: Vec<Sum>,
}

/// Of the axes, and how many windows are in it; all zero where hardly any is.
#[derive(Clone, Copy)]
struct Sum {
    axes: [f64; 3],
    windows: f64,
}

/// What is common to some epochs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Common {
    /// Of noise, a chi square with a degree of freedom for each axis.
    pub power: f64,
    /// The mean of each axis over its standard error.
    pub mean: [f64; 3],
    /// How many epochs were recorded.
    pub epochs: usize,
}

impl Stack {
    /// Sums in units of what most of them have, and of noise as loud as it was fitted at least.
    pub fn new(grid: &Grid, width: usize) -> Self {
        let windows = running(&grid.recorded(), width);
        let axes: [Vec<f64>; 3] = std::array::from_fn(|k| running(&grid.real(k), width));
        let recorded: Vec<usize> = (0..windows.len()).filter(|i| windows[*i] > RECORDED * width as f64).collect();
        let louder = axes.each_ref().map(|sums| {
            let mut sizes: Vec<f64> = recorded.iter().map(|i| (sums[*i] / windows[*i].sqrt()).abs()).collect();
            median(&mut sizes).map_or(1.0, |middle| (MAD_TO_SIGMA * middle).max(1.0))
        });
        let mut sums = vec![Sum { axes: [0.0; 3], windows: 0.0 }; windows.len()];
        for i in recorded {
            sums[i] = Sum { axes: [0, 1, 2].map(|k| axes[k][i] / louder[k]), windows: windows[i] };
        }
        Self { width, sums }
    }

    /// What is common to the epochs from these places on; those beyond the grid, or hardly recorded, have no part in it.
    pub fn common(&self, places: impl Iterator<Item = usize>) -> Common {
        let (mut axes, mut windows, mut epochs) = ([0.0; 3], 0.0, 0);
        for sum in places.filter_map(|i| self.sums.get(i)) {
            (0..3).for_each(|k| axes[k] += sum.axes[k]);
            windows += sum.windows;
            epochs += usize::from(sum.windows > 0.0);
        }
        let mean = axes.map(|sum| if windows > 0.0 { sum / windows.sqrt() } else { 0.0 });
        Common { power: mean.iter().map(|m| m * m).sum(), mean, epochs }
    }

    /// The largest share that one epoch has in what is common to all of them.
    pub fn largest_share(&self, common: &Common, places: impl Iterator<Item = usize>) -> f64 {
        let along = |sum: &Sum| (0..3).map(|k| sum.axes[k] * common.mean[k]).sum::<f64>();
        let shares: Vec<f64> = places.filter_map(|i| self.sums.get(i)).map(along).collect();
        shares.iter().copied().fold(0.0, f64::max) / shares.iter().sum::<f64>()
    }
}

/// Sums over so many values from each on, as far as there are as many.
fn running(series: &[f64], width: usize) -> Vec<f64> {
    let mut until = vec![0.0];
    for x in series {
        until.push(until[until.len() - 1] + x);
    }
    (width..until.len()).map(|end| until[end] - until[end - width]).collect()
}
