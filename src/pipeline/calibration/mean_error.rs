//! The standard error of a mean over windows. Their noise averages down, but for what windows that overlap share; what the bias law and the
//! scale factor leave open is the same error in all of them, and does not.

use super::apply::{Bias, Calibration};
use super::bias_law::PARAMETERS;
use crate::pipeline::axes::errors_to_body;
use crate::pipeline::product::Product;
use crate::pipeline::window::WINDOW_TENTHS;
use crate::telemetry::{Axis, Range};

/// Errors that windows of one axis and range share: those of the law, what the law does not describe, and the scale factor.
const SHARED: usize = PARAMETERS + 2;

/// The shared errors of a value, each of unit size, ng.
type Shared = [f64; SHARED];

/// The open errors of a law, counts, at hours since lift-off and a temperature.
type OpenErrors<'a> = Box<dyn Fn(f64, f64) -> [f64; PARAMETERS] + 'a>;

/// What a calibration leaves open, ready to be asked for many windows.
pub struct MeanError<'a> {
    calibration: &'a Calibration,
    open: [[Option<OpenErrors<'a>>; 3]; 3],
}

impl<'a> MeanError<'a> {
    /// Of a calibration.
    pub fn new(calibration: &'a Calibration) -> Self {
        let open = calibration.bias.each_ref().map(|ranges| {
            ranges.each_ref().map(|bias| {
                let fit = bias.as_ref().and_then(Bias::fit)?;
                Some(Box::new(fit.open_errors()) as OpenErrors<'a>)
            })
        });
        Self { calibration, open }
    }

    /// The statistical standard error, body axes, ng, of the mean of the products with a value on an axis, which are in order of time and
    /// made with this calibration; None without one. Systematic errors are not in it.
    pub fn of(&self, products: &[Product]) -> [Option<f64>; 3] {
        let of_axis = |axis: Axis| {
            let i = axis.index();
            // Body Y is the sensor's Z, and body Z its Y.
            let body = [0, 2, 1][i];
            let mut shared = [[0.0; SHARED]; 3];
            let mut variance = 0.0;
            let mut before: Option<(i64, f64)> = None;
            let mut count = 0;
            for product in products {
                let Some(value) = product.acceleration.0[body] else { continue };
                let range = product.range[i].unwrap_or(Range::C);
                let of_window = self.shared(axis, range, product, value.trimmed_ng);
                shared[range.index()].iter_mut().zip(of_window).for_each(|(sum, one)| *sum += one);
                let all = value.sigma_ng.powi(2);
                let noise = (all - of_window.iter().map(|x| x * x).sum::<f64>()).max(0.0).sqrt();
                let start = product.start.tenths();
                // Of two that overlap by half, half of the noise is the same.
                let overlap = before
                    .map_or(0.0, |(last, noise)| noise * (1.0 - (start - last) as f64 / WINDOW_TENTHS as f64).max(0.0));
                variance += noise * noise + 2.0 * noise * overlap;
                before = Some((start, noise));
                count += 1;
            }
            variance += shared.as_flattened().iter().map(|sum| sum * sum).sum::<f64>();
            (count > 0).then(|| variance.sqrt() / f64::from(count))
        };
        errors_to_body(Axis::ALL.map(of_axis))
    }

    /// What a value has in common with others of its axis and range.
    fn shared(&self, axis: Axis, range: Range, product: &Product, value_ng: f64) -> Shared {
        let (i, j) = (axis.index(), range.index());
        let mut errors = [0.0; SHARED];
        let scale = self.calibration.scale[i][j];
        errors[PARAMETERS + 1] = value_ng * scale.sigma / scale.correction;
        let fit = self.calibration.bias[i][j].as_ref().and_then(Bias::fit);
        if let (Some(open), Some(fit), Some(temperature_c)) = (&self.open[i][j], fit, product.temperature_c) {
            let ng_per_count = self.calibration.resolution_ng[i][j] * scale.correction;
            let centre_s = product.start.plus_tenths(WINDOW_TENTHS / 2).seconds();
            let of_law = open(self.calibration.time.met_h(centre_s), temperature_c);
            errors.iter_mut().zip(of_law).for_each(|(error, counts)| *error = counts * ng_per_count);
            errors[PARAMETERS] = fit.drift_variance.sqrt() * ng_per_count;
        }
        errors
    }
}
