//! `oare pad FILE`: what a PAD file holds, and as CSV for any other program (and for `oare diagnose`, which takes it itself).

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use oare_ground::ingest::wire::Pad;

use super::output::is_one_file;

/// A PAD file of the space station's archive: what it holds, and as CSV.
#[derive(clap::Args)]
pub struct Args {
    /// The data file; its header is beside it, with `.header` after the name.
    file: PathBuf,
    /// Write `t_s,x_g,y_g,z_g` here.
    #[arg(long)]
    csv: Option<PathBuf>,
}

/// Runs it.
pub fn run(args: Args) -> anyhow::Result<ExitCode> {
    let pad = match read(&args.file) {
        Ok(pad) => pad,
        Err(error) => {
            eprintln!("oare: {error:#}");
            return Ok(super::unusable());
        }
    };
    let header = &pad.header;
    let last_s = pad.samples.last().map_or(0.0, |s| s.t_s);
    println!("sensor {}, time zero {}, {}", header.sensor, header.time_zero, header.coordinates);
    println!(
        "{} samples over {last_s:.3} s, {} a second, cutoff {} Hz, gain {}; {}",
        pad.samples.len(),
        header.rate_hz,
        header.cutoff_hz,
        header.gain,
        header.quality
    );
    for ((axis, mean), rms) in ["x", "y", "z"].iter().zip(pad.mean_g()).zip(pad.rms_g()) {
        println!("{axis}  mean {:+10.2} ug  rms about it {:9.2} ug", mean * 1e6, rms * 1e6);
    }
    if let Some(out) = &args.csv {
        if is_one_file(out, &args.file) {
            eprintln!("oare: --csv {}: that is the PAD file itself, and is not written over", out.display());
            return Ok(super::unusable());
        }
        std::fs::write(out, pad.csv()).with_context(|| format!("cannot write {}", out.display()))?;
    }
    Ok(super::DONE)
}

fn read(file: &Path) -> anyhow::Result<Pad> {
    let mut header = file.as_os_str().to_owned();
    header.push(".header");
    let header = PathBuf::from(header);
    let xml = std::fs::read_to_string(&header).with_context(|| header.display().to_string())?;
    let data = std::fs::read(file).with_context(|| file.display().to_string())?;
    Pad::read(&xml, &data).with_context(|| file.display().to_string())
}
