//! The error of a time constant, from its posterior: that of a slow decay is long towards slower ones, of which the curvature at its peak
//! knows nothing.

use super::Frame;
use crate::diagnose::catalogue::Effect;
use crate::diagnose::design::Column;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Entry, Set};

/// Steps of the scan to either side, and its half width in errors of the curvature; twice as wide while the posterior is not low at an end.
const STEPS: i32 = 24;
const HALF_WIDTH: f64 = 4.0;
const WIDER: i32 = 3;
/// Log posterior below its top that counts as low.
const LOW: f64 = 6.0;
/// Share of the posterior outside of two standard errors, on either side.
const OUTSIDE: f64 = 0.0228;

/// Standard error of the exponential of nonlinear number `j` of member `i`, whose logarithm has `sigma` by curvature: half of what holds all
/// but the tails, on the longer side. `follow` is by how much the member's other nonlinear number moves with it. None where the posterior
/// says nothing.
pub(super) fn error(
    scene: &Scene,
    frame: &Frame,
    entries: &[Entry],
    set: &Set,
    (i, effect, j): (usize, &Effect, usize),
    (sigma, follow): (f64, f64),
) -> Option<f64> {
    let others = set.without(i);
    let chosen = others.chosen(frame);
    let fitted = set.members[i].theta;
    let sizes = set.members[i].sizes(entries);
    let gain_at = |shift: f64| {
        let mut theta = fitted;
        theta[j] += shift;
        theta[1 - j] += follow * shift;
        let raws = (effect.signature)(scene, &theta)?.columns();
        let columns: Vec<Column> = raws.iter().zip(&sizes).map(|(raw, size)| frame.column(raw, *size)).collect();
        Some(chosen.gain(&columns))
    };
    let scan = |half_width: f64| -> Vec<(f64, f64)> {
        let shifts = (-STEPS..=STEPS).map(|step| half_width * f64::from(step) / f64::from(STEPS));
        shifts.filter_map(|shift| Some((shift, gain_at(shift)?))).collect()
    };
    let top = |posterior: &[(f64, f64)]| posterior.iter().map(|(_, gain)| *gain).fold(f64::NEG_INFINITY, f64::max);
    let mut half_width = HALF_WIDTH * sigma;
    let mut posterior = scan(half_width);
    for _ in 0..WIDER {
        let low = top(&posterior) - LOW;
        let is_low = |end: Option<&(f64, f64)>| end.is_none_or(|(_, gain)| *gain < low);
        if is_low(posterior.first()) && is_low(posterior.last()) {
            break;
        }
        half_width *= 2.0;
        posterior = scan(half_width);
    }
    let value = fitted[j].exp();
    longer_side(&posterior).map(|shift| 0.5 * ((fitted[j] + shift).exp() - value).abs())
}

/// The shift beyond which a tail lies, on the side on which it is farther, as a factor; `posterior` has shifts in order and their logarithms.
fn longer_side(posterior: &[(f64, f64)]) -> Option<f64> {
    let top = posterior.iter().map(|(_, gain)| *gain).fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = posterior.iter().map(|(_, gain)| (gain - top).exp()).collect();
    let total: f64 = weights.iter().sum();
    let quantile = |share: f64| {
        let mut below = 0.0;
        posterior.iter().zip(&weights).find_map(|((shift, _), weight)| {
            below += weight / total;
            (below >= share).then_some(*shift)
        })
    };
    let (low, high) = (quantile(OUTSIDE)?, quantile(1.0 - OUTSIDE)?);
    // In the number itself, whose logarithm is scanned.
    Some(if high.exp() - 1.0 >= 1.0 - low.exp() { high } else { low })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longer_side_of_a_posterior_is_told() {
        let normal =
            |sigma: f64| move |step: i32| (f64::from(step) * 0.01, -0.5 * (f64::from(step) * 0.01 / sigma).powi(2));
        // Narrow: two standard errors to either side, and in the number itself the upper one is farther.
        let narrow: Vec<(f64, f64)> = (-40..=40).map(normal(0.05)).collect();
        assert!((longer_side(&narrow).unwrap() - 0.10).abs() < 0.011);
        let skewed: Vec<(f64, f64)> = (-100..=300).map(|step| normal(if step < 0 { 0.1 } else { 0.8 })(step)).collect();
        let upper = longer_side(&skewed).unwrap();
        assert!((1.5..2.0).contains(&upper), "{upper}");
        assert_eq!(longer_side(&[]), None);
    }
}
