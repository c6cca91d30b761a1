//! Effects that imitate a named one on this record: what they leave of its series is too little to be told, whichever of them the
//! noise of this one record happens to prefer.

use super::Best;
use super::named::parts;
use crate::diagnose::search::{self, Bank};
use crate::diagnose::separating::{Part, Rival};
use crate::diagnose::solve::Library;

/// SNR left at which two effects are the same to a record: the data then prefer the wrong one in one record of fifteen.
const SAME_SNR: f64 = 3.0;

/// The best set with one member taken for its imitator, for every imitator of every member that is loud enough for it to matter.
pub fn imitators(library: &Library, best: &Best) -> Vec<Rival> {
    let bank = Bank::new(&best.frame, &library.entries[..library.listed]);
    let key = best.set.key();
    let Some(parts) = parts(library, &best.set) else { return Vec::new() };
    let mut found = Vec::new();
    for i in 0..best.set.members.len() {
        let whole = best.set.whitened(i, &best.frame);
        let frame = best.frame.before(whole.clone());
        let seen = bank.before(&whole);
        let others = best.set.without(i);
        let chosen = others.chosen_about_nothing(&frame);
        if chosen.left_in(&whole).0 < SAME_SNR * SAME_SNR {
            continue;
        }
        for index in (0..library.listed).filter(|index| !key.contains(index)) {
            let imitation = search::imitation(&seen, index, &chosen, &whole);
            if let Some((effect, imitation)) = imitation.filter(|(_, imitation)| imitation.left_snr < SAME_SNR) {
                let mut rival = parts.clone();
                rival[i] = Part { effect, theta: imitation.theta };
                found.push(rival);
            }
        }
    }
    found
}
