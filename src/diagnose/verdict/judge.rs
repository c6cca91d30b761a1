//! What the evidence and the trial say, before what remains is asked.

use super::credible::{simplest, simplest_open};
use super::stands::{changes, fails, tried};
use super::{Proof, asked, ids};
use crate::diagnose::answer::Verdict;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::Weighed;
use crate::diagnose::solve::{Library, Solution};
use crate::diagnose::trial::Tried;

/// Log odds by which a set that cannot be believed must be above all that can, for those to be no explanation.
const REFUSED_MARGIN: f64 = 3.0;
/// Log odds, of twenty as of any second effect, by which a set must be above one that it is but for a formula more.
const BESIDE_MARGIN: f64 = 3.0;
/// A finding that fails its trial is still a mismatch when noise makes its evidence this much more rarely than a claim asks.
const BEYOND_DOUBT: f64 = 0.05;

/// A finding that does not stand.
pub struct Failure {
    /// The set, in words.
    pub set: String,
    /// Why not.
    pub why: String,
}

/// The judgement of a case.
pub struct Judged<'a> {
    /// The verdict.
    pub verdict: Verdict,
    /// The set behind the verdict, and how its trial went.
    pub on_trial: Option<(&'a Weighed, Tried)>,
    /// A finding that failed its trial.
    pub failure: Option<Failure>,
    /// An open form is better than every set of listed effects, those that cannot be believed included where they lead.
    pub open_wins: bool,
}

/// Whether a set has all members of another.
fn has_all_of(set: &Weighed, other: &Weighed) -> bool {
    let key = set.set.key();
    other.set.key().iter().all(|entry| key.contains(entry))
}

/// Judges; `listed` are the sets of listed effects that can be believed, best first.
pub fn judge<'a>(
    scene: &Scene,
    library: &Library,
    solution: &'a Solution,
    listed: &[&'a Weighed],
    Proof { statistic, probability, claim, .. }: Proof,
) -> Judged<'a> {
    let height = |w: Option<&Weighed>| w.map_or(f64::NEG_INFINITY, |w| w.log_posterior);
    let null = solution.null.log_posterior;
    let [top, best, open] =
        [listed.first().copied(), solution.listed.first(), solution.open.first()].map(|w| (height(w), w));
    let refused = best.0 - top.0 > REFUSED_MARGIN;
    let to_beat = if refused { best.0 } else { top.0 };
    let leads = if refused { best.1 } else { top.1 };
    let is_beside = open.1.zip(leads).is_some_and(|(open, listed)| has_all_of(open, listed));
    let open_wins = open.0 > (to_beat + if is_beside { BESIDE_MARGIN } else { 0.0 }).max(null);
    let claimed = probability <= asked(claim) && best.0.max(open.0) > null;
    let (verdict, chosen) = match (claimed, open_wins, refused) {
        (false, _, _) => (Verdict::Consistent, None),
        (true, true, _) => (Verdict::Unexplained, simplest_open(scene, library, &solution.open, to_beat)),
        (true, false, true) => (Verdict::Unexplained, best.1),
        // Neither refused nor beaten: there is one that can be believed.
        (true, false, false) => (Verdict::Explained, Some(simplest(listed))),
    };
    let on_trial = chosen.map(|weighed| (weighed, tried(scene, library, weighed)));
    let changed = |weighed| (verdict == Verdict::Explained).then(|| changes(scene, library, weighed)).flatten();
    let failure = on_trial.as_ref().and_then(|(weighed, tried)| {
        let why = fails(tried, statistic).or_else(|| changed(*weighed))?;
        Some(Failure { set: ids(library, &weighed.set).join(" + "), why })
    });
    let (verdict, on_trial) = match &failure {
        Some(_) if probability > BEYOND_DOUBT * claim => (Verdict::Consistent, None),
        Some(_) => (Verdict::Unexplained, on_trial),
        None => (verdict, on_trial),
    };
    Judged { verdict, on_trial, failure, open_wins }
}
