//! `oare diagnose CASE_DIR`: what did the simulation leave out?

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use oare_ground::challenge::folder;
use oare_ground::diagnose::analysis::{Analysis, Prepared, Settings};
use oare_ground::diagnose::answer::Diagnosis;
use oare_ground::diagnose::catalogue;
use oare_ground::diagnose::error::CaseError;
use oare_ground::diagnose::measured::{self, MeasuredCase};
use oare_ground::diagnose::report;
use oare_ground::paper::page::with_error;

use super::output::{is_one_file, write, write_report};

/// Says what physics a simulation left out, from a case directory.
#[derive(clap::Args)]
pub struct Args {
    /// Directory with `case.toml` and the files it names, or that `case.toml`.
    #[arg(value_parser = case_directory)]
    case: PathBuf,
    /// Where `diagnosis.json` goes; no file of the case is written over.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Directory for the report: `index.html` and its figures.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Print the answer as JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// Override a key of `case.toml`, for example `vehicle.mass_kg=104500`.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Seed of the bootstrap.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Bootstrap replicates for the false-alarm probability; 0 takes the table of nulls.
    #[arg(long, default_value_t = 0)]
    bootstraps: usize,
    /// Catalogue effects to leave out.
    #[arg(long, value_delimiter = ',', value_parser = effect)]
    without: Vec<String>,
    /// False-alarm probability at or below which something is claimed.
    #[arg(long, default_value_t = 0.002, value_parser = probability)]
    claim_probability: f64,
}

/// Orbits, series and poses: recordings of another kind, the same answer in their own unit.
fn measured(args: &Args) -> anyhow::Result<ExitCode> {
    let other_claim = args.claim_probability != Settings::default().claim_probability;
    let without = !args.without.is_empty();
    for (given, option) in
        [(args.bootstraps > 0, "--bootstraps"), (without, "--without"), (other_claim, "--claim-probability")]
    {
        if given {
            eprintln!(
                "oare: {option} is for accelerations against a simulation, and does nothing to a case of this kind"
            );
        }
    }
    let read = oare_ground::challenge::real::read(&args.case, &args.set).map_err(anyhow::Error::from);
    let (answer, plates) = match read.and_then(|(case, files)| Ok(measured::analyse(&case, &files)?)) {
        Ok(found) => found,
        Err(error) => {
            eprintln!("oare: {error}");
            return Ok(super::unusable());
        }
    };
    let json = serde_json::to_string_pretty(&answer).context("the answer does not serialise")?;
    if let Some(out) = &args.out {
        write(out, &json)?;
    }
    if let Some(directory) = &args.report {
        write_report(directory, &measured::page::report(&answer, &plates), ("diagnosis.json", &json))?;
    }
    if args.json {
        println!("{json}");
        return Ok(super::DONE);
    }
    println!(
        "{}: {} (false-alarm probability {:.1e})",
        answer.case,
        answer.verdict.word(),
        answer.false_alarm_probability
    );
    println!("  {}", measured::page::sentence(&answer));
    for effect in &answer.effects {
        println!("  {}: {}", effect.id, effect.why);
        for p in &effect.parameters {
            println!("    {} = {:.4e} +- {:.1e} {}", p.name, p.value, p.sigma, p.unit);
        }
    }
    for note in &answer.notes {
        println!("  {note}");
    }
    Ok(super::DONE)
}

/// Why the answer cannot go where it is wanted: over a file of the case, into a folder, or a report among the files of the case.
fn misplaced(args: &Args) -> Option<String> {
    let case = args.case.canonicalize().ok()?;
    if let Some(out) = &args.out {
        if out.is_dir() {
            return Some(format!("--out {}: expected a file, found a folder", out.display()));
        }
        let is_inside = out.canonicalize().is_ok_and(|out| out.starts_with(&case));
        let is_named = || named_files(args).iter().any(|file| is_one_file(file, out));
        if (is_inside || is_named()) && !is_answer(out) {
            return Some(format!("--out {}: that is a file of the case, and is not written over", out.display()));
        }
    }
    let report = args.report.as_ref().filter(|report| report.canonicalize().is_ok_and(|report| report == case))?;
    Some(format!("--report {}: that is the case itself, and is not written to", report.display()))
}

/// Everything that `case.toml` or an override may name as a file, wherever it lies.
fn named_files(args: &Args) -> Vec<PathBuf> {
    fn texts(value: &toml::Value, found: &mut Vec<String>) {
        match value {
            toml::Value::String(text) => found.push(text.clone()),
            toml::Value::Array(values) => values.iter().for_each(|value| texts(value, found)),
            toml::Value::Table(table) => table.values().for_each(|value| texts(value, found)),
            _ => {}
        }
    }
    let text = std::fs::read_to_string(args.case.join("case.toml")).unwrap_or_default();
    let mut found = Vec::new();
    texts(&toml::Value::Table(text.parse().unwrap_or_default()), &mut found);
    found
        .extend(args.set.iter().filter_map(|set| set.split_once('=')).map(|(_, value)| value.trim_matches('"').into()));
    found.iter().map(|name| args.case.join(name)).collect()
}

/// Whether a file is an earlier answer.
fn is_answer(path: &Path) -> bool {
    let json =
        std::fs::read_to_string(path).ok().and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
    json.is_some_and(|json| json["schema"].as_str().is_some_and(|schema| schema.starts_with("oare.diagnosis/")))
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if let Some(misplaced) = misplaced(&args) {
        eprintln!("oare: {misplaced}");
        return Ok(super::unusable());
    }
    let text = std::fs::read_to_string(args.case.join("case.toml")).unwrap_or_default();
    if MeasuredCase::kind_of(&text, &args.set).is_some() {
        return measured(&args);
    }
    let analysis = match analyse(&args) {
        Ok(analysis) => analysis,
        Err(error) => {
            eprintln!("oare: {error}");
            return Ok(super::unusable());
        }
    };
    let json = serde_json::to_string_pretty(&analysis.diagnosis).context("the answer does not serialise")?;
    if let Some(out) = &args.out {
        write(out, &json)?;
    }
    if let Some(directory) = &args.report {
        let report = report::report(&analysis.diagnosis, &analysis.plates);
        write_report(directory, &report, ("diagnosis.json", &json))?;
    }
    if args.json {
        println!("{json}");
    } else {
        print_table(&analysis.diagnosis);
    }
    Ok(super::DONE)
}

fn analyse(args: &Args) -> Result<Analysis, CaseError> {
    let case = folder::case(&args.case, &args.set)?;
    let settings = Settings {
        seed: args.seed,
        bootstraps: args.bootstraps,
        without: args.without.clone(),
        claim_probability: args.claim_probability,
    };
    let prepared = Prepared::new(&case, &settings)?;
    let bar = ProgressBar::new(args.bootstraps as u64);
    if let Ok(style) = ProgressStyle::with_template("bootstrap {bar:40} {pos}/{len} {elapsed} (left {eta})") {
        bar.set_style(style);
    }
    let reached = (args.bootstraps > 0).then(|| prepared.bootstrap().run(args.bootstraps, || bar.inc(1)));
    bar.finish_and_clear();
    Ok(prepared.conclude(reached))
}

/// A case goes by its directory, or by the file in it that makes it one.
fn case_directory(text: &str) -> Result<PathBuf, std::convert::Infallible> {
    let path = Path::new(text);
    let is_the_file = path.file_name().is_some_and(|name| name == "case.toml") && path.is_file();
    Ok(path.parent().filter(|_| is_the_file).map_or(path.into(), |directory| Path::new(".").join(directory)))
}

fn effect(text: &str) -> Result<String, String> {
    match catalogue::by_id(text) {
        Some(_) => Ok(text.into()),
        None => {
            let known: Vec<&str> = catalogue::ALL.iter().map(|effect| effect.id).collect();
            Err(format!("the catalogue has no such effect; it has {}", known.join(", ")))
        }
    }
}

fn probability(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(p) if p > 0.0 && p < 1.0 => Ok(p),
        _ => Err("a probability between 0 and 1 is expected".into()),
    }
}

fn print_table(diagnosis: &Diagnosis) {
    let verdict = diagnosis.verdict.word();
    let from = diagnosis.false_alarm_from.map_or(String::new(), |source| format!(", by the {}", source.words()));
    println!("{}: {verdict} (false-alarm probability {:.1e}{from})", diagnosis.case, diagnosis.false_alarm_probability);
    for effect in &diagnosis.effects {
        println!("  {:<28} posterior {:.3}", effect.id, effect.posterior);
        if let Some(axis) = &effect.axis {
            println!("      {:<18} {axis}", "axis");
        }
        for p in &effect.parameters {
            let (value, sigma) = with_error(p.value, p.sigma);
            let error = if sigma.is_empty() { sigma } else { format!(" +- {sigma}") };
            println!("      {:<18} {value:>14}{error} {}", p.name, p.unit);
        }
    }
    if let Some(h) = &diagnosis.hypothesis {
        println!("  hypothesis: {} on {} ({})", h.formula, h.axis, h.location);
    }
    for set in &diagnosis.cannot_tell_apart {
        println!("  cannot tell apart: {}", set.join(" + "));
    }
    for a in &diagnosis.alternatives {
        println!("  alternative: {} (posterior {:.3})", a.effects.join(" + "), a.posterior);
    }
    if let Some(fit) = &diagnosis.fit {
        println!(
            "  rms before {:.1?} ng, after {:.1?} ng, noise floor {:.1?} ng",
            fit.before.rms_ng, fit.after.rms_ng, fit.noise_floor_ng
        );
        let removed = match fit.confirmed {
            None if !diagnosis.effects.is_empty() => "what is left in says nothing of what is left out".to_string(),
            _ => format!("excess removed {:.3}", fit.held_out.excess_removed),
        };
        println!(
            "  held out: log score gain {:.1}{}, {removed}",
            fit.held_out.log_score_gain,
            fit.held_out.log_score_gain_se.map_or(String::new(), |error| format!(" +- {error:.1}"))
        );
    }
    for note in &diagnosis.notes {
        println!("  note: {note}");
    }
}
