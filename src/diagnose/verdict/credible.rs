//! Which sets can be believed, and the simplest of those that are as good.

use super::effect_of;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Set, Weighed};
use crate::diagnose::solve::Library;

/// Log odds (of twenty) within which another set is as good, and the smaller of two nested sets is preferred.
pub const EQUAL: f64 = 3.0;

/// So many reasons of refusals are told.
const REFUSALS_TOLD: usize = 3;

/// Listed sets whose sizes can be believed, and why others are refused: an effect once, as it is in the best set that is refused for it.
pub fn credible<'a>(scene: &Scene, library: &Library, sets: &'a [Weighed]) -> (Vec<&'a Weighed>, Vec<String>) {
    let (mut kept, mut refused): (Vec<&Weighed>, Vec<(&str, String)>) = (Vec::new(), Vec::new());
    for w in sets {
        let (frame, set) = w.framed(scene, &library.entries);
        let (mean, covariance) = set.coefficients(&frame, &library.entries);
        let mut next = 0;
        let mut reason = None;
        for (i, m) in set.members.iter().enumerate() {
            let Some(effect) = effect_of(&library.entries, &set, i) else { continue };
            for (k, l) in effect.linear.iter().enumerate().take(m.linear()) {
                let doubt = 2.0 * covariance[(next + k, next + k)].max(0.0).sqrt();
                if let Some(why) = l.refuses(mean[next + k], doubt) {
                    reason = Some((effect.id, format!("{} is refused: {why}", effect.id)));
                }
            }
            next += m.linear();
        }
        match reason {
            None => kept.push(w),
            Some((id, _)) if refused.iter().any(|(told, _)| *told == id) => {}
            Some(reason) => refused.push(reason),
        }
    }
    (kept, refused.into_iter().map(|(_, reason)| reason).take(REFUSALS_TOLD).collect())
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
