//! The accuracy analysis of Rice 1996, section 6, for the mission at hand, and the published Tables 4 to 6 beside it.

/// Systematic error, ng.
pub const SYSTEMATIC_NG: f64 = 20.0;

/// Statistical error of a fitted law: RMS of fitted less measured over the root of the degrees of freedom.
pub fn statistical_error(fit_rms: f64, degrees_of_freedom: f64) -> f64 {
    fit_rms / degrees_of_freedom.max(1.0).sqrt()
}

/// Errors that are independent add in quadrature.
pub fn quadrature(errors: &[f64]) -> f64 {
    errors.iter().map(|e| e * e).sum::<f64>().sqrt()
}

/// One axis of the tables, range C.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct AxisAccuracy {
    /// RMS of (S(t+75 s) - S(t))/2, counts; None without differences.
    pub signal_difference_rms_counts: Option<f64>,
    /// Its mean, which should be near nothing, counts.
    pub signal_difference_mean_counts: f64,
    /// Number of differences.
    pub signal_differences: f64,
    /// RMS of measured less fitted bias over all measurements, counts.
    pub bias_fit_rms_counts: f64,
    /// The same without outliers, and without measurements taken while the Orbiter turned.
    pub bias_fit_rms_used_counts: f64,
    /// The same, ng (nominal).
    pub bias_fit_rms_ng: f64,
    /// The same without outliers, ng.
    pub bias_fit_rms_used_ng: f64,
    /// Measurements, and degrees of freedom of the fit.
    pub measurements: usize,
    /// Of those, measurements while quiet was asserted.
    pub quiet_measurements: usize,
    /// RMS of measured less fitted bias of these, counts and ng; None without any.
    pub quiet_fit_rms: Option<[f64; 2]>,
    /// Degrees of freedom.
    pub degrees_of_freedom: f64,
    /// Bias fit RMS / sqrt(degrees of freedom), ng.
    pub statistical_ng: f64,
    /// Mean standard error of the fitted bias over the measurements, ng: what goes into the products.
    pub fitted_sigma_ng: f64,
    /// Statistical and systematic in quadrature, ng.
    pub total_ng: f64,
}

/// What the report prints, X, Y, Z.
pub mod published {
    /// Table 4: RMS of signal differences, counts, range C.
    pub const SIGNAL_DIFFERENCE_COUNTS: [f64; 3] = [94.0, 37.0, 29.0];
    /// Table 4: RMS of the bias fit, counts; in parentheses without outliers.
    pub const BIAS_FIT_COUNTS: [[f64; 2]; 3] = [[138.0, 123.0], [45.0, 29.0], [26.0, 22.0]];
    /// Table 4: the same in ng.
    pub const BIAS_FIT_NG: [[f64; 2]; 3] = [[421.0, 375.0], [206.0, 133.0], [119.0, 101.0]];
    /// Table 5: STS-62, all biases, counts and ng.
    pub const STS62_ALL: [[f64; 2]; 3] = [[60.0, 185.0], [50.0, 230.0], [30.0, 138.0]];
    /// Table 5: STS-62, quiet biases, counts and ng.
    pub const STS62_QUIET: [[f64; 2]; 3] = [[19.0, 60.0], [15.0, 69.0], [15.0, 69.0]];
    /// Table 6: STS-65, 78 degrees of freedom, ng.
    pub const STS65_STATISTICAL_NG: [f64; 3] = [48.0, 24.0, 14.0];
    /// Table 6: STS-62 quiet, 21 degrees of freedom, ng.
    pub const STS62_QUIET_STATISTICAL_NG: [f64; 3] = [14.0, 15.0, 15.0];
    /// Degrees of freedom of the two.
    pub const DEGREES_OF_FREEDOM: [f64; 2] = [78.0, 21.0];
    /// A1 in range C of the fitted constants, of raw telemetry, counts.
    pub const A1_C: [[f64; 2]; 3] = [[-2247.4, -2241.7], [47.30, 48.9], [1510.3, 1511.8]];
    /// A2 in range C: not legible for X and Y in the source.
    pub const A2_C: [Option<f64>; 3] = [None, None, Some(385.1)];
    /// t0 and t1 in range C, hours: not legible for X in the source.
    pub const T_C_H: [[Option<f64>; 2]; 3] = [[None, None], [Some(9.3), None], [Some(12.6), Some(130.0)]];
    /// Size of the one-sided trim in range C, counts, and its error.
    pub const ONE_SIDED_COUNTS: [[f64; 2]; 3] = [[5.7, 0.3], [1.6, 0.1], [1.5, 0.1]];
    /// Minutes between bias calibrations, and their number.
    pub const CALIBRATIONS: (f64, u32) = (251.0, 84);
}
