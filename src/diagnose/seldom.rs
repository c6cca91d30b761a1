//! Effects of the catalogue under circumstances that are rarer, such as a shift of mass that no log has: looked for where something is
//! found at all, beside what is found and in place of each part of it, so that a record with nothing in it pays nothing for them.

use std::slice::from_ref;

use super::catalogue::Seldom;
use super::design::Frame;
use super::scene::Scene;
use super::search::{self, Bank, Entry, Set, Weighed};
use super::solve::{ALONG, Library};

/// The best set with each of the rarer effects, weighed, as far as it may be likelier than the best of `listed`, and is than the same
/// without its circumstances: an offset from the beginning is no shift, whether or not the catalogue has offsets.
pub fn found(scene: &Scene, library: &Library, listed: &[Weighed]) -> Vec<Weighed> {
    let Some(best) = listed.first() else { return Vec::new() };
    let (frame, set) = best.framed(scene, &library.entries);
    let of_one = |(index, seldom): (usize, &Seldom)| -> Option<Weighed> {
        let entry = Entry::seldom(scene, seldom)?;
        let seeds = seeds(&set, library, &entry);
        let found = beside(&frame, library, &seeds, &entry, index)?;
        let usual = Entry::listed(scene, seldom.usual).and_then(|usual| beside(&frame, library, &seeds, &usual, index));
        let likelier = usual.map_or(f64::NEG_INFINITY, |usual| usual.score).max(set.score - ALONG);
        (found.score > likelier)
            .then(|| search::weigh_with_own_noise(scene, &library.entries, &found, &best.noise, 2, 40))
    };
    library.seldom().filter_map(of_one).collect()
}

/// What an entry may join: nothing, a set, and the set without one of its members; none that has the effect already.
pub fn seeds(set: &Set, library: &Library, entry: &Entry) -> Vec<Set> {
    let id = |entry: &Entry| entry.effect().map(|effect| effect.id);
    let others = (0..set.members.len()).map(|i| set.without(i));
    let mut seeds: Vec<Set> = [Set::default(), set.clone()].into_iter().chain(others).collect();
    seeds.retain(|seed| {
        let has_room = seed.members.len() < search::SET_MAX;
        has_room && seed.members.iter().all(|m| id(&library.entries[m.entry]) != id(entry))
    });
    seeds
}

/// The best of what an entry, at its place in the library, joins.
pub fn beside(frame: &Frame, library: &Library, seeds: &[Set], entry: &Entry, index: usize) -> Option<Set> {
    let bank = Bank::new(frame, from_ref(entry));
    let seen = bank.before(&frame.data);
    let with_it = |seed: &Set| {
        let mut seed = seed.clone();
        seed.weigh(frame, &library.entries);
        let (gain, mut member) = search::best_of_entry(&seen, 0, &seed.chosen(frame));
        member.entry = index;
        seed.joined_by(member, gain)
    };
    seeds.iter().map(with_it).max_by(|a, b| a.score.total_cmp(&b.score))
}
