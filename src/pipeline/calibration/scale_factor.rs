//! The scale factor from the table's rate [Rice 1996]: y = (r w^2 + s)/SF_A + b, so
//!
//! 1/SF_A = [mean(y) - MP sin(d)/d - (1 - sin(d)/d) mean(b)] / (r w^2), SF_C = SF_A / SF_N,
//!
//! MP the midpoint of the means before and after, d the half angular travel, w the rate, b the bias. Rate and travel come from
//! the table packets: the rate is the mean of the slope of the angle and the rate told, by the rounding of each.

use std::collections::BTreeMap;

use super::sequence::{Hold, next_step};
use crate::math::robust::{TrimmedMean, rounding_error_spread};
use crate::pipeline::archive::{Archive, RECORD_TENTHS};
use crate::telemetry::{Axis, Mode, Range, Step, TableReport};
use crate::units::{Clock, NANO_G_M_S2};

/// Fewer samples than this in the rate step give no estimate: 3 s.
const RATE_SAMPLES_MIN: usize = 30;
/// Fewer samples than this before or after give none: 20 s.
const STILL_SAMPLES_MIN: usize = 200;
/// The table's rate is told in thousandths of a degree a second: two reports of one rate differ by no more than this, rad/s.
const RATE_QUANTUM_RAD_S: f64 = 0.001 * std::f64::consts::PI / 180.0;
/// Rates that differ by more than this are unsteady, rad/s.
pub const JITTER_RAD_S: f64 = 3.0 * RATE_QUANTUM_RAD_S;
/// The noise factor, about: errors kept here are those of independent samples, and that of rounding is no such.
const RATIO_OF_NOISE: f64 = 2.8;
/// Seconds between the middles of the steps before and after, on average; for the drift of the signal between them.
const PRE_TO_POST_S: f64 = 100.0;

/// Why a scale sequence is not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Refusal {
    /// The sequence was cut off.
    Aborted,
    /// The science records are there and the table packets are not, or make no sense.
    TablePackets,
    /// Telemetry is missing.
    Gap,
    /// The table's rate is unsteady.
    Jitter,
    /// The result is far from all others.
    Outlier,
}

impl Refusal {
    /// In the files.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Aborted => "aborted",
            Self::TablePackets => "table_packets",
            Self::Gap => "gap",
            Self::Jitter => "table_jitter",
            Self::Outlier => "outlier",
        }
    }
}

/// What one sequence holds, in counts; the scale factor needs the bias as well.
#[derive(Debug, Clone, PartialEq)]
pub struct ScaleSequence {
    /// Target axis.
    pub axis: Axis,
    /// Range.
    pub range: Range,
    /// Number of the calibration, when the table told it.
    pub calibration_id: Option<u16>,
    /// First and last clock.
    pub span: [Clock; 2],
    /// Middle of the rate step, s.
    pub clock_s: f64,
    /// Mean temperature, C.
    pub temperature_c: f64,
    /// Means before, at the rate and after, counts, and their independent standard errors.
    pub pre: [f64; 2],
    /// At the rate.
    pub rate: [f64; 2],
    /// After.
    pub post: [f64; 2],
    /// Rate, rad/s, and its standard error.
    pub rate_rad_s: [f64; 2],
    /// Standard deviation of the rates reported, rad/s.
    pub jitter_rad_s: f64,
    /// Half angular travel, rad.
    pub half_travel_rad: f64,
    /// Variance of half the signal's change over 75 s beyond the usual, squared counts: a manoeuvre.
    pub excess_counts2: f64,
    /// Why it cannot be used.
    pub refusal: Option<Refusal>,
}

/// What a sequence gives with a bias.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleMeasurement {
    /// SF_C.
    pub correction: f64,
    /// Its standard error.
    pub sigma: f64,
}

/// Half angular travel d: sin(d)/d.
pub fn sinc(half_travel_rad: f64) -> f64 {
    if half_travel_rad.abs() < 1e-6 { 1.0 } else { half_travel_rad.sin() / half_travel_rad }
}

/// The formula of Rice 1996: SF_A in ng per count.
pub fn actual_ng_per_count(
    mean_y: f64,
    midpoint: f64,
    bias: f64,
    half_travel_rad: f64,
    rate_rad_s: f64,
    radius_m: f64,
) -> f64 {
    let s = sinc(half_travel_rad);
    radius_m * rate_rad_s.powi(2) / NANO_G_M_S2 / (mean_y - midpoint * s - (1.0 - s) * bias)
}

impl ScaleSequence {
    /// SF_C with a bias and its error; `factor` is the noise factor of the axis, `use_post` whether the level after is trusted.
    pub fn measure(
        &self,
        bias: [f64; 2],
        resolution_ng: f64,
        radius_m: f64,
        factor: f64,
        use_post: bool,
    ) -> Option<ScaleMeasurement> {
        if self.refusal.is_some() {
            return None;
        }
        let (midpoint, midpoint_se) = match use_post {
            true => (0.5 * (self.pre[0] + self.post[0]), 0.5 * self.pre[1].hypot(self.post[1])),
            false => (self.pre[0], self.pre[1]),
        };
        let actual =
            actual_ng_per_count(self.rate[0], midpoint, bias[0], self.half_travel_rad, self.rate_rad_s[0], radius_m);
        let s = sinc(self.half_travel_rad);
        let span_counts = self.rate[0] - midpoint * s - (1.0 - s) * bias[0];
        if !(span_counts > 0.0) {
            return None;
        }
        let noise = (factor * self.rate[1]).powi(2)
            + (factor * s * midpoint_se).powi(2)
            + ((1.0 - s) * bias[1]).powi(2)
            + self.excess_counts2;
        let relative = (noise.sqrt() / span_counts).hypot(2.0 * self.rate_rad_s[1] / self.rate_rad_s[0]);
        let correction = actual / resolution_ng;
        Some(ScaleMeasurement { correction, sigma: correction * relative })
    }

    /// Post less pre, counts, and its standard error.
    pub fn shift(&self, factor: f64, half_drift_variance_counts2: f64) -> [f64; 2] {
        // The usual signal changes like a line, a manoeuvre like a walk.
        let usual = half_drift_variance_counts2 * (2.0 * PRE_TO_POST_S / 75.0).powi(2);
        let drift = usual + self.excess_counts2 * 4.0 * PRE_TO_POST_S / 75.0;
        [self.post[0] - self.pre[0], ((factor * self.pre[1]).powi(2) + (factor * self.post[1]).powi(2) + drift).sqrt()]
    }
}

/// Target axis of a scale sequence.
fn axis_of(target: u8) -> Option<Axis> {
    (1..=3).contains(&target).then(|| Axis::ALL[usize::from(target) - 1])
}

/// Every scale sequence in the archive, usable or not, in order of time.
pub fn sequences(archive: &Archive, holds: &[Hold<'_>]) -> Vec<ScaleSequence> {
    let table: BTreeMap<i64, &TableReport> = if holds.iter().any(|hold| hold.mode() == Mode::Scale) {
        archive
            .table()
            .filter(|t| t.mode == Mode::Scale && t.step == Step::Rate)
            .map(|t| (t.clock.tenths(), t))
            .collect()
    } else {
        BTreeMap::new()
    };
    (0..holds.len())
        .filter(|place| holds[*place].mode() == Mode::Scale && holds[*place].step() == Step::PreRate)
        .filter_map(|place| sequence(archive, holds, place, &table))
        .collect()
}

fn sequence(
    archive: &Archive,
    holds: &[Hold<'_>],
    place: usize,
    table: &BTreeMap<i64, &TableReport>,
) -> Option<ScaleSequence> {
    let pre = &holds[place];
    let axis = axis_of(pre.target())?;
    let range = pre.range(axis);
    let rate = next_step(holds, place, Step::Rate);
    let post = rate.and_then(|_| next_step(holds, place + 1, Step::PostRate));
    let end = post.or(rate).unwrap_or(pre).last();
    let mut found = ScaleSequence {
        axis,
        range,
        calibration_id: None,
        span: [pre.start(), end],
        clock_s: rate.unwrap_or(pre).centre_s(),
        temperature_c: rate.unwrap_or(pre).temperature_c(),
        pre: [0.0; 2],
        rate: [0.0; 2],
        post: [0.0; 2],
        rate_rad_s: [0.0; 2],
        jitter_rad_s: 0.0,
        half_travel_rad: 0.0,
        excess_counts2: 0.0,
        refusal: None,
    };
    let (Some(rate), Some(post)) = (rate, post) else {
        found.refusal = Some(if ends_in_normal(archive, end) { Refusal::Aborted } else { Refusal::Gap });
        return Some(found);
    };
    let figures = |mean: TrimmedMean| {
        let rounding = rounding_error_spread(mean.winsorised_sd);
        [mean.mean, mean.independent_standard_error_of_spread().hypot(rounding / RATIO_OF_NOISE)]
    };
    let mean = |hold: &Hold<'_>, least: usize| hold.mean(axis, least).map(figures);
    let means = (mean(pre, STILL_SAMPLES_MIN), mean(rate, RATE_SAMPLES_MIN), mean(post, STILL_SAMPLES_MIN));
    let (Some(a), Some(b), Some(c)) = means else {
        found.refusal = Some(Refusal::Gap);
        return Some(found);
    };
    (found.pre, found.rate, found.post) = (a, b, c);
    read_table(&mut found, rate, table);
    Some(found)
}

/// Whether the records go on in normal mode right after a clock: the sequence was cut off, not lost.
fn ends_in_normal(archive: &Archive, end: Clock) -> bool {
    let next = end.plus_tenths(RECORD_TENTHS);
    archive.records_between(next, next).any(|r| r.clock == next && r.mode == Mode::Normal)
}

/// Rate, travel and steadiness from the table packets of the rate step.
fn read_table(found: &mut ScaleSequence, rate: &Hold<'_>, table: &BTreeMap<i64, &TableReport>) {
    let (from, to) = (rate.start().tenths(), rate.last().tenths());
    let seconds = (to - from) / RECORD_TENTHS + 1;
    let reports: Vec<(f64, &TableReport)> = table
        .range(from..=to)
        .filter(|(_, report)| report.target == rate.target())
        .map(|(tenths, report)| ((tenths - from) as f64 / 10.0, *report))
        .collect();
    // Lost frames take science records and table packets alike; where nearly all of the first are there, the others were bad.
    let missing_records = (rate.records.len() as i64) * 5 < seconds * 4;
    if reports.len() < 3 || (reports.len() as i64) * 2 < seconds {
        found.refusal = Some(if missing_records { Refusal::Gap } else { Refusal::TablePackets });
        return;
    }
    let count = reports.len() as f64;
    let mean_t = reports.iter().map(|(t, _)| t).sum::<f64>() / count;
    let mean_angle = reports.iter().map(|(_, r)| r.angle_rad).sum::<f64>() / count;
    let tt: f64 = reports.iter().map(|(t, _)| (t - mean_t).powi(2)).sum();
    let slope = reports.iter().map(|(t, r)| (t - mean_t) * (r.angle_rad - mean_angle)).sum::<f64>() / tt;
    let mean_rate = reports.iter().map(|(_, r)| r.rate_rad_s).sum::<f64>() / count;
    let spread = reports.iter().map(|(_, r)| (r.rate_rad_s - mean_rate).powi(2)).sum::<f64>() / count;
    // The slope of the angle and the rate told, each with the rounding of its last digit; that of a steady rate is the same in
    // every report.
    let slope_sigma = 0.01f64.to_radians() / 12f64.sqrt() / tt.sqrt();
    let told_sigma = RATE_QUANTUM_RAD_S / 12f64.sqrt();
    let weights = [slope_sigma.powi(-2), told_sigma.powi(-2)];
    let rate_told = (slope.abs() * weights[0] + mean_rate.abs() * weights[1]) / (weights[0] + weights[1]);
    let rounding = (weights[0] + weights[1]).powf(-0.5);
    found.calibration_id = Some(reports[0].1.calibration_id);
    found.jitter_rad_s = spread.sqrt();
    found.rate_rad_s = [rate_told, rounding.hypot((spread - told_sigma.powi(2)).max(0.0).sqrt() / count.sqrt())];
    found.half_travel_rad = 0.5 * slope.abs() * seconds as f64;
    let largest = reports.iter().map(|(_, r)| (r.rate_rad_s - mean_rate).abs()).fold(0.0, f64::max);
    if largest > JITTER_RAD_S {
        found.refusal = Some(Refusal::Jitter);
    }
}

/// The mean over a mission: weighted by the errors, widened where the measurements scatter more than these say; outliers left out.
pub fn combine(measurements: &[ScaleMeasurement]) -> Option<ScaleMeasurement> {
    let mut values: Vec<f64> = measurements.iter().map(|m| m.correction).collect();
    let middle = crate::math::robust::median(&mut values)?;
    let middle_sigma = measurements.iter().map(|m| m.sigma).fold(f64::INFINITY, f64::min);
    let used = |m: &&ScaleMeasurement| {
        measurements.len() < 3 || (m.correction - middle).abs() < 6.0 * m.sigma.hypot(middle_sigma)
    };
    let weight: f64 = measurements.iter().filter(used).map(|m| m.sigma.powi(-2)).sum();
    if !(weight > 0.0) {
        return None;
    }
    let correction = measurements.iter().filter(used).map(|m| m.correction * m.sigma.powi(-2)).sum::<f64>() / weight;
    let count = measurements.iter().filter(used).count();
    let chi2: f64 = measurements.iter().filter(used).map(|m| ((m.correction - correction) / m.sigma).powi(2)).sum();
    let freedom = count.saturating_sub(1) as f64;
    let reduced = if freedom > 0.0 { chi2 / freedom } else { 1.0 };
    let beyond_chance = reduced > 1.0 + 3.0 * (2.0 / freedom.max(1.0)).sqrt();
    let widening = if beyond_chance { reduced.sqrt() } else { 1.0 };
    Some(ScaleMeasurement { correction, sigma: widening / weight.sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_formula_gives_back_the_scale_factor_it_was_made_with() {
        // y = (r w^2 + s cos q)/SF + b averaged over the travel; s the signal at rest.
        let (rate, radius, actual, bias, signal_ng) = (0.07f64, 0.1016, 3.0518 * 1.025, -1400.0, 400.0);
        let d = rate * 25.0;
        let midpoint = signal_ng / actual + bias;
        let y = (radius * rate * rate / NANO_G_M_S2 + signal_ng * sinc(d)) / actual + bias;
        let found = actual_ng_per_count(y, midpoint, bias, d, rate, radius);
        assert!((found / actual - 1.0).abs() < 1e-12, "{found}");
    }

    #[test]
    fn a_scattered_set_has_a_wider_error_than_its_parts_say() {
        let m = |correction| ScaleMeasurement { correction, sigma: 0.001 };
        let tight = combine(&[m(1.1), m(1.101), m(1.0995), m(1.1)]).unwrap();
        assert!((tight.sigma - 0.0005).abs() < 1e-12);
        let wide = combine(&[m(1.1), m(1.104), m(1.096), m(1.1), m(1.105), m(1.095)]).unwrap();
        assert!(wide.sigma > 0.001, "{wide:?}");
    }
}
