//! The on-board estimator against the on-board estimates in the sample dumps, bit for bit.

use std::collections::BTreeMap;

use oare_ground::ingest::wire::{
    Assembled, Assembler, Deframer, LinkConfig, Record, SpacePacket, TransferFrame, Verdict,
};
use oare_ground::simulate::onboard::{WINDOW, estimate};
use oare_ground::telemetry::{AccRecord, OnBoardEstimate};

fn records(dump: &[u8]) -> (BTreeMap<i64, AccRecord>, Vec<OnBoardEstimate>) {
    let link = LinkConfig::default();
    let mut frames = Vec::new();
    let mut deframer = Deframer::new(link);
    deframer.push(dump, |arrival| frames.extend(matches!(arrival.verdict, Verdict::Good(_)).then_some(arrival.octets)));
    let (mut assembler, mut science, mut estimates) = (Assembler::default(), BTreeMap::new(), Vec::new());
    for octets in &frames {
        let frame = TransferFrame::read(&link, octets).unwrap();
        assembler.take(&frame, |assembled| {
            let Assembled::Packet(_, octets) = assembled else { return };
            match SpacePacket::read(octets).and_then(|packet| Record::read(&packet)) {
                Ok(Record::Acc(acc)) => drop(science.insert(acc.clock.tenths(), acc)),
                Ok(Record::Prc(prc)) => estimates.push(prc),
                _ => {}
            }
        });
    }
    (science, estimates)
}

#[test]
fn the_samples_on_board_estimates_are_the_flight_form_of_the_estimator() {
    for name in ["dumps/clean-6h.dump", "dumps/defects-24h.dump"] {
        let Some(path) = super::shared_data(name) else { return };
        let (science, estimates) = records(&std::fs::read(path).unwrap());
        assert!(estimates.len() > 700);
        let mut compared = 0;
        for sent in &estimates {
            let start = sent.clock.tenths();
            let seconds: Option<Vec<&AccRecord>> = (0..50).map(|k| science.get(&(start + k * 10))).collect();
            let Some(seconds) = seconds else { continue };
            for (axis, sent) in sent.axes.iter().enumerate() {
                let counts: Vec<i16> = seconds.iter().flat_map(|acc| acc.counts).map(|c| c[axis]).collect();
                assert_eq!(counts.len(), WINDOW);
                assert_eq!(
                    estimate(&counts, seconds[49].ranges[axis], true),
                    *sent,
                    "{name} window {start} axis {axis}"
                );
                compared += 1;
            }
        }
        assert!(compared > 2000, "{compared}");
    }
}
