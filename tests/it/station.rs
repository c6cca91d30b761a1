//! The pipeline as a state machine: what a late, repeated or contradicting frame does.

use std::collections::BTreeMap;

use oare_ground::ingest::wire::packet::{Apid, PacketId, total_octets, write, write_idle};
use oare_ground::ingest::wire::record::write_acc;
use oare_ground::ingest::wire::{Arrival, FrameId, LinkConfig, PlaybackPart, PlaybackReader, Sense, Verdict, frame};
use oare_ground::pipeline::calibration::KnownCalibration;
use oare_ground::pipeline::product::Revision;
use oare_ground::pipeline::station::replay;
use oare_ground::pipeline::{Change, PlaybackId, Settings, Station, files};
use oare_ground::simulate::recorder::{self, RecorderConfig, playbacks};
use oare_ground::simulate::{Fault, Mission, MissionConfig};
use oare_ground::telemetry::{AccRecord, Mode, Quality, Range, Step};
use oare_ground::units::Clock;

/// One second of quiet science data, its counts a simple function of time and `offset`.
fn record(second: i64, offset: i16) -> AccRecord {
    let counts = std::array::from_fn(|n| {
        let wave = (second * 10 + n as i64) % 17;
        [wave as i16 + offset, 2 * wave as i16, 5 - wave as i16]
    });
    AccRecord {
        clock: Clock::from_tenths(second * 10),
        sequence: (second % 16_384) as u16,
        orbiter_unix_ms: 773_671_981_000 + second * 1000,
        counts,
        temperature_c: 4.0,
        mode: Mode::Normal,
        quiet: false,
        table_moving: false,
        at_rail: false,
        ranges: [Range::C; 3],
        target: 0,
        step: Step::None,
    }
}

/// Frames of channel 1 that carry these records.
fn frames(records: &[AccRecord]) -> Vec<Arrival> {
    frames_from(0, records)
}

/// The same, counted from a number on.
fn frames_from(first_count: u32, records: &[AccRecord]) -> Vec<Arrival> {
    let link = LinkConfig::default();
    let mut octets: Vec<u8> = records
        .iter()
        .flat_map(|record| {
            let id = PacketId { apid: Apid::ACC, clock: record.clock, sequence: record.sequence };
            write(id, &write_acc(record))
        })
        .collect();
    let data_octets = 1103;
    let short = (data_octets - (octets.len() + 7) % data_octets) % data_octets;
    octets.extend(write_idle(0, 7 + short));
    let mut starts = vec![];
    let mut at = 0;
    while at < octets.len() {
        starts.push(at);
        at += total_octets(&octets[at..]).unwrap();
    }
    let first_header = |from: usize| {
        let inside = starts.iter().find(|start| (from..from + data_octets).contains(*start));
        inside.map_or(frame::NO_PACKET_STARTS, |start| (start - from) as u16)
    };
    octets
        .chunks(data_octets)
        .enumerate()
        .map(|(count, data)| {
            let id = FrameId { channel: 1, count: first_count + count as u32 };
            good(id, frame::write(&link, id, count as u8, first_header(count * data_octets), data))
        })
        .collect()
}

/// A good frame, forward.
fn good(id: FrameId, octets: Vec<u8>) -> Arrival {
    Arrival { sense: Sense::ALL[0], first_bit: 0, verdict: Verdict::Good(id), octets }
}

fn known() -> KnownCalibration {
    let scale = [[1.0; 3]; 3];
    let law = [[[0.0, 0.0, 0.0, 0.0, 1.0, 10.0]; 3]; 3];
    let text = serde_json::json!({"scale_correction": scale, "bias_law_coefficients": law}).to_string();
    KnownCalibration::parse(&text).unwrap()
}

fn revisions(changes: &[Change]) -> Vec<(f64, bool)> {
    changes
        .iter()
        .filter_map(|change| match change {
            Change::Window { product, supersedes } => Some((product.start.seconds(), supersedes.is_some())),
            _ => None,
        })
        .collect()
}

#[test]
fn a_late_frame_reopens_only_the_windows_it_touches() {
    let records: Vec<AccRecord> = (1000..1400).map(|second| record(second, 0)).collect();
    let frames = frames(&records);
    let mut station = Station::new(Settings::sts65(), Some(known()));
    let late = 12;
    for frame in frames.iter().enumerate().filter(|(n, _)| *n != late).map(|(_, frame)| frame) {
        station.take(PlaybackId(1), frame);
    }
    let before = station.flush();
    let seconds_before = station.ledger().seconds.len();
    assert_eq!(station.gaps().len(), 1);
    let (from, to) = station.gaps()[0];
    station.take(PlaybackId(2), &frames[late]);
    let after = revisions(&station.flush());
    assert_eq!(station.ledger().seconds.len(), 400);
    assert!(seconds_before < 400 && revisions(&before).iter().all(|(_, superseded)| !superseded));
    // Windows of 50 s every 25 s that overlap the gap, and no others.
    let touched: Vec<f64> = (38..56)
        .map(|n| f64::from(n) * 25.0)
        .filter(|start| *start < to.seconds() && start + 50.0 > from.seconds())
        .collect();
    assert_eq!(after.iter().map(|(start, _)| *start).collect::<Vec<_>>(), touched);
    assert!(after.iter().all(|(_, superseded)| *superseded));
}

/// Octets of a simulated mission as the recorder plays them.
fn simulated(hours: f64) -> Vec<u8> {
    let mission = Mission::new(MissionConfig::sts65(17, hours)).unwrap();
    let link = LinkConfig::default();
    playbacks(&recorder::frames(mission.fly(), link), &link, &RecorderConfig::clean(), 17)
        .into_iter()
        .flat_map(|pass| pass.octets)
        .collect()
}

/// A window that is not whole is told of when the next look finds nothing more of it: two of the looks below.
const PATIENCE_TENTHS: i64 = 8000;

#[test]
fn what_is_told_of_windows_is_what_changed_and_no_more() {
    let octets = simulated(10.0);
    let mut station = Station::new(Settings::sts65(), None);
    let mut told: BTreeMap<i64, Revision> = BTreeMap::new();
    let (mut again, mut calibrations) = (0, 0);
    for playback in [1, 2].map(PlaybackId) {
        let mut reader = PlaybackReader::new(LinkConfig::default());
        // A few hundred seconds between two looks.
        for chunk in octets.chunks(1 << 15) {
            reader.push(chunk, |part| match part {
                PlaybackPart::Opened => station.open_playback(playback),
                PlaybackPart::Arrival(arrival) => station.take(playback, &arrival),
                PlaybackPart::Closed { bits } => station.close_playback(playback, bits),
            });
            let changes = station.settle();
            calibrations += changes.iter().filter(|change| matches!(change, Change::Calibration { .. })).count();
            for change in changes {
                let Change::Window { product, supersedes } = change else { continue };
                let start = product.start.tenths();
                assert_eq!(playback, PlaybackId(1), "the second time nothing is new");
                assert_eq!(supersedes, told.insert(start, product.revision), "the one told before");
                assert_ne!(supersedes, Some(product.revision), "told of without a change");
                again += usize::from(supersedes.is_some());
            }
            let last = station.windows().last().map(|window| window.start);
            for product in station
                .products()
                .filter(|product| last.is_some_and(|last| product.start.plus_tenths(PATIENCE_TENTHS) < last))
            {
                assert_eq!(told.get(&product.start.tenths()), Some(&product.revision), "a change not told");
            }
        }
        station.flush().iter().for_each(|change| {
            if let Change::Window { product, .. } = change {
                told.insert(product.start.tenths(), product.revision);
            }
        });
    }
    assert!(calibrations >= 2 && again > 500, "{calibrations} calibrations, {again} windows told of again");
}

#[test]
fn of_two_frames_that_differ_the_one_in_more_playbacks_counts_whatever_the_order() {
    let records: Vec<AccRecord> = (1000..1100).map(|second| record(second, 0)).collect();
    let mut wrong = records.clone();
    wrong[30] = record(1030, 99);
    let (right, wrong) = (frames(&records), frames(&wrong));
    let differing = right.iter().zip(&wrong).filter(|(a, b)| a.octets != b.octets).count();
    assert!(differing > 0);
    // Three playbacks; the second copy of the right one is shorter, so that it is another playback.
    let playbacks: [&[Arrival]; 3] = [&right, &wrong, &right[..right.len() - 1]];
    let clean = replay(&Settings::sts65(), Some(&known()), |station| {
        right.iter().for_each(|frame| station.take(PlaybackId(1), frame));
    });
    for order in [[0, 1, 2], [1, 0, 2], [1, 2, 0], [2, 1, 0], [0, 2, 1], [2, 0, 1]] {
        let station = replay(&Settings::sts65(), Some(&known()), |station| {
            for (n, playback) in order.iter().enumerate() {
                playbacks[*playback].iter().for_each(|frame| station.take(PlaybackId(n as u32), frame));
            }
        });
        assert_eq!(files::windows_csv(&station), files::windows_csv(&clean), "order {order:?}");
        assert_eq!(station.ledger().frame_conflicts, differing as u64);
        assert!(station.ledger().total().closes());
    }
}

#[test]
fn samples_at_the_rail_enter_no_estimate() {
    let mut records: Vec<AccRecord> = (1000..1050).map(|second| record(second, 0)).collect();
    let clean = replay(&Settings::sts65(), Some(&known()), |station| {
        frames(&records).iter().for_each(|frame| station.take(PlaybackId(1), frame));
    });
    records[10].counts[3][1] = AccRecord::RAIL_COUNTS;
    records[10].at_rail = true;
    let railed = replay(&Settings::sts65(), Some(&known()), |station| {
        frames(&records).iter().for_each(|frame| station.take(PlaybackId(1), frame));
    });
    let whole = |station: &Station| *station.products().find(|product| product.start.seconds() == 1000.0).unwrap();
    let (clean, railed) = (whole(&clean), whole(&railed));
    assert!(railed.quality.contains(Quality::SATURATED | Quality::PARTIAL));
    let z_ng = |product: &oare_ground::pipeline::Product| product.acceleration.0[2].unwrap().mean_ng;
    let difference = z_ng(&railed) - z_ng(&clean);
    // One of 500 samples at +-16 counts of 4.6 ng left out moves a mean by 0.15 ng at most; at the rail it would be 300 ng.
    assert!(difference.abs() < 0.15, "{difference}");
}

/// A channel that is at its rail takes no value from the others, and its own is unknown in every form.
#[test]
fn an_axis_at_its_rail_leaves_the_others_their_values() {
    let clean: Vec<AccRecord> = (1000..2000).map(|second| record(second, 0)).collect();
    let y_at_rail = |mut record: AccRecord| {
        record.counts.iter_mut().for_each(|counts| counts[1] = AccRecord::RAIL_COUNTS);
        AccRecord { at_rail: true, ..record }
    };
    // The last five minutes, and the last quarter of an hour.
    let railed = |from_s: usize| -> Vec<AccRecord> {
        clean.iter().enumerate().map(|(s, r)| if s < from_s { *r } else { y_at_rail(*r) }).collect()
    };
    let flown = |records: &[AccRecord]| {
        replay(&Settings::sts65(), Some(&known()), |station| {
            frames(records).iter().for_each(|frame| station.take(PlaybackId(1), frame));
        })
    };
    let (whole, shortly, long) = (flown(&clean), flown(&railed(700)), flown(&railed(100)));
    let at = |station: &Station, start_s: f64| *station.products().find(|p| p.start.seconds() == start_s).unwrap();
    let (of_clean, of_railed) = (at(&whole, 1900.0), at(&shortly, 1900.0));
    // Sensor Y is the body's Z.
    let [x, y, _] = of_clean.acceleration.whole().unwrap();
    assert_eq!(of_railed.acceleration.0, [Some(x), Some(y), None]);
    assert_ne!(of_clean.revision, of_railed.revision);
    assert!(of_railed.quality.contains(Quality::SATURATED) && !of_railed.quality.contains(Quality::UNCALIBRATED));
    let csv = files::windows_csv(&shortly);
    let row: Vec<&str> = csv.lines().last().unwrap().split(',').collect();
    let empty =
        csv.lines().next().unwrap().split(',').zip(row).filter(|(_, cell)| cell.is_empty()).map(|(name, _)| name);
    assert_eq!(
        empty.collect::<Vec<_>>(),
        ["az_ng", "sigma_az_ng", "sigma_sys_az_ng", "mean_az_ng", "q_y", "trim_y", "range_y"]
    );
    // The latest value has all three axes, unless one has been away for long.
    assert_eq!(shortly.latest().unwrap().start.seconds(), 1675.0);
    assert_eq!(long.latest().unwrap().start, whole.latest().unwrap().start);
}

/// A value a hundred times too large is not told for an hour as if nothing were wrong with it.
#[test]
fn a_wrong_range_is_noticed_within_minutes_while_data_come() {
    const FROM_S: u32 = 40_013;
    let mut config = MissionConfig::sts65(11, 12.0);
    config.faults.push(Fault::RangeMisreport { from_clock_s: FROM_S, seconds: 7200 });
    let link = LinkConfig::default();
    let mut reader = PlaybackReader::new(link);
    let mut station = Station::new(Settings::sts65(), None);
    station.open_playback(PlaybackId(1));
    let mut noticed_s = None;
    // Some ten seconds at a time, as they come down in real time.
    for piece in recorder::frames(Mission::new(config).unwrap().fly(), link).chunks(2) {
        reader.push(&crate::service_support::cadus(piece), |part| {
            if let PlaybackPart::Arrival(arrival) = part {
                station.take(PlaybackId(1), &arrival);
            }
        });
        station.settle();
        let latest_s = station.ledger().seconds.spans().last().map_or(0, |(_, to)| to);
        if !station.derived().range_corrections.is_empty() {
            noticed_s = Some(latest_s - i64::from(FROM_S));
            break;
        }
        assert!(latest_s < i64::from(FROM_S) + 300, "not noticed by {latest_s} s");
    }
    assert!(noticed_s.is_some_and(|s| (0..300).contains(&s)), "{noticed_s:?}");
}

/// Two records of one second that differ in no more than the temperature: the same one stays, and the count of conflicts is the same,
/// whichever comes first and however often.
#[test]
fn of_two_records_of_a_second_the_same_one_stays_in_every_order() {
    let colder = record(300, 0);
    let warmer = AccRecord { temperature_c: 4.5, ..colder };
    let others: Vec<AccRecord> = (0..300).chain(301..600).map(|second| record(second, 0)).collect();
    let made = |order: &[AccRecord]| {
        let mut station = Station::new(Settings::sts65(), None);
        for (n, record) in (1..).zip(order) {
            let id = PlaybackId(n);
            station.open_playback(id);
            // In frames of their own, so that none is another's repeat.
            frames_from(1000 * n, &[*record]).iter().for_each(|arrival| station.take(id, arrival));
        }
        let id = PlaybackId(100);
        station.open_playback(id);
        frames(&others).iter().for_each(|arrival| station.take(id, arrival));
        station.flush();
        (files::windows_csv(&station), station.ledger().total().packets_refused)
    };
    let one = made(&[colder, warmer, colder]);
    assert_eq!(one, made(&[warmer, colder, warmer]));
    assert_eq!(one.1["conflict"], 1);
}

/// A version of the calibration is in use from the instant on since which it is known, and not from the next one that is looked at.
#[test]
fn a_version_is_in_use_since_it_is_known() {
    let mission = Mission::new(MissionConfig::sts65(5, 5.5)).unwrap();
    let mut station = Station::new(Settings::sts65(), None);
    let id = PlaybackId(1);
    station.open_playback(id);
    let mut told = Vec::new();
    for (count, octets) in (0..).zip(recorder::frames(mission.fly(), LinkConfig::default())) {
        station.take(id, &good(FrameId { channel: 1, count }, octets));
        station.settle();
        let latest = station.ledger().seconds.spans().last().map(|(_, to)| to - 1);
        told.extend(latest.map(|second| (Clock::from_tenths(second * 10), station.calibration().map(|c| c.version))));
    }
    station.flush();
    let versions = station.derived().timeline.len();
    assert!(versions >= 2, "{versions}");
    for (clock, version) in told {
        assert_eq!(version, station.derived().as_of(clock).map(|c| c.version), "at {}", clock.seconds());
    }
}
