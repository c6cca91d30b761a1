//! Whether what the fullest model of a triad leaves of its poses follows something: how they lie, or when they were held. What scatters from
//! pose to pose whatever they are is noise, however large; a law is not.
//!
//! Each form is asked alone, beside all that was fitted, by an F test: its square against what is left, for each of its numbers. The least
//! probable of all is told, and its probability is multiplied by how many were asked.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, Vector3};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::still::Pose;
use super::{SPARE_POSES, Triad};

/// Parts of the direction of gravity.
const NAMES: [&str; 3] = ["dx", "dy", "dz"];
/// What an axis may fall short of, in gravity: bounds at which it clips, and within which it is dead.
const BOUNDS: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
/// Fewest poses to either side of an instant.
const SIDE: usize = 3;
/// Cycles over the recording from one period to the next.
const CYCLES: f64 = 0.5;
/// Share of a form that must be its own, beside what was fitted.
const OWN: f64 = 1e-3;

/// A form that what is left follows.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// The chance that noise follows one of all those asked as well.
    pub probability: f64,
    /// F of its numbers times how many.
    pub energy: f64,
    /// As a formula of d, the direction of gravity in the triad, and t, the time from 0 to 1.
    pub formula: String,
    /// Axes it is of: some of `x`, `y`, `z`.
    pub axes: Vec<&'static str>,
    /// From when on, s, where it begins.
    pub from_s: Option<f64>,
}

/// Series of the poses.
struct Form {
    formula: String,
    columns: Vec<Vec<f64>>,
    axes: Vec<usize>,
    from_s: Option<f64>,
}

/// The strongest form beside a fit.
pub fn structure(fit: &Triad, poses: &[Pose]) -> Option<Structure> {
    let n = poses.len();
    let unknowns = fit.slopes.ncols();
    let mut basis = fit.slopes.clone();
    for mut column in basis.column_iter_mut() {
        let norm = column.norm().max(f64::MIN_POSITIVE);
        column /= norm;
    }
    let q = basis.qr().q();
    let beside = |x: DMatrix<f64>| &x - &q * q.tr_mul(&x);
    let left = beside(DMatrix::from_column_slice(n, 1, &fit.residuals)).column(0).into_owned();
    let all = left.norm_squared();
    let forms = forms(fit, poses);
    let asked = forms.len() as f64;
    let tried = |form: &Form| -> Option<(f64, f64, DVector<f64>, DVector<f64>)> {
        let k = form.columns.len();
        let free = n.checked_sub(unknowns + k).filter(|free| *free >= SPARE_POSES)? as f64;
        let raw = DMatrix::from_fn(n, k, |i, j| form.columns[j][i]);
        let columns = beside(raw.clone());
        let own = (0..k).all(|j| columns.column(j).norm() > OWN * raw.column(j).norm());
        let inverse = columns.tr_mul(&columns).try_inverse().filter(|_| own)?;
        let right = columns.tr_mul(&left);
        let size = &inverse * &right;
        let explained = right.dot(&size);
        let variance = (all - explained).max(all * 1e-12) / free;
        let f = explained / k as f64 / variance;
        let chance = FisherSnedecor::new(k as f64, free).ok()?.sf(f);
        Some((chance, f * k as f64, size, (inverse * variance).diagonal().map(f64::sqrt)))
    };
    let found = forms.iter().filter_map(|form| Some((form, tried(form)?)));
    let (form, (chance, energy, size, sigma)) = found.min_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
    let numbers: Vec<String> = size.iter().zip(&sigma).map(|(v, s)| format!("{v:.3e} +- {s:.1e}")).collect();
    Some(Structure {
        probability: (asked * chance).min(1.0),
        energy,
        formula: format!("({}) m/s^2 x {}", numbers.join(", "), form.formula),
        axes: form.axes.iter().map(|k| ["x", "y", "z"][*k]).collect(),
        from_s: form.from_s,
    })
}

/// All that is asked.
fn forms(fit: &Triad, poses: &[Pose]) -> Vec<Form> {
    let d: Vec<Vector3<f64>> = poses.iter().map(|pose| fit.direction(pose)).collect();
    let middle = |pose: &Pose| 0.5 * (pose.start_s + pose.end_s);
    let (first, last) = poses.first().zip(poses.last()).map_or((0.0, 1.0), |(a, b)| (middle(a), middle(b)));
    let t: Vec<f64> = poses.iter().map(|pose| (middle(pose) - first) / (last - first).max(1e-9)).collect();
    let mut all = Vec::new();
    let mut add = |formula: String, axes: &[usize], f: &dyn Fn(usize) -> f64| {
        let columns = vec![(0..poses.len()).map(f).collect()];
        all.push(Form { formula, columns, axes: axes.to_vec(), from_s: None });
    };
    for (k, name) in NAMES.into_iter().enumerate() {
        let x = |i: usize| d[i][k];
        add(format!("{name}^3"), &[k], &|i| x(i).powi(3));
        add(format!("{name}^4"), &[k], &|i| x(i).powi(4));
        add(format!("|{name}|"), &[k], &|i| x(i).abs());
        add(format!("{name} |{name}|"), &[k], &|i| x(i) * x(i).abs());
        for bound in BOUNDS {
            // Of the magnitude an axis has as much as it has of gravity.
            add(format!("|{name}| max(0, |{name}| - {bound})"), &[k], &|i| x(i).abs() * (x(i).abs() - bound).max(0.0));
            add(format!("{name} max(0, {name} - {bound})"), &[k], &|i| x(i) * (x(i) - bound).max(0.0));
            add(format!("{name} max(0, -{name} - {bound})"), &[k], &|i| x(i) * (-x(i) - bound).max(0.0));
            add(format!("{name}^2 where |{name}| < {bound}"), &[k], &|i| {
                if x(i).abs() < bound { x(i).powi(2) } else { 0.0 }
            });
        }
        add(format!("t {name}"), &[k], &|i| t[i] * x(i));
        add(format!("t^2 {name}"), &[k], &|i| t[i].powi(2) * x(i));
        add(format!("t {name}^2"), &[k], &|i| t[i] * x(i).powi(2));
        for j in (0..3).filter(|j| *j != k) {
            add(format!("{name}^2 {}", NAMES[j]), &[k, j], &|i| x(i).powi(2) * d[i][j]);
        }
    }
    add("dx dy dz".into(), &[0, 1, 2], &|i| d[i].x * d[i].y * d[i].z);
    add("t".into(), &[0, 1, 2], &|i| t[i]);
    add("t^2".into(), &[0, 1, 2], &|i| t[i].powi(2));
    for (k, name) in NAMES.into_iter().enumerate() {
        for from in SIDE..poses.len().saturating_sub(SIDE) {
            let after = |i: usize| if i >= from { d[i][k] } else { 0.0 };
            all.push(Form {
                formula: format!("{name} from {:.0} s on", poses[from].start_s),
                columns: vec![(0..poses.len()).map(after).collect()],
                axes: vec![k],
                from_s: Some(poses[from].start_s),
            });
        }
        for cycles in (2..).map(|i| CYCLES * f64::from(i)).take_while(|cycles| 3.0 * cycles < poses.len() as f64) {
            let wave = |of: fn(f64) -> f64| (0..poses.len()).map(|i| d[i][k] * of(TAU * cycles * t[i])).collect();
            all.push(Form {
                formula: format!("{name} times the sine, cosine of {cycles:.1} cycles over the recording"),
                columns: vec![wave(f64::sin), wave(f64::cos)],
                axes: vec![k],
                from_s: None,
            });
        }
    }
    all
}
