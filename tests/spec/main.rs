//! Numbers that the report prints, from the report's own other numbers. Source: J. E. Rice, NASA CR-198552 (1996), section 6 and
//! section 3, as transcribed in the specification of this project.

use oare_ground::pipeline::calibration::accuracy::{published, quadrature, statistical_error};

#[test]
fn table_6_follows_from_tables_4_and_5_to_the_rounding_of_the_print() {
    for axis in 0..3 {
        let sts65 = statistical_error(published::BIAS_FIT_NG[axis][0], published::DEGREES_OF_FREEDOM[0]);
        assert!((sts65 - published::STS65_STATISTICAL_NG[axis]).abs() <= 1.0, "STS-65 axis {axis}: {sts65}");
        let quiet = statistical_error(published::STS62_QUIET[axis][1], published::DEGREES_OF_FREEDOM[1]);
        assert!((quiet - published::STS62_QUIET_STATISTICAL_NG[axis]).abs() <= 1.0, "STS-62 axis {axis}: {quiet}");
    }
}

#[test]
fn counts_and_ng_of_table_4_agree_by_the_nominal_resolution() {
    let resolution_ng = [3.0518, 4.5776, 4.5776];
    for (axis, resolution) in resolution_ng.iter().enumerate() {
        for column in 0..2 {
            let ng = published::BIAS_FIT_COUNTS[axis][column] * resolution;
            // Counts are printed to 1: half of one, in ng.
            assert!((ng - published::BIAS_FIT_NG[axis][column]).abs() <= 0.5 * resolution + 0.5, "axis {axis}: {ng}");
        }
    }
}

#[test]
fn systematic_errors_add_in_quadrature() {
    assert!((quadrature(&[48.0, 20.0]) - 52.0).abs() < 1e-12);
    assert!((quadrature(&[3.0, 4.0, 12.0]) - 13.0).abs() < 1e-12);
}

#[test]
fn a1_on_board_is_lower_than_raw_telemetry_by_the_one_sided_trim() {
    for axis in 0..3 {
        let [on_board, raw] = published::A1_C[axis];
        let [shift, error] = published::ONE_SIDED_COUNTS[axis];
        assert!((raw - on_board - shift).abs() <= error + 1e-9, "axis {axis}");
    }
}

#[test]
fn the_mission_has_84_calibrations() {
    let (minutes, count) = published::CALIBRATIONS;
    // 14.75 days of operation, one at the start.
    let expected = (14.75 * 1440.0 / minutes).floor() as u32;
    assert_eq!(expected, count);
}

#[test]
fn the_one_sided_mean_of_normal_noise_is_low_by_0_0035_sigma() {
    // (X(N-k) - T)/(M - 1) with N = 500, a = 0.05: the highest point kept is at the 95 % quantile, 1.645 sigma.
    let (kept, quantile) = (450.0, 1.645);
    let shift: f64 = quantile / (kept - 1.0);
    assert!((shift - 0.0035).abs() < 0.0003, "{shift}");
}

#[test]
fn what_is_not_legible_is_not_there() {
    assert_eq!(published::A2_C, [None, None, Some(385.1)]);
    assert_eq!(published::T_C_H[0], [None, None]);
}
