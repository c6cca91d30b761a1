//! A log that cannot be read for a while.

use super::*;
use crate::ingest::wire::{Arrival, Direction, FrameId, LinkConfig, Polarity, Sense, Verdict, frame};
use crate::pipeline::Settings;

/// A playback of one good frame of the same identity, told apart by an octet.
fn playback(playback: u32, octet: u8) -> [Entry; 3] {
    let link = LinkConfig::default();
    let id = FrameId { channel: 1, count: 7 };
    let data = vec![octet; link.frame_octets - frame::HEADER_OCTETS - frame::FECF_OCTETS];
    let arrival = Arrival {
        sense: Sense { direction: Direction::Forward, polarity: Polarity::Normal },
        first_bit: 0,
        verdict: Verdict::Good(id),
        octets: frame::write(&link, id, octet, frame::NO_PACKET_STARTS, &data),
    };
    [Entry::Opened { playback }, Entry::Arrival { playback, arrival }, Entry::Closed { playback, bits: 8 * 1119 }]
}

#[test]
fn a_log_that_cannot_be_read_for_a_while_is_taken_again_when_it_can() {
    let dir = tempfile::tempdir().unwrap();
    let (there, away) = (dir.path().join("there"), dir.path().join("away"));
    let settings = Settings::sts65();
    let log = Arc::new(RawLog::open(&there, &settings.mission, &settings.link).unwrap());
    let station: SharedStation = Arc::new(RwLock::new(Station::new(settings.clone(), None)));
    let hub = Hub::new(&settings.mission, 0x41, 16, Arc::new(StationSamples(station.clone())));
    let journal = log.journal().unwrap();
    let mut writer = Writer::restore(log.clone(), journal, station, Arc::new(hub), Arc::new(Board::default())).unwrap();
    // Of two frames with one vote each that with the lower hash counts: in one of both orders the one in use loses.
    for (n, octet) in [(1, 1), (2, 2)] {
        let batch = playback(n, octet);
        writer.write(&batch, NUMBERS_AHEAD).unwrap();
        writer.take(&batch);
    }
    if !writer.aside_waits {
        let batch = [playback(3, 2), playback(4, 3)].concat();
        writer.write(&batch, NUMBERS_AHEAD).unwrap();
        writer.take(&batch);
    }
    assert!(writer.aside_waits);

    std::fs::rename(&there, &away).unwrap();
    log.reopen().unwrap_err();
    writer.set_frames_aside(1);
    assert!(writer.aside_waits, "it waits");
    std::fs::rename(&away, &there).unwrap();
    log.reopen().unwrap();
    assert!(writer.aside_failed.is_some());
    writer.aside_failed = Some(Instant::now() + RETRY);
    writer.set_frames_aside(1);
    assert!(writer.aside_waits, "not time and again");
    writer.aside_failed = Instant::now().checked_sub(RETRY);
    writer.set_frames_aside(1);
    assert!(!writer.aside_waits);
    assert_eq!(writer.station.read().unwrap().to_set_aside(), None);
}
