//! What the figures show: measured, fitted and left, the scale factors, and the histories in spans of two days.

use crate::pipeline::calibration::BiasMeasurement;
use crate::pipeline::product::{Component, Product};
use crate::pipeline::station::Station;
use crate::telemetry::{Axis, Range};

/// Hours of one history figure; those of Rice 1996 show two days and a bit each.
const HISTORY_H: f64 = 48.0;
/// Points of a drawn curve at most: one per pixel is enough.
const POINTS_MAX: usize = 700;
/// Share of the windows that sets a history's scale: the rest are manoeuvres, and leave the panel.
const SHOWN_SHARE: f64 = 0.98;

/// A point with its error.
#[derive(Debug, Clone, Copy)]
pub struct Dot {
    /// Hours since lift-off.
    pub met_h: f64,
    /// Value.
    pub value: f64,
    /// Standard error.
    pub sigma: f64,
    /// Whether it is used.
    pub used: bool,
}

/// One axis and range: measured, fitted with its band, and left.
#[derive(Debug, Clone, Default)]
pub struct BiasPlate {
    /// Measurements, counts.
    pub measured: Vec<Dot>,
    /// Measured less fitted, counts.
    pub left: Vec<Dot>,
    /// The law along the mission with its standard error, counts.
    pub fitted: Vec<Dot>,
}

/// The biases of one range.
#[derive(Debug, Clone)]
pub struct Biases {
    /// The range.
    pub range: Range,
    /// X, Y, Z.
    pub axes: [BiasPlate; 3],
}

/// A stretch of the mission: least, mean and most of the windows around each instant, by body axis, and the temperature.
#[derive(Debug, Clone, Default)]
pub struct History {
    /// From and to, hours since lift-off.
    pub span_h: [f64; 2],
    /// Runs without a gap, by axis: hours, least, mean, most, standard error, ng.
    pub runs: [Vec<Vec<[f64; 5]>>; 3],
    /// Scale of each axis, ng.
    pub shown_ng: [[f64; 2]; 3],
    /// Hours and sensor temperature, C.
    pub temperature: Vec<(f64, f64)>,
}

/// Everything the figures show.
#[derive(Debug, Clone, Default)]
pub struct Plates {
    /// Ranges C, B, A.
    pub biases: Vec<Biases>,
    /// Scale corrections by axis and range.
    pub scales: [[Vec<Dot>; 3]; 3],
    /// The combined correction and its error.
    pub combined: Option<[[[f64; 2]; 3]; 3]>,
    /// Histories, in order.
    pub histories: Vec<History>,
    /// First and last hour of the mission.
    pub span_h: [f64; 2],
}

impl Plates {
    /// Collects what there is.
    pub fn of(station: &Station) -> Self {
        let time = station.settings().time;
        let met_h = |product: &Product| time.met_h(product.start.seconds() + 25.0);
        let products: Vec<&Product> = station.products().collect();
        let (Some(first), Some(last)) = (products.first(), products.last()) else { return Self::default() };
        let span_h = [met_h(first), met_h(last)];
        let mut plates = Self { span_h, ..Self::default() };
        if station.derived().estimated.is_some() {
            plates.biases = [Range::C, Range::B, Range::A].map(|range| biases(station, range, &products)).into();
        }
        for (sequence, measured) in &station.derived().scales {
            let Some(measured) = measured else { continue };
            plates.scales[sequence.axis.index()][sequence.range.index()].push(Dot {
                met_h: time.met_h(sequence.clock_s),
                value: measured.correction,
                sigma: measured.sigma,
                used: true,
            });
        }
        plates.combined = station.calibration().map(|c| c.scale.map(|of| of.map(|s| [s.correction, s.sigma])));
        let count = ((span_h[1] - span_h[0]) / HISTORY_H).ceil().max(1.0) as usize;
        for n in 0..count {
            let from_h = span_h[0] + n as f64 * HISTORY_H;
            let inside: Vec<(f64, &Product)> = products
                .iter()
                .map(|product| (met_h(product), *product))
                .filter(|(h, _)| (from_h..=from_h + HISTORY_H).contains(h))
                .collect();
            if inside.iter().any(|(_, product)| product.acceleration.is_any()) {
                plates.histories.push(history([from_h, (from_h + HISTORY_H).min(span_h[1])], &inside));
            }
        }
        plates
    }
}

fn biases(station: &Station, range: Range, products: &[&Product]) -> Biases {
    let (derived, time) = (station.derived(), station.settings().time);
    let axes = Axis::ALL.map(|axis| {
        let law =
            |clock_s: f64, t: f64| derived.estimated.as_ref().and_then(|c| c.bias_and_error(axis, range, clock_s, t));
        let of_law = derived.measurements.iter().filter(|m| m.axis == axis && m.range == range);
        let mut plate = BiasPlate::default();
        for m in of_law {
            plate.measured.push(dot(m, time.met_h(m.clock_s), m.counts));
            if let Some([fitted, _]) = law(m.clock_s, m.temperature_c) {
                plate.left.push(dot(m, time.met_h(m.clock_s), m.counts - fitted));
            }
        }
        let step = products.len().div_ceil(POINTS_MAX).max(1);
        plate.fitted = products
            .iter()
            .step_by(step)
            .filter_map(|product| {
                let clock_s = product.start.seconds() + 25.0;
                let [value, sigma] = law(clock_s, product.temperature_c?)?;
                Some(Dot { met_h: time.met_h(clock_s), value, sigma, used: true })
            })
            .collect();
        plate
    });
    Biases { range, axes }
}

fn dot(m: &BiasMeasurement, met_h: f64, value: f64) -> Dot {
    Dot { met_h, value, sigma: m.sigma_counts, used: m.weight > 0.0 && !m.unsteady }
}

fn history(span_h: [f64; 2], inside: &[(f64, &Product)]) -> History {
    let bucket_h = ((span_h[1] - span_h[0]) / POINTS_MAX as f64).max(25.0 / 3600.0);
    let mut history = History { span_h, ..History::default() };
    for axis in 0..3 {
        let mut all: Vec<f64> = Vec::new();
        let mut runs: Vec<Vec<[f64; 5]>> = Vec::new();
        let mut last_bucket = i64::MIN;
        let mut count = 0.0;
        for (h, product) in inside {
            let Some(Component { trimmed_ng: ng, sigma_ng: sigma, .. }) = product.acceleration.0[axis] else {
                continue;
            };
            all.push(ng);
            let bucket = ((h - span_h[0]) / bucket_h).floor() as i64;
            if bucket == last_bucket
                && let Some(point) = runs.last_mut().and_then(|run| run.last_mut())
            {
                *point = [point[0], point[1].min(ng), point[2] + ng, point[3].max(ng), point[4] + sigma];
                count += 1.0;
                continue;
            }
            close(&mut runs, count);
            // Three buckets without a window are a gap.
            if last_bucket == i64::MIN || bucket - last_bucket > 3.max((0.06 / bucket_h) as i64) {
                runs.push(Vec::new());
            }
            if let Some(run) = runs.last_mut() {
                run.push([*h, ng, ng, ng, sigma]);
            }
            (last_bucket, count) = (bucket, 1.0);
        }
        close(&mut runs, count);
        history.shown_ng[axis] = shown(&mut all);
        history.runs[axis] = runs;
    }
    let step = inside.len().div_ceil(POINTS_MAX).max(1);
    history.temperature = inside.iter().step_by(step).filter_map(|(h, p)| Some((*h, p.temperature_c?))).collect();
    history
}

/// Sums to means in the bucket that is complete.
fn close(runs: &mut [Vec<[f64; 5]>], count: f64) {
    if let Some(point) = runs.last_mut().and_then(|run| run.last_mut())
        && count > 1.0
    {
        point[2] /= count;
        point[4] /= count;
    }
}

/// The scale that shows most of the values, with some room.
fn shown(all: &mut [f64]) -> [f64; 2] {
    if all.is_empty() {
        return [-1.0, 1.0];
    }
    all.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| all[((all.len() - 1) as f64 * share) as usize];
    let (low, high) = (at(0.5 - 0.5 * SHOWN_SHARE), at(0.5 + 0.5 * SHOWN_SHARE));
    let room = 0.15 * (high - low).max(1.0);
    [low - room, high + room]
}
