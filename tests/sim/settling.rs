//! Missions in pairs, with and without the settling transient: what is left of its skew once it is taken away.

use oare_ground::pipeline::calibration::BiasMeasurement;
use oare_ground::simulate::MissionConfig;
use oare_ground::telemetry::{AccRecord, Axis, Range, Step};
use rayon::prelude::*;

use super::flown::{Flown, fly, fly_altered, seeds};

/// Mean over the windows of the difference of the fitted biases, and of the measurements' means, counts in range C.
fn left(with: &Flown, without: &Flown, axis: Axis) -> [f64; 2] {
    let bias = |flown: &Flown, clock_s: f64, t: f64| {
        flown.derived.current().and_then(|c| c.bias_at(axis, Range::C, clock_s, t)).expect("a bias")
    };
    let fitted = with
        .windows
        .values()
        .map(|w| bias(with, w.centre_s(), w.temperature_c) - bias(without, w.centre_s(), w.temperature_c))
        .sum::<f64>()
        / with.windows.len() as f64;
    let measured: Vec<f64> = with
        .derived
        .measurements
        .iter()
        .zip(&without.derived.measurements)
        .filter(|(a, _)| a.axis == axis && a.range == Range::C && a.target == 2)
        .map(|(a, b)| a.counts - b.counts)
        .collect();
    [fitted, measured.iter().sum::<f64>() / measured.len() as f64]
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn little_is_left_of_the_settling_once_it_is_taken_away() {
    let count = seeds(10, 2);
    let pairs: Vec<[[f64; 2]; 2]> = (0..count)
        .into_par_iter()
        .map(|seed| {
            let config = MissionConfig::sts65(4000 + seed, 354.0);
            let mut still = config.clone();
            still.instrument = still.instrument.without_settling();
            let (with, without) = (fly(config), fly(still));
            assert_eq!(with.derived.measurements.len(), without.derived.measurements.len());
            [Axis::Y, Axis::Z].map(|axis| left(&with, &without, axis))
        })
        .collect();
    println!("seed  left of the skew, counts: Y fitted, Y measured, Z fitted, Z measured");
    for (seed, [y, z]) in pairs.iter().enumerate() {
        println!("{seed:4}  {:8.2} {:8.2} {:8.2} {:8.2}", y[0], y[1], z[0], z[1]);
    }
    for [y, z] in &pairs {
        assert!(y.iter().all(|counts| counts.abs() < 3.0), "{y:?}");
        assert!(z.iter().all(|counts| counts.abs() < 1.0), "{z:?}");
    }
}

/// The first seconds of a position are those in which it settles: without them the transient is as large, there and in all others.
#[test]
fn a_position_whose_beginning_is_lost_settles_from_its_own_beginning() {
    let settles = |r: &AccRecord| (r.step, r.target, r.ranges[1]) == (Step::Opposite, 2, Range::C);
    let config = MissionConfig::sts65(4100, 12.0);
    let whole = fly(config.clone());
    let of_y = |flown: &Flown| -> Vec<BiasMeasurement> {
        let all = flown.derived.measurements.iter().copied();
        all.filter(|m| (m.axis, m.range, m.target) == (Axis::Y, Range::C, 2)).collect()
    };
    let measured = of_y(&whole);
    let first_s = measured[0].clock_s;
    // A frame holds eleven seconds; one is lost there, and in the second calibration the turn and the position before it as well.
    let is_lost = |r: &AccRecord| {
        let clock_s = r.clock.seconds();
        let of_first = settles(r) && (first_s + 12.5..first_s + 24.0).contains(&clock_s);
        of_first
            || (measured[1].clock_s - 80.0..measured[1].clock_s + 24.0).contains(&clock_s) && r.step != Step::Normal
    };
    let holed = fly_altered(config, |r| (!is_lost(&r)).then_some(r));
    let [with, without] = [&whole, &holed].map(|flown| flown.derived.estimated.as_ref().unwrap().settling.unwrap()[0]);
    assert!((with.amplitude_counts - without.amplitude_counts).abs() < 4.0 * with.amplitude_sigma, "{without:?}");
    let left = of_y(&holed);
    assert_eq!(left.len(), measured.len());
    for (a, b) in measured.iter().zip(&left) {
        assert!((a.counts - b.counts).abs() < 1.2 * a.sigma_counts.hypot(b.sigma_counts), "{a:?} {b:?}");
    }
}
