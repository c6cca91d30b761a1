//! Whole flights, looked at through the wire: what was planted is what comes down.

use std::collections::BTreeMap;

use super::faults::SHUTDOWN_S;
use super::mission::{Mission, MissionConfig};
use super::noise::NoisePlan;
use super::recorder::{Framer, Packetiser, RecorderConfig, playbacks};
use super::truth::{TrueWindow, TruthBuilder, instrument_json};
use super::{Fault, Second};
use crate::ingest::wire::{
    Assembled, Assembler, Deframer, FrameId, LinkConfig, Record, SpacePacket, TransferFrame, Verdict,
};
use crate::telemetry::{AccRecord, Axis, EventCode, Mode, Range, Step};
use crate::units::NANO_G_M_S2;

fn fly(config: MissionConfig) -> Vec<Second> {
    Mission::new(config).unwrap().fly().collect()
}

/// No force, hardly any noise: what is left is the instrument itself.
fn still(hours: f64) -> MissionConfig {
    let mut config = MissionConfig::sts65(5, hours);
    config.forces.gravity_gradient = 0.0;
    config.forces.rotation = 0.0;
    config.forces.drag = 0.0;
    config.forces.solar_radiation = 0.0;
    config.noise = NoisePlan { asleep_ng: [20.0; 3], ..NoisePlan::sts65() }.without_bursts();
    config
}

fn frames(seconds: &[Second]) -> Vec<Vec<u8>> {
    let (mut packetiser, mut framer) = (Packetiser::default(), Framer::new(LinkConfig::default(), 1, 0));
    let mut frames = Vec::new();
    for sent in seconds.iter().flat_map(|second| &second.sent) {
        framer.push(&packetiser.packet(sent), |frame| frames.push(frame));
    }
    framer.finish(|frame| frames.push(frame));
    frames
}

/// Everything readable in a set of playbacks, and how many packets were refused.
fn receive<'a>(streams: impl Iterator<Item = &'a [u8]>) -> (Vec<Record>, usize, BTreeMap<FrameId, Vec<u8>>) {
    let link = LinkConfig::default();
    let mut kept = BTreeMap::new();
    for stream in streams {
        let mut deframer = Deframer::new(link);
        let mut take = |arrival: crate::ingest::wire::Arrival| {
            if let Verdict::Good(id) = arrival.verdict {
                kept.entry(id).or_insert(arrival.octets);
            }
        };
        deframer.push(stream, &mut take);
        deframer.finish(&mut take);
    }
    let (mut assembler, mut records, mut refused) = (Assembler::default(), Vec::new(), 0);
    for octets in kept.values() {
        let frame = TransferFrame::read(&link, octets).unwrap();
        assembler.take(&frame, |assembled| match assembled {
            Assembled::Packet(_, octets) => match SpacePacket::read(octets).and_then(|p| Record::read(&p)) {
                Ok(record) => records.push(record),
                // The idle packet at the end has no time field.
                Err(_) => refused += usize::from(octets[0] & 7 != 7),
            },
            Assembled::Broken(..) => refused += 1,
        });
    }
    // A packet cut by a frame border comes after the next frame's: the order is made that of time again.
    records.sort_by_key(order);
    (records, refused, kept)
}

/// Kind, time, and what tells events of one second apart.
fn order(record: &Record) -> (u8, i64, u16, u32) {
    match record {
        Record::Acc(acc) => (0, acc.clock.tenths(), 0, 0),
        Record::Hsk(hsk) => (1, hsk.clock.tenths(), 0, 0),
        Record::Tbl(tbl) => (2, tbl.clock.tenths(), 0, 0),
        Record::Evt(event) => (3, event.clock.tenths(), event.code.code(), event.argument),
        Record::Prc(prc) => (4, prc.clock.tenths(), 0, 0),
    }
}

fn science(records: &[Record]) -> Vec<AccRecord> {
    let acc = |record: &Record| if let Record::Acc(acc) = record { Some(*acc) } else { None };
    records.iter().filter_map(acc).collect()
}

fn sent_science(seconds: &[Second]) -> Vec<AccRecord> {
    seconds
        .iter()
        .flat_map(|second| science(&second.sent.iter().map(|s| s.record.clone()).collect::<Vec<_>>()))
        .collect()
}

#[test]
fn the_same_seed_flies_the_same_octets_and_another_does_not() {
    let dump = |seed: u64| {
        let seconds = fly(MissionConfig::sts65(seed, 1.0));
        playbacks(&frames(&seconds), &LinkConfig::default(), &RecorderConfig::messy(), seed)
            .into_iter()
            .flat_map(|playback| playback.octets)
            .collect::<Vec<u8>>()
    };
    let first = dump(3);
    assert_eq!(first, dump(3));
    assert_ne!(first, dump(4));
}

#[test]
fn a_clean_dump_gives_back_every_record() {
    let seconds = fly(MissionConfig::sts65(8, 1.0));
    let playbacks = playbacks(&frames(&seconds), &LinkConfig::default(), &RecorderConfig::clean(), 8);
    let (records, refused, _) = receive(playbacks.iter().map(|p| p.octets.as_slice()));
    assert_eq!(refused, 0);
    let mut sent: Vec<Record> = seconds.iter().flat_map(|s| &s.sent).map(|s| s.record.clone()).collect();
    sent.sort_by_key(order);
    assert_eq!(records.len(), sent.len());
    // Whatever the wire can hold exactly comes back exactly.
    for (received, sent) in records.iter().zip(&sent) {
        if let (Record::Tbl(received), Record::Tbl(sent)) = (received, sent) {
            assert!((received.angle_rad - sent.angle_rad).abs() < 0.005_f64.to_radians() + 1e-12);
        } else {
            assert_eq!(received, sent);
        }
    }
}

#[test]
fn a_messy_tape_gives_back_every_frame_that_was_left_in_peace() {
    let seconds = fly(MissionConfig::sts65(9, 6.0));
    let frames = frames(&seconds);
    let playbacks = playbacks(&frames, &LinkConfig::default(), &RecorderConfig::messy(), 21);
    assert!(playbacks.iter().any(|p| p.reversed) && playbacks.iter().any(|p| p.inverted));
    let (records, _, kept) = receive(playbacks.iter().map(|p| p.octets.as_slice()));
    for (id, octets) in &kept {
        assert_eq!(octets, &frames[id.count as usize], "{id}");
    }
    let untouched = |k: usize| {
        playbacks.iter().any(|p| {
            (p.first_frame..p.first_frame + p.frames).contains(&k) && !p.touched.contains(&k) && !p.lost.contains(&k)
        })
    };
    let missing: Vec<usize> = (0..frames.len())
        .filter(|k| untouched(*k) && !kept.contains_key(&FrameId { channel: 1, count: *k as u32 }))
        .collect();
    // A receiver locks on at the first marker it sees whole: the last frame of a reversed pass may go with the cut.
    assert!(missing.len() <= playbacks.len(), "{missing:?}");
    let sent: BTreeMap<i64, AccRecord> = sent_science(&seconds).into_iter().map(|a| (a.clock.tenths(), a)).collect();
    for acc in science(&records) {
        assert_eq!(sent[&acc.clock.tenths()], acc);
    }
}

#[test]
fn packets_are_as_many_as_in_the_samples_over_the_same_hours() {
    // clean-6h: 21600 ACC, 2160 HSK, 3093 TBL, 736 PRC over its two bias calibrations and one of scale.
    let mut config = MissionConfig::sts65(2, 6.0);
    config.start_clock_s = 226_280;
    config.attitudes[0].from_clock_s = 226_280.0;
    config.calibration.first_id = 15;
    let seconds = fly(config);
    let count = |kind: fn(&Record) -> bool| seconds.iter().flat_map(|s| &s.sent).filter(|s| kind(&s.record)).count();
    assert_eq!(count(|r| matches!(r, Record::Acc(_))), 21_600);
    assert_eq!(count(|r| matches!(r, Record::Hsk(_))), 2160);
    assert_eq!(count(|r| matches!(r, Record::Tbl(_))), 3093);
    assert_eq!(count(|r| matches!(r, Record::Prc(_))), 736);
    let first_hsk = seconds[0].sent.iter().find_map(|s| match &s.record {
        Record::Hsk(hsk) => Some((hsk.bias_calibrations, hsk.scale_calibrations)),
        _ => None,
    });
    assert_eq!(first_hsk, Some((14, 5)));
    assert_eq!(frames(&seconds).len(), 1865);
}

/// Mean counts of an axis in a step, its last `keep_s` seconds.
fn mean_counts(seconds: &[Second], target: u8, range: Range, step: Step, axis: usize, keep_s: usize) -> f64 {
    let records: Vec<AccRecord> = sent_science(seconds)
        .into_iter()
        .filter(|a| a.target == target && a.ranges[0] == range && a.step == step)
        .collect();
    assert!(records.len() >= keep_s, "{} seconds of target {target} {range:?} {step:?}", records.len());
    let end = records.len().min(50);
    let values: Vec<f64> =
        records[end - keep_s..end].iter().flat_map(|a| a.counts).map(|c| f64::from(c[axis])).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn the_planted_bias_and_scale_factor_are_in_the_counts() {
    let config = still(0.8);
    let (instrument, time) = (config.instrument.clone(), config.time);
    let seconds = fly(config);
    for (axis, target) in [(0, 1), (1, 2), (2, 2)] {
        for range in Range::ALL {
            let normal = mean_counts(&seconds, target, range, Step::Normal, axis, 5);
            let opposite = mean_counts(&seconds, target, range, Step::Opposite, axis, 5);
            // Between the last seconds of the two positions lie 75 s: the law at their middle.
            let last = sent_science(&seconds)
                .iter()
                .filter(|a| a.target == target && a.ranges[0] == range && a.step == Step::Opposite)
                .map(|a| a.clock.seconds())
                .fold(0.0, f64::max);
            let middle_s = last - 40.0;
            let temperature_c = seconds[(middle_s - 14_400.0) as usize].temperature_c;
            let expected = instrument.bias_counts(Axis::ALL[axis], range, time.met_h(middle_s), temperature_c);
            // 45 s of settling leave 1.7 of 3000 counts, halved; the noise of 6.4 counts leaves 2 after 5 s.
            let bound = if range == Range::C { 7.0 } else { 1.0 };
            let found = (normal + opposite) / 2.0;
            assert!((found - expected).abs() < bound, "{axis} {range:?} {normal} {opposite} {expected}");
        }
    }
    for (axis, target) in [(0, 1), (1, 2), (2, 3)] {
        let [pre, rate, post] =
            [Step::PreRate, Step::Rate, Step::PostRate].map(|s| mean_counts(&seconds, target, Range::C, s, axis, 50));
        let felt_ng = instrument.radius_m[axis] * 0.07_f64.powi(2) / NANO_G_M_S2;
        let ng_per_count = felt_ng / (rate - (pre + post) / 2.0);
        let expected = instrument.ng_per_count(Axis::ALL[axis], Range::C);
        assert!((ng_per_count / expected - 1.0).abs() < 5e-4, "{axis} {ng_per_count} {expected}");
    }
}

#[test]
fn settling_shows_in_the_opposite_position_of_y_and_z_only() {
    let seconds = fly(still(0.8));
    let first_second =
        |target: u8| *sent_science(&seconds).iter().find(|a| a.target == target && a.step == Step::Opposite).unwrap();
    let late = |axis| mean_counts(&seconds, 2, Range::C, Step::Opposite, axis, 5);
    let (y, z) = (f64::from(first_second(2).counts[0][1]) - late(1), f64::from(first_second(2).counts[0][2]) - late(2));
    assert!((y + 3000.0).abs() < 30.0 && (z + 110.0).abs() < 30.0, "{y} {z}");
    assert!((f64::from(first_second(1).counts[0][1]) - late(1)).abs() < 60.0);
}

#[test]
fn the_noise_in_the_counts_is_the_noise_of_the_plan() {
    let mut config = still(0.5);
    config.noise = NoisePlan { sleep_begins_met_h: 0.0, ..NoisePlan::sts65() }.without_bursts();
    config.calibration.first_after_s = 100_000;
    let instrument = config.instrument.clone();
    let levels = config.noise.asleep_ng;
    let acc = sent_science(&fly(config));
    for axis in 0..3 {
        let ng: Vec<f64> = acc
            .iter()
            .flat_map(|a| a.counts)
            .map(|c| f64::from(c[axis]) * instrument.ng_per_count(Axis::ALL[axis], Range::C))
            .collect();
        // Differences over 30 s: the drift of the bias is gone, the variance doubled.
        let variance = ng.windows(301).map(|w| (w[300] - w[0]).powi(2)).sum::<f64>() / (ng.len() - 300) as f64 / 2.0;
        assert!((variance.sqrt() / levels[axis] - 1.0).abs() < 0.05, "{axis} {}", variance.sqrt());
    }
}

#[test]
fn truth_is_the_mean_of_the_forces_over_each_window() {
    let mission = Mission::new(MissionConfig::sts65(6, 5.0)).unwrap();
    let mut builder = TruthBuilder::default();
    let windows: Vec<TrueWindow> = mission.fly().filter_map(|second| builder.take(&second)).collect();
    assert_eq!(windows.len(), 5 * 144 - 1);
    for window in windows.iter().step_by(37) {
        let from = f64::from(window.start_clock_s);
        let mean = (0..50)
            .map(|k| mission.forces().smooth_m_s2(from + f64::from(k) + 0.45) / NANO_G_M_S2)
            .fold(crate::physics::Vec3::zeros(), |sum, a| sum + a / 50.0);
        assert!((window.body_ng - mean).norm() < 0.05, "{window:?} {mean}");
    }
    assert!(windows.iter().any(|w| !w.normal) && windows.iter().any(|w| w.normal));
}

#[test]
fn a_misreported_range_is_hidden_in_the_records_and_ends_with_a_rail() {
    let mut config = MissionConfig::sts65(4, 3.0);
    config.faults = vec![
        Fault::ScaleAborted { calibration_id: 1, sequence: 4 },
        Fault::RangeMisreport { from_clock_s: 0, seconds: 3600 },
    ];
    let mission = Mission::new(config).unwrap();
    let (from_s, to_s) = mission.fly().misreported().unwrap();
    let seconds: Vec<Second> = mission.fly().collect();
    for second in &seconds {
        let acc = sent_science(std::slice::from_ref(second))[0];
        if (from_s..to_s).contains(&second.clock_s) {
            assert_eq!((acc.ranges, second.true_ranges), ([Range::C; 3], [Range::A; 3]));
            assert_eq!(acc.at_rail, second.clock_s == to_s - 1, "{}", second.clock_s);
        } else if second.clock_s > to_s {
            assert_eq!(acc.ranges, second.true_ranges);
        }
    }
    let codes: Vec<EventCode> = seconds
        .iter()
        .flat_map(|s| &s.sent)
        .filter_map(|s| if let Record::Evt(event) = &s.record { Some(event.code) } else { None })
        .collect();
    for code in [EventCode::ReentryAsserted, EventCode::ReentryCancelled, EventCode::ScaleAborted] {
        assert_eq!(codes.iter().filter(|c| **c == code).count(), 1, "{code:?}");
    }
    assert!(instrument_json(&mission).contains("\"range_misreported\""));
}

#[test]
fn clocks_jump_axes_saturate_and_the_instrument_shuts_down() {
    let mut config = still(2.0);
    config.faults = vec![
        Fault::ClockJump { at_clock_s: 17_000, jump_s: 0.5 },
        Fault::Saturation { axis: 2, from_clock_s: 18_000.0, seconds: 2.0 },
        Fault::Shutdown { at_clock_s: 20_000 },
    ];
    let epoch_ms = config.time.epoch_utc.as_millisecond();
    let seconds = fly(config);
    let acc = sent_science(&seconds);
    let ahead_ms = |a: &AccRecord| a.orbiter_unix_ms - epoch_ms - a.clock.tenths() * 100;
    let at = |clock_s: i64| acc.iter().find(|a| a.clock.tenths() == clock_s * 10).unwrap();
    assert!((ahead_ms(at(17_000)) - ahead_ms(at(16_999)) - 500).abs() < 15);
    let saturated = at(18_001);
    assert!(saturated.counts.iter().all(|c| c[2] == AccRecord::RAIL_COUNTS) && saturated.at_rail);
    assert_eq!(at(18_006).ranges, [Range::C, Range::C, Range::A]);
    let last = acc.last().unwrap();
    assert_eq!((last.clock.tenths() / 10, last.mode), (20_000 + i64::from(SHUTDOWN_S), Mode::Reentry));
    assert!(last.counts.iter().all(|c| c[1] == AccRecord::RAIL_COUNTS));
    let codes =
        |s: &Second| s.sent.iter().any(|s| matches!(&s.record, Record::Evt(e) if e.code == EventCode::Shutdown));
    assert!(codes(seconds.last().unwrap()));
}

#[test]
fn what_is_planted_in_a_scale_calibration_is_there() {
    let plain = fly(still(0.8));
    let mut config = still(0.8);
    config.faults = vec![
        Fault::ElectronicShift { z_counts: 150.0 },
        Fault::TableJitter { calibration_id: 1, share: 0.02 },
        Fault::MalformedScaleRecord { calibration_id: 1, sequence: 7 },
        Fault::BiasOutlier { calibration_id: 1, counts: [900.0, 0.0, 300.0] },
    ];
    let faulty = fly(config);
    let shift = |target, step, axis| {
        mean_counts(&faulty, target, Range::C, step, axis, 40) - mean_counts(&plain, target, Range::C, step, axis, 40)
    };
    assert!((shift(3, Step::PostRate, 2) - 150.0).abs() < 0.1);
    assert_eq!(shift(3, Step::PreRate, 2), 0.0);
    for step in [Step::Normal, Step::Opposite] {
        assert!((shift(1, step, 0) - 900.0).abs() < 0.1 && (shift(2, step, 2) - 300.0).abs() < 0.1);
        assert_eq!(shift(2, step, 1), 0.0);
    }
    let playbacks = playbacks(&frames(&faulty), &LinkConfig::default(), &RecorderConfig::clean(), 1);
    let (records, refused, _) = receive(playbacks.iter().map(|p| p.octets.as_slice()));
    // 50 seconds at rate in range C: 50 table packets cut short, one science record without a time.
    assert_eq!(refused, 51);
    assert_eq!(science(&records).len(), faulty.len() - 1);
    let scatter = |seconds: &[Second]| {
        let rates: Vec<f64> = seconds
            .iter()
            .flat_map(|s| &s.sent)
            .filter_map(|s| match &s.record {
                Record::Tbl(t) if t.step == Step::Rate && t.target == 3 && t.ranges[0] == Range::C => {
                    Some(t.rate_rad_s)
                }
                _ => None,
            })
            .collect();
        rates.iter().map(|r| (r / 0.07 - 1.0).powi(2)).sum::<f64>() / rates.len() as f64
    };
    assert!(scatter(&plain) < 1e-20 && (scatter(&faulty).sqrt() - 0.02).abs() < 0.012, "{}", scatter(&faulty).sqrt());
}
