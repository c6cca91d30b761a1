//! What of a change is told to readers, and what of a station to those who ask how it stands.

use std::collections::BTreeMap;

use crate::hub::status::Picture;
use crate::hub::wire::{Gap, members, told_anomaly, told_calibration, told_event, withdrawn};
use crate::hub::{Body, Hub, Topic};
use crate::pipeline::{Change, Station};
use crate::units::Clock;

/// What a change says to readers; `None` when they know.
pub(super) fn body(hub: &Hub, station: &Station, change: Change) -> Option<Body> {
    match change {
        Change::Window { product, .. } => match hub.told_revision(product.start) {
            Some(revision) if revision == product.revision => None,
            Some(revision) => Some(Body::Supersede(product, Some(revision))),
            None => Some(Body::Window(product)),
        },
        Change::Raw(record) => Some(Body::Second(record)),
        change => whole(station, &change),
    }
}

/// What takes back the anomalies that were told and are not among those there are now.
pub(super) fn taken_back(mut told: BTreeMap<(Topic, String), Clock>, now: impl Iterator<Item = Body>) -> Vec<Body> {
    for anomaly in now {
        if let Body::Told { topic, json, .. } = anomaly {
            told.remove(&(topic, json));
        }
    }
    let gone = told.into_iter().filter(|((topic, _), _)| *topic == Topic::Anomaly);
    gone.map(|((topic, json), clock)| withdrawn(Body::Told { topic, clock, json })).collect()
}

/// What is told whole of a change.
pub(super) fn whole(station: &Station, change: &Change) -> Option<Body> {
    let mission = station.settings().time;
    match change {
        Change::Window { .. } | Change::Raw(_) => None,
        Change::Gap { from, to } => {
            let json = members("gap", &Gap::new(&mission, *from, *to));
            Some(Body::Told { topic: Topic::Window, clock: *from, json })
        }
        Change::Event(event) => Some(told_event(&mission, event)),
        Change::Anomaly(anomaly) => Some(told_anomaly(&mission, anomaly)),
        Change::AnomalyWithdrawn(anomaly) => Some(withdrawn(told_anomaly(&mission, anomaly))),
        Change::Calibration { .. } => station.calibration().map(told_calibration),
    }
}

pub(super) fn picture(station: &Station) -> Picture {
    let ledger = station.ledger();
    let total = ledger.total();
    let refused: u64 = total.frames_refused.values().sum();
    let latest = ledger.seconds.spans().last().map(|(_, to)| to as f64);
    Picture {
        frames_durable: total.frames_new + total.frames_repeated + refused,
        frames_new: total.frames_new,
        frames_repeated: total.frames_repeated,
        frames_refused: total.frames_refused.iter().map(|(reason, n)| (reason.word(), *n)).collect(),
        packets: total.packets,
        packets_refused: total.packets_refused,
        bits_in: total.bits_in,
        frame_conflicts: ledger.frame_conflicts,
        playbacks: ledger.playbacks().count() as u64,
        playbacks_open: ledger.playbacks().filter(|(_, playback)| !playback.closed).count() as u64,
        seconds_covered: ledger.seconds.len(),
        gaps: station.gaps(),
        latest_clock_s: latest,
        calibration: station.calibration().map_or(0, |calibration| calibration.version),
        events: station.events().count() as u64,
        anomalies: station.derived().anomalies.len() as u64,
        settled: station.is_settled(),
    }
}
