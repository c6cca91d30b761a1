//! The matched filter: how strong a signature is in a record, and how much of it is left when another effect imitates it best.

use nalgebra::{DMatrix, DVector, Vector3};

use super::effect::{self, Drawn, Signal, apparent};
use super::flight::{Flight, STEP_S};
use super::force::{self, Air, Series};
use super::noise::{Noise, Whitening};
use super::record::{activity, window_means};

/// Below this SNR left, two effects count as the same to a record.
pub const CONFUSABLE_SNR: f64 = 3.0;

/// Whitening of a record, with its constants to be projected out.
pub struct Matched<'a> {
    flight: &'a Flight,
    whitenings: [Whitening; 3],
    ones: [Vec<f64>; 3],
}

/// No wind beside co-rotation is stronger than this, m/s.
const WIND_M_S_MAX: f64 = 600.0;

/// One way an effect can imitate: columns on all axes, or one shape that every axis may carry with its own size.
enum Group {
    Columns(Vec<Series>),
    /// Columns whose sizes together must stay below 1: an imitation no flight could have is none.
    Within(Vec<Series>),
    Shape(Vec<f64>),
}

/// A whitened series per axis, constants projected out.
pub type White = [Vec<f64>; 3];

impl<'a> Matched<'a> {
    /// For the windows kept of a flight in this noise.
    pub fn new(flight: &'a Flight, noise: &Noise, kept: &[bool]) -> Self {
        let activity = activity(flight, noise);
        let whitenings: [Whitening; 3] = std::array::from_fn(|axis| noise.whitening(axis, &activity, kept));
        let ones = std::array::from_fn(|axis| whitenings[axis].apply(&vec![1.0; activity.len()]));
        Self { flight, whitenings, ones }
    }

    /// Through the window mean and the whitening.
    pub fn white(&self, series: &[Vector3<f64>]) -> White {
        let means = window_means(self.flight, series);
        std::array::from_fn(|axis| self.white_axis(axis, &means[axis]))
    }

    fn white_axis(&self, axis: usize, means: &[f64]) -> Vec<f64> {
        let mut white = self.whitenings[axis].apply(means);
        let ones = &self.ones[axis];
        let share = dot(&white, ones) / dot(ones, ones);
        white.iter_mut().zip(ones).for_each(|(x, one)| *x -= share * one);
        white
    }

    /// Norm of a whitened signature.
    pub fn snr(white: &White) -> f64 {
        white.iter().map(|axis| dot(axis, axis)).sum::<f64>().sqrt()
    }

    /// What is left of `white` when each catalogue effect imitates it best.
    pub fn left(&self, white: &White, signal: &Signal, total: &[Vector3<f64>]) -> Vec<(&'static str, f64)> {
        let kinds: Vec<&str> = self.flight.events.iter().map(|e| e.kind).collect();
        effect::IDS
            .iter()
            .filter(|id| effect::event_needed(id).is_none_or(|kind| kinds.contains(&kind)))
            .map(|id| (*id, self.left_by(id, white, signal, total)))
            .collect()
    }

    /// What is left of `white` when one effect imitates it best; all of it by what is no effect of the catalogue.
    pub fn left_by(&self, id: &str, white: &White, signal: &Signal, total: &[Vector3<f64>]) -> f64 {
        let Some(id) = effect::IDS.into_iter().find(|known| *known == id) else { return Self::snr(white) };
        let groups = self.groups(id, signal, total);
        groups.iter().map(|g| self.left_of(white, g)).fold(Self::snr(white), f64::min)
    }

    fn left_of(&self, white: &White, group: &Group) -> f64 {
        match group {
            Group::Columns(columns) => {
                let columns: Vec<White> = columns.iter().map(|c| self.white(c)).collect();
                least(white, &columns, f64::INFINITY)
            }
            Group::Within(columns) => {
                let columns: Vec<White> = columns.iter().map(|c| self.white(c)).collect();
                least(white, &columns, 1.0)
            }
            Group::Shape(shape) => {
                let series: Series = shape.iter().map(|x| Vector3::new(*x, *x, *x)).collect();
                let w = self.white(&series);
                let left = (0..3).map(|i| {
                    let (xy, xx) = (dot(&w[i], &white[i]), dot(&w[i], &w[i]));
                    dot(&white[i], &white[i]) - if xx > 1e-12 { xy * xy / xx } else { 0.0 }
                });
                left.sum::<f64>().max(0.0).sqrt()
            }
        }
    }

    fn groups(&self, id: &'static str, signal: &Signal, total: &[Vector3<f64>]) -> Vec<Group> {
        let flight = self.flight;
        let offset = || (0..3).map(|i| apparent(flight, &Vector3::ith(i, 1.0))).collect::<Vec<_>>();
        let since = |onset: f64| flight.times_s.iter().map(move |t| t - onset);
        let onsets = || (1..36).map(|j| flight.start_s + flight.length_s * f64::from(j) / 36.0);
        let lags = [0.0, 600.0, 1200.0, 2400.0, 4800.0, 9600.0, 19_200.0];
        match id {
            "cg_offset" => vec![Group::Columns(offset())],
            "mass_shift" => {
                let events = flight.events.iter().filter(|e| e.kind == "mass_change");
                let gate = |c: Series, t0: f64| -> Series {
                    since(t0).zip(c).map(|(t, a)| a * f64::from(u8::from(t > 0.0))).collect()
                };
                events.map(|e| Group::Columns(offset().into_iter().map(|c| gate(c, e.clock_s)).collect())).collect()
            }
            "magnetic_sensitivity" => {
                let field = force::field_t(flight);
                let column = |i: usize, j: usize| field.iter().map(|b| Vector3::ith(i, b[j] * 1e6)).collect();
                vec![Group::Columns((0..9).map(|ij| column(ij / 3, ij % 3)).collect())]
            }
            "scale_factor" => {
                let largest = |i: usize| total.iter().map(move |a| Vector3::ith(i, effect::SCALE_ERROR_MAX * a[i]));
                (0..3).map(|i| Group::Within(vec![largest(i).collect()])).collect()
            }
            "misalignment" => {
                let turned = |i: usize| total.iter().map(|a| a.cross(&Vector3::ith(i, 1.0))).collect();
                vec![Group::Columns((0..3).map(turned).collect())]
            }
            "temperature_bias" => lags
                .iter()
                .map(|lag| {
                    let t = &flight.temperature_c;
                    Group::Shape((0..t.len()).map(|k| flight.temperature_at(k as f64 - lag / STEP_S) - t[0]).collect())
                })
                .collect(),
            "time_offset" => {
                let late = (0..total.len()).map(|k| total[k.saturating_sub(1)] - total[k]).collect();
                vec![Group::Columns(vec![late])]
            }
            "thermospheric_wind" => {
                let wind = |wind_m_s| force::minus(&force::drag(flight, Air { wind_m_s, ..signal.air }), &signal.drag);
                vec![Group::Within(vec![wind([WIND_M_S_MAX, 0.0]), wind([0.0, WIND_M_S_MAX])])]
            }
            "atmosphere_corotation" => {
                let other = force::drag(flight, Air { corotation: 1.0 - signal.air.corotation, ..signal.air });
                vec![Group::Columns(vec![force::minus(&other, &signal.drag)])]
            }
            "vent_leak" => onsets()
                .flat_map(|onset| [3e3, 8e3, 2e4, 6e4].map(|tau| (onset, tau)))
                .map(|(onset, tau)| {
                    Group::Shape(since(onset).map(|t| if t > 0.0 { (-t / tau).exp() } else { 0.0 }).collect())
                })
                .collect(),
            "bias_step" => {
                let logged = flight.events.iter().filter(|e| e.kind == "mass_change").map(|e| e.clock_s);
                onsets()
                    .chain(logged)
                    .map(|onset| Group::Shape(since(onset).map(|t| f64::from(u8::from(t > 0.0))).collect()))
                    .collect()
            }
            "bias_drift" => [2e4, 4e4, 8e4, 16e4]
                .into_iter()
                .map(|tau| Group::Shape(since(flight.start_s).map(|t| (-t / tau).exp()).collect()))
                .collect(),
            "water_dump" => vec![Group::Shape(force::during(flight, "water_dump"))],
            "evaporator_venting" => vec![Group::Shape(force::during(flight, "evaporator"))],
            "thruster_residual" => vec![Group::Shape(force::during(flight, "thruster"))],
            "crew_activity" => vec![Group::Shape(force::during(flight, "crew_sleep"))],
            // The rest are one column of fixed form and any size.
            _ => {
                let unit = Drawn { id, parameters: unit_parameters(id), axis: None };
                vec![Group::Columns(vec![unit.signature(flight, signal, total)])]
            }
        }
    }
}

fn unit_parameters(id: &str) -> Vec<(String, f64)> {
    let name = match id {
        "solar_radiation_pressure" => "coefficient",
        "diurnal_bulge" => "amplitude",
        _ => "fraction",
    };
    vec![(name.to_string(), 1.0)]
}

/// Norm of what least squares on these columns leaves; all of it when their sizes exceed `size_max` in all.
fn least(white: &White, columns: &[White], size_max: f64) -> f64 {
    let n = columns.len();
    let inner = |a: &White, b: &White| (0..3).map(|i| dot(&a[i], &b[i])).sum::<f64>();
    // Columns of unit norm, so that one threshold tells dependence from size.
    let norms: Vec<f64> = columns.iter().map(|c| inner(c, c).sqrt().max(1e-12)).collect();
    let gram = DMatrix::from_fn(n, n, |i, j| inner(&columns[i], &columns[j]) / (norms[i] * norms[j]));
    let right = DVector::from_fn(n, |i, _| inner(&columns[i], white) / norms[i]);
    let Ok(x) = gram.svd(true, true).solve(&right, 1e-9) else { return Matched::snr(white) };
    let size = x.iter().zip(&norms).map(|(x, norm)| (x / norm).powi(2)).sum::<f64>().sqrt();
    let explained = if size <= size_max { x.dot(&right) } else { 0.0 };
    (inner(white, white) - explained).max(0.0).sqrt()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
