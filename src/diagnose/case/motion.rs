//! Whether the columns of the ancillary data agree: velocities are how positions change, and body rates how attitudes do.
//!
//! Gross errors only, a wrong unit, frame or sign: by the middle of all rows, so that gaps and single rows say nothing.

use nalgebra::{Quaternion, UnitQuaternion};

use super::Ancillary;
use crate::diagnose::error::CaseError;
use crate::math::rms::about_mean;
use crate::math::robust::median;
use crate::physics::Vec3;

/// Longest time between two rows that tell a rate, s: a tenth of an orbit is too long, a hundredth is not.
const STEP_MAX_S: f64 = 130.0;
/// Fewest rows that tell anything.
const ROWS_MIN: usize = 20;
/// Share of its size by which a velocity may be off, and a body rate.
const VELOCITY_SHARE: f64 = 0.2;
const RATE_SHARE: f64 = 0.5;
/// Rates below say nothing, rad/s: a deadband may swing within a step.
const RATE_LEAST_RAD_S: f64 = 2e-4;

/// A swing of the rates that is less is rounding, rad/s.
const SWING_LEAST_RAD_S: f64 = 1e-7;

/// A quantity and the rate of change it should be.
struct Pair {
    given: f64,
    changed: f64,
    apart: f64,
}

impl Pair {
    fn of(given: &Vec3, changed: &Vec3) -> Self {
        Self { given: given.norm(), changed: changed.norm(), apart: (given - changed).norm() }
    }
}

/// Checks both.
///
/// # Errors
/// The column that is not how the other changes.
pub fn agree(file: &str, ancillary: &Ancillary) -> Result<(), CaseError> {
    let clock = &ancillary.clock_s;
    let vector = |v: &[f64; 3]| Vec3::new(v[0], v[1], v[2]);
    let attitude = |q: &[f64; 4]| UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]));
    let around = || (1..clock.len().saturating_sub(1)).filter(|i| clock[i + 1] - clock[i - 1] <= STEP_MAX_S);
    let velocity = around().map(|i| {
        let change = vector(&ancillary.r_m[i + 1]) - vector(&ancillary.r_m[i - 1]);
        Pair::of(&vector(&ancillary.v_m_s[i]), &(change / (clock[i + 1] - clock[i - 1])))
    });
    let rate = around().map(|i| {
        // Body from inertial, so that the body turns by the inverse of what the quaternion changes by.
        let change = attitude(&ancillary.q[i - 1]) * attitude(&ancillary.q[i + 1]).inverse();
        let turned = change.scaled_axis() / (clock[i + 1] - clock[i - 1]);
        let [before, now, after] = [i - 1, i, i + 1].map(|j| vector(&ancillary.w_rad_s[j]));
        let mean = (before + 2.0 * now + after) / 4.0;
        Pair::of(&mean, &turned)
    });
    let velocities = ("vx_m_s, vy_m_s, vz_m_s", "rx_m, ry_m, rz_m", "m/s");
    let rates = ("wx_rad_s, wy_rad_s, wz_rad_s", "qw, qx, qy, qz", "rad/s");
    let turning = rate.filter(|pair| pair.given.max(pair.changed) > RATE_LEAST_RAD_S);
    middle(file, velocities, VELOCITY_SHARE, &velocity.collect::<Vec<Pair>>())?;
    middle(file, rates, RATE_SHARE, &turning.collect::<Vec<Pair>>())
}

/// Share of the swing of the body rates that is missed between the rows of the ancillary data, of the middle row: slews are as they are.
pub fn unresolved(ancillary: &Ancillary) -> f64 {
    let rates: [Vec<f64>; 3] = std::array::from_fn(|k| ancillary.w_rad_s.iter().map(|w| w[k]).collect());
    let about = rates.each_ref().map(|rates| about_mean(rates));
    let norm = |of: &dyn Fn(usize) -> f64| (0..3).map(|k| of(k).powi(2)).sum::<f64>().sqrt();
    let rows = || 0..ancillary.clock_s.len();
    let mut missed: Vec<f64> = rows().map(|i| norm(&|k| super::missed(&ancillary.clock_s, &rates[k], i))).collect();
    let mut swing: Vec<f64> = rows().map(|i| norm(&|k| about[k][i])).collect();
    match [&mut missed, &mut swing].map(|all| median(all).unwrap_or(0.0)) {
        [missed, swing] if swing > SWING_LEAST_RAD_S => missed / swing,
        _ => 0.0,
    }
}

fn middle(
    file: &str,
    (column, other, unit): (&str, &'static str, &'static str),
    share: f64,
    pairs: &[Pair],
) -> Result<(), CaseError> {
    if pairs.len() < ROWS_MIN {
        return Ok(());
    }
    let of = |size: fn(&Pair) -> f64| median(&mut pairs.iter().map(size).collect::<Vec<f64>>()).unwrap_or(0.0);
    let (found, expected, apart) = (of(|p| p.given), of(|p| p.changed), of(|p| p.apart));
    if apart > share * found.max(expected) {
        let (file, column) = (file.into(), column.into());
        return Err(CaseError::Contradiction { file, column, other, unit, found, expected, apart });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates that swing once in 300 s: every minute a row is too few, every 20 s are enough.
    #[test]
    fn rows_that_are_too_few_for_the_motion_are_told() {
        let of = |step_s: f64| {
            let clock_s: Vec<f64> = (0..400).map(|i| step_s * f64::from(i)).collect();
            let swing = |t: &f64| 1e-4 * (std::f64::consts::TAU * t / 300.0).sin();
            let w_rad_s = clock_s.iter().map(|t| [1.1e-3 + swing(t), 0.0, 2e-4]).collect();
            unresolved(&Ancillary { clock_s, w_rad_s, ..Ancillary::default() })
        };
        assert!((0.05..0.2).contains(&of(60.0)) && of(20.0) < 0.005, "{} {}", of(60.0), of(20.0));
    }
}
