//! What a sensor's series may follow beside its simulation, each as a column of the regression. Not here: which of them it
//! follows (see `search`).

use std::f64::consts::TAU;

use super::form::Form;
use super::read::{Axis, Series};
use crate::diagnose::measure::relaxed;
use crate::math::rms::about_mean;

/// An effect a sensor's series may show.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Follows {
    /// A temperature (index of the covariate), late by a time constant in seconds.
    Temperature(usize, f64),
    /// A temperature as it was so many seconds before.
    Delayed(usize, f64),
    /// A component of the magnetic field (index of the covariate), at once: a sensor feels no field of an hour ago.
    Field(usize),
    /// Exponential decay with this time constant in seconds from the start of the data.
    Drift(f64),
    /// A step at this time, s.
    Step(f64),
    /// The reference, more or less of it than the simulation has.
    Scale,
    /// The reference, by so many seconds earlier than the series' own clock says.
    Offset(f64),
    /// No effect of the catalogue: a form of a covariate, late by a time constant in seconds.
    Form(Form, usize, f64),
    /// Neither: the product of two covariates, each less its mean.
    Product(usize, usize),
    /// Neither: a push from an instant on, for so long, both in s.
    Pulse(f64, f64),
    /// Neither: an oscillation with a period, s, and a phase at the first sample, rad.
    Line(f64, f64),
}

impl Follows {
    /// The catalogue's name.
    pub fn id(&self) -> &'static str {
        match self {
            Self::Temperature(..) | Self::Delayed(..) => "temperature_bias",
            Self::Field(_) => "magnetic_sensitivity",
            Self::Drift(_) => "bias_drift",
            Self::Step(_) => "bias_step",
            Self::Scale => "scale_factor",
            Self::Offset(_) => "time_offset",
            Self::Form(..) | Self::Product(..) | Self::Pulse(..) | Self::Line(..) => "formula",
        }
    }

    /// The name for people.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Temperature(..) | Self::Delayed(..) => "A bias that follows temperature",
            Self::Field(_) => "A sensor that feels the magnetic field",
            Self::Drift(_) => "A decaying bias",
            Self::Step(_) => "A step of the bias",
            Self::Scale => "A scale factor against the reference",
            Self::Offset(_) => "A clock ahead of the reference's",
            Self::Form(..) | Self::Product(..) | Self::Pulse(..) | Self::Line(..) => "A formula",
        }
    }

    /// The covariate that it is of, or both; what it is, where it is of none.
    pub fn of_what(&self, series: &Series) -> String {
        let name = |k: &usize| series.covariates[*k].name.clone();
        match self {
            Self::Temperature(k, _) | Self::Delayed(k, _) | Self::Field(k) | Self::Form(_, k, _) => name(k),
            Self::Product(k, j) => format!("{} and {}", name(k), name(j)),
            Self::Pulse(..) | Self::Line(..) => "time".to_owned(),
            other => other.id().to_owned(),
        }
    }

    /// Unit of its coefficient on an axis of another.
    pub fn unit(&self, axis: &str, series: &Series) -> String {
        match self {
            Self::Temperature(k, _) | Self::Delayed(k, _) | Self::Field(k) => {
                format!("{axis}/{}", series.covariates[*k].unit)
            }
            Self::Form(form, k, _) => format!("{axis}/{}", form.unit(&series.covariates[*k].unit)),
            Self::Product(k, j) => format!("{axis}/({} {})", series.covariates[*k].unit, series.covariates[*j].unit),
            Self::Drift(_) | Self::Step(_) | Self::Pulse(..) | Self::Line(..) => axis.to_owned(),
            Self::Scale => "1".to_owned(),
            Self::Offset(_) => "s".to_owned(),
        }
    }

    /// How many unknowns it is charged for: its coefficient, and what was looked for beside it.
    pub fn price(&self) -> f64 {
        match self {
            Self::Temperature(_, 0.0) | Self::Form(.., 0.0) | Self::Product(..) | Self::Field(_) | Self::Scale => 1.0,
            Self::Pulse(..) | Self::Line(..) => 3.0,
            _ => 2.0,
        }
    }

    /// Whether one of them leaves no room for the other in a model: two components of a field do.
    pub fn excludes(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Field(one), Self::Field(other)) => one == other,
            _ => self.id() == other.id(),
        }
    }

    /// The number that does not enter linearly: a time constant or an instant.
    pub fn inner(&self) -> Option<f64> {
        match *self {
            Self::Temperature(_, s)
            | Self::Delayed(_, s)
            | Self::Drift(s)
            | Self::Step(s)
            | Self::Offset(s)
            | Self::Form(.., s) => Some(s),
            Self::Scale | Self::Field(_) | Self::Product(..) | Self::Pulse(..) | Self::Line(..) => None,
        }
    }

    /// The response to the same at once, of one that is late.
    pub fn immediate(&self) -> Option<Self> {
        match *self {
            Self::Temperature(k, s) | Self::Delayed(k, s) if s > 0.0 => Some(Self::Temperature(k, 0.0)),
            Self::Form(form, k, s) if s > 0.0 => Some(Self::Form(form, k, 0.0)),
            _ => None,
        }
    }

    /// The same effect with another such number.
    pub fn with_inner(self, s: f64) -> Self {
        match self {
            Self::Temperature(k, _) => Self::Temperature(k, s),
            Self::Delayed(k, _) => Self::Delayed(k, s),
            Self::Form(form, k, _) => Self::Form(form, k, s),
            Self::Drift(_) => Self::Drift(s),
            Self::Step(_) => Self::Step(s),
            Self::Offset(_) => Self::Offset(s),
            Self::Scale | Self::Field(_) | Self::Product(..) | Self::Pulse(..) | Self::Line(..) => self,
        }
    }
}

/// One axis to be explained: its values less what is known of them, and the columns of a model.
pub struct Equation {
    /// Recording less simulation, less what the model fixes without a coefficient.
    pub values: Vec<f64>,
    /// One column per effect.
    pub columns: Vec<Vec<f64>>,
}

/// Put a model to an axis.
pub fn equation(series: &Series, axis: &Axis, model: &[Follows]) -> Equation {
    let t = &series.t_s;
    let offset_s = model.iter().find_map(|f| if let Follows::Offset(s) = f { Some(*s) } else { None });
    let mut values = axis.values.clone();
    // The simulation is the reference as it stands; the model's is the reference at a shifted time.
    let reference = axis.reference.as_ref().map(|r| match offset_s {
        None => r.clone(),
        Some(s) => {
            let moved: Vec<f64> = t.iter().map(|t| at(&series.t_s, r, t - s)).collect();
            values.iter_mut().zip(r.iter().zip(&moved)).for_each(|(v, (was, is))| *v -= is - was);
            moved
        }
    });
    let none = || vec![0.0; t.len()];
    let column = |follows: &Follows| match follows {
        Follows::Temperature(k, lag_s) => late(t, &series.covariates[*k].values, *lag_s),
        Follows::Delayed(k, lag_s) => t.iter().map(|now| at(t, &series.covariates[*k].values, now - lag_s)).collect(),
        Follows::Field(k) => series.covariates[*k].values.clone(),
        Follows::Form(form, k, lag_s) => late(t, &form.of(t, &series.covariates[*k].values), *lag_s),
        Follows::Product(k, j) => {
            let [one, other] = [k, j].map(|k| about_mean(&series.covariates[*k].values));
            one.iter().zip(&other).map(|(a, b)| a * b).collect()
        }
        Follows::Drift(tau_s) => t.iter().map(|t| (-(t - series.t_s[0]) / tau_s).exp()).collect(),
        Follows::Step(at_s) => t.iter().map(|t| f64::from(u8::from(t >= at_s))).collect(),
        Follows::Pulse(from_s, length_s) => {
            t.iter().map(|t| f64::from(u8::from((0.0..*length_s).contains(&(t - from_s))))).collect()
        }
        Follows::Line(period_s, phase) => {
            t.iter().map(|t| (TAU * (t - series.t_s[0]) / period_s + phase).sin()).collect()
        }
        Follows::Scale => reference.clone().unwrap_or_else(none),
        Follows::Offset(_) => reference.as_ref().map_or_else(none, |r| slope(t, r).iter().map(|s| -s).collect()),
    };
    Equation { columns: model.iter().map(column).collect(), values }
}

/// First-order lag; a gap restarts it at what is measured then.
fn late(t_s: &[f64], x: &[f64], lag_s: f64) -> Vec<f64> {
    if lag_s <= 0.0 {
        return x.to_vec();
    }
    let mut out = Vec::with_capacity(x.len());
    let mut state = x.first().copied().unwrap_or(0.0);
    for (i, value) in x.iter().enumerate() {
        if i > 0 {
            let dt = t_s[i] - t_s[i - 1];
            state = if dt > 4.0 * lag_s { *value } else { relaxed(state, [x[i - 1], *value], dt, lag_s) };
        }
        out.push(state);
    }
    out
}

/// Value at a time between the samples, by the cubic through the four nearest; the ends hold.
fn at(t_s: &[f64], x: &[f64], when: f64) -> f64 {
    let n = t_s.len();
    let after = t_s.partition_point(|t| *t <= when);
    if after == 0 || n < 4 {
        return x[0];
    }
    if after >= n {
        return x[n - 1];
    }
    let from = after.saturating_sub(2).min(n - 4);
    let nodes: Vec<f64> = t_s[from..from + 4].iter().map(|t| t - t_s[from]).collect();
    let weights = crate::physics::earth_orientation::lagrange_weights(&nodes, when - t_s[from]);
    weights.iter().zip(&x[from..from + 4]).map(|(w, x)| w * x).sum()
}

pub(super) fn slope(t_s: &[f64], x: &[f64]) -> Vec<f64> {
    let n = t_s.len();
    let one = |i: usize| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(n - 1));
        (x[b] - x[a]) / (t_s[b] - t_s[a]).max(1e-12)
    };
    (0..n).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_response_to_a_ramp_trails_it_by_its_time_constant() {
        let t: Vec<f64> = (0..400).map(|i| 10.0 * f64::from(i)).collect();
        let trailing = late(&t, &t, 200.0);
        assert!((t[399] - trailing[399] - 200.0).abs() < 1e-6, "{}", t[399] - trailing[399]);
    }

    #[test]
    fn between_samples_a_sine_is_read_to_a_thousandth() {
        let t: Vec<f64> = (0..100).map(f64::from).collect();
        let x: Vec<f64> = t.iter().map(|t| (t / 5.0).sin()).collect();
        assert!((at(&t, &x, 40.37) - (40.37_f64 / 5.0).sin()).abs() < 1e-3);
    }
}
