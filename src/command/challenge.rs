//! `oare challenge`: conceal cases, commit to their truth, analyse them blind, reveal, score.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use oare_ground::challenge::conceal::{Kind, Manner, Wander, effect, law};
use oare_ground::challenge::engine::Engine;
use oare_ground::challenge::score::{Outcome, score};
use oare_ground::challenge::{run, seal};

/// Half a day has a night and a day of the crew; beyond ten the recording would outlast the mission.
const HOURS: RangeInclusive<i64> = 12..=240;

/// Conceal cases, commit to their truth, analyse them blind, reveal, score.
#[derive(clap::Args)]
pub struct Args {
    /// Number of cases.
    #[arg(long, default_value_t = 60)]
    cases: usize,
    /// First seed of every kind.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Length of the recordings, hours.
    #[arg(long, default_value_t = Manner::default().hours, value_parser = clap::value_parser!(u32).range(HOURS))]
    hours: u32,
    /// Only these kinds, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',')]
    kinds: Vec<Kind>,
    /// Only this effect of the catalogue, or this unlisted law.
    #[arg(long, value_parser = known)]
    effect: Option<&'static str>,
    /// Winds, density waves and panel areas that the analyser's regressors do not have.
    #[arg(long)]
    other_physics: bool,
    /// The noise of records with slow noise is smooth, as no autoregression is.
    #[arg(long)]
    smooth: bool,
    /// The noise of records with slow noise is flicker noise: of the same power in every octave, up to 60 ng.
    #[arg(long, conflicts_with = "smooth")]
    flicker: bool,
    /// The noise of records with slow noise resonates on every axis about a period of its own, up to 60 ng.
    #[arg(long, conflicts_with_all = ["smooth", "flicker"])]
    resonant: bool,
    /// One half window in a hundred is ten times as loud; the SNR does not know of it.
    #[arg(long)]
    bursts: bool,
    /// Four times a day the noise is up to four times as loud, for half an hour to two and a half: only the deviations say so.
    #[arg(long, conflicts_with = "dump")]
    storms: bool,
    /// Noise with a memory is averaged over the windows, as what the samples have is; the SNR does not know of it.
    #[arg(long, conflicts_with = "dump")]
    averaged: bool,
    /// Every recording is a dump of the payload recorder, from an instrument of its own; only accelerations are concealed in it.
    #[arg(long)]
    dump: bool,
    /// Draw from the real recordings below this folder instead of simulated ones.
    #[arg(long)]
    real: Option<PathBuf>,
    /// With `--real`: diagnose the cases whole too, and write the evidence as a page here.
    #[arg(long, requires = "real")]
    report: Option<PathBuf>,
    /// Bootstrap replicates per case; without them the table of nulls decides.
    #[arg(long, default_value_t = 0)]
    bootstrap: usize,
    /// Score the case directories in this one that carry their truth.json, instead of concealed cases.
    #[arg(long)]
    open: Option<PathBuf>,
    /// Write the cases here as directories, their truths apart from them, and the outcomes.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Make and seal the cases, and analyse none.
    #[arg(long, requires = "out")]
    make: bool,
    /// The score as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if let Some(dir) = &args.real {
        return super::challenge_real::run(dir, args.cases, args.seed, args.report.as_deref().or(args.out.as_deref()));
    }
    let engine = Engine { bootstraps: args.bootstrap, seed: args.seed };
    let outcomes = match &args.open {
        Some(directory) => {
            let progress = bar(0, "analysing");
            let outcomes = run::run_open(directory, &engine, &progress);
            progress.finish_and_clear();
            match outcomes {
                Ok(outcomes) => outcomes,
                Err(error) => {
                    eprintln!("oare challenge: cannot use the cases of {}: {error}", directory.display());
                    return Ok(super::unusable());
                }
            }
        }
        None => match concealed(&args, &engine)? {
            Some(outcomes) => outcomes,
            None => return Ok(super::DONE),
        },
    };
    if let Some(out) = &args.out {
        keep(out, &outcomes).with_context(|| format!("cannot write to {}", out.display()))?;
    }
    let score = score(&outcomes);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&score)?);
    } else {
        print!("{score}");
    }
    Ok(if score.failed.is_empty() { super::DONE } else { super::done_in_part() })
}

/// Seals, perhaps writes, analyses; nothing to score when the cases were only to be made.
fn concealed(args: &Args, engine: &Engine) -> anyhow::Result<Option<Vec<Outcome>>> {
    let only = args.effect;
    let kinds = match (args.kinds.is_empty(), only) {
        (false, _) => args.kinds.clone(),
        (true, None) => Kind::ALL.to_vec(),
        (true, Some(id)) if effect::IDS.contains(&id) => vec![Kind::One],
        (true, Some(_)) => vec![Kind::Unknown],
    };
    let Args { hours, other_physics, bursts, storms, averaged, dump, .. } = *args;
    let wander = match (args.smooth, args.flicker, args.resonant) {
        (true, _, _) => Wander::Smooth,
        (_, true, _) => Wander::Flicker,
        (_, _, true) => Wander::Resonant,
        _ => Wander::Autoregression,
    };
    let manner = Manner { hours, other_physics, wander, bursts, storms, averaged, dump };
    let orders = run::plan(args.cases, args.seed, &kinds, manner, only);
    let progress = bar(orders.len(), "sealing");
    let seals = run::seal(&orders, &progress);
    progress.finish_and_clear();
    eprintln!("{} cases, commitment {}", seals.len(), seal::root(&seals));
    if let Some(out) = &args.out {
        let progress = bar(orders.len(), "writing");
        run::write(&orders, &seals, out, &progress).with_context(|| format!("cannot write to {}", out.display()))?;
        progress.finish_and_clear();
    }
    if args.make {
        return Ok(None);
    }
    let progress = bar(orders.len(), "analysing");
    let outcomes = run::run(&orders, &seals, engine, &progress)?;
    progress.finish_and_clear();
    Ok(Some(outcomes))
}

/// One line of JSON per case: truth, answer, time.
fn keep(out: &Path, outcomes: &[Outcome]) -> anyhow::Result<()> {
    std::fs::create_dir_all(out)?;
    let lines: Result<Vec<String>, _> = outcomes.iter().map(serde_json::to_string).collect();
    std::fs::write(out.join("outcomes.jsonl"), lines?.join("\n") + "\n")?;
    Ok(())
}

fn known(id: &str) -> Result<&'static str, String> {
    let all = || effect::IDS.into_iter().chain(law::all().map(|(name, _)| name));
    let there = || all().collect::<Vec<&str>>().join(", ");
    all().find(|known| *known == id).ok_or_else(|| format!("no such effect or law; there are: {}", there()))
}

pub(super) fn bar(length: usize, doing: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:>10} {bar:40} {pos}/{len} {elapsed} (left {eta})");
    let bar = ProgressBar::new(length as u64).with_message(doing);
    if let Ok(style) = style { bar.with_style(style) } else { bar }
}
