//! `oare simulate`: a mission flown, its dump and its truth written.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;

use oare_ground::ingest::wire::LinkConfig;
use oare_ground::simulate::expected::{CASE_FILES, case_files};
use oare_ground::simulate::mission_file::{Overrides, from_toml};
use oare_ground::simulate::recorder::{Framer, Packetiser};
use oare_ground::simulate::truth::{TruthBuilder, instrument_json, truth_csv};
use oare_ground::simulate::{Mission, SimulateError, playbacks};

use super::output::over_an_input;

/// Fly a simulated mission and write its recorder dump, with the truth beside it.
#[derive(clap::Args)]
pub struct Args {
    /// Dump to write; several playbacks stand in it one after the other. The true instrument goes beside it as
    /// `.instrument.json`, true accelerations as `.truth.csv`.
    #[arg(long)]
    out: PathBuf,
    /// Mission file; without it, STS-65 as it was (config/mission.toml explains every key).
    #[arg(long)]
    config: Option<PathBuf>,
    /// Length of the mission in hours, in place of the file's.
    #[arg(long)]
    hours: Option<f64>,
    /// Seed, in place of the file's.
    #[arg(long)]
    seed: Option<u64>,
    /// Where to write the true accelerations, in place of beside the dump.
    #[arg(long)]
    truth: Option<PathBuf>,
    /// Directory for what an analyst would have beside the dump: `case.toml`, simulation, ancillary data and log, for `oare
    /// diagnose` and for the running diagnosis of `oare serve`. The simulation takes every force as nature has it.
    #[arg(long)]
    case: Option<PathBuf>,
}

/// Flies the mission.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    if let Some(misplaced) = misplaced(&args) {
        eprintln!("oare simulate: {misplaced}");
        return Ok(super::unusable());
    }
    let text = match &args.config {
        Some(path) => match fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) => {
                eprintln!("oare simulate: cannot read {}: {error}", path.display());
                return Ok(super::unusable());
            }
        },
        None => String::new(),
    };
    let overrides = Overrides { seed: args.seed, hours: args.hours };
    let file = match from_toml(&text, overrides) {
        Ok(file) => file,
        Err(problems) => return Ok(refuse(&problems)),
    };
    let mission = match Mission::new(file.mission) {
        Ok(mission) => mission,
        Err(problems) => return Ok(refuse(&problems)),
    };

    let bar = indicatif::ProgressBar::new(u64::from(mission.config().end_clock_s() - mission.config().start_clock_s));
    let link = LinkConfig::default();
    let (mut packetiser, mut framer, mut truth) =
        (Packetiser::default(), Framer::new(link, 1, 0), TruthBuilder::default());
    let (mut frames, mut windows, mut seconds) = (Vec::new(), Vec::new(), 0u64);
    for second in mission.fly() {
        for sent in &second.sent {
            framer.push(&packetiser.packet(sent), |frame| frames.push(frame));
        }
        windows.extend(truth.take(&second));
        seconds += 1;
        if seconds.is_multiple_of(3600) {
            bar.set_position(seconds);
        }
    }
    framer.finish(|frame| frames.push(frame));
    bar.finish_and_clear();

    let passes = playbacks(&frames, &link, &file.recorder, mission.config().seed);
    let octets: Vec<u8> = passes.iter().flat_map(|pass| pass.octets.iter().copied()).collect();
    write(&args.out, &octets)?;
    let [truth_path, instrument_path] = beside(&args);
    write(&truth_path, truth_csv(&windows).as_bytes())?;
    write(&instrument_path, instrument_json(&mission).as_bytes())?;
    if let Some(folder) = &args.case
        && let Err(problems) = write_case(&mission, folder, &args.out)?
    {
        return Ok(refuse(&problems));
    }
    println!(
        "{seconds} seconds in {} frames and {} playback(s): {} octets in {}, truth in {}",
        frames.len(),
        passes.len(),
        octets.len(),
        args.out.display(),
        truth_path.display()
    );
    Ok(super::DONE)
}

/// Where the true accelerations and the true instrument go.
fn beside(args: &Args) -> [PathBuf; 2] {
    let truth = args.truth.clone().unwrap_or_else(|| args.out.with_extension("truth.csv"));
    [truth, args.out.with_extension("instrument.json")]
}

/// Which file would be written over another, or over the mission file.
fn misplaced(args: &Args) -> Option<String> {
    let [truth, instrument] = beside(args);
    if truth == args.out || truth == instrument {
        let path = truth.display();
        return Some(format!(
            "--truth {path}: the dump or the instrument goes there, and one would be written over the other"
        ));
    }
    let of_case = args.case.iter().flat_map(|folder| CASE_FILES.map(|name| folder.join(name)));
    let outputs = [args.out.clone(), truth, instrument].into_iter().chain(of_case);
    let inputs: Vec<&Path> = args.config.iter().map(PathBuf::as_path).collect();
    over_an_input(outputs, &inputs)
}

fn write_case(mission: &Mission, folder: &Path, dump: &Path) -> anyhow::Result<Result<(), Vec<SimulateError>>> {
    let id = folder.file_name().map_or_else(|| "simulated".into(), |name| name.to_string_lossy().into_owned());
    let dump = fs::canonicalize(dump).with_context(|| format!("cannot find {}", dump.display()))?;
    let files = match case_files(mission, &id, &dump.to_string_lossy()) {
        Ok(files) => files,
        Err(problems) => return Ok(Err(problems)),
    };
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for (name, text) in files {
        write(&folder.join(name), text.as_bytes())?;
    }
    Ok(Ok(()))
}

fn refuse(problems: &[SimulateError]) -> ExitCode {
    for problem in problems {
        eprintln!("{problem}");
    }
    super::unusable()
}

fn write(path: &Path, octets: &[u8]) -> anyhow::Result<()> {
    fs::write(path, octets).with_context(|| format!("cannot write {}", path.display()))
}
