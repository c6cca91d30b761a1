//! The set of frames: which were seen, in which playbacks, and which of two that differ counts.
//!
//! Two good frames of one identity that differ are a conflict: the one seen in more playbacks counts, a tie goes to the lower
//! SHA-256. A playback sent again is the same playback (its frames hash to the same), so that repetition changes nothing.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use sha2::{Digest, Sha256};

use super::ledger::PlaybackId;
use crate::ingest::wire::FrameId;

/// SHA-256 of a frame.
pub type FrameDigest = [u8; 32];

/// What a frame is to the set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Novelty {
    /// Its identity is new.
    New,
    /// The same frame again.
    Repeated,
    /// Its identity was seen, with other content.
    Conflicting,
}

/// One content seen under one identity.
#[derive(Debug, Clone)]
struct Variant {
    digest: FrameDigest,
    playbacks: GroupId,
}

/// Number of a group of playbacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct GroupId(u32);

/// Groups of playbacks, each kept once: a hundred thousand frames are of a handful.
#[derive(Debug, Default)]
struct Groups {
    members: Vec<Vec<PlaybackId>>,
    /// The group that a playback makes of a group, or of none.
    with: HashMap<(Option<GroupId>, PlaybackId), GroupId>,
}

impl Groups {
    fn members(&self, group: GroupId) -> &[PlaybackId] {
        &self.members[group.0 as usize]
    }

    /// The group with this playback in it too.
    fn with(&mut self, group: Option<GroupId>, playback: PlaybackId) -> GroupId {
        if let Some(known) = self.with.get(&(group, playback)) {
            return *known;
        }
        let mut members = group.map_or_else(Vec::new, |group| self.members(group).to_vec());
        let made = match group {
            Some(group) if members.contains(&playback) => group,
            _ => {
                members.push(playback);
                self.members.push(members);
                GroupId(self.members.len() as u32 - 1)
            }
        };
        self.with.insert((group, playback), made);
        made
    }
}

/// Frames by identity.
#[derive(Debug, Default)]
pub struct FrameSet {
    frames: HashMap<FrameId, Variant>,
    groups: Groups,
    /// Further variants of identities in conflict, in the order seen.
    others: BTreeMap<FrameId, Vec<Variant>>,
    /// Running hash of the good frames of each playback.
    fingerprints: HashMap<PlaybackId, FrameDigest>,
    /// Variants that lost a conflict and are not to be used.
    set_aside: BTreeSet<(FrameId, FrameDigest)>,
    /// The variant in use of each identity in conflict.
    in_use: BTreeMap<FrameId, FrameDigest>,
}

impl FrameSet {
    /// A set in which these variants are known to have lost.
    pub fn without(set_aside: BTreeSet<(FrameId, FrameDigest)>) -> Self {
        Self { set_aside, ..Self::default() }
    }

    /// Adds a good frame of a playback. Gives what it is to the set, and whether its packets are to be used.
    pub fn add(&mut self, playback: PlaybackId, id: FrameId, octets: &[u8]) -> (Novelty, bool) {
        let digest: FrameDigest = Sha256::digest(octets).into();
        self.note_in_fingerprint(playback, digest);
        let usable = !self.set_aside.contains(&(id, digest));
        let Some(first) = self.frames.get_mut(&id) else {
            self.frames.insert(id, Variant { digest, playbacks: self.groups.with(None, playback) });
            if usable {
                self.in_use.insert_if_contested(id, digest, &self.set_aside);
            }
            return (Novelty::New, usable);
        };
        if first.digest == digest {
            first.playbacks = self.groups.with(Some(first.playbacks), playback);
            return (Novelty::Repeated, false);
        }
        let first_digest = first.digest;
        let others = self.others.entry(id).or_default();
        if let Some(other) = others.iter_mut().find(|other| other.digest == digest) {
            other.playbacks = self.groups.with(Some(other.playbacks), playback);
            return (Novelty::Conflicting, false);
        }
        others.push(Variant { digest, playbacks: self.groups.with(None, playback) });
        let first_in_use = !self.set_aside.contains(&(id, first_digest));
        let in_use = self.in_use.get(&id).copied().or(first_in_use.then_some(first_digest));
        match in_use {
            Some(in_use) => {
                self.in_use.insert(id, in_use);
                (Novelty::Conflicting, false)
            }
            None if usable => {
                self.in_use.insert(id, digest);
                (Novelty::Conflicting, true)
            }
            None => (Novelty::Conflicting, false),
        }
    }

    /// Adds a frame known to be one of those added before under its identity; false where there are several, or none.
    pub fn add_repeat(&mut self, playback: PlaybackId, id: FrameId) -> bool {
        let Some(only) = self.frames.get_mut(&id).filter(|_| !self.others.contains_key(&id)) else { return false };
        only.playbacks = self.groups.with(Some(only.playbacks), playback);
        let digest = only.digest;
        self.note_in_fingerprint(playback, digest);
        true
    }

    fn note_in_fingerprint(&mut self, playback: PlaybackId, digest: FrameDigest) {
        let fingerprint = self.fingerprints.entry(playback).or_default();
        *fingerprint = Sha256::new_with_prefix(*fingerprint).chain_update(digest).finalize().into();
    }

    /// Distinct identities.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether no frame was seen.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// How many identities there are under which frames differ.
    pub fn conflicts(&self) -> usize {
        self.others.len()
    }

    /// The variants that lose, when one of them is in use: with these set aside, everything has to be taken again.
    pub fn to_set_aside(&self) -> Option<BTreeSet<(FrameId, FrameDigest)>> {
        let mut losers = BTreeSet::new();
        let mut wrong_one_in_use = false;
        for (id, others) in &self.others {
            let variants = || std::iter::once(&self.frames[id]).chain(others);
            let Some(winner) = variants().max_by_key(|v| (self.votes(v), std::cmp::Reverse(v.digest))) else {
                continue;
            };
            losers.extend(variants().filter(|v| v.digest != winner.digest).map(|v| (*id, v.digest)));
            wrong_one_in_use |= self.in_use.get(id) != Some(&winner.digest);
        }
        wrong_one_in_use.then_some(losers)
    }

    /// Playbacks that hold a variant, those with the same good frames counted once.
    fn votes(&self, variant: &Variant) -> usize {
        self.groups
            .members(variant.playbacks)
            .iter()
            .filter_map(|id| self.fingerprints.get(id))
            .collect::<BTreeSet<_>>()
            .len()
    }
}

/// Remembers a variant in use from the start where its identity is known to be contested.
trait InUse {
    fn insert_if_contested(&mut self, id: FrameId, digest: FrameDigest, aside: &BTreeSet<(FrameId, FrameDigest)>);
}

impl InUse for BTreeMap<FrameId, FrameDigest> {
    fn insert_if_contested(&mut self, id: FrameId, digest: FrameDigest, aside: &BTreeSet<(FrameId, FrameDigest)>) {
        let contested = aside.range((id, [0; 32])..=(id, [255; 32])).next().is_some();
        if contested {
            self.insert(id, digest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ID: FrameId = FrameId { channel: 1, count: 7 };

    fn verdict(order: &[(u32, &[u8])]) -> BTreeSet<(FrameId, FrameDigest)> {
        let mut set = FrameSet::default();
        for (playback, octets) in order {
            set.add(PlaybackId(*playback), ID, octets);
        }
        match set.to_set_aside() {
            None => BTreeSet::new(),
            Some(losers) => {
                let mut again = FrameSet::without(losers.clone());
                for (playback, octets) in order {
                    again.add(PlaybackId(*playback), ID, octets);
                }
                assert_eq!(again.to_set_aside(), None, "one more pass settles it");
                losers
            }
        }
    }

    #[test]
    fn the_variant_in_more_playbacks_counts_and_a_tie_goes_to_the_lower_hash() {
        let (a, b) = (b"one".as_slice(), b"two".as_slice());
        let lower: FrameDigest = Sha256::digest(a).min(Sha256::digest(b)).into();
        // A third frame makes the playbacks of one variant differ from each other.
        let mut set = FrameSet::default();
        let other = FrameId { channel: 1, count: 8 };
        set.add(PlaybackId(1), ID, a);
        set.add(PlaybackId(2), ID, b);
        set.add(PlaybackId(3), ID, b);
        set.add(PlaybackId(3), other, b"x");
        assert_eq!(
            set.to_set_aside().unwrap().into_iter().map(|l| l.1).collect::<Vec<_>>(),
            [<[u8; 32]>::from(Sha256::digest(a))]
        );
        for order in [[(1, a), (2, b)], [(1, b), (2, a)]] {
            let losers = verdict(&order);
            assert!(losers.iter().all(|(_, digest)| *digest != lower));
        }
    }

    #[test]
    fn a_playback_sent_twice_votes_once() {
        let (a, b) = (b"one".as_slice(), b"two".as_slice());
        let once = verdict(&[(1, a), (2, b)]);
        let twice = verdict(&[(1, a), (2, b), (3, a), (4, b), (5, b)]);
        assert_eq!(once, twice);
    }
}
