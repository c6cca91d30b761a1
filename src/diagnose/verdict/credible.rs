//! Which sets can be believed, and the simplest of those that are as good.

use super::effect_of;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Set, Weighed};
use crate::diagnose::solve::{EQUAL, Library};

/// So many reasons of refusals are told.
const REFUSALS_TOLD: usize = 3;

/// Listed sets whose sizes can be believed, and why others are refused: an effect once, as it is in the best set that is refused for it.
pub fn credible<'a>(scene: &Scene, library: &Library, sets: &'a [Weighed]) -> (Vec<&'a Weighed>, Vec<String>) {
    let (mut kept, mut refused): (Vec<&Weighed>, Vec<(&str, String)>) = (Vec::new(), Vec::new());
    for w in sets {
        match refusal(scene, library, w) {
            None => kept.push(w),
            Some((id, _)) if refused.iter().any(|(told, _)| *told == id) => {}
            Some((id, why)) => refused.push((id, format!("{id} is refused: {why}"))),
        }
    }
    (kept, refused.into_iter().map(|(_, reason)| reason).take(REFUSALS_TOLD).collect())
}

/// The listed effect of a set whose size cannot be believed, and why; the last of several.
fn refusal(scene: &Scene, library: &Library, weighed: &Weighed) -> Option<(&'static str, String)> {
    let (frame, set) = weighed.framed(scene, &library.entries);
    let (mean, covariance) = set.coefficients(&frame, &library.entries);
    let mut next = 0;
    let mut reason = None;
    for (i, m) in set.members.iter().enumerate() {
        if let Some(effect) = effect_of(&library.entries, &set, i) {
            for (k, l) in effect.linear.iter().enumerate().take(m.linear()) {
                let doubt = 2.0 * covariance[(next + k, next + k)].max(0.0).sqrt();
                reason = l.refuses(mean[next + k], doubt).map(|why| (effect.id, why)).or(reason);
            }
        }
        next += m.linear();
    }
    reason
}

/// Of the sets with an open form, best first, the one to tell: as good as the best, with the fewest members, and with no listed effect of a
/// size that cannot be believed where one of them has none; `to_beat` is what it must be above in any case.
pub fn simplest_open<'a>(scene: &Scene, library: &Library, open: &'a [Weighed], to_beat: f64) -> Option<&'a Weighed> {
    let best = open.first()?;
    let as_good: Vec<&Weighed> = open
        .iter()
        .filter(|w| best.log_posterior - w.log_posterior < EQUAL && w.log_posterior > to_beat)
        .filter(|w| w.set.members.len() <= best.set.members.len())
        .collect();
    let believed: Vec<&Weighed> = as_good.iter().filter(|w| refusal(scene, library, w).is_none()).copied().collect();
    let among = if believed.is_empty() { as_good } else { believed };
    // The first of the fewest: they are in order.
    Some(among.into_iter().min_by_key(|w| w.set.members.len()).unwrap_or(best))
}

/// The smallest set that is part of the best one and as good.
pub fn simplest<'a>(listed: &[&'a Weighed]) -> &'a Weighed {
    let best = listed[0];
    let key = best.set.key();
    let nested = |w: &&&Weighed| w.set.members.len() < key.len() && w.set.key().iter().all(|e| key.contains(e));
    listed
        .iter()
        .filter(|w| best.log_posterior - w.log_posterior < EQUAL)
        .filter(nested)
        .min_by_key(|w| w.set.members.len())
        .copied()
        .unwrap_or(best)
}

/// Whether one set holds the other.
pub fn is_nested(a: &Set, b: &Set) -> bool {
    let (a, b) = (a.key(), b.key());
    a.iter().all(|e| b.contains(e)) || b.iter().all(|e| a.contains(e))
}
