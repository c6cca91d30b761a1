//! `oare process`: dumps in, product files out; the same pipeline as the service, without sockets.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use oare_ground::ingest::wire::{PlaybackPart, PlaybackReader};
use oare_ground::pipeline::calibration::KnownCalibration;
use oare_ground::pipeline::station::replay;
use oare_ground::pipeline::{PlaybackId, Settings, Station, files};

/// Arguments of `oare process`.
#[derive(clap::Args)]
pub struct Args {
    /// Dump files, in the order in which they are to arrive.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Folder for the product files; made if need be.
    #[arg(long)]
    out: PathBuf,
    /// Known bias laws and scale factors, taken instead of estimating them.
    #[arg(long)]
    calibration: Option<PathBuf>,
    /// Print one JSON document with the ledger on standard output.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: Args) -> Result<ExitCode> {
    let settings = Settings::sts65();
    let known = match &args.calibration {
        Some(path) => match read_calibration(path) {
            Ok(known) => Some(known),
            Err(error) => {
                eprintln!("oare process: {error:#}");
                return Ok(super::unusable());
            }
        },
        None => None,
    };
    let mut dumps = Vec::new();
    for path in &args.files {
        match fs::read(path) {
            Ok(octets) => dumps.push(octets),
            Err(error) => {
                eprintln!("oare process: cannot read {}: {error}", path.display());
                return Ok(super::unusable());
            }
        }
    }
    let station = replay(&settings, known.as_ref(), |station| take_all(station, &settings, &dumps));
    write_products(&station, &args.out)?;
    summarise(&station, args.json)
}

fn read_calibration(path: &Path) -> Result<KnownCalibration> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    KnownCalibration::parse(&text).with_context(|| format!("cannot use {}", path.display()))
}

/// Takes every dump, a stream each.
fn take_all(station: &mut Station, settings: &Settings, dumps: &[Vec<u8>]) {
    let mut next = 0;
    for dump in dumps {
        let mut reader = PlaybackReader::new(settings.link);
        let mut take = |part: PlaybackPart| match part {
            PlaybackPart::Opened => {
                next += 1;
                station.open_playback(PlaybackId(next));
            }
            PlaybackPart::Arrival(arrival) => station.take(PlaybackId(next), &arrival),
            PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(next), bits),
        };
        reader.push(dump, &mut take);
        reader.finish(&mut take);
    }
}

fn write_products(station: &Station, out: &Path) -> Result<()> {
    fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    let write = |name: &str, text: String| {
        let path = out.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))
    };
    let pretty = |value: &serde_json::Value| -> Result<String> { Ok(serde_json::to_string_pretty(value)? + "\n") };
    write("windows.csv", files::windows_csv(station))?;
    write("calibration.json", pretty(&files::calibration_json(station))?)?;
    write("anomalies.json", pretty(&files::anomalies_json(station))?)?;
    write("ledger.json", pretty(&files::ledger_json(station))?)
}

/// Tells what was taken in, and what could not be used.
fn summarise(station: &Station, json: bool) -> Result<ExitCode> {
    let total = station.ledger().total();
    if json {
        println!("{}", serde_json::to_string(&files::ledger_json(station))?);
    }
    let refused: u64 = total.frames_refused.values().sum();
    let packets_refused: u64 = total.packets_refused.values().sum();
    eprintln!(
        "{} playbacks, {} frames: {} new, {} repeated, {refused} refused; {} s of science data, {} gaps; {} windows; {packets_refused} packets refused",
        station.ledger().playbacks().count(),
        total.frames_found,
        total.frames_new,
        total.frames_repeated,
        station.ledger().seconds.len(),
        station.gaps().len(),
        station.products().count(),
    );
    for (reason, n) in &total.frames_refused {
        eprintln!("  {n} frames refused: {reason}");
    }
    for (reason, n) in &total.packets_refused {
        eprintln!("  {n} packets refused: {reason}");
    }
    let in_part = refused + packets_refused > 0 || total.frames_found == 0;
    Ok(if in_part { super::done_in_part() } else { super::DONE })
}
