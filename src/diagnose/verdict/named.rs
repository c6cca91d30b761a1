//! The effects that are named, what else it could be, and what would decide.

use super::credible::{EQUAL, is_nested};
use super::{Best, effect_of, ids};
use crate::diagnose::answer::{Alternative, Diagnosis, EffectAnswer, ParameterAnswer, Verdict};
use crate::diagnose::catalogue::{self, Effect, Theta};
use crate::diagnose::design::Column;
use crate::diagnose::scene::Scene;
use crate::diagnose::search::{Entry, Family, Member, Set, Weighed};
use crate::diagnose::separating;
use crate::diagnose::solve::Library;
use crate::math::rms::rms_about_mean;

/// Log odds within which a set that does not hold the best one, nor is held by it, cannot be told from it: sets whose signatures
/// differ by an SNR of three come within this in more than half of all records.
const RIVAL: f64 = 5.0;
/// Posterior below which an alternative is not mentioned.
const MENTION: f64 = 0.004;

/// Names the effects of the best set, with their rivals and alternatives.
pub fn name(answer: &mut Diagnosis, scene: &Scene, library: &Library, best: &Best, listed: &[&Weighed]) {
    let top = listed[0].log_posterior;
    let total: f64 = listed.iter().map(|w| (w.log_posterior - top).exp()).sum();
    let posterior = |w: &Weighed| (w.log_posterior - top).exp() / total;
    let key = best.set.key();
    answer.effects = effects(library, best, |entry| {
        listed.iter().filter(|w| w.set.key().contains(&entry)).map(|w| posterior(w)).sum()
    });
    let others: Vec<&&Weighed> = listed.iter().filter(|w| w.set.key() != key).collect();
    let rivals: Vec<&&&Weighed> = others
        .iter()
        .filter(|w| best.weighed.log_posterior - w.log_posterior < RIVAL && !is_nested(&w.set, &best.set))
        .collect();
    let twin = step_at_mass_change(scene, library, best);
    if !rivals.is_empty() || twin.is_some() {
        answer.verdict = Verdict::Ambiguous;
        answer.cannot_tell_apart.push(ids(library, &best.set));
        answer.cannot_tell_apart.extend(rivals.iter().map(|w| ids(library, &w.set)));
        let sets: Vec<&Set> = std::iter::once(&best.set).chain(rivals.iter().map(|w| &w.set)).collect();
        let contestants = contestants(library, &sets, twin.is_some());
        answer.cannot_tell_apart.extend(twin);
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
}

/// The set with its mass shift taken for a bias step at the same instant, when that fits as well: the instant is no
/// argument for either, since what shifts a mass may shift a bias.
fn step_at_mass_change(scene: &Scene, library: &Library, best: &Best) -> Option<Vec<String>> {
    let entries = &library.entries;
    let i = (0..best.set.members.len())
        .find(|i| effect_of(entries, &best.set, *i).is_some_and(|e| e.id == "mass_shift"))?;
    let step =
        entries[..library.listed].iter().find(|e| matches!(e.family, Family::Listed(e) if e.id == "bias_step"))?;
    let others = Set {
        members: best.set.members.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, m)| m.clone()).collect(),
        score: 0.0,
    };
    let chosen = others.chosen(&best.frame);
    let gain = |entry: &Entry, effect: &Effect, theta: &Theta| {
        let raws = (effect.signature)(scene, theta).map(|s| s.columns()).unwrap_or_default();
        let columns: Vec<Column> =
            raws.iter().zip(&entry.sizes).map(|(raw, size)| best.frame.column(raw, *size)).collect();
        chosen.normal(&columns).explained()
    };
    let Family::Listed(step_effect) = step.family else { return None };
    let m = &best.set.members[i];
    let shift_effect = effect_of(entries, &best.set, i)?;
    let lacking = gain(&entries[m.entry], shift_effect, &m.theta) - gain(step, step_effect, &m.theta);
    (lacking < RIVAL).then(|| {
        ids(library, &best.set)
            .into_iter()
            .map(|id| if id == "mass_shift" { "bias_step".to_string() } else { id })
            .collect()
    })
}

/// The sets that cannot be told apart, best first, for the observation that would separate them; the last one may be the best
/// with its mass shift taken for a bias step.
fn contestants(library: &Library, sets: &[&Set], has_twin: bool) -> Vec<separating::Rival> {
    let part = |m: &Member| match library.entries[m.entry].family {
        Family::Listed(effect) => Some(separating::Part { effect, theta: m.theta }),
        Family::Open(_) => None,
    };
    let mut rivals: Vec<separating::Rival> =
        sets.iter().map(|set| set.members.iter().filter_map(part).collect()).collect();
    if let (true, Some(step)) = (has_twin, catalogue::by_id("bias_step")) {
        let stepping = |p: &separating::Part| match p.effect.id {
            "mass_shift" => separating::Part { effect: step, ..p.clone() },
            _ => p.clone(),
        };
        let twin = rivals[0].iter().map(stepping).collect();
        rivals.push(twin);
    }
    rivals
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
