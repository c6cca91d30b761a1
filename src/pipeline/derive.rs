//! A window and a calibration make a product.

use rapidhash::v3::rapidhash_v3;

use super::axes::to_body;
use super::calibration::{Calibration, Measured, RangeCorrection};
use super::product::{Component, Product, Revision};
use super::settings::WindowPolicy;
use super::window::{AxisWindow, WINDOW_TENTHS, Window};
use crate::math::robust::rounding_error_trimmed;
use crate::math::shared_work;
use crate::telemetry::{Axis, Quality, Range};

/// The product of a window by a calibration, or without one.
pub fn product(
    window: &Window,
    calibration: Option<&Calibration>,
    corrections: &[RangeCorrection],
    policy: &WindowPolicy,
) -> Product {
    let mut quality = window.quality;
    let mut ranges = [None; 3];
    let mut calibrated = [None; 3];
    for axis in Axis::ALL {
        let Some(axis_window) = &window.axes[axis.index()] else { continue };
        let taken_in = true_range(window, axis, axis_window.range, corrections);
        ranges[axis.index()] = Some(taken_in.unwrap_or(axis_window.range));
        quality = quality
            .with_if(Quality::RANGE_CORRECTED, taken_in.is_some_and(|range| range != axis_window.range))
            .with_if(Quality::RANGE_MIXED, taken_in.is_none());
        calibrated[axis.index()] = calibration
            .zip(taken_in)
            .and_then(|(calibration, range)| calibration.apply(&measured(window, axis, range, axis_window, policy)));
    }
    let acceleration = to_body(calibrated);
    let estimates = window.axes.map(|axis| axis.map(|axis| axis.estimate));
    let extrapolated = calibrated.iter().flatten().any(|axis| axis.extrapolated);
    let uncalibrated = window.axes.iter().zip(&calibrated).any(|(axis, value)| axis.is_some() && value.is_none());
    let quality = quality.with_if(Quality::UNCALIBRATED, uncalibrated).with_if(Quality::EXTRAPOLATED, extrapolated);
    let mut product = Product {
        start: window.start,
        acceleration,
        q: estimates.map(|estimate| estimate.and_then(|estimate| estimate.q)),
        trim: estimates.map(|estimate| estimate.map(|estimate| estimate.trim)),
        range: ranges,
        samples: window.samples,
        temperature_c: window.temperature_c.is_finite().then_some(window.temperature_c),
        mode: window.mode,
        quality,
        calibration: calibration.map_or(0, |calibration| calibration.version),
        revision: Revision(0),
        known_since: window.known_since.max(calibration.map_or(window.known_since, |c| c.known_since)),
    };
    product.revision = revision(window, &product);
    product
}

/// The products of many windows, in their order.
pub fn products(
    windows: &[&Window],
    calibration: Option<&Calibration>,
    corrections: &[RangeCorrection],
    policy: &WindowPolicy,
) -> Vec<Product> {
    shared_work::map(windows, |window| product(window, calibration, corrections, policy))
}

/// The range the sensor was in; `None` at the edge of a correction, where samples of one range carry the name of another and no one
/// calibration is that of all.
fn true_range(window: &Window, axis: Axis, reported: Range, corrections: &[RangeCorrection]) -> Option<Range> {
    let end = window.start.plus_tenths(WINDOW_TENTHS);
    let touching =
        corrections.iter().find(|c| c.axis == axis && c.reported == reported && c.from < end && c.to > window.start);
    match touching {
        None => Some(reported),
        Some(whole) if whole.from <= window.start && whole.to >= end => Some(whole.actual),
        Some(_) => None,
    }
}

fn measured(window: &Window, axis: Axis, range: Range, counts: &AxisWindow, policy: &WindowPolicy) -> Measured {
    Measured {
        axis,
        range,
        clock_s: window.centre_s(),
        temperature_c: window.temperature_c,
        trimmed_counts: counts.estimate.mean,
        mean_counts: counts.estimate.plain_mean,
        independent_counts: counts.estimate.independent_standard_error(),
        rounding_counts: rounding_error_trimmed(counts.estimate.winsorised_sd),
        noise_factor: policy.correlated_samples.sqrt(),
    }
}

/// Hash of the samples, of every figure they were turned into, and of when that can be known: of none of them is another told under the
/// same name.
fn revision(window: &Window, product: &Product) -> Revision {
    let mut octets = Vec::with_capacity(128);
    octets.extend(window.hash.to_le_bytes());
    octets.extend(product.calibration.to_le_bytes());
    octets.extend(product.known_since.tenths().to_le_bytes());
    let acceleration = &product.acceleration;
    let figures: [fn(&Component) -> f64; 4] = [|c| c.trimmed_ng, |c| c.mean_ng, |c| c.sigma_ng, |c| c.sigma_sys_ng];
    octets
        .extend(figures.into_iter().flat_map(|figure| acceleration.each(figure)).flatten().flat_map(f64::to_le_bytes));
    if acceleration.is_any() && acceleration.whole().is_none() {
        octets.extend(acceleration.0.map(|axis| u8::from(axis.is_some())));
    }
    octets.extend(product.range.map(|range| range.map_or(3, |range| range.index() as u8)));
    Revision(rapidhash_v3(&octets))
}
