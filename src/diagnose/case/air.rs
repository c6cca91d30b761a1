//! Whether the density is that of air at the height of the orbit: within a factor of a hundred of NRLMSISE-00.
//!
//! What is off by more is another unit (g/cm3 make a factor of a thousand) and would be answered as missing drag. A simulation without
//! drag may have no density at all.

use super::{Ancillary, Header};
use crate::diagnose::error::CaseError;
use crate::math::robust::median;
use crate::physics::Vec3;
use crate::physics::density::{Activity, Atmosphere};
use crate::physics::geodetic::place;

/// Rows that are asked.
const ROWS: usize = 48;
/// Heights at which the density of quiet and of stormy days lies within a factor of thirty of that of [`MIDDLE`], m: see the test.
const HEIGHT_M: [f64; 2] = [120e3, 500e3];
/// By how much the density may differ from the model's, to the next power of ten.
const FACTOR: f64 = 100.0;
/// Neither quiet nor stormy.
const MIDDLE: Activity = Activity { f107: 120.0, f107_average: 120.0, ap: 12.0 };

/// Checks it, by the middle of some rows.
///
/// # Errors
/// When the density is of another order; both in the sentence.
pub fn agrees(file: &str, header: &Header, ancillary: &Ancillary) -> Result<(), CaseError> {
    let atmosphere = Atmosphere::default();
    let epoch_s = header.epoch_utc.as_second() as f64;
    let modelled = |i: usize| {
        let (unix_s, r_m) = (epoch_s + ancillary.clock_s[i], Vec3::from(ancillary.r_m[i]));
        let height_m = place(unix_s, &r_m).ok()?.height_m;
        let here = (HEIGHT_M[0]..=HEIGHT_M[1]).contains(&height_m);
        here.then(|| atmosphere.density_kg_m3(unix_s, &r_m, &MIDDLE).ok()).flatten()
    };
    let step = ancillary.clock_s.len().div_ceil(ROWS);
    let rows = (0..ancillary.clock_s.len()).step_by(step).filter(|i| ancillary.density_kg_m3[*i] > 0.0);
    let (mut given, mut expected): (Vec<f64>, Vec<f64>) =
        rows.filter_map(|i| Some((ancillary.density_kg_m3[i], modelled(i)?))).unzip();
    let (Some(found), Some(expected)) = (median(&mut given), median(&mut expected)) else { return Ok(()) };
    let [low, high] = [(expected / FACTOR).log10().floor(), (expected * FACTOR).log10().ceil()].map(|x| 10f64.powf(x));
    if (low..=high).contains(&found) {
        return Ok(());
    }
    let column = "density_kg_m3 (at this height)".into();
    Err(CaseError::Unit { file: file.into(), column, found, unit: "kg/m3", low, high })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The quietest and the stormiest days of a century, by day and by night.
    #[test]
    fn the_density_of_any_day_is_within_a_factor_of_thirty() {
        let atmosphere = Atmosphere::default();
        let quiet = Activity { f107: 65.0, f107_average: 66.0, ap: 0.0 };
        let stormy = Activity { f107: 300.0, f107_average: 250.0, ap: 300.0 };
        for height_m in [HEIGHT_M[0], 200e3, 300e3, 400e3, HEIGHT_M[1]] {
            for unix_s in (0..8).map(|hour| 773_000_000.0 + 10_800.0 * f64::from(hour)) {
                let r_m = Vec3::new(6_378_137.0 + height_m, 0.0, 0.0);
                let density = |activity| atmosphere.density_kg_m3(unix_s, &r_m, activity).unwrap();
                let middle = density(&MIDDLE);
                for other in [density(&quiet), density(&stormy)] {
                    let factor = (other / middle).max(middle / other);
                    assert!(factor < 30.0, "{height_m} m: {factor}");
                }
            }
        }
    }
}
