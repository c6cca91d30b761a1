//! The table of nulls against the bootstrap; and sixty concealed cases of all kinds, analysed blind: no aim of the acceptance
//! table may be refuted by them.
//!
//! Sixty cases cannot prove 99 %, and they can show that it is not so: a rate is refuted when a program that just reaches its aim would
//! do as badly by chance less than once in [`CHANCE`].

use indicatif::ProgressBar;
use oare_ground::challenge::conceal::{self, Kind, Manner};
use oare_ground::challenge::engine::{self, Engine};
use oare_ground::challenge::run::Material;
use oare_ground::challenge::score::Rate;
use oare_ground::challenge::{run, score, seal};
use oare_ground::diagnose::Settings;
use oare_ground::diagnose::analysis::Prepared;
use oare_ground::diagnose::bootstrap::REACH;
use oare_ground::diagnose::null_table;
use rayon::prelude::*;
use statrs::distribution::{Binomial, DiscreteCDF};

/// First seed; fixed, so that a failure names its case.
const SEED: u64 = 9_000;

/// Chance that one rate of a program that just reaches all aims is refuted; there are some twenty rates.
const CHANCE: f64 = 0.05 / 20.0;

/// Share in an aim such as "<= 0.3 %" or "95.4 +- 1.5 %", and whether less is better.
fn aim(text: &str) -> (f64, bool) {
    let (less, number) = text.strip_prefix("<=").map_or((false, text), |rest| (true, rest));
    let number = number.trim().split([' ', '%']).next().unwrap_or("");
    let share: f64 = number.parse().unwrap_or_else(|_| panic!("no number in the aim `{text}`"));
    (share / 100.0, less)
}

/// The table of nulls beside the bootstrap it stands for: on records with nothing missing, the whole search run again on noise drawn
/// from the fitted one must reach the statistic of a tabulated probability about as often as the table says.
#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn the_table_of_nulls_agrees_with_the_bootstrap() {
    const REPLICATES: usize = 30;
    let replicates: Vec<[f64; 3]> = [Kind::Clean, Kind::Slow, Kind::Clean, Kind::Slow]
        .into_iter()
        .zip(SEED..)
        .flat_map(|(kind, seed)| {
            let concealed = conceal::draw(kind, seed);
            let case = engine::read(&Material::Files(&concealed.files)).unwrap();
            let prepared = Prepared::new(&case, &Settings::default()).unwrap();
            let bootstrap = prepared.bootstrap();
            let replicate = |i| {
                let (look, found) = bootstrap.look_and_solution(i);
                [look, found.statistic(), found.null.slow_evidence]
            };
            (0..REPLICATES).into_par_iter().map(replicate).collect::<Vec<[f64; 3]>>()
        })
        .collect();
    let further = replicates.iter().map(|[look, statistic, _]| statistic - look).fold(f64::NEG_INFINITY, f64::max);
    println!("the search exceeds the first look by {further:.2} at most in {} replicates", replicates.len());
    assert!(further < REACH, "{further}: the bootstrap would pass over replicates that count");
    let probabilities: Vec<f64> =
        replicates.iter().map(|[_, statistic, slow]| null_table::false_alarm_probability(*statistic, *slow)).collect();
    let reached = |level: f64| probabilities.iter().filter(|p| **p <= level).count();
    for level in [0.5, 0.25, 0.1, 0.03, 0.01] {
        println!("table says {level}: {} of {} replicates", reached(level), probabilities.len());
    }
    // Its middle differs from record to record, higher where there is slow noise; claims are made in its tail.
    for level in [0.1, 0.03, 0.01] {
        // More than four binomial standard deviations above what the table says would be alarms it does not own up to.
        let n = probabilities.len() as f64;
        let most = n * level + 4.0 * (n * level * (1.0 - level)).sqrt();
        assert!(
            (reached(level) as f64) < most,
            "the table says {level}, {} of {n} replicates reach it",
            reached(level)
        );
    }
}

/// Cases drawn, sealed and analysed blind: the aims that they refute.
fn refuted(cases: usize, manner: Manner) -> Vec<String> {
    let orders = run::plan(cases, SEED, &Kind::ALL, manner, None);
    let progress = ProgressBar::hidden();
    let seals = run::seal(&orders, &progress);
    println!("commitment {}", seal::root(&seals));
    let outcomes = run::run(&orders, &seals, &Engine::default(), &progress).unwrap();
    let score = score::score(&outcomes);
    println!("{score}");
    assert!(score.failed.is_empty(), "cases without an answer: {:?}", score.failed);
    let refutes = |rate: &&Rate| {
        let (share, less) = aim(&rate.aim);
        let (hits, of) = (rate.hits as u64, rate.of as u64);
        // Exactly: so many hits or more, so many hits or fewer, of a program that just reaches the aim.
        let reached = Binomial::new(share, of).unwrap();
        let as_bad = if less { hits.checked_sub(1).map_or(1.0, |h| reached.sf(h)) } else { reached.cdf(hits) };
        as_bad < CHANCE
    };
    let told = |rate: &Rate| {
        format!("{}: {} of {}, aim {}: {}", rate.name, rate.hits, rate.of, rate.aim, rate.look_at.join(" "))
    };
    score.rates.iter().filter(refutes).map(told).collect()
}

#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn sixty_concealed_cases_refute_no_aim() {
    let refuted = refuted(60, Manner::default());
    assert!(refuted.is_empty(), "refuted:\n{}", refuted.join("\n"));
}

/// The same of recordings that are dumps, each from an instrument of its own that calibrates itself.
#[test]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
fn forty_concealed_dumps_refute_no_aim() {
    let refuted = refuted(40, Manner { dump: true, ..Manner::default() });
    assert!(refuted.is_empty(), "refuted:\n{}", refuted.join("\n"));
}
