//! Calibration against the truth: the sample dumps, and one simulated day. The pooled missions are in `coverage`, `anomalies` and
//! `settling`: `cargo test --features slow --test sim -- --nocapture` flies a part of them, `OARE_SEEDS=all` before it the
//! whole, `OARE_SEEDS=20` that many seeds.

use std::collections::BTreeMap;

use oare_ground::ingest::wire::{PlaybackPart, PlaybackReader};
use oare_ground::pipeline::archive::Archive;
use oare_ground::pipeline::calibration::{AnomalyKind, Derived, KnownCalibration, range_corrections_as_of};
use oare_ground::pipeline::station::replay;
use oare_ground::pipeline::{PlaybackId, Product, Settings, Station};
use oare_ground::simulate::{Fault, Mission, MissionConfig};
use oare_ground::telemetry::{Axis, Mode, Quality, Range};
use oare_ground::units::Clock;

use super::flown::{derive_all, fly, fly_altered};
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

/// True body-axis acceleration, ng, and whether the window is one of normal mode, by the start of the window.
fn truth_of(name: &str) -> BTreeMap<i64, ([f64; 3], bool)> {
    let path = shared_data(&format!("dumps/{name}.truth.csv")).expect("the dump is there, so is its truth");
    let mut reader = csv::Reader::from_path(path).unwrap();
    let rows = reader.deserialize::<(f64, f64, f64, f64, f64, u8)>();
    rows.map(|row| row.map(|(start, x, y, z, _, normal)| (start as i64, ([x, y, z], normal == 1))).unwrap()).collect()
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
    let corrected: Vec<&Product> =
        station.products().filter(|p| p.quality.contains(Quality::RANGE_CORRECTED)).collect();
    assert!(corrected.len() > 280, "{}", corrected.len());
    // Their error bars hold: neighbours share half their samples, so that a share of these is worth that of half as many.
    let truth = truth_of("defects-24h");
    for axis in 0..3 {
        let sigmas: Vec<f64> = corrected
            .iter()
            .filter_map(|product| {
                let (found, (truth, normal)) =
                    (product.acceleration.0[axis]?, truth.get(&(product.start.seconds() as i64))?);
                normal.then(|| (found.trimmed_ng - truth[axis]) / found.sigma_ng)
            })
            .collect();
        let inside = sigmas.iter().filter(|z| z.abs() < 2.0).count() as f64 / sigmas.len() as f64;
        println!("axis {axis}: {:.1} % of {} corrected windows inside two sigma", 100.0 * inside, sigmas.len());
        assert!(sigmas.len() > 250 && inside > 0.9, "axis {axis}: {inside:.3} of {}", sigmas.len());
    }
    let shift = derived.anomalies.iter().find(|a| a.kind == AnomalyKind::ElectronicShift).unwrap();
    assert!((shift.value - 150.0).abs() < 3.0 * shift.sigma, "{}", shift.sentence);
    let aborted = derived.anomalies.iter().filter(|a| a.kind == AnomalyKind::ScaleRecordDefect).count();
    assert_eq!(aborted, 1);
}

/// Where the calibrations of X never came down, Y and Z have their values all the same.
#[test]
fn an_axis_without_a_bias_leaves_the_others_their_values() {
    let flown = fly_altered(MissionConfig::sts65(5, 12.0), |record| {
        (record.mode != Mode::Bias || record.target != 1).then_some(record)
    });
    let mut sigmas: [Vec<f64>; 2] = Default::default();
    let mut products = 0;
    for product in flown.products().filter(|product| product.mode == Mode::Normal) {
        let [x, y, z] = product.acceleration.0;
        assert!(x.is_none(), "{:?}", product.start);
        products += 1;
        let truth = flown.truth.get(&(product.start.seconds() as u32)).filter(|truth| truth.normal);
        let (Some(y), Some(z), Some(truth)) = (y, z, truth) else { continue };
        assert!(product.quality.contains(Quality::UNCALIBRATED));
        sigmas[0].push((y.trimmed_ng - truth.body_ng[1]) / y.sigma_ng.hypot(y.sigma_sys_ng));
        sigmas[1].push((z.trimmed_ng - truth.body_ng[2]) / z.sigma_ng.hypot(z.sigma_sys_ng));
    }
    assert!(products > 1500, "{products}");
    for (axis, of_axis) in ["Y", "Z"].into_iter().zip(sigmas) {
        let inside = of_axis.iter().filter(|z| z.abs() < 2.0).count() as f64 / of_axis.len() as f64;
        println!("{axis}: {:.1} % of {} windows inside two standard errors", 100.0 * inside, of_axis.len());
        assert!(of_axis.len() > 1200 && inside > 0.9, "{axis}: {inside:.3} of {}", of_axis.len());
    }
}

/// Beside the pooled missions of `coverage`, the two samples: single ones, so that their errors are all of one piece.
#[test]
fn the_error_bars_of_the_samples_hold() {
    for name in ["clean-6h", "defects-24h"] {
        let Some(station) = station_of(name) else { return };
        let known = std::fs::read_to_string(shared_data(&format!("dumps/{name}.instrument.json")).unwrap()).unwrap();
        let known = KnownCalibration::parse(&known).unwrap().calibration(station.settings());
        let (current, truth) = (station.calibration().unwrap(), truth_of(name));
        println!("{name}: inside two standard errors, % (largest error in standard errors)");
        println!("axis  bias, range C  acceleration  scale, 3 ranges");
        for axis in Axis::ALL {
            let i = axis.index();
            let bias = station.windows().filter_map(|window| {
                let (clock_s, t) = (window.centre_s(), window.temperature_c);
                let [counts, sigma] = current.bias_and_error(axis, Range::C, clock_s, t)?;
                Some((counts - known.bias_at(axis, Range::C, clock_s, t)?) / sigma)
            });
            let acceleration = station.products().filter(|p| !p.quality.contains(Quality::PARTIAL)).filter_map(|p| {
                let (found, (truth, normal)) = (p.acceleration.0[i]?, truth.get(&(p.start.seconds() as i64))?);
                normal.then(|| (found.trimmed_ng - truth[i]) / found.sigma_ng)
            });
            let scale = Range::ALL.into_iter().map(|range| {
                let found = current.scale[i][range.index()];
                (found.correction - known.scale[i][range.index()].correction) / found.sigma
            });
            let of: [Vec<f64>; 3] = [bias.collect(), acceleration.collect(), scale.collect()];
            let inside = |z: &[f64]| z.iter().filter(|z| z.abs() < 2.0).count() as f64 / z.len() as f64;
            let largest = |z: &[f64]| z.iter().fold(0.0, |most: f64, z| most.max(z.abs()));
            let [bias, acceleration, scale] =
                of.each_ref().map(|z| format!("{:5.1} ({:3.1})", 100.0 * inside(z), largest(z)));
            println!("{}     {bias}    {acceleration}   {scale}", axis.letter().to_uppercase());
            assert!(largest(&of[0]) < 4.0 && largest(&of[2]) < 4.0 && inside(&of[1]) > 0.92, "{name}, {axis:?}");
        }
    }
}

#[test]
fn one_day_with_its_manoeuvre_has_an_honest_bias_and_no_false_anomaly() {
    let mut config = MissionConfig::sts65(7, 24.0);
    config.instrument = config.instrument.without_settling();
    config.one_sided_on_board = false;
    let flown = fly(config);
    assert!(flown.derived.anomalies.is_empty(), "{:#?}", flown.derived.anomalies);
    let (current, time) = (flown.derived.current().unwrap(), Settings::sts65().time);
    for axis in Axis::ALL {
        for window in flown.windows.values() {
            let (clock_s, t) = (window.centre_s(), window.temperature_c);
            let [counts, sigma] = current.bias_and_error(axis, Range::C, clock_s, t).unwrap();
            let truth = flown.mission.config().instrument.bias_counts(axis, Range::C, time.met_h(clock_s), t);
            assert!((counts - truth).abs() < 4.5 * sigma, "{axis:?} at {clock_s}: {counts} +- {sigma}, true {truth}");
        }
    }
}

#[test]
fn what_was_answered_at_any_instant_is_given_again_as_of_it() {
    let mut config = MissionConfig::sts65(11, 14.0);
    let start_s = config.start_clock_s;
    config.faults.push(Fault::RangeMisreport { from_clock_s: start_s + 18_000, seconds: 7200 });
    let mission = Mission::new(config).unwrap_or_else(|problems| panic!("{problems:?}"));
    // Before, in and right after a calibration, while its scale part runs, in the misreported span, and later.
    let asked_h = [0.4, 0.45, 0.7, 4.4, 4.48, 4.55, 5.5, 6.3, 8.6, 8.75, 10.0, 13.9];
    let mut asked: Vec<u32> = asked_h.iter().map(|h| start_s + (h * 3600.0) as u32).collect();
    let mut archive = Archive::default();
    let mut answers = Vec::new();
    for (n, second) in mission.fly().enumerate() {
        for sent in second.sent {
            archive.add(sent.record, n as u16 & 0x3fff);
        }
        if asked.first() == Some(&second.clock_s) {
            let (_, derived) = derive_all(&archive);
            answers.push((Clock::from_seconds(asked.remove(0).into()), derived));
        }
    }
    let (windows, whole) = derive_all(&archive);
    assert_eq!(answers.len(), asked_h.len());
    for (at, then) in &answers {
        assert_eq!(then.current(), whole.as_of(*at), "at {}", at.seconds());
        let corrections = range_corrections_as_of(&archive, &windows, &whole, *at);
        assert_eq!(then.range_corrections, corrections, "at {}", at.seconds());
    }
    assert!(answers.iter().any(|(_, then)| !then.range_corrections.is_empty()), "the fault is seen");
    assert_eq!(answers.last().map(|(_, then)| then.timeline.len()), Some(4));
}
