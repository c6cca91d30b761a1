//! How nearly one effect imitates another on a record: what it leaves of the other's series, noise or no noise.

use super::{Family, Seen};
use crate::diagnose::catalogue::{Effect, Theta};
use crate::diagnose::design::{Chosen, Column};

/// An imitation.
pub struct Imitation {
    /// Matched-filter SNR of what it leaves.
    pub left_snr: f64,
    /// Where in its nonlinear parameters.
    pub theta: Theta,
}

/// The best imitation of the data behind `chosen`, beside those chosen, by an entry at a size that can be believed; `whole` is the
/// data as a column.
pub fn imitation(seen: &Seen, index: usize, chosen: &Chosen, whole: &Column) -> Option<(&'static Effect, Imitation)> {
    let entry = &seen.bank.entries[index];
    let Family::Listed(effect) = entry.family else { return None };
    let (energy, _) = chosen.left_in(whole);
    let points = seen.bank.points[index].iter().zip(&seen.alone[index]);
    points
        .filter_map(|(point, alone)| {
            let normal = chosen.beside(&point.columns, alone);
            if point.fixed {
                return Some((energy - 2.0 * normal.gain_at_one(), point.theta));
            }
            let (explained, sizes) = normal.free_fit()?;
            let values = sizes.iter().zip(&entry.sizes).map(|(x, size)| x * size);
            let refused = effect.linear.iter().zip(values).any(|(l, value)| l.refuses(value, 0.0).is_some());
            (!refused).then_some((energy - 2.0 * explained, point.theta))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(left, theta)| (effect, Imitation { left_snr: left.max(0.0).sqrt(), theta }))
}
