//! Sixty concealed cases of all kinds, analysed blind: no aim of the acceptance table may be refuted by them.
//!
//! A rate is refuted when its whole 95 % Wilson interval lies on the wrong side of its aim: sixty cases cannot prove 99 %,
//! and they can show that it is not so.
#![cfg(feature = "slow")]

use indicatif::ProgressBar;
use oare_ground::challenge::conceal::Kind;
use oare_ground::challenge::engine::Engine;
use oare_ground::challenge::{run, score, seal};

/// First seed; fixed, so that a failure names its case.
const SEED: u64 = 9_000;

/// Share in an aim such as "<= 0.3 %" or "95.4 +- 1.5 %", and whether less is better.
fn aim(text: &str) -> (f64, bool) {
    let (less, number) = text.strip_prefix("<=").map_or((false, text), |rest| (true, rest));
    let number = number.trim().split([' ', '%']).next().unwrap_or("");
    let share: f64 = number.parse().unwrap_or_else(|_| panic!("no number in the aim `{text}`"));
    (share / 100.0, less)
}

#[test]
fn sixty_concealed_cases_refute_no_aim() {
    let orders = run::plan(60, SEED, &Kind::ALL, false, None);
    let progress = ProgressBar::hidden();
    let seals = run::seal(&orders, &progress);
    println!("commitment {}", seal::root(&seals));
    let outcomes = run::run(&orders, &seals, &Engine::default(), &progress).unwrap();
    let score = score::score(&outcomes);
    println!("{score}");
    assert!(score.failed.is_empty(), "cases without an answer: {:?}", score.failed);
    let refuted: Vec<String> = score
        .rates
        .iter()
        .filter(|rate| {
            let (share, less) = aim(&rate.aim);
            if less { rate.interval[0] > share } else { rate.interval[1] < share }
        })
        .map(|rate| {
            format!("{}: {} of {}, aim {}: {}", rate.name, rate.hits, rate.of, rate.aim, rate.look_at.join(" "))
        })
        .collect();
    assert!(refuted.is_empty(), "refuted:\n{}", refuted.join("\n"));
}
