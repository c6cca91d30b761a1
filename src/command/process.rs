//! `oare process`: dumps in, product files out; the same pipeline as the service, without sockets.

use std::cell::Cell;
use std::collections::HashSet;
use std::fs;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use oare_ground::config::Config;
use oare_ground::ingest::wire::{LinkConfig, PlaybackPart, PlaybackReader, Verdict};
use oare_ground::pipeline::calibration::KnownCalibration;
use oare_ground::pipeline::report::report;
use oare_ground::pipeline::station::replay;
use oare_ground::pipeline::{PlaybackId, Station, files};
use oare_ground::record::{mcap_file::Recording, mcap_reader};
use oare_ground::units::Clock;
use sha2::{Digest, Sha256};

use super::output::{over_an_input, write, write_report};

/// Arguments of `oare process`.
#[derive(clap::Args)]
pub struct Args {
    /// Dump files, or recordings (.mcap) of ours, in the order in which they are to arrive.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Folder for the product files; made if need be.
    #[arg(long)]
    out: PathBuf,
    /// Configuration file; STS-65 without it.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Folder for a report: a page with accuracy tables, calibration and histories, its figures, and the tables as JSON.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Known bias laws and scale factors, taken instead of estimating them.
    #[arg(long)]
    calibration: Option<PathBuf>,
    /// Print one JSON document with the ledger on standard output.
    #[arg(long)]
    json: bool,
}

/// What is written into the folder for the products, and beside the figures into that of the report.
const PRODUCTS: [&str; 5] = ["windows.csv", "calibration.json", "anomalies.json", "ledger.json", RECORDING];
const RECORDING: &str = "recording.mcap";
const REPORT: [&str; 2] = ["index.html", "accuracy.json"];

/// Runs the command.
pub fn run(args: Args) -> Result<ExitCode> {
    let inputs: Vec<&Path> =
        args.files.iter().chain(&args.config).chain(&args.calibration).map(PathBuf::as_path).collect();
    let of_report = args.report.iter().flat_map(|folder| REPORT.map(|name| folder.join(name)));
    if let Some(over) = over_an_input(PRODUCTS.map(|name| args.out.join(name)).into_iter().chain(of_report), &inputs) {
        eprintln!("oare process: {over}");
        return Ok(super::unusable());
    }
    let settings = match super::serve::read_config(args.config) {
        Ok(Config { settings, .. }) => settings,
        Err(error) => {
            eprintln!("oare process: {error:#}");
            return Ok(super::unusable());
        }
    };
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
    let mut streams = Vec::new();
    for path in &args.files {
        match read_stream(path, settings.link) {
            Ok(stream) => streams.push(stream),
            Err(error) => {
                eprintln!("oare process: {error:#}");
                return Ok(super::unusable());
            }
        }
    }
    let station = replay(&settings, known.as_ref(), |station| take_all(station, &streams));
    write_products(&station, &args.out)?;
    write_recording(&station, &streams, &args.out.join(RECORDING))?;
    if let Some(folder) = &args.report {
        let report = report(&station);
        write_report(folder, &report.paper, (REPORT[1], &pretty(&report.accuracy)?))?;
    }
    for (path, stream) in args.files.iter().zip(&streams).filter(|(_, stream)| stream.frames.get() == 0) {
        let (file, octets) = (path.display(), stream.octets.len());
        eprintln!("oare process: {file}: no frame in {octets} octets; it adds nothing");
    }
    let whole = streams.iter().all(|stream| stream.whole && stream.frames.get() > 0);
    Ok(if summarise(&station, args.json)? && whole { super::DONE } else { super::done_in_part() })
}

fn read_calibration(path: &Path) -> Result<KnownCalibration> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    KnownCalibration::parse(&text).with_context(|| format!("cannot use {}", path.display()))
}

/// One stream, and the link it came down on.
struct Stream {
    link: LinkConfig,
    octets: Vec<u8>,
    /// Frames found in it, good or not.
    frames: Cell<u64>,
    /// Not a recording that was cut off or damaged.
    whole: bool,
}

/// A dump, or the frames of a recording, whose channel coding is removed already.
fn read_stream(path: &Path, link: LinkConfig) -> Result<Stream> {
    let octets = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    if !mcap_reader::is_mcap(&octets) {
        return Ok(Stream { link, octets, frames: Cell::new(0), whole: true });
    }
    let link = LinkConfig { randomised: false, reed_solomon_interleave: None, ..link };
    let recorded = mcap_reader::dump(&octets, &link).with_context(|| format!("cannot use {}", path.display()))?;
    recorded.faults.iter().for_each(|fault| eprintln!("oare process: {}: {fault}", path.display()));
    Ok(Stream { link, octets: recorded.dump, frames: Cell::new(0), whole: recorded.faults.is_empty() })
}

/// Reads every stream; parts come with the number of their playback.
fn read_all(streams: &[Stream], mut hand_on: impl FnMut(u32, PlaybackPart)) {
    let mut playback = 0;
    for stream in streams {
        let mut reader = PlaybackReader::new(stream.link);
        let mut number = |part: PlaybackPart| {
            playback += u32::from(part == PlaybackPart::Opened);
            stream.frames.set(stream.frames.get() + u64::from(matches!(part, PlaybackPart::Arrival(_))));
            hand_on(playback, part);
        };
        stream.octets.chunks(1 << 16).for_each(|chunk| reader.push(chunk, &mut number));
        reader.finish(&mut number);
    }
}

fn take_all(station: &mut Station, streams: &[Stream]) {
    read_all(streams, |playback, part| match part {
        PlaybackPart::Opened => station.open_playback(PlaybackId(playback)),
        PlaybackPart::Arrival(arrival) => station.take(PlaybackId(playback), &arrival),
        PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(playback), bits),
    });
}

/// The raw frames, repeats left out, and the products.
fn write_recording(station: &Station, streams: &[Stream], path: &Path) -> Result<()> {
    let cannot = || format!("cannot write {}", path.display());
    let file = fs::File::create(path).with_context(cannot)?;
    let mut recording = Recording::begin(BufWriter::new(file), station.settings()).with_context(cannot)?;
    let mut known = HashSet::new();
    let mut written = Ok(());
    read_all(streams, |playback, part| {
        let PlaybackPart::Arrival(arrival) = part else { return };
        let repeated = match arrival.verdict {
            Verdict::Good(id) => !known.insert((id, Sha256::digest(&arrival.octets))),
            Verdict::Refused(_) => false,
        };
        if !repeated && written.is_ok() {
            written = recording.frame(playback, &arrival);
        }
    });
    written.with_context(cannot)?;
    let [first, last] = [i64::MIN, i64::MAX].map(Clock::from_tenths);
    recording.products(station, first, last).with_context(cannot)?;
    recording.finish().with_context(cannot)?;
    Ok(())
}

fn write_products(station: &Station, out: &Path) -> Result<()> {
    let [windows, calibration, anomalies, ledger, _] = PRODUCTS.map(|name| out.join(name));
    write(&windows, files::windows_csv(station))?;
    write(&calibration, &pretty(&files::calibration_json(station))?)?;
    write(&anomalies, &pretty(&files::anomalies_json(station))?)?;
    write(&ledger, &pretty(&files::ledger_json(station))?)
}

fn pretty(value: &serde_json::Value) -> Result<String> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

/// Tells what was taken in, and what could not be used; whether everything could.
fn summarise(station: &Station, json: bool) -> Result<bool> {
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
    Ok(refused + packets_refused == 0 && total.frames_found > 0)
}
