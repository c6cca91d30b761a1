//! `oare challenge`: conceal cases, commit to their truth, analyse them blind, reveal, score.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use oare_ground::challenge::conceal::{Kind, effect, law};
use oare_ground::challenge::{run, seal};

/// Conceal cases, commit to their truth, analyse them blind, reveal, score.
#[derive(clap::Args)]
pub struct Args {
    /// Number of cases.
    #[arg(long, default_value_t = 60)]
    cases: usize,
    /// First seed of every kind.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only these kinds, separated by commas.
    #[arg(long, value_enum, value_delimiter = ',')]
    kinds: Vec<Kind>,
    /// Only this effect of the catalogue, or this unlisted law.
    #[arg(long)]
    effect: Option<String>,
    /// Winds, density waves and panel areas that the analyser's regressors do not have.
    #[arg(long)]
    other_physics: bool,
    /// Draw from the real recordings below this folder instead of simulated ones.
    #[arg(long)]
    real: Option<PathBuf>,
    /// Write the cases here as directories, their truths apart from them.
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if let Some(dir) = &args.real {
        return super::challenge_real::run(dir, args.cases, args.seed, args.out.as_deref());
    }
    let only = args.effect.as_deref().map(known).transpose()?;
    let kinds = match (args.kinds.is_empty(), only) {
        (false, _) => args.kinds.clone(),
        (true, None) => Kind::ALL.to_vec(),
        (true, Some(id)) if effect::IDS.contains(&id) => vec![Kind::One],
        (true, Some(_)) => vec![Kind::Unknown],
    };
    let orders = run::plan(args.cases, args.seed, &kinds, args.other_physics, only);
    let progress = bar(orders.len(), "sealing");
    let seals = run::seal(&orders, &progress);
    progress.finish_and_clear();
    eprintln!("{} cases, commitment {}", seals.len(), seal::root(&seals));
    if let Some(out) = &args.out {
        let progress = bar(orders.len(), "writing");
        run::write(&orders, &seals, out, &progress).with_context(|| format!("cannot write to {}", out.display()))?;
        progress.finish_and_clear();
    }
    Ok(super::DONE)
}

fn known(id: &str) -> anyhow::Result<&'static str> {
    let mut ids = effect::IDS.into_iter().chain(law::LAWS.map(|(name, _)| name));
    ids.find(|known| *known == id).with_context(|| {
        let all: Vec<&str> = effect::IDS.into_iter().chain(law::LAWS.map(|(name, _)| name)).collect();
        format!("no effect or law `{id}`; there are: {}", all.join(", "))
    })
}

pub(super) fn bar(length: usize, doing: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:>10} {bar:40} {pos}/{len} {elapsed} (left {eta})");
    let bar = ProgressBar::new(length as u64).with_message(doing);
    if let Ok(style) = style { bar.with_style(style) } else { bar }
}
