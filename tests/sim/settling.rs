//! Missions in pairs, with and without the settling transient: what is left of its skew once it is taken away.

use oare_ground::simulate::MissionConfig;
use oare_ground::telemetry::{Axis, Range};
use rayon::prelude::*;

use super::flown::{Flown, fly, seeds};

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
