//! How much the signal itself changes while the bias is measured.
//!
//! A two-position measurement takes half of the signal's change between its positions for bias. Usually that is a few nanog;
//! while the Orbiter manoeuvres it is micro-g, and the measurement is worth nothing. All readings of one calibration tell: the
//! reversed positions, those that the turn does not reverse, and the windows around it. They are described by one bias per target
//! and range, a straight line for the signal, and a random walk; the walk's rate is the one of largest likelihood, and counts
//! only where that likelihood is beyond what chance gives.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use nalgebra::{DMatrix, DVector};

use super::scale_factor::ScaleSequence;
use super::sequence::Hold;
use super::two_position::Pair;
use crate::math::robust::{rounding_error_spread, rounding_error_trimmed};
use crate::pipeline::settings::Settings;
use crate::pipeline::window::Windows;
use crate::telemetry::{Axis, Mode, Quality, Range, Step};

/// Pairs of one calibration lie this close, s: it takes 900.
const CALIBRATION_S: f64 = 1000.0;
/// Sequences of one scale calibration lie this close, s: it takes 1293.
const SCALE_CALIBRATION_S: f64 = 1500.0;
/// Windows and scale holds this close to the calibration take part, s.
pub(super) const AROUND_S: f64 = 260.0;
/// Smallest scatter told apart, counts.
const SCATTER_COUNTS_MIN: f64 = 0.3;
/// Seconds between the middles of the two positions.
const POSITIONS_S: f64 = 75.0;
/// Logarithm of the likelihood ratio from which a walk counts. Under a steady signal twice the ratio is chi squared with one
/// degree of freedom, half of the time nothing: chance does this once in 5000 calibrations of an axis, and then widens
/// one error bar.
const LN_RATIO_MIN: f64 = 6.3;
/// Trial variances of half the change of the walk between the positions, over the variance of a reading.
const TRIALS: [f64; 14] = [0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, 1e6];

/// Excess variances of a calibration by the hash of its readings, made before: they depend on nothing else.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Walks {
    known: HashMap<u64, f64>,
}

impl Walks {
    /// The variance of these readings, from what is known or made now.
    fn of(&mut self, previous: Option<&Walks>, readings: &[Reading]) -> f64 {
        let mut hasher = DefaultHasher::new();
        for r in readings {
            (r.clock_s.to_bits(), r.ng.to_bits(), r.variance_ng2.to_bits(), r.bias, r.sign > 0.0).hash(&mut hasher);
        }
        let key = hasher.finish();
        let variance = previous.and_then(|walks| walks.known.get(&key).copied()).unwrap_or_else(|| walk(readings));
        self.known.insert(key, variance);
        variance
    }
}

/// One level of one axis.
struct Reading {
    clock_s: f64,
    ng: f64,
    variance_ng2: f64,
    /// Which bias it holds.
    bias: usize,
    /// 1, or -1 where the turn reversed the axis.
    sign: f64,
}

/// Variance of half the signal's change between the positions beyond the usual, ng^2 at nominal scale, by pair and axis.
pub(super) fn excess(
    holds: &[Hold<'_>],
    pairs: &[Pair<'_, '_>],
    windows: &Windows,
    settings: &Settings,
    walks: (&mut Walks, Option<&Walks>),
) -> Vec<[f64; 3]> {
    let (made, previous) = walks;
    let mut found = vec![[0.0; 3]; pairs.len()];
    let mut first = 0;
    while first < pairs.len() {
        let start_s = pairs[first].normal.start().seconds();
        let count = pairs[first..].iter().take_while(|p| p.normal.start().seconds() - start_s < CALIBRATION_S).count();
        let of_calibration = &pairs[first..first + count];
        let around = around(holds, of_calibration);
        let normals: Vec<&Hold<'_>> = of_calibration.iter().map(|pair| pair.normal).collect();
        let variances = Axis::ALL.map(|axis| {
            let mut readings = readings(of_calibration, axis, settings);
            readings.extend(around.iter().filter_map(|hold| reading(hold, axis, SHARED_BIAS, 1.0, settings)));
            let span_s = [start_s, of_calibration[count - 1].opposite.last().seconds()];
            readings.extend(window_readings(span_s, &normals, windows, axis, settings));
            made.of(previous, &readings)
        });
        found[first..first + count].fill([as_one(variances); 3]);
        first += count;
    }
    found
}

/// The Orbiter turns as one body: an axis is as unsteady as the one that shows it most. An axis whose signal changes by the same
/// amount in both positions of a turn about it does not show that it is unsteady.
fn as_one(variances_ng2: [f64; 3]) -> f64 {
    variances_ng2.into_iter().fold(0.0, f64::max)
}

/// The same during the scale calibrations, squared counts of each sequence's own range, put into the sequences. Only the levels
/// before and after the rates take part, and of those not the ones whose shift is in question.
pub(super) fn of_scales(
    holds: &[Hold<'_>],
    sequences: &mut [ScaleSequence],
    windows: &Windows,
    settings: &Settings,
    walks: (&mut Walks, Option<&Walks>),
) {
    let (made, previous) = walks;
    let levels: Vec<&Hold<'_>> = holds
        .iter()
        .filter(|hold| hold.mode() == Mode::Scale && matches!(hold.step(), Step::PreRate | Step::PostRate))
        .collect();
    let mut first = 0;
    while first < sequences.len() {
        let [start, _] = sequences[first].span;
        let count = sequences[first..]
            .iter()
            .take_while(|s| s.span[0].seconds() - start.seconds() < SCALE_CALIBRATION_S)
            .count();
        let of_calibration = &mut sequences[first..first + count];
        let end = of_calibration[count - 1].span[1];
        let inside: Vec<&Hold<'_>> =
            levels.iter().copied().filter(|hold| start <= hold.start() && hold.start() <= end).collect();
        let half_variance_ng2 = Axis::ALL.map(|axis| {
            let in_question = |hold: &&&Hold<'_>| {
                hold.step() == Step::PostRate
                    && hold.range(axis) == Range::C
                    && usize::from(hold.target()) == axis.index() + 1
            };
            let mut readings: Vec<Reading> = inside
                .iter()
                .filter(|hold| !in_question(hold))
                .filter_map(|hold| {
                    let range = hold.range(axis);
                    let bias = if range == Range::C { SHARED_BIAS } else { range.index() };
                    reading(hold, axis, bias, 1.0, settings)
                })
                .collect();
            readings.extend(window_readings([start.seconds(), end.seconds()], &inside, windows, axis, settings));
            made.of(previous, &readings)
        });
        for sequence in of_calibration {
            let resolution = settings.instrument.resolution_ng(sequence.axis, sequence.range);
            sequence.excess_counts2 = half_variance_ng2[sequence.axis.index()] / (resolution * resolution);
        }
        first += count;
    }
}

/// The bias of range C outside the bias calibration; those of targets 1 and 2 by range come before.
const SHARED_BIAS: usize = 6;
/// From here on, by range: the biases of windows that name range C and were taken in another.
const OTHER_RANGE_BIAS: usize = 7;

fn readings(pairs: &[Pair<'_, '_>], axis: Axis, settings: &Settings) -> Vec<Reading> {
    let mut found = Vec::new();
    for pair in pairs {
        let bias = usize::from(pair.normal.target() == 2) * 3 + pair.normal.range(axis).index();
        let reverses = pair.axes().contains(&axis);
        found.extend(reading(pair.normal, axis, bias, 1.0, settings));
        // What settles is no level; its model belongs to a version of the calibration.
        if !(reverses && pair.settles()) {
            found.extend(reading(pair.opposite, axis, bias, if reverses { -1.0 } else { 1.0 }, settings));
        }
    }
    found
}

/// Scale calibrations start right after: their first levels in range C are the signal's, as that of a window is.
fn around<'h, 'a>(holds: &'h [Hold<'a>], pairs: &[Pair<'h, 'a>]) -> Vec<&'h Hold<'a>> {
    let end = pairs[pairs.len() - 1].opposite.last();
    let from = holds.partition_point(|hold| hold.start() <= end);
    holds[from..]
        .iter()
        .take_while(|hold| hold.start().seconds() - end.seconds() < AROUND_S)
        .filter(|hold| hold.mode() == Mode::Scale && hold.step() == Step::PreRate)
        .filter(|hold| hold.range(Axis::X) == Range::C)
        .collect()
}

fn reading(hold: &Hold<'_>, axis: Axis, bias: usize, sign: f64, settings: &Settings) -> Option<Reading> {
    let mean = hold.mean(axis, settings.window.samples_min)?;
    let resolution = settings.instrument.resolution_ng(axis, hold.range(axis));
    let noise = settings.window.correlated_samples.sqrt() * mean.independent_standard_error_of_spread();
    let error_ng = resolution * noise.hypot(rounding_error_spread(mean.winsorised_sd));
    let ng = resolution * mean.mean;
    Some(Reading { clock_s: hold.centre_s(), ng, variance_ng2: error_ng * error_ng, bias, sign })
}

/// The range of which a window's scatter is, against that of levels whose range was commanded. Ranges differ by ten and more in
/// what a count means; quiet and busy times by far less.
fn range_of_scatter(scatter_counts: f64, axis: Axis, levels_ng: f64, settings: &Settings) -> Range {
    let off = |range: Range| {
        let ng = scatter_counts.max(SCATTER_COUNTS_MIN) * settings.instrument.resolution_ng(axis, range);
        (ng / levels_ng).ln().abs()
    };
    Range::ALL.into_iter().min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(Range::C)
}

/// Whole windows that name range C and do not overlap, before and after, as far as they are known when the calibration is.
fn window_readings(
    [start_s, end_s]: [f64; 2],
    levels: &[&Hold<'_>],
    windows: &Windows,
    axis: Axis,
    settings: &Settings,
) -> Vec<Reading> {
    let cell = |clock_s: f64| (clock_s / 25.0).floor() as i64;
    let factor = settings.window.correlated_samples.sqrt();
    let levels_ng = levels
        .iter()
        .filter(|hold| hold.range(axis) == Range::C)
        .filter_map(|hold| hold.mean(axis, settings.window.samples_min))
        .map(|mean| mean.winsorised_sd.max(SCATTER_COUNTS_MIN) * settings.instrument.resolution_ng(axis, Range::C))
        .min_by(f64::total_cmp);
    windows
        .range(cell(start_s - AROUND_S)..=cell(end_s + AROUND_S))
        .filter(|(cell, window)| *cell % 2 == 0 && window.quality == Quality::GOOD)
        .filter(|(_, window)| window.known_since.seconds() <= end_s + AROUND_S)
        .filter_map(|(_, window)| {
            let seen = window.axes[axis.index()].filter(|seen| seen.range == Range::C)?.estimate;
            let taken_in = |levels_ng| range_of_scatter(seen.winsorised_sd, axis, levels_ng, settings);
            let range = levels_ng.map_or(Range::C, taken_in);
            let bias = if range == Range::C { SHARED_BIAS } else { OTHER_RANGE_BIAS + range.index() };
            let resolution = settings.instrument.resolution_ng(axis, range);
            let noise = factor * seen.independent_standard_error();
            let error_ng = resolution * noise.hypot(rounding_error_trimmed(seen.winsorised_sd));
            let (clock_s, ng) = (window.centre_s(), resolution * seen.mean);
            Some(Reading { clock_s, ng, variance_ng2: error_ng * error_ng, bias, sign: 1.0 })
        })
        .collect()
}

/// Variance of half the walk's change between the positions; 0 for a steady signal.
fn walk(readings: &[Reading]) -> f64 {
    let mut used: Vec<usize> = readings.iter().map(|reading| reading.bias).collect();
    used.sort_unstable();
    used.dedup();
    let middle_s = readings.iter().map(|r| r.clock_s).sum::<f64>() / readings.len() as f64;
    let design = DMatrix::from_fn(readings.len(), used.len() + 2, |row, column| {
        let reading = &readings[row];
        match column.checked_sub(used.len()) {
            None => f64::from(u8::from(used[column] == reading.bias)),
            Some(0) => reading.sign,
            Some(_) => reading.sign * (reading.clock_s - middle_s) / POSITIONS_S,
        }
    });
    let Some(design) = independent(design).filter(|design| readings.len() >= design.ncols() + 2) else { return 0.0 };
    let values = DVector::from_iterator(readings.len(), readings.iter().map(|reading| reading.ng));
    let typical = readings.iter().map(|reading| reading.variance_ng2).sum::<f64>() / readings.len() as f64;
    let likelihood = |half_variance: f64| ln_likelihood(readings, &design, &values, half_variance);
    let Some(steady) = likelihood(0.0) else { return 0.0 };
    let best = TRIALS
        .iter()
        .filter_map(|trial| Some((trial * typical, likelihood(trial * typical)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    match best {
        Some((variance, likelihood)) if likelihood - steady > LN_RATIO_MIN => variance,
        _ => 0.0,
    }
}

/// Columns that span the same, without those of which nothing is left: a level common to all biases is the signal's where no turn
/// reverses an axis. A ridge in their place would weigh the biases, the more the quieter the readings are.
fn independent(design: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let svd = design.svd(true, false);
    let least = 1e-9 * svd.singular_values.max();
    let kept: Vec<usize> = (0..svd.singular_values.len()).filter(|n| svd.singular_values[*n] > least).collect();
    svd.u.map(|u| u.select_columns(&kept))
}

/// Restricted likelihood of the readings with a walk: what their differences say, whatever the biases and the line.
fn ln_likelihood(
    readings: &[Reading],
    design: &DMatrix<f64>,
    values: &DVector<f64>,
    half_variance: f64,
) -> Option<f64> {
    // Var(s(t) - s(u)) = q |t - u|, and half the change over 75 s has the variance q 75 / 4.
    let rate = 4.0 * half_variance / POSITIONS_S;
    let start_s = readings.iter().map(|r| r.clock_s).fold(f64::INFINITY, f64::min);
    let covariance = DMatrix::from_fn(readings.len(), readings.len(), |i, j| {
        let (a, b) = (&readings[i], &readings[j]);
        let common = a.sign * b.sign * rate * (a.clock_s.min(b.clock_s) - start_s);
        common + if i == j { a.variance_ng2 } else { 0.0 }
    });
    let root = covariance.cholesky()?;
    let lower = root.l();
    let whitened = lower.solve_lower_triangular(design)?;
    let target = lower.solve_lower_triangular(values)?;
    let normal = (whitened.transpose() * &whitened).cholesky()?;
    let right = whitened.transpose() * &target;
    let explained = right.dot(&normal.solve(&right));
    let ln_determinant = |l: &DMatrix<f64>| 2.0 * l.diagonal().iter().map(|x| x.ln()).sum::<f64>();
    Some(-0.5 * (ln_determinant(&lower) + ln_determinant(&normal.l()) + target.norm_squared() - explained))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Readings to a nanog of a signal that swings with the orbit, behind biases of up to 141,000 ng.
    #[test]
    fn a_large_bias_makes_no_quiet_record_unsteady() {
        let signal_ng = |t: f64| 500.0 * (1.16e-3 * t).sin();
        let bias_ng = [-9300.0, -9200.0, 5600.0, 7600.0, 14_600.0, 141_000.0, -9300.0];
        let reading = |clock_s: f64, variance_ng2: f64, bias: usize, sign: f64| Reading {
            clock_s,
            ng: bias_ng[bias] + sign * signal_ng(clock_s),
            variance_ng2,
            bias,
            sign,
        };
        let mut readings = Vec::new();
        for bias in 0..6 {
            let (start_s, variance_ng2) = (150.0 * bias as f64, [0.36, 80.0, 7700.0][bias % 3]);
            readings.push(reading(start_s + 25.0, variance_ng2, bias, 1.0));
            readings.push(reading(start_s + 100.0, variance_ng2, bias, if bias < 3 { -1.0 } else { 1.0 }));
        }
        let around = (0..5).map(|n| 50.0 * f64::from(n) - 250.0).chain((0..4).map(|n| 950.0 + 50.0 * f64::from(n)));
        readings.extend(around.map(|clock_s| reading(clock_s, 0.36, SHARED_BIAS, 1.0)));
        let half_change_ng = walk(&readings).sqrt();
        assert!((1.0..30.0).contains(&half_change_ng), "{half_change_ng}");
    }
}
