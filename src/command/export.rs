//! `oare export`: products out of a data directory, in the formats people use.

use std::fs::{self, File};
use std::io::BufWriter;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result};
use clap::ValueEnum;
use oare_ground::ingest::log_replay::rebuild;
use oare_ground::ingest::raw_log::{RawLog, StoreError};
use oare_ground::pipeline::{Station, files};
use oare_ground::record::{mcap_file::Recording, table};
use oare_ground::units::{Clock, MissionTime};

/// Arguments of `oare export`.
#[derive(clap::Args)]
pub struct Args {
    /// The data directory of a service that is not running.
    #[arg(long)]
    data: PathBuf,
    /// Configuration file; STS-65 without it.
    #[arg(long)]
    config: Option<PathBuf>,
    /// In which format.
    #[arg(long, value_enum)]
    format: Format,
    /// First window start: clock seconds or RFC 3339.
    #[arg(long)]
    from: Option<String>,
    /// Last window start: clock seconds or RFC 3339.
    #[arg(long)]
    to: Option<String>,
    /// Folder for the files; made if need be.
    #[arg(long)]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// `windows.csv` and the other product files.
    Csv,
    /// `recording.mcap`: raw frames and products.
    Mcap,
}

/// Runs the command.
pub fn run(args: Args) -> Result<ExitCode> {
    let settings = match super::serve::read_config(args.config) {
        Ok(config) => config.settings,
        Err(error) => {
            eprintln!("oare export: {error:#}");
            return Ok(super::unusable());
        }
    };
    let bounds = (bound(&settings.time, "from", args.from, i64::MIN), bound(&settings.time, "to", args.to, i64::MAX));
    let (from, to) = match bounds {
        (Ok(from), Ok(to)) => (from, to),
        (from, to) => {
            from.err().into_iter().chain(to.err()).for_each(|sentence| eprintln!("oare export: {sentence}"));
            return Ok(super::unusable());
        }
    };
    if from > to {
        eprintln!("oare export: --from is after --to: {} s and {} s", from.seconds(), to.seconds());
        return Ok(super::unusable());
    }
    if !args.data.join("raw.redb").is_file() {
        eprintln!("oare export: there is no raw log in {}", args.data.display());
        return Ok(super::unusable());
    }
    let log = RawLog::open(&args.data, &settings.mission, &settings.link)?;
    if log.is_empty()? {
        let (mission, spacecraft) = (&settings.mission, settings.link.spacecraft_id);
        let held = match log.held_for()? {
            held if held.is_empty() => "it holds none at all".to_string(),
            held => format!("it holds those of {}", held.join("; ")),
        };
        let folder = args.data.display();
        eprintln!("oare export: {folder} has no frame of mission {mission:?}, spacecraft {spacecraft:#x}; {held}");
        return Ok(super::unusable());
    }
    let station = match rebuild(&log, &settings) {
        Err(fault @ StoreError::FrameOctets { .. }) => {
            eprintln!("oare export: {fault}");
            return Ok(super::unusable());
        }
        rebuilt => rebuilt?,
    };
    fs::create_dir_all(&args.out).with_context(|| format!("cannot make {}", args.out.display()))?;
    match args.format {
        Format::Csv => write_tables(&station, &args.out, from, to)?,
        Format::Mcap => write_recording(&log, &station, &args.out, from, to)?,
    }
    Ok(super::DONE)
}

fn bound(mission: &MissionTime, name: &str, text: Option<String>, standard_tenths: i64) -> Result<Clock, String> {
    let Some(text) = text else { return Ok(Clock::from_tenths(standard_tenths)) };
    let clock_s = match (text.parse::<f64>(), text.parse::<jiff::Timestamp>()) {
        (Ok(clock_s), _) if clock_s.is_finite() => clock_s,
        (_, Ok(utc)) => mission.clock_s(utc),
        _ => return Err(format!("--{name} is {text:?}; a time is clock seconds or RFC 3339")),
    };
    Ok(Clock::from_seconds(clock_s))
}

fn write_tables(station: &Station, out: &std::path::Path, from: Clock, to: Clock) -> Result<()> {
    let json = |value: serde_json::Value| serde_json::to_string_pretty(&value).map(|text| text + "\n");
    let files = [
        ("windows.csv", table::windows_csv_between(station, from, to)),
        ("calibration.json", json(files::calibration_json(station))?),
        ("anomalies.json", json(files::anomalies_json(station))?),
        ("ledger.json", json(files::ledger_json(station))?),
    ];
    files.iter().try_for_each(|(name, text)| super::output::write(&out.join(name), text))
}

fn write_recording(log: &RawLog, station: &Station, out: &std::path::Path, from: Clock, to: Clock) -> Result<()> {
    let path = out.join("recording.mcap");
    let file = File::create(&path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut recording = Recording::begin(BufWriter::new(file), station.settings())?;
    for batch in 0..log.batches() {
        for (playback, arrival) in log.first_arrivals(batch)? {
            recording.frame(playback, &arrival)?;
        }
    }
    recording.products(station, from, to)?;
    recording.finish()?;
    Ok(())
}
