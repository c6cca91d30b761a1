//! The sample dumps, through the pure core: what is recovered, how well, and that arrival changes nothing.

use std::collections::BTreeSet;
use std::path::PathBuf;

use oare_ground::ingest::wire::{LinkConfig, PlaybackPart, PlaybackReader};
use oare_ground::pipeline::calibration::KnownCalibration;
use oare_ground::pipeline::station::replay;
use oare_ground::pipeline::{PlaybackId, Settings, Station, files};

use crate::shared_data;

fn dumps() -> Option<PathBuf> {
    shared_data("dumps")
}

fn messy(folder: &std::path::Path) -> Vec<Vec<u8>> {
    (1..=6).map(|n| std::fs::read(folder.join(format!("messy-6h/{n}.dump"))).unwrap()).collect()
}

/// The parts of one stream, cut into chunks of so many octets.
fn parts(dump: &[u8], chunk_octets: usize) -> Vec<PlaybackPart> {
    let mut reader = PlaybackReader::new(LinkConfig::default());
    let mut parts = Vec::new();
    dump.chunks(chunk_octets).for_each(|chunk| reader.push(chunk, |part| parts.push(part)));
    reader.finish(|part| parts.push(part));
    parts
}

fn station<'a>(
    streams: impl Iterator<Item = &'a Vec<PlaybackPart>> + Clone,
    known: Option<&KnownCalibration>,
) -> Station {
    replay(&Settings::sts65(), known, |station| {
        let mut next = 0;
        for part in streams.clone().flatten() {
            match part {
                PlaybackPart::Opened => {
                    next += 1;
                    station.open_playback(PlaybackId(next));
                }
                PlaybackPart::Arrival(arrival) => station.take(PlaybackId(next), arrival),
                PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(next), *bits),
            }
        }
    })
}

/// The bytes that must not depend on arrival, and what of the ledger must not.
fn product_bytes(station: &Station) -> [String; 5] {
    let ledger = station.ledger();
    [
        files::windows_csv(station),
        files::calibration_json(station).to_string(),
        files::anomalies_json(station).to_string(),
        format!("{:?}", ledger.total()),
        format!("{:?}", station.gaps()),
    ]
}

#[test]
fn the_messy_sample_yields_exactly_the_recoverable_seconds() {
    let Some(folder) = dumps() else { return };
    let text = std::fs::read_to_string(folder.join("messy-6h/expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&text).unwrap();
    let streams: Vec<_> = messy(&folder).iter().map(|dump| parts(dump, 1460)).collect();
    let station = station(streams.iter(), None);
    assert_eq!(station.ledger().seconds.len(), expected["acc_seconds_recoverable"].as_u64().unwrap());
    let missing: BTreeSet<i64> =
        expected["missing_clock_s"].as_array().unwrap().iter().map(|s| s.as_f64().unwrap() as i64).collect();
    let gaps: BTreeSet<i64> = station.ledger().seconds.gaps().iter().flat_map(|(from, to)| *from..*to).collect();
    assert_eq!(gaps, missing);
    for (playback, expected) in station.ledger().playbacks().zip(expected["playbacks"].as_array().unwrap()) {
        let (_, playback) = playback;
        let sense = playback.sense.expect("every playback has a good frame");
        assert_eq!(sense.direction_word(), expected["direction"].as_str().unwrap());
        assert_eq!(sense.polarity_word(), expected["polarity"].as_str().unwrap());
        let whole = playback.account.frames_new + playback.account.frames_repeated;
        assert_eq!(whole, expected["frames_whole"].as_u64().unwrap());
        assert!(playback.account.closes());
    }
    assert!(station.ledger().total().closes());
}

/// Every order of `items`.
fn orders(items: &mut Vec<usize>, at: usize, visit: &mut impl FnMut(&[usize])) {
    if at == items.len() {
        return visit(items);
    }
    for other in at..items.len() {
        items.swap(at, other);
        orders(items, at + 1, visit);
        items.swap(at, other);
    }
}

/// Compares every `stride`-th of the 720 orders with the first.
fn compare_orders(stride: usize) {
    let Some(folder) = dumps() else { return };
    let streams: Vec<_> = messy(&folder).iter().map(|dump| parts(dump, 65_536)).collect();
    let reference = product_bytes(&station(streams.iter(), None));
    let (mut seen, mut compared) = (0, 0);
    orders(&mut (0..6).collect(), 0, &mut |order| {
        seen += 1;
        if seen % stride == 0 {
            compared += 1;
            let bytes = product_bytes(&station(order.iter().map(|n| &streams[*n]), None));
            assert!(bytes == reference, "order {order:?} gives other products");
        }
    });
    assert_eq!((seen, compared), (720, 720 / stride));
}

#[test]
fn thirty_orders_of_arrival_give_the_same_bytes() {
    compare_orders(24);
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn all_720_orders_of_arrival_give_the_same_bytes() {
    compare_orders(1);
}

#[test]
fn chunks_and_repeats_give_the_same_bytes() {
    let Some(folder) = dumps() else { return };
    let dumps = messy(&folder);
    let streams = |chunk: usize| dumps.iter().map(|dump| parts(dump, chunk)).collect::<Vec<_>>();
    let whole = streams(65_536);
    for chunk in [1, 7, 1460] {
        assert!(streams(chunk) == whole, "chunks of {chunk} octets give other frames");
    }
    let reference = product_bytes(&station(whole.iter(), None));
    let twice = station(whole.iter().chain(whole.iter().rev()), None);
    assert!(product_bytes(&twice)[..3] == reference[..3], "repeats give other products");
    assert!(twice.ledger().total().closes());
}

/// Truth of one sample by window start: body axes, ng; only windows wholly in normal mode.
fn truth(path: &std::path::Path) -> Vec<(f64, [f64; 3])> {
    let text = std::fs::read_to_string(path).unwrap();
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse::<f64>().unwrap()).collect::<Vec<_>>())
        .filter(|row| row[5] == 1.0)
        .map(|row| (row[0], [row[1], row[2], row[3]]))
        .collect()
}

#[test]
fn the_clean_sample_is_recovered_to_the_noise_floor() {
    let Some(folder) = dumps() else { return };
    let text = std::fs::read_to_string(folder.join("clean-6h.instrument.json")).unwrap();
    let known = KnownCalibration::parse(&text).unwrap();
    let stream = parts(&std::fs::read(folder.join("clean-6h.dump")).unwrap(), 1460);
    let station = station(std::iter::once(&stream), Some(&known));
    assert_eq!(station.ledger().seconds.len(), 21_600);
    let truth = truth(&folder.join("clean-6h.truth.csv"));
    let mut errors: [Vec<f64>; 3] = Default::default();
    for product in station.products().filter(|product| product.quality.is_good()) {
        let Ok(at) = truth.binary_search_by(|row| row.0.total_cmp(&product.start.seconds())) else { continue };
        let found = product.acceleration.whole().unwrap().map(|axis| axis.trimmed_ng);
        (0..3).for_each(|axis| errors[axis].push(found[axis] - truth[at].1[axis]));
    }
    // The noise floor that the windows of this sample leave: RMS 118, 54, 70 ng in X, Y, Z body, to within 3 %.
    for (axis, floor_ng) in [118.0, 54.0, 70.0].into_iter().enumerate() {
        let n = errors[axis].len() as f64;
        let mean = errors[axis].iter().sum::<f64>() / n;
        let rms = (errors[axis].iter().map(|error| error * error).sum::<f64>() / n).sqrt();
        assert!((rms / floor_ng - 1.0).abs() < 0.03, "axis {axis}: rms {rms:.1} ng, floor {floor_ng}");
        // Windows overlap by half, so that half as many are independent.
        assert!(mean.abs() < 3.0 * rms / (n / 2.0).sqrt(), "axis {axis}: mean {mean:.1} ng");
        println!("axis {axis}: {n} windows, mean {mean:.1} ng, rms {rms:.1} ng");
    }
}
