//! The unlisted competitor: formulas of covariates, events and memory that no catalogue entry claims.
//!
//! A dictionary of some two hundred forms, families of variants among them, on the same evidence scale as the catalogue. Every form is dimensionless: centred and
//! scaled to unit deviation over the record, so its coefficient is in ng. A form that wins is a hypothesis with a
//! formula and a place, never a physical name.

mod history;
mod instrument;
mod motion;
mod places;
mod push;
mod resets;
mod surroundings;

pub use self::push::PUSH;
use crate::math::shared_work;
use crate::physics::Vec3;

use super::catalogue::Shape;
use super::design::Raw;
use super::scene::{Axes, Scene};

/// Prior size of the coefficient of a form, ng.
pub const SIZE_NG: f64 = 30.0;

/// What is said of a family of forms.
pub struct Said {
    /// Covariate it belongs to.
    pub covariate: &'static str,
    /// Where it lives, in words.
    pub location: &'static str,
    /// The formula of each form.
    pub formulas: Vec<String>,
    /// What each part of each form is divided by: its deviation over the record.
    pub deviations: Vec<Vec<f64>>,
}

/// A family of forms, weighed together: one form, or the same form at several widths, delays or places.
pub struct Atom {
    /// In words.
    pub said: Said,
    /// The series of each form.
    pub shapes: Vec<Shape>,
}

struct Collector<'a> {
    scene: &'a Scene<'a>,
    atoms: Vec<Atom>,
}

impl Collector<'_> {
    /// A number on the grid.
    fn grid(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        f: impl Fn(usize) -> f64,
    ) {
        let series = self.scene.measure_scalar(f);
        self.windows(formula, covariate, location, series);
    }

    /// A series at the windows.
    fn windows(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        series: Vec<f64>,
    ) {
        self.family(covariate, location, [(formula.into(), series)]);
    }

    /// Several series at the windows, one of which may hold.
    fn family(
        &mut self,
        covariate: &'static str,
        location: &'static str,
        members: impl IntoIterator<Item = (String, Vec<f64>)>,
    ) {
        let mut said = Said { covariate, location, formulas: Vec::new(), deviations: Vec::new() };
        let mut shapes = Vec::new();
        for (formula, series) in members {
            let Some((series, deviation)) = standard(series) else { continue };
            said.formulas.push(formula);
            said.deviations.push(vec![deviation]);
            shapes.push(Shape::scalar(series));
        }
        if !shapes.is_empty() {
            self.atoms.push(Atom { said, shapes });
        }
    }

    /// Columns, a coefficient each, of parts with these deviations.
    fn columns(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        (columns, deviations): (Vec<Raw>, Vec<f64>),
    ) {
        let said = Said { covariate, location, formulas: vec![formula.into()], deviations: vec![deviations] };
        self.atoms.push(Atom { said, shapes: vec![Shape::Columns(columns)] });
    }

    /// Several numbers on the grid, each with a coefficient on every body axis.
    fn several(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        parts: &[&dyn Fn(usize) -> f64],
    ) {
        let series: Vec<Vec<f64>> = parts.iter().map(|f| self.scene.measure_scalar(f)).collect();
        self.several_family(covariate, location, [(formula.into(), series)]);
    }

    /// Forms of several series at the windows, each with a coefficient on every body axis; one of the forms may hold.
    fn several_family(
        &mut self,
        covariate: &'static str,
        location: &'static str,
        members: impl IntoIterator<Item = (String, Vec<Vec<f64>>)>,
    ) {
        let mut said = Said { covariate, location, formulas: Vec::new(), deviations: Vec::new() };
        let mut shapes = Vec::new();
        for (formula, parts) in members {
            let count = parts.len();
            let (series, deviations): (Vec<Vec<f64>>, Vec<f64>) = parts.into_iter().filter_map(standard).unzip();
            if series.len() < count {
                continue;
            }
            said.formulas.push(formula);
            said.deviations.push(deviations);
            shapes.push(Shape::Several(series));
        }
        if !shapes.is_empty() {
            self.atoms.push(Atom { said, shapes });
        }
    }

    /// Vectors on the grid, one coefficient each, scaled to unit deviation over all axes.
    fn vectors(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        parts: &[&dyn Fn(usize) -> Vec3],
    ) {
        let of_part = |f: &&dyn Fn(usize) -> Vec3| standard_vector(&self.scene.measure(f));
        let (columns, deviations): (Vec<Raw>, Vec<f64>) =
            parts.iter().filter_map(of_part).map(|(axes, deviation)| (axes.map(Some), deviation)).unzip();
        if columns.len() == parts.len() {
            self.columns(formula, covariate, location, (columns, deviations));
        }
    }
}

/// A series of unit deviation and the deviation it had, `None` for what hardly varies.
fn standard(mut series: Vec<f64>) -> Option<(Vec<f64>, f64)> {
    let n = series.len() as f64;
    let mean = series.iter().sum::<f64>() / n;
    let deviation = (series.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    let largest = series.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let zero_at_rest = series.iter().filter(|x| **x == 0.0).count() * 2 > series.len();
    // A form that is zero most of the time keeps its zeros: its support is where it lives.
    let shift = if zero_at_rest { 0.0 } else { mean };
    series.iter_mut().for_each(|x| *x = (*x - shift) / deviation);
    (deviation.is_finite() && deviation > 1e-9 * largest && deviation > 0.0).then_some((series, deviation))
}

fn standard_vector(axes: &Axes) -> Option<(Axes, f64)> {
    let n = axes[0].len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|k| axes[k].iter().sum::<f64>() / n);
    let deviation =
        ((0..3).map(|k| axes[k].iter().map(|x| (x - mean[k]).powi(2)).sum::<f64>()).sum::<f64>() / n).sqrt();
    let largest = axes.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    (deviation.is_finite() && deviation > 1e-6 * largest && deviation > 0.0)
        .then(|| (std::array::from_fn(|k| axes[k].iter().map(|x| (x - mean[k]) / deviation).collect()), deviation))
}

/// Who fills the dictionary, in the order in which its forms stand.
const COLLECTORS: [fn(&mut Collector); 12] = [
    motion::rates,
    motion::orbit,
    history::attitude,
    surroundings::sunlight,
    history::terminator,
    surroundings::field,
    surroundings::surroundings,
    instrument::sensor,
    history::events,
    history::clock,
    places::places,
    resets::resets,
];

/// The dictionary for a case.
pub fn dictionary(scene: &Scene) -> Vec<Atom> {
    let collected = |collect: &fn(&mut Collector)| {
        let mut c = Collector { scene, atoms: Vec::new() };
        collect(&mut c);
        c.atoms
    };
    shared_work::map(&COLLECTORS, collected).into_iter().flatten().collect()
}

const AXIS: [&str; 3] = ["x", "y", "z"];
