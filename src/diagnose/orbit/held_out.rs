//! What the first half of an arc says of the second, where the recording leaves nothing beyond the fit to predict. Not here: the
//! prediction of what follows `fit_hours`, which the fit itself flies on to (see `search`).

use super::arc::{Arc, ArcFit, EPOCHS_MIN, solve};
use super::search::{Level, Problem, predicted_m, residual};

/// Rms of the 3-D residual over the second half of an arc, m, when its state and the coefficients of its level are fitted to the
/// first half alone: linear about the fit of the whole arc, from which neither half is far. None where the halves are too short,
/// or where a velocity step in the second half is what no first half can know.
fn second_half_predicted_m(arc: &Arc, fit: &ArcFit) -> Option<f64> {
    let (first, last) = (arc.t_s[0], arc.t_s[arc.fitted - 1]);
    let middle = 0.5 * (first + last);
    let half = arc.t_s[..arc.fitted].partition_point(|t| *t <= middle);
    if half < EPOCHS_MIN || arc.fitted - half < EPOCHS_MIN || fit.impulses.iter().any(|kick| kick.at_s > middle) {
        return None;
    }
    let (seen, unseen) = (3 * half, 3 * (arc.fitted - half));
    let design = fit.partials.rows(0, seen + unseen).select_columns(&fit.fitted_columns(|_| true));
    let residual = residual(arc, fit);
    let step = solve(&design.rows(0, seen).into_owned(), &residual.rows(0, seen).into_owned())?;
    let left = residual.rows(seen, unseen) - design.rows(seen, unseen) * step;
    let rms = (left.norm_squared() / (arc.fitted - half) as f64).sqrt();
    rms.is_finite().then_some(rms)
}

/// What every arc is missed by, and in which way, m: what follows `fit_hours`, or where nothing does the second half of each.
pub fn missed_m(problem: &Problem, level: &Level) -> (&'static str, Vec<Option<f64>>) {
    let each = |of: fn(&Arc, &ArcFit) -> Option<f64>| -> Vec<Option<f64>> {
        problem.arcs.iter().zip(&level.fits).map(|(arc, fit)| of(arc, fit)).collect()
    };
    let beyond = each(predicted_m);
    match beyond.iter().any(Option::is_some) {
        true => ("what follows fit_hours, predicted; median of the arcs, 3-D", beyond),
        false => {
            ("the second half of each arc, from its first; median of the arcs, 3-D", each(second_half_predicted_m))
        }
    }
}
