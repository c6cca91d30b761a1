//! What comes nearest to a claim where none is made: a reader who knows of a reason for one of them can weigh it.

use super::ids;
use crate::diagnose::answer::Alternative;
use crate::diagnose::search::Weighed;
use crate::diagnose::solve::Library;

/// Posterior below which a set is not mentioned. By the tables of nulls one record of noise in twenty has such a set.
const MENTION: f64 = 0.1;

/// Sets of listed effects with their posterior beside that of nothing at all.
pub fn nearest(library: &Library, null: &Weighed, listed: &[&Weighed]) -> Vec<Alternative> {
    let odds = |w: &Weighed| (w.log_posterior - null.log_posterior).exp();
    let total = 1.0 + listed.iter().map(|w| odds(w)).sum::<f64>();
    listed
        .iter()
        .filter(|w| odds(w) > MENTION * total)
        .map(|w| Alternative {
            effects: ids(library, &w.set),
            posterior: odds(w) / total,
            delta_bic: 2.0 * (null.log_posterior - w.log_posterior),
        })
        .collect()
}
