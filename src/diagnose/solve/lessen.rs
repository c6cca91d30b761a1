//! Sets with what they do not need taken away.

use super::Stop;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{self, Entry, Set, Weighed};
use crate::math::shared_work;

/// Weighs the best set with one member less, and that again, as long as what is left is as good but for `less` in log posterior: what only
/// described slow noise is found at one noise together with what is real, and every set kept may hold it. Sets that are not `wanted` are not weighed.
pub(super) fn lessen(
    scene: &Scene,
    entries: &[Entry],
    sets: &mut Vec<Weighed>,
    (wanted, less): (impl Fn(&Set) -> bool, f64),
    stop: Stop,
) -> Option<()> {
    let of = |w: &Weighed| (w.set.clone(), w.noise);
    let Some((mut set, mut noise)) = sets.first().map(of) else { return Some(()) };
    while set.members.len() > 1 {
        if stop() {
            return None;
        }
        let fewer: Vec<Set> = (0..set.members.len()).map(|i| set.without(i)).filter(|set| wanted(set)).collect();
        let new: Vec<&Set> = fewer.iter().filter(|set| !sets.iter().any(|w| w.set.key() == set.key())).collect();
        let weighed = shared_work::map(&new, |set| search::weigh_with_own_noise(scene, entries, set, &noise, 2, 40));
        merge(sets, weighed);
        let is_fewer = |w: &&Weighed| fewer.iter().any(|set| set.key() == w.set.key());
        let best = sets.first().map_or(f64::NEG_INFINITY, |best| best.log_posterior);
        // They are in order: the first is the best of them.
        match sets.iter().find(is_fewer).filter(|w| best - w.log_posterior <= less) {
            Some(as_good) => (set, noise) = of(as_good),
            None => break,
        }
    }
    Some(())
}

/// Of sets found twice the better weighed one, best first.
pub(super) fn merge(sets: &mut Vec<Weighed>, more: Vec<Weighed>) {
    sets.extend(more);
    sets.sort_by(|a, b| b.log_posterior.total_cmp(&a.log_posterior));
    search::retain_first(sets, |w| w.set.key());
}
