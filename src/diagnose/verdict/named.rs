//! The effects that are named, what else it could be, and what would decide.

use std::collections::BTreeSet;

use super::credible::is_nested;
use super::imitators::imitators;
use super::{Best, effect_of, ids};
use crate::diagnose::answer::{Alternative, Diagnosis, EffectAnswer, ParameterAnswer, Verdict};
use crate::diagnose::catalogue::{self, Effect};
use crate::diagnose::design::Column;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Entry, Family, Member, Set, Weighed};
use crate::diagnose::separating::{self, Part, Rival};
use crate::diagnose::solve::{EQUAL, Library};
use crate::math::rms::rms_about_mean;

/// Log odds within which a set that does not hold the best one, nor is held by it, cannot be told from it: sets whose signatures
/// differ by an SNR of three come within this in more than half of all records.
const RIVAL: f64 = 5.0;
/// Posterior below which an alternative is not mentioned.
const MENTION: f64 = 0.004;

/// Names the effects of the best set, with their rivals and alternatives; `open` are the sets with a formula of no effect in them.
pub fn name(
    answer: &mut Diagnosis,
    scene: &Scene,
    library: &Library,
    best: &Best,
    listed: &[&Weighed],
    open: &[Weighed],
) {
    let top = listed[0].log_posterior;
    let all = || listed.iter().copied().chain(open);
    let total: f64 = all().map(|w| (w.log_posterior - top).exp()).sum();
    let posterior = |w: &Weighed| (w.log_posterior - top).exp() / total;
    let key = best.set.key();
    answer.effects =
        effects(library, best, |entry| all().filter(|w| w.set.key().contains(&entry)).map(posterior).sum());
    let others: Vec<&&Weighed> = listed.iter().filter(|w| w.set.key() != key).collect();
    let rivals: Vec<&&&Weighed> = others
        .iter()
        .filter(|w| best.weighed.log_posterior - w.log_posterior < RIVAL && !is_nested(&w.set, &best.set))
        .collect();
    // Sets that weigh as much, a mass shift taken for a bias step, and what imitates on this record: each once, in this order.
    let mut contestants: Vec<Rival> = std::iter::once(&best.set)
        .chain(rivals.iter().map(|w| &w.set))
        .filter_map(|set| parts(library, set))
        .chain(step_at_mass_change(scene, library, best))
        .chain(imitators(library, best))
        .collect();
    let mut seen: Vec<BTreeSet<&str>> = Vec::new();
    contestants.retain(|rival| {
        let ids: BTreeSet<&str> = rival.iter().map(|part| part.effect.id).collect();
        let new = !seen.contains(&ids);
        seen.push(ids);
        new
    });
    if contestants.len() > 1 {
        answer.verdict = Verdict::Ambiguous;
        let ids = |rival: &Rival| rival.iter().map(|part| part.effect.id.to_string()).collect();
        answer.cannot_tell_apart = contestants.iter().map(ids).collect();
        answer.separating_observation = separating::cheapest(scene, &best.weighed.noise, &contestants);
    }
    answer.alternatives = others
        .iter()
        .filter(|w| posterior(w) > MENTION && !rivals.iter().any(|r| r.set.key() == w.set.key()))
        .filter(|w| !is_nested(&w.set, &best.set) || w.log_posterior > best.weighed.log_posterior - EQUAL)
        .map(|w| Alternative {
            effects: ids(library, &w.set),
            posterior: posterior(w),
            delta_bic: 2.0 * (best.weighed.log_posterior - w.log_posterior),
        })
        .collect();
    answer.notes.extend(of_larger_sets(best, library, listed));
    answer.notes.extend(of_a_formula(best, library, open));
}

/// Says which formula of no effect comes near enough for the record not to tell it from what is named.
fn of_a_formula(best: &Best, library: &Library, open: &[Weighed]) -> Option<String> {
    let formula = open.iter().find(|w| !is_nested(&w.set, &best.set))?;
    let log_odds = best.weighed.log_posterior - formula.log_posterior;
    (log_odds < RIVAL).then(|| {
        format!(
            "{}, of which the catalogue knows nothing, this record cannot tell from {}: log odds of {log_odds:.1} against it",
            ids(library, &formula.set).join(" + "),
            ids(library, &best.set).join(" + ")
        )
    })
}

/// Says what beside the named is likelier than not, and not sure enough to be named.
fn of_larger_sets(best: &Best, library: &Library, listed: &[&Weighed]) -> Option<String> {
    let named = ids(library, &best.set);
    let larger = listed.iter().find(|w| w.set.members.len() > named.len() && is_nested(&w.set, &best.set))?;
    let log_odds = larger.log_posterior - best.weighed.log_posterior;
    let beside: Vec<String> = ids(library, &larger.set).into_iter().filter(|id| !named.contains(id)).collect();
    (log_odds > 0.0 && !beside.is_empty()).then(|| {
        format!(
            "{} beside {} is likelier than not, at odds of {:.1}, and is not named below odds of {:.0}",
            beside.join(" + "),
            named.join(" + "),
            log_odds.exp(),
            EQUAL.exp()
        )
    })
}

/// What a set is made of, `None` where an open form is in it.
pub fn parts(library: &Library, set: &Set) -> Option<Rival> {
    let part = |m: &Member| match library.entries[m.entry].family {
        Family::Listed(effect) => Some(Part { effect, theta: m.theta }),
        Family::Open(_) => None,
    };
    set.members.iter().map(part).collect()
}

/// The set with its mass shift taken for a bias step at the same instant, when that fits as well: the instant is no
/// argument for either, since what shifts a mass may shift a bias.
fn step_at_mass_change(scene: &Scene, library: &Library, best: &Best) -> Option<Rival> {
    let mut rival = parts(library, &best.set)?;
    let i = rival.iter().position(|part| part.effect.id == "mass_shift")?;
    let step = catalogue::by_id("bias_step")?;
    let entry =
        library.entries[..library.listed].iter().find(|e| matches!(e.family, Family::Listed(e) if e.id == step.id))?;
    let others = best.set.without(i);
    let chosen = others.chosen(&best.frame);
    let m = &best.set.members[i];
    let gain = |entry: &Entry, effect: &Effect| {
        let raws = (effect.signature)(scene, &m.theta).map(|s| s.columns()).unwrap_or_default();
        let columns: Vec<Column> =
            raws.iter().zip(&entry.sizes).map(|(raw, size)| best.frame.column(raw, *size)).collect();
        chosen.normal(&columns).explained()
    };
    let lacking = gain(&library.entries[m.entry], rival[i].effect) - gain(entry, step);
    rival[i] = Part { effect: step, theta: m.theta };
    (lacking < RIVAL).then_some(rival)
}

fn effects(library: &Library, best: &Best, posterior: impl Fn(usize) -> f64) -> Vec<EffectAnswer> {
    let mut out = Vec::new();
    for (i, m) in best.set.members.iter().enumerate() {
        let Some(effect) = effect_of(&library.entries, &best.set, i) else { continue };
        out.push(EffectAnswer {
            id: effect.id.into(),
            name: effect.name.into(),
            posterior: posterior(m.entry).min(1.0),
            parameters: best.fits[i]
                .parameters
                .iter()
                .map(|p| ParameterAnswer { name: p.name.into(), value: p.value, sigma: p.sigma, unit: p.unit.into() })
                .collect(),
            axis: best.fits[i].axis.clone(),
            why: effect.why.into(),
            rms_ng: Some(std::array::from_fn(|k| rms_about_mean(&best.contributions[i][k]))),
        });
    }
    out.sort_by(|a, b| b.posterior.total_cmp(&a.posterior));
    out
}
