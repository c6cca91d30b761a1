//! A calibrated sensor's series against what its simulation holds (a constant, as a rule, or a reference beside it): what it
//! follows beside, axis by axis, with controls in which nothing is expected.
//!
//! Everything is judged on block means, against a slow wander as the competitor (`red`): a wander agrees with any slow
//! covariate by chance. Not here: orbits, poses.

mod blunders;
pub mod follow;
pub mod form;
mod likely;
pub mod read;
mod red;
mod report;
pub mod search;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

pub use self::follow::Follows;
use self::read::Series;
use self::search::{AxisFound, included, search};
use crate::diagnose::measured::plates::{Plates, SeriesPlate};
use crate::diagnose::measured::{Answer, MeasuredCase, MeasuredError};

/// Analyse a series.
pub fn diagnose(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<(Answer, Plates), MeasuredError> {
    let series = read::series(case, files)?;
    let mut found = Vec::new();
    for axis in &series.axes {
        let own = if axis.control { Vec::new() } else { included(case, &series, axis)? };
        found.push(search(&series, axis, &own));
    }
    let answer = report::answer(case, &series, &found);
    Ok((answer, Plates::Series(plates(&series, &found))))
}

fn plates(series: &Series, found: &[AxisFound]) -> Vec<SeriesPlate> {
    let one = |(axis, found): (&read::Axis, &AxisFound)| SeriesPlate {
        name: axis.column.clone(),
        unit: axis.unit.clone(),
        t_s: series.t_s.clone(),
        before: found.fits[0].residuals.clone(),
        after: found.last().residuals.clone(),
        control: axis.control,
    };
    series.axes.iter().zip(found).map(one).collect()
}
