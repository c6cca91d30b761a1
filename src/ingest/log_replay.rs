//! The raw log, taken again by a station: after a restart, for an export, and without the frames that lost a vote.

use std::collections::HashMap;

use super::raw_log::{Entry, RawLog, StoreError, Stored};
use crate::pipeline::{PlaybackId, Settings, Station};

/// A station over a whole log, with nobody to tell.
///
/// # Errors
/// When the log cannot be read.
pub fn rebuild(log: &RawLog, settings: &Settings) -> Result<Station, StoreError> {
    let mut station = Station::new(settings.clone(), None);
    take_log(log, &mut station, |_, _, _| {})?;
    station.flush();
    Ok(station)
}

/// A new station takes a whole log, a second time where frames lost a vote; `note` is called with every batch it took.
pub(super) fn take_log(
    log: &RawLog,
    station: &mut Station,
    mut note: impl FnMut(&mut Station, u64, &[Stored]),
) -> Result<(), StoreError> {
    take_once(log, station, &mut note)?;
    if let Some(again) = taken_again(log, station, note)? {
        *station = again;
    }
    Ok(())
}

/// Another station that takes the log again, where good frames of one identity differ and one in use lost the vote; None where none did.
pub(super) fn taken_again(
    log: &RawLog,
    station: &Station,
    mut note: impl FnMut(&mut Station, u64, &[Stored]),
) -> Result<Option<Station>, StoreError> {
    let Some(set_aside) = station.to_set_aside() else { return Ok(None) };
    tracing::warn!("good frames of one identity differ; the log is taken again with the ones seen more often");
    let mut again = Station::without(station.settings().clone(), None, set_aside);
    take_once(log, &mut again, &mut note)?;
    Ok(Some(again))
}

fn take_once(
    log: &RawLog,
    station: &mut Station,
    note: &mut impl FnMut(&mut Station, u64, &[Stored]),
) -> Result<(), StoreError> {
    log.replay(|number, batch| {
        for stored in &batch {
            take_stored(log, station, stored)?;
        }
        note(station, number, &batch);
        Ok(())
    })
}

/// The octets of a repeat are read again only where the station cannot do without.
fn take_stored(log: &RawLog, station: &mut Station, stored: &Stored) -> Result<(), StoreError> {
    match stored {
        Stored::Entry(entry, _) => take_entry(station, entry),
        Stored::Repeat { playback, arrival, place } => {
            let playback = PlaybackId(*playback);
            if !station.take_repeat(playback, arrival) {
                station.take(playback, &log.resolve(arrival.clone(), *place)?);
            }
        }
    }
    Ok(())
}

/// A station takes one entry.
pub(super) fn take_entry(station: &mut Station, entry: &Entry) {
    match entry {
        Entry::Opened { playback } => station.open_playback(PlaybackId(*playback)),
        Entry::Arrival { playback, arrival } => station.take(PlaybackId(*playback), arrival),
        Entry::Closed { playback, bits } => station.close_playback(PlaybackId(*playback), *bits),
    }
}

/// Playbacks that a crash left open: from which bit of their stream to which.
pub(super) struct Orphans {
    frame_octets: usize,
    open: HashMap<u32, (u64, u64)>,
    /// One more than the greatest number of a playback.
    pub(super) next_playback: u32,
}

impl Orphans {
    /// None yet; frames have so many octets.
    pub(super) fn new(frame_octets: usize) -> Self {
        Self { frame_octets, open: HashMap::new(), next_playback: 0 }
    }

    /// Notes one entry of the log.
    pub(super) fn note(&mut self, stored: &Stored) {
        match stored {
            Stored::Entry(Entry::Opened { playback }, _) => {
                self.next_playback = self.next_playback.max(playback + 1);
                self.open.insert(*playback, (0, 0));
            }
            Stored::Entry(Entry::Closed { playback, .. }, _) => {
                self.open.remove(playback);
            }
            Stored::Entry(Entry::Arrival { playback, arrival }, _) => {
                self.note_arrival(*playback, arrival.first_bit, arrival.octets.len());
            }
            Stored::Repeat { playback, arrival, .. } => {
                self.note_arrival(*playback, arrival.first_bit, self.frame_octets);
            }
        }
    }

    fn note_arrival(&mut self, playback: u32, first_bit: u64, octets: usize) {
        let end_bit = first_bit + octets as u64 * 8;
        let span = self.open.entry(playback).or_insert((first_bit, end_bit));
        if *span == (0, 0) {
            *span = (first_bit, end_bit);
        }
        span.1 = span.1.max(end_bit);
    }

    /// The ends of these playbacks, as far as their bits are known.
    pub(super) fn closing(self) -> Vec<Entry> {
        let closed = |(playback, (from_bit, to_bit))| Entry::Closed { playback, bits: to_bit - from_bit };
        let mut open: Vec<_> = self.open.into_iter().collect();
        open.sort_unstable_by_key(|(playback, _)| *playback);
        open.into_iter().map(closed).collect()
    }
}
