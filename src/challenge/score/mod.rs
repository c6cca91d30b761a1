//! Answers against truths: the figures of merit, each with its 95 % interval and the cases that failed it.
//!
//! Works on `diagnosis.json` alone, so any analyser that writes it can be scored.

mod answer;
mod rate;
mod table;

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

pub use answer::Answer;
pub use rate::{Rate, wilson};

use super::conceal::Truth;
use crate::diagnose::null_table::is_quiet;

/// One case, analysed.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// The truth, revealed.
    pub truth: Truth,
    /// The answer, or why there is none.
    pub answer: Result<Answer, String>,
    /// Time it took, s.
    pub seconds: f64,
}

/// All figures over some outcomes.
#[derive(Debug, Clone, Serialize)]
pub struct Score {
    /// Cases scored.
    pub cases: usize,
    /// Cases without an answer, with the reason.
    pub failed: Vec<(String, String)>,
    /// Rates.
    pub rates: Vec<Rate>,
    /// Mean number of sets reported where the truth is identifiable, two effects or one.
    pub mean_set_size: Option<f64>,
    /// Share of the held-out excess over the noise removed, SNR 20 and more: as reported (median), and by the true noise floor, pooled.
    pub excess_removed: Option<[f64; 2]>,
    /// The statistic that shares of the cases without mismatch reach, (share, statistic): of quiet records, then of the others. What
    /// the tables of nulls are made of.
    pub null_statistics: [Vec<(f64, f64)>; 2],
    /// Time per case, s: median and 95th percentile.
    pub seconds: [f64; 2],
    /// Truth (id or kind) to first answer (id or verdict) to count.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
}

/// Scores outcomes.
pub fn score(outcomes: &[Outcome]) -> Score {
    // A case without an answer is no hit in any rate that its truth belongs to.
    let none = Answer::default();
    let all: Vec<Pair> = outcomes.iter().map(|o| (&o.truth, o.answer.as_ref().unwrap_or(&none))).collect();
    let answered: Vec<Pair> = outcomes.iter().filter_map(|o| Some((&o.truth, o.answer.as_ref().ok()?))).collect();
    let failed =
        outcomes.iter().filter_map(|o| o.answer.as_ref().err().map(|e| (o.truth.case.clone(), e.clone()))).collect();
    Score {
        cases: outcomes.len(),
        failed,
        rates: rates(&all),
        mean_set_size: mean_set_size(&answered),
        excess_removed: excess_removed(&answered),
        null_statistics: [true, false].map(|quiet| null_statistics(&answered, quiet)),
        seconds: seconds(outcomes),
        confusion: confusion(&answered),
    }
}

type Pair<'a> = (&'a Truth, &'a Answer);

fn rates(all: &[Pair]) -> Vec<Rate> {
    let kind = |kinds: &'static [&'static str]| move |p: &&Pair| kinds.contains(&p.0.kind.as_str());
    let of = |keep: &dyn Fn(&&Pair) -> bool, hit: &dyn Fn(&Pair) -> bool, name: &str, aim: &str| {
        Rate::over(name, aim, all.iter().filter(|p| keep(p)), hit, |p| p.0.case.clone())
    };
    let listed = |p: &&Pair| matches!(p.0.kind.as_str(), "one" | "two" | "recorder_dump, two effects");
    let one_in = |low: f64, high: f64| move |p: &&Pair| p.0.kind == "one" && (low..high).contains(&p.0.snr_min());
    let plain = |low: f64, high: f64| {
        move |p: &&Pair| p.0.kind == "one" && (low..high).contains(&p.0.snr_min()) && p.0.is_identifiable()
    };
    let alarm = |p: &Pair| !p.1.is_none() && p.1.verdict != "consistent";
    let first = |p: &Pair| p.1.first().is_some_and(|id| p.0.effects.contains_key(id));
    let exact = |p: &Pair| p.1.named() == p.0.ids().into_iter().collect::<BTreeSet<_>>();
    let inside = |p: &Pair| p.1.sets().contains(&p.0.ids().into_iter().collect::<BTreeSet<_>>());
    let unexplained = |p: &Pair| p.1.verdict == "unexplained";
    let named = |p: &Pair| matches!(p.1.verdict.as_str(), "explained" | "ambiguous") && !p.1.effects.is_empty();
    const ALL: f64 = f64::INFINITY;
    let mut rates = vec![
        of(&kind(&["clean"]), &alarm, "false alarm, clean", "<= 0.3 %"),
        of(&kind(&["slow"]), &alarm, "false alarm, slow noise", "<= 1 %"),
        of(&one_in(12.0, ALL), &first, "right first name, SNR 12 and more", "99 %"),
        of(&one_in(8.0, 12.0), &first, "right first name, SNR 8 to 12", "97 %"),
        of(&one_in(5.0, 8.0), &first, "right first name, SNR 5 to 8", "80 %"),
        of(&plain(12.0, ALL), &first, "  the same, identifiable, SNR 12 and more", "99 %"),
        of(&plain(8.0, 12.0), &first, "  the same, identifiable, SNR 8 to 12", "97 %"),
        of(&plain(5.0, 8.0), &first, "  the same, identifiable, SNR 5 to 8", "80 %"),
        of(&|p| listed(p) && p.0.snr_min() >= 8.0, &inside, "truth inside the reported set, SNR 8 and more", "99.5 %"),
        of(
            &|p| listed(p) && p.0.snr_min() >= 8.0,
            &|p| alarm(p) && inside(p),
            "  the same, something being claimed",
            "99.5 %",
        ),
        of(&one_in(12.0, ALL), &exact, "exactly right, one effect, SNR 12 and more", "98 %"),
        of(
            &|p| p.0.kind == "two" && p.0.snr_min() >= 12.0,
            &exact,
            "exactly right, two effects, SNR 12 and more",
            "95 %",
        ),
        of(&kind(&["unknown"]), &unexplained, "unlisted law: flagged unexplained", "95 %"),
        of(&kind(&["unknown"]), &named, "unlisted law: given a physical name", "<= 3 %"),
        of(&kind(&["deleted"]), &unexplained, "deleted effect: flagged unexplained", "95 %"),
        of(&kind(&["deleted"]), &named, "deleted effect: given a physical name", "<= 3 %"),
        of(&|p| listed(p) && p.0.snr_min() >= 5.0, &unexplained, "listed effect called unlisted", "<= 2 %"),
        of(&kind(&["single"]), &honest, "unidentifiable: declared ambiguous, truth in the set", "95 %"),
    ];
    let answered = all.iter().filter(|p| !p.1.is_none());
    let checks: Vec<(String, bool)> = answered.flat_map(|p| answer::within_two_sigma(p.0, p.1)).collect();
    rates.push(Rate::over(
        "parameters within 2 sigma",
        "95.4 +- 1.5 %",
        checks.iter(),
        &|c: &(String, bool)| c.1,
        |c| c.0.clone(),
    ));
    rates.retain(|rate| rate.of > 0);
    rates
}

/// Several sets named where several fit; where only the truth fits, the truth among those named.
fn honest(p: &Pair) -> bool {
    let truth: BTreeSet<&str> = p.0.ids().into_iter().collect();
    let inside = p.1.sets().contains(&truth);
    if p.0.is_identifiable() { inside } else { inside && p.1.verdict == "ambiguous" }
}

fn mean_set_size(all: &[Pair]) -> Option<f64> {
    let sizes: Vec<f64> = all
        .iter()
        .filter(|p| matches!(p.0.kind.as_str(), "one" | "two") && p.0.is_identifiable() && p.0.snr_min() >= 8.0)
        .map(|p| p.1.sets().len() as f64)
        .filter(|size| *size > 0.0)
        .collect();
    (!sizes.is_empty()).then(|| sizes.iter().sum::<f64>() / sizes.len() as f64)
}

fn excess_removed(all: &[Pair]) -> Option<[f64; 2]> {
    let strong = all.iter().filter(|p| matches!(p.0.kind.as_str(), "one" | "two") && p.0.snr_min() >= 20.0);
    let (mut reported, mut before, mut after) = (Vec::new(), 0.0, 0.0);
    for (truth, answer) in strong {
        let Some(held) = answer.fit.as_ref().and_then(|fit| fit.held_out.as_ref()) else { continue };
        reported.push(held.excess_removed);
        for axis in 0..3 {
            before += held.before_rms_ng[axis].powi(2) - truth.noise_ng[axis].powi(2);
            after += held.after_rms_ng[axis].powi(2) - truth.noise_ng[axis].powi(2);
        }
    }
    if reported.is_empty() {
        return None;
    }
    reported.sort_by(f64::total_cmp);
    Some([reported[reported.len() / 2], 1.0 - after / before])
}

/// Shares of nulls whose statistic is given.
const NULL_SHARES: [f64; 12] = [0.95, 0.75, 0.5, 0.25, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005, 0.002, 0.001];

fn null_statistics(all: &[Pair], quiet: bool) -> Vec<(f64, f64)> {
    let nulls = all.iter().filter(|p| p.0.effects.is_empty());
    let asked = nulls.filter(|p| p.1.slow_evidence.is_some_and(|slow| is_quiet(slow) == quiet));
    let mut statistics: Vec<f64> = asked.filter_map(|p| p.1.statistic).collect();
    statistics.sort_by(|a, b| b.total_cmp(a));
    // The statistic of so many of them, or more.
    let reached = |share: f64| (share * statistics.len() as f64).floor() as usize;
    let given = NULL_SHARES.into_iter().filter(|share| reached(*share) >= 1);
    given.map(|share| (share, statistics[reached(share) - 1])).collect()
}

fn seconds(outcomes: &[Outcome]) -> [f64; 2] {
    let mut seconds: Vec<f64> = outcomes.iter().map(|o| o.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let at = |share: f64| seconds.get(((seconds.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(0.0);
    [at(0.5), at(0.95)]
}

fn confusion(all: &[Pair]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut table: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for (truth, answer) in all {
        let row = match truth.kind.as_str() {
            "one" => truth.ids().join("+"),
            "clean" | "slow" | "two" => format!("({})", truth.kind),
            kind => format!("({kind}) {}", truth.ids().join("+")),
        };
        *table.entry(row).or_default().entry(answer.word()).or_default() += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outcome(kind: &str, id: Option<&str>, snr: f64, answer: &str) -> Outcome {
        let mut truth = Truth { case: format!("{kind}-1"), kind: kind.into(), ..Truth::default() };
        if let Some(id) = id {
            truth.effects.insert(id.into(), BTreeMap::from([("fraction".to_string(), 0.2.into())]));
            truth.snr.insert(id.into(), snr);
        }
        Outcome { truth, answer: Ok(serde_json::from_str(answer).unwrap()), seconds: 1.0 }
    }

    fn value(score: &Score, name: &str) -> (usize, usize) {
        let rate = score.rates.iter().find(|r| r.name == name).unwrap();
        (rate.hits, rate.of)
    }

    #[test]
    fn a_silent_answer_is_right_on_a_clean_case_and_wrong_on_a_loud_one() {
        let silent = r#"{"verdict":"consistent","effects":[],"alternatives":[{"effects":["aerodynamic_drag"],"posterior":0.6}]}"#;
        let score =
            score(&[outcome("clean", None, 0.0, silent), outcome("one", Some("aerodynamic_drag"), 30.0, silent)]);
        assert_eq!(value(&score, "false alarm, clean"), (0, 1));
        assert_eq!(value(&score, "right first name, SNR 12 and more"), (0, 1));
        assert_eq!(value(&score, "truth inside the reported set, SNR 8 and more"), (1, 1));
        assert_eq!(value(&score, "  the same, something being claimed"), (0, 1));
    }

    #[test]
    fn a_case_without_an_answer_is_a_miss_and_no_alarm() {
        let silent = r#"{"verdict":"consistent"}"#;
        let mut failed = [
            outcome("clean", None, 0.0, silent),
            outcome("one", Some("vent_leak"), 30.0, silent),
            outcome("unknown", None, 30.0, silent),
        ];
        failed.iter_mut().for_each(|outcome| outcome.answer = Err("it panicked".into()));
        let score = score(&failed);
        assert_eq!(score.failed.len(), 3);
        for name in [
            "false alarm, clean",
            "right first name, SNR 12 and more",
            "truth inside the reported set, SNR 8 and more",
            "unlisted law: flagged unexplained",
            "unlisted law: given a physical name",
        ] {
            assert_eq!(value(&score, name), (0, 1), "{name}");
        }
    }

    #[test]
    fn a_named_effect_counts_by_its_set_and_its_numbers() {
        let answer = r#"{"verdict":"explained","effects":[{"id":"aerodynamic_drag","parameters":
            [{"name":"fraction","value":0.25,"sigma":0.02,"unit":"1"}]}],"alternatives":[{"effects":["scale_factor"]}]}"#;
        let score = score(&[outcome("one", Some("aerodynamic_drag"), 30.0, answer)]);
        assert_eq!(value(&score, "exactly right, one effect, SNR 12 and more"), (1, 1));
        assert_eq!(value(&score, "parameters within 2 sigma"), (0, 1));
        assert_eq!(score.mean_set_size, Some(2.0));
    }
}
