//! `oare replay`: sends dump files as a recorder playback would arrive.

use std::fs;
use std::io::{ErrorKind, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use indicatif::{ProgressBar, ProgressStyle};
use oare_ground::ingest::wire::{LinkConfig, PlaybackPart, PlaybackReader, Verdict};
use oare_ground::record::frame_clock;
use oare_ground::record::mcap_reader::{self, Recorded};

/// Arguments of `oare replay`.
#[derive(clap::Args)]
pub struct Args {
    /// Dump files, or recordings (.mcap) of ours, each sent over a connection of its own, in order.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The dump port, such as 127.0.0.1:7650.
    #[arg(long)]
    to: SocketAddr,
    /// Times the recorded pace, or `max`.
    #[arg(long, default_value = "max")]
    speed: Speed,
    /// Configuration file with the link the dumps were made for; the standard link without it.
    #[arg(long)]
    config: Option<PathBuf>,
}

/// How fast to send.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// As fast as it is taken.
    Max,
    /// So many times the pace at which it was recorded.
    Times(f64),
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "max" => Ok(Speed::Max),
            _ => match text.parse() {
                Ok(times) if times > 0.0 && times < 1e9 => Ok(Speed::Times(times)),
                _ => Err(format!("{text:?} is no speed; a number above 0, or max")),
            },
        }
    }
}

/// Runs the command.
pub fn run(args: Args) -> Result<ExitCode> {
    let link = match super::serve::read_config(args.config) {
        Ok(config) => config.settings.link,
        Err(error) => {
            eprintln!("oare replay: {error:#}");
            return Ok(super::unusable());
        }
    };
    let mut dumps = Vec::new();
    for path in &args.files {
        match read(path, &link) {
            Ok(dump) => dumps.push((path, dump)),
            Err(error) => {
                eprintln!("oare replay: {error:#}");
                return Ok(super::unusable());
            }
        }
    }
    let mut whole = true;
    for (path, Recorded { dump, faults }) in &dumps {
        eprintln!("oare replay: {} to {}", path.display(), args.to);
        faults.iter().for_each(|fault| eprintln!("oare replay: {}: {fault}", path.display()));
        whole &= faults.is_empty();
        send(dump, args.to, args.speed, &link)?;
    }
    Ok(if whole { super::DONE } else { super::done_in_part() })
}

/// A dump, or a recording as one.
fn read(path: &Path, link: &LinkConfig) -> Result<Recorded> {
    let octets = fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    match mcap_reader::is_mcap(&octets) {
        true => mcap_reader::dump(&octets, link).with_context(|| format!("cannot use {}", path.display())),
        false => Ok(Recorded { dump: octets, faults: Vec::new() }),
    }
}

/// Sends one dump over one connection.
pub fn send(dump: &[u8], to: SocketAddr, speed: Speed, link: &LinkConfig) -> Result<()> {
    let mut stream = TcpStream::connect(to).with_context(|| format!("cannot connect to {to}"))?;
    let bar = ProgressBar::new(dump.len() as u64);
    bar.set_style(ProgressStyle::with_template("{bar:40} {bytes}/{total_bytes} {bytes_per_sec} {eta}")?);
    let sent = match speed {
        Speed::Max => send_all(&mut stream, dump, &bar),
        Speed::Times(times) => send_paced(&mut stream, dump, times, link, &bar),
    };
    bar.finish_and_clear();
    match sent {
        Err(error) if error.kind() == ErrorKind::BrokenPipe || error.kind() == ErrorKind::ConnectionReset => {
            Err(error).with_context(|| format!("{to} closed the connection before everything was sent"))
        }
        sent => sent.with_context(|| format!("cannot send to {to}")),
    }
}

fn send_all(stream: &mut TcpStream, dump: &[u8], bar: &ProgressBar) -> std::io::Result<()> {
    for chunk in dump.chunks(1 << 18) {
        stream.write_all(chunk)?;
        bar.inc(chunk.len() as u64);
    }
    stream.flush()
}

/// Where in the dump so much recorded time has passed: octet and clock, as the frames arrive.
fn pace(dump: &[u8], link: &LinkConfig) -> Vec<(usize, f64)> {
    let mut marks: Vec<(usize, f64)> = Vec::new();
    let mut reader = PlaybackReader::new(*link);
    let mut note = |part: PlaybackPart| {
        if let PlaybackPart::Arrival(arrival) = part
            && let Verdict::Good(_) = arrival.verdict
            && let Some(clock) = frame_clock(link, &arrival.octets)
        {
            let end = (arrival.first_bit / 8) as usize + arrival.octets.len();
            marks.push((end.min(dump.len()), clock.seconds()));
        }
    };
    dump.chunks(1 << 16).for_each(|chunk| reader.push(chunk, &mut note));
    reader.finish(&mut note);
    marks
}

fn send_paced(
    stream: &mut TcpStream,
    dump: &[u8],
    times: f64,
    link: &LinkConfig,
    bar: &ProgressBar,
) -> std::io::Result<()> {
    let marks = pace(dump, link);
    let start = Instant::now();
    let (mut sent, mut recorded_s) = (0, 0.0);
    let mut last_clock_s = marks.first().map_or(0.0, |mark| mark.1);
    for (end, clock_s) in marks {
        // A tape runs at its pace in either direction; a gap or an overlap takes no longer than the frames around it.
        let step_s = (clock_s - last_clock_s).abs();
        last_clock_s = clock_s;
        recorded_s += if step_s < 60.0 { step_s } else { 0.0 };
        let due = start + Duration::from_secs_f64(recorded_s / times);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        if end > sent {
            stream.write_all(&dump[sent..end])?;
            bar.set_position(end as u64);
            sent = end;
        }
    }
    stream.write_all(&dump[sent..])
}
