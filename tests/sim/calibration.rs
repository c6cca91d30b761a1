//! Calibration against the truth: the sample dumps, and simulated missions of many seeds.
//!
//! `cargo test --release --features slow --test sim calibration -- --nocapture` flies the pooled suites; `OARE_SEEDS` sets the seeds
//! (50 for the whole, 5 otherwise).

use std::collections::BTreeMap;

use oare_ground::ingest::wire::{PlaybackPart, PlaybackReader};
use oare_ground::pipeline::archive::Archive;
use oare_ground::pipeline::calibration::{self, AnomalyKind, Derived};
use oare_ground::pipeline::station::replay;
use oare_ground::pipeline::window::{Window, windows};
use oare_ground::pipeline::{PlaybackId, Settings, Station};
use oare_ground::simulate::{Mission, MissionConfig};
use oare_ground::telemetry::{Axis, Quality, Range};

use super::shared_data;

fn station_of(name: &str) -> Option<Station> {
    let dump = std::fs::read(shared_data(&format!("dumps/{name}.dump"))?).unwrap();
    let settings = Settings::sts65();
    Some(replay(&settings, None, |station| {
        let mut reader = PlaybackReader::new(settings.link);
        let mut take = |part: PlaybackPart| match part {
            PlaybackPart::Opened => station.open_playback(PlaybackId(1)),
            PlaybackPart::Arrival(arrival) => station.take(PlaybackId(1), &arrival),
            PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(1), bits),
        };
        reader.push(&dump, &mut take);
        reader.finish(&mut take);
    }))
}

fn kinds(derived: &Derived) -> Vec<AnomalyKind> {
    let mut kinds: Vec<AnomalyKind> = derived.anomalies.iter().map(|anomaly| anomaly.kind).collect();
    kinds.dedup();
    kinds
}

#[test]
fn the_clean_sample_shows_its_settling_and_its_estimator_and_nothing_else() {
    let Some(station) = station_of("clean-6h") else { return };
    let derived = station.derived();
    assert_eq!(kinds(derived), [AnomalyKind::OneSidedTrim, AnomalyKind::SettlingTransient], "{:#?}", derived.anomalies);
    assert!(derived.one_sided.compared > 100);
    assert_eq!(derived.one_sided.flight_exact, derived.one_sided.compared);
    let settling = derived.estimated.as_ref().unwrap().settling.unwrap();
    assert!((settling[0].amplitude_counts + 3000.0).abs() < 4.0 * settling[0].amplitude_sigma, "{settling:?}");
}

#[test]
fn the_misreported_interval_of_the_defects_sample_is_found() {
    let Some(station) = station_of("defects-24h") else { return };
    let derived = station.derived();
    let found = derived.anomalies.iter().find(|a| a.kind == AnomalyKind::RangeMisreport).unwrap();
    assert!((found.from.seconds() - 568_631.0).abs() <= 30.0, "{}", found.sentence);
    assert!((found.to.seconds() - 575_831.0).abs() <= 30.0, "{}", found.sentence);
    assert_eq!(found.axes, Axis::ALL);
    assert!(derived.range_corrections.iter().all(|c| c.reported == Range::C && c.actual == Range::A));
    let corrected = station.products().filter(|p| p.quality.contains(Quality::RANGE_CORRECTED)).count();
    assert!(corrected > 280, "{corrected}");
    let shift = derived.anomalies.iter().find(|a| a.kind == AnomalyKind::ElectronicShift).unwrap();
    assert!((shift.value - 150.0).abs() < 3.0 * shift.sigma, "{}", shift.sentence);
    let aborted = derived.anomalies.iter().filter(|a| a.kind == AnomalyKind::ScaleRecordDefect).count();
    assert_eq!(aborted, 1);
}

/// A mission's facts, windows and what is derived from them, without the wire between.
pub struct Flown {
    /// Windows.
    pub windows: BTreeMap<i64, Window>,
    /// What was derived.
    pub derived: Derived,
}

/// Flies a mission into the pure core.
pub fn fly(config: MissionConfig) -> (Flown, Mission) {
    let mission = Mission::new(config).unwrap_or_else(|problems| panic!("{problems:?}"));
    let settings = Settings::sts65();
    let mut archive = Archive::default();
    let mut sequence = 0u16;
    for second in mission.fly() {
        for sent in second.sent.iter().filter(|sent| sent.damage.is_none()) {
            archive.add(sent.record.clone(), sequence);
            sequence = sequence.wrapping_add(1) & 0x3fff;
        }
    }
    let mut held = BTreeMap::new();
    let cells: Vec<i64> = archive.cells().collect();
    windows(&archive, cells, &settings.window, |cell, window| {
        if let Some(window) = window {
            held.insert(cell, window);
        }
    });
    let derived = calibration::derive(&archive, &held, &settings, None, None);
    (Flown { windows: held, derived }, mission)
}

/// Per axis: windows within two standard errors of the true bias, all windows, sums of the errors squared, of sigma.
fn bias_tally(flown: &Flown, mission: &Mission) -> [[f64; 4]; 3] {
    let current = flown.derived.current().expect("a calibration");
    let time = Settings::sts65().time;
    Axis::ALL.map(|axis| {
        let mut tally = [0.0; 4];
        for window in flown.windows.values() {
            let (clock_s, t) = (window.centre_s(), window.temperature_c);
            let Some([counts, sigma]) = current.bias_and_error(axis, Range::C, clock_s, t) else { continue };
            let truth = mission.config().instrument.bias_counts(axis, Range::C, time.met_h(clock_s), t);
            let error = counts - truth;
            tally[0] += f64::from(u8::from(error.abs() < 2.0 * sigma));
            tally[1] += 1.0;
            tally[2] += error * error;
            tally[3] += sigma;
        }
        tally
    })
}

fn seeds(whole: u64, part: u64) -> u64 {
    match std::env::var("OARE_SEEDS") {
        Ok(number) => number.parse().unwrap_or(whole),
        Err(_) => part,
    }
}

fn pooled(hours: f64, seeds: u64) {
    let mut total = [[0.0; 4]; 3];
    let mut scale = [[0usize; 2]; 3];
    for seed in 0..seeds {
        let (flown, mission) = fly(MissionConfig::sts65(1000 + seed, hours));
        let tally = bias_tally(&flown, &mission);
        for (axis, of_axis) in tally.iter().enumerate() {
            (0..4).for_each(|n| total[axis][n] += of_axis[n]);
            for range in 0..3 {
                let found = flown.derived.current().unwrap().scale[axis][range];
                let truth = mission.config().instrument.scale_correction[axis][range];
                scale[axis][0] += usize::from((found.correction - truth).abs() < 2.0 * found.sigma);
                scale[axis][1] += 1;
            }
        }
    }
    println!("{hours} h, {seeds} seeds, range C");
    println!("axis  bias in 2 sigma  rms error  mean sigma (counts)  scale in 2 sigma");
    for axis in Axis::ALL {
        let [within, all, square, sigma] = total[axis.index()];
        let [scale_within, scales] = scale[axis.index()];
        println!(
            "{}     {:6.2} %         {:7.2}    {:7.2}              {scale_within} of {scales}",
            axis.letter().to_uppercase(),
            100.0 * within / all,
            (square / all).sqrt(),
            sigma / all
        );
    }
    for axis in Axis::ALL {
        let [within, all, ..] = total[axis.index()];
        // Errors of one mission are correlated: the share of a 95 % band scatters by some 15 % between missions.
        let tolerance = 0.02 + 3.0 * 0.15 / (seeds as f64).sqrt();
        assert!((within / all - 0.95).abs() < tolerance, "{}: {}", axis.letter(), within / all);
    }
}

#[test]
fn one_day_without_a_manoeuvre_has_an_honest_bias_and_no_false_anomaly() {
    let mut config = MissionConfig::sts65(7, 24.0);
    // A manoeuvre between the two positions disturbs a bias measurement for good, and is told as an outlier.
    config.attitudes.truncate(1);
    config.instrument = config.instrument.without_settling();
    config.one_sided_on_board = false;
    let (flown, mission) = fly(config);
    assert!(flown.derived.anomalies.is_empty(), "{:#?}", flown.derived.anomalies);
    for [within, all, ..] in bias_tally(&flown, &mission) {
        assert!(within / all > 0.5, "{}", within / all);
    }
}

#[cfg(feature = "slow")]
#[test]
fn three_days_pooled_over_seeds() {
    pooled(72.0, seeds(50, 5));
}

#[cfg(feature = "slow")]
#[test]
fn the_whole_mission_pooled_over_seeds() {
    pooled(354.0, seeds(50, 5));
}

#[cfg(feature = "slow")]
#[test]
fn clean_days_without_manoeuvres_have_no_false_anomaly() {
    let days = seeds(200, 20);
    let mut false_ones = Vec::new();
    for seed in 0..days {
        let mut config = MissionConfig::sts65(5000 + seed, 24.0);
        config.attitudes.truncate(1);
        config.instrument = config.instrument.without_settling();
        config.one_sided_on_board = false;
        let (flown, _) = fly(config);
        false_ones.extend(flown.derived.anomalies.into_iter().map(|anomaly| (seed, anomaly.sentence)));
    }
    println!("{days} clean days: {} false anomalies {false_ones:#?}", false_ones.len());
    assert!(false_ones.is_empty());
}

#[cfg(not(feature = "slow"))]
#[test]
fn six_hours_are_flown_into_the_core() {
    let _ = seeds(1, 1);
    let (flown, _) = fly(MissionConfig::sts65(3, 6.0));
    assert!(flown.derived.current().is_some());
    let _ = pooled as fn(f64, u64);
}
