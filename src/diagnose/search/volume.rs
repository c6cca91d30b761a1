//! The volume of the posterior of nonlinear parameters about their peak, against that of their prior.
//!
//! By Laplace, the evidence falling as a parabola; but along an onset, where it is jagged: one window more or less before the step
//! changes it by that window's noise, and several instants do nearly as well as the best. There it is summed.

use nalgebra::DMatrix;

use crate::diagnose::catalogue::{Effect, Theta};

/// Log of the share of the prior that the posterior fills, never more than all of it, and standard errors, of the parameters `free` of
/// an effect: its log evidence is `gain`, highest (`peak`) at `theta`, where the log density of the prior is `log_density`.
pub fn volume(
    gain: &impl Fn(&Theta) -> f64,
    theta: &Theta,
    free: &[usize],
    effect: &Effect,
    log_density: f64,
    peak: f64,
) -> (f64, Theta) {
    let n = free.len();
    // A wall on one side (a lag cannot be negative) is mirrored: the fall is counted on the open side.
    let mirrored = |t: &Theta| {
        let there = gain(t);
        if there.is_finite() {
            return there;
        }
        gain(&[2.0 * theta[0] - t[0], 2.0 * theta[1] - t[1]])
    };
    let h: Vec<f64> = free.iter().map(|j| half_down(&mirrored, theta, *j, effect.nonlinear[*j].step, peak)).collect();
    let at = |shifts: &[(usize, f64)]| {
        let mut t = *theta;
        shifts.iter().for_each(|(a, s)| t[free[*a]] += s * h[*a]);
        mirrored(&t)
    };
    let mut hessian = DMatrix::zeros(n, n);
    for a in 0..n {
        hessian[(a, a)] = (2.0 * peak - at(&[(a, 1.0)]) - at(&[(a, -1.0)])).clamp(0.05, 1e6) / (h[a] * h[a]);
        for b in 0..a {
            let mixed = (at(&[(a, 1.0), (b, -1.0)]) + at(&[(a, -1.0), (b, 1.0)])
                - at(&[(a, 1.0), (b, 1.0)])
                - at(&[(a, -1.0), (b, -1.0)]))
                / (4.0 * h[a] * h[b]);
            let bound = 0.95 * (hessian[(a, a)] * hessian[(b, b)]).sqrt();
            let mixed = if mixed.is_finite() { mixed.clamp(-bound, bound) } else { 0.0 };
            hessian[(a, b)] = mixed;
            hessian[(b, a)] = mixed;
        }
    }
    let mut sigma = [0.0; 2];
    let Some(inverse) = hessian.clone().try_inverse() else { return (0.0, sigma) };
    for (a, j) in free.iter().enumerate() {
        sigma[*j] = inverse[(a, a)].max(0.0).sqrt();
    }
    let mut log_volume = 0.5 * (n as f64 * std::f64::consts::TAU.ln() - hessian.determinant().max(1e-300).ln());
    for (a, j) in free.iter().enumerate().filter(|(_, j)| effect.nonlinear[**j].jagged) {
        let parabola = (std::f64::consts::TAU / hessian[(a, a)]).sqrt();
        log_volume += (area(gain, theta, *j, h[a], peak) / parabola).ln();
    }
    ((log_volume + log_density).min(0.0), sigma)
}

/// The parameters with another value of one.
fn with(theta: &Theta, j: usize, value: f64) -> Theta {
    let mut theta = *theta;
    theta[j] = value;
    theta
}

/// The step along coordinate `j` at which the evidence falls by about one half: neither rounding nor the far side.
fn half_down(gain: &impl Fn(&Theta) -> f64, theta: &Theta, j: usize, step: f64, peak: f64) -> f64 {
    let mut h = step * 0.1;
    for _ in 0..14 {
        let at = |sign: f64| gain(&with(theta, j, theta[j] + sign * h));
        let drop = peak - 0.5 * (at(1.0) + at(-1.0));
        if !drop.is_finite() || drop > 1.5 {
            h *= 0.6;
        } else if drop < 0.25 {
            h *= 1.5;
        } else {
            break;
        }
    }
    h
}

/// Steps away from the peak begin at about a standard error and grow by so much, up to so many: a thousand standard errors, for the
/// evidence of an onset that is hardly there never falls.
const GROWTH: f64 = 1.4;
const STEPS: usize = 18;
/// Evidence that has fallen by this much adds nothing more.
const NOTHING_MORE: f64 = 10.0;

/// The area under the evidence along coordinate `j`, that at the peak being 1.
fn area(gain: &impl Fn(&Theta) -> f64, theta: &Theta, j: usize, first: f64, peak: f64) -> f64 {
    let side = |sign: f64| {
        let (mut t, mut step) = (*theta, first);
        let (mut before, mut sum) = (1.0, 0.0);
        for _ in 0..STEPS {
            t[j] += sign * step;
            let fallen = peak - gain(&t);
            let here = if fallen.is_finite() { (-fallen).exp() } else { 0.0 };
            sum += 0.5 * (before + here) * step;
            if fallen.is_nan() || fallen > NOTHING_MORE {
                break;
            }
            before = here;
            step *= GROWTH;
        }
        sum
    };
    side(1.0) + side(-1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_under_a_parabola_is_that_of_laplace_and_side_peaks_add_theirs() {
        let parabola = |t: &Theta| 7.0 - 0.5 * (t[0] - 3.0).powi(2) / 16.0;
        let laplace = (std::f64::consts::TAU * 16.0).sqrt();
        let found = area(&parabola, &[3.0, 0.0], 0, 2.0, 7.0);
        assert!((found / laplace).ln().abs() < 0.05, "{found} {laplace}");
        // Beside the peak a plateau lower by one, twenty of its widths long.
        let jagged = |t: &Theta| if (3.0..83.0).contains(&t[0]) { parabola(t).max(6.0) } else { parabola(t) };
        let expected = laplace + 80.0 * (-1.0_f64).exp();
        let found = area(&jagged, &[3.0, 0.0], 0, 2.0, 7.0);
        assert!((found / expected).ln().abs() < 0.25, "{found} {expected}");
    }
}
