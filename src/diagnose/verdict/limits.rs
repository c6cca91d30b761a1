//! How small everything that is not claimed must be.

use crate::diagnose::answer::UpperLimit;
use crate::diagnose::design::{Chosen, Column, Frame};
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Family, Set};
use crate::diagnose::solve::Library;
use crate::math::rms::rms_about_mean;
use crate::math::shared_work;

/// 95 % limits on the size of every listed effect that is not claimed, beside what is.
pub fn upper_limits(scene: &Scene, library: &Library, frame: &Frame, set: &Set) -> Vec<UpperLimit> {
    let chosen = set.chosen(frame);
    let n = scene.schedule.len() as f64;
    let listed: Vec<usize> = (0..library.listed).collect();
    let limit = |index: &usize| {
        let entry = &library.entries[*index];
        let Family::Listed(effect) = entry.family else { return None };
        if set.members.iter().any(|m| m.entry == *index) {
            return None;
        }
        // A dozen of the starting points: the loosest of them is the limit.
        let stride = entry.points.len().div_ceil(12);
        let limits = entry.points.iter().step_by(stride).map(|(_, shape)| {
            let raws = shape.columns();
            let scales: Vec<f64> = raws
                .iter()
                .map(|raw| (raw.iter().flatten().map(|s| rms_about_mean(s).powi(2)).sum::<f64>()).sqrt().max(1e-30))
                .collect();
            let columns: Vec<Column> = raws.iter().zip(&scales).map(|(raw, s)| frame.column(raw, 300.0 / s)).collect();
            let (value, sigma) = conditional(&chosen, &columns);
            value + 1.645 * sigma
        });
        let limit_ng = 300.0 * limits.fold(0.0, f64::max);
        (limit_ng.is_finite() && n > 0.0)
            .then(|| UpperLimit { id: effect.id.into(), limit_ng: (limit_ng * 100.0).round() / 100.0 })
    };
    shared_work::map(&listed, limit).into_iter().flatten().collect()
}

/// Size and standard error of the largest of several columns beside those chosen, in units of their prior.
fn conditional(chosen: &Chosen, columns: &[Column]) -> (f64, f64) {
    let mut worst = (0.0_f64, 0.0_f64);
    for column in columns {
        let (a, y) = chosen.left_in(column);
        let (value, sigma) = (y / (a + 1.0), (a + 1.0).sqrt().recip());
        if value.abs() + 1.645 * sigma > worst.0 + 1.645 * worst.1 {
            worst = (value.abs(), sigma);
        }
    }
    worst
}
