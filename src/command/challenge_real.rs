//! `oare challenge --real`: the lot over real recordings, and the evidence it leaves.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use indicatif::ProgressBar;
use oare_ground::challenge::real::evidence::{Evidence, LIMITS, Whole};
use oare_ground::challenge::real::{self, NOTHING, Outcome, Real, Score};
use oare_ground::diagnose::measured::{self, Kind, Plates};
use rayon::prelude::*;

use super::challenge::bar;
use super::output;

/// Draw, analyse, reveal, score, and say how long it took; with `out`, diagnose the cases whole and write the evidence.
pub fn run(dir: &Path, draws: usize, seed: u64, out: Option<&Path>) -> anyhow::Result<ExitCode> {
    let started = std::time::Instant::now();
    let folders = real::folders(dir);
    if folders.is_empty() {
        eprintln!("SKIPPED: no real recordings below {}", dir.display());
        return Ok(super::DONE);
    }
    let progress = bar(folders.len(), "full models");
    let read = match Real::read(dir, &|| progress.inc(1)) {
        Ok(read) => read,
        Err(error) => {
            progress.finish_and_clear();
            eprintln!("oare: {error}");
            return Ok(super::unusable());
        }
    };
    progress.finish_and_clear();
    let lots = read.draw(draws, seed);
    let commitment = real::commitment(&lots);
    eprintln!(
        "{} draws over {} satellites, pose sets and axes; commitment {commitment}",
        lots.len(),
        read.subjects.len()
    );
    let progress = bar(lots.len(), "analysing");
    let outcomes = read.run(&lots, &|| progress.inc(1));
    progress.finish_and_clear();
    let score = real::score(&outcomes, commitment);
    show(&outcomes, &score);
    if let Some(out) = out {
        write(out, &folders, outcomes, score)?;
    }
    let threads = rayon::current_num_threads();
    println!("{:.0} s on {threads} threads, seed {seed}", started.elapsed().as_secs_f64());
    Ok(super::DONE)
}

fn show(outcomes: &[Outcome], score: &Score) {
    for wrong in outcomes.iter().filter(|o| !o.right) {
        let named = if wrong.named.is_empty() { NOTHING.to_owned() } else { wrong.named.join(", ") };
        println!("draw {}: {} without {}: named {named}", wrong.truth.draw, wrong.truth.subject, wrong.truth.removed);
    }
    let line = |what: &str, [good, of]: [usize; 2]| {
        println!("{what:<52} {good:>5} of {of:>5}   {:.1} %", 100.0 * good as f64 / of.max(1) as f64);
    };
    line("a term taken out, named rightly and alone", score.removed);
    line("nothing taken out, answered with nothing", score.nothing);
    line("coefficients within 2 sigma of the full model's", score.coefficients);
    println!("{LIMITS}");
}

fn write(out: &Path, folders: &[PathBuf], draws: Vec<Outcome>, score: Score) -> anyhow::Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let mut orders = Vec::new();
    for folder in folders {
        orders.extend(variants(folder)?.into_iter().map(|with| (folder, with)));
    }
    let progress: ProgressBar = bar(orders.len(), "whole cases");
    let one = |(folder, with): &(&PathBuf, Vec<String>)| {
        let (case, files) = real::read(folder, with)?;
        let (answer, plates) = measured::analyse(&case, &files).with_context(|| folder.display().to_string())?;
        let with = if with.is_empty() { "as it stands".to_owned() } else { with.join(", ") };
        progress.inc(1);
        anyhow::Ok((Whole { with, answer }, plates))
    };
    let wholes: Vec<(Whole, Plates)> = orders.par_iter().map(one).collect::<anyhow::Result<_>>()?;
    let (cases, plates): (Vec<Whole>, Vec<Plates>) = wholes.into_iter().unzip();
    progress.finish_and_clear();
    let evidence = Evidence { limits: LIMITS, score, draws, cases };
    output::write(&out.join("evidence.json"), &serde_json::to_string_pretty(&evidence)?)?;
    output::write(&out.join("evidence.html"), evidence.html(&plates))?;
    eprintln!("evidence in {}", out.display());
    Ok(())
}

/// As it stands; an orbit once more with its second half held back.
fn variants(folder: &Path) -> anyhow::Result<Vec<Vec<String>>> {
    let (case, _) = real::read(folder, &[])?;
    let half = case.number("recording.fit_hours")?.map(|h| format!("recording.fit_hours={}", h / 2.0));
    match (case.kind, half) {
        (Kind::OrbitSp3, Some(half)) => Ok(vec![Vec::new(), vec![half]]),
        _ => Ok(vec![Vec::new()]),
    }
}
