//! `oare demo`: the whole thing with nothing prepared. A service comes up on a directory of its own, and a simulated mission is
//! flown into its dump port, playback by playback; half way something begins to leak that the simulation knows nothing of.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use oare_ground::config::Config;
use oare_ground::ingest::wire::LinkConfig;
use oare_ground::physics::Vec3;
use oare_ground::service::{Service, ServiceError};
use oare_ground::simulate::expected::case_files;
use oare_ground::simulate::forces::Push;
use oare_ground::simulate::recorder::{Framer, Packetiser, RecorderConfig, playbacks};
use oare_ground::simulate::{Mission, MissionConfig};
use tokio_util::sync::CancellationToken;

use super::replay::{Speed, send};

/// Arguments of `oare demo`.
#[derive(clap::Args)]
pub struct Args {
    /// Length of the mission in hours.
    #[arg(long, default_value_t = 24.0)]
    hours: f64,
    /// Times the pace of the mission, or `max`.
    #[arg(long, default_value = "3600")]
    speed: Speed,
    /// Seed of the mission.
    #[arg(long, default_value_t = 65)]
    seed: u64,
    /// Where dumps are taken; any free port where this one is busy.
    #[arg(long, default_value = "127.0.0.1:7650")]
    ingest: SocketAddr,
    /// Where products are served; any free port where this one is busy.
    #[arg(long, default_value = "127.0.0.1:8080")]
    http: SocketAddr,
}

/// Frames of one playback: about an hour of telemetry.
const PLAYBACK_FRAMES: usize = 320;
/// Frames of the playback before that come again.
const OVERLAP_FRAMES: usize = 20;

/// The concealed leak, at its begin, and how it dies away.
const LEAK_NG: [f64; 3] = [250.0, -120.0, 300.0];
const LEAK_TAU_S: f64 = 9000.0;

/// Runs the command.
pub fn run(args: Args) -> Result<ExitCode> {
    super::log_to_stderr();
    let planned = concealing(MissionConfig::sts65(args.seed, args.hours));
    let flown = Mission::new(planned).and_then(|mission| Ok((case_files(&mission, "demo", "the dump port")?, mission)));
    let (case, mission) = match flown {
        Ok(flown) => flown,
        Err(problems) => {
            problems.iter().for_each(|problem| eprintln!("oare demo: {problem}"));
            return Ok(super::unusable());
        }
    };
    let data = Scratch::new()?;
    for (name, text) in case {
        std::fs::write(data.0.join(name), text)?;
    }
    super::runtime()?.block_on(async {
        let service = start(&args, &data.0).await?;
        println!("dashboard: http://{}/", service.http_address);
        println!("latest value: curl http://{}/accel", service.http_address);
        println!("what the simulation lacks, as it shows: curl http://{}/diagnosis", service.http_address);
        println!("dump port: {}; Ctrl-C ends", service.ingest_address);
        let landed = CancellationToken::new();
        let (to, over) = (service.ingest_address, landed.clone());
        let flight = tokio::task::spawn_blocking(move || fly(&mission, to, args.speed, args.seed, &over));
        tokio::select! {
            told = super::serve::told_to_end() => told?,
            () = service.failed() => {}
        }
        landed.cancel();
        flight.await.map_err(|error| anyhow!("the mission broke off: {error}"))??;
        service.drain().await?;
        Ok(super::DONE)
    })
}

/// The mission with a leak half way, of which the simulation that the service compares with knows nothing.
fn concealing(mut config: MissionConfig) -> MissionConfig {
    let (from_s, until_s) = (f64::from(config.start_clock_s), f64::from(config.end_clock_s()));
    config.forces.pushes.push(Push {
        from_clock_s: (0.5 * (from_s + until_s)).round(),
        until_clock_s: f64::INFINITY,
        tau_s: Some(LEAK_TAU_S),
        body_ng: Vec3::from(LEAK_NG),
    });
    config
}

/// A directory that goes with the demonstration.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Result<Self> {
        let path = std::env::temp_dir().join(format!("oare-demo-{}", std::process::id()));
        std::fs::create_dir_all(&path)?;
        Ok(Self(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The service at the addresses asked for, or on free ports where one of them is busy.
async fn start(args: &Args, data: &Path) -> Result<Service> {
    let mut config = Config::from_toml_in("[diagnosis]\ncase = \".\"\n", data)?;
    config.data_dir = data.to_path_buf();
    config.ingest.address = args.ingest;
    config.http.address = args.http;
    loop {
        let error = match Service::start(config.clone()).await {
            Ok(service) => return Ok(service),
            Err(error) => error,
        };
        let ServiceError::Bind { address, .. } = &error else { return Err(error.into()) };
        if address.port() == 0 {
            return Err(error.into());
        }
        eprintln!("oare demo: {error}; taking a free port");
        let busy =
            if *address == config.ingest.address { &mut config.ingest.address } else { &mut config.http.address };
        busy.set_port(0);
    }
}

/// Flies the mission and sends its tape down, an hour at a time, as a recorder on a bad day would.
fn fly(mission: &Mission, to: SocketAddr, speed: Speed, seed: u64, over: &CancellationToken) -> Result<()> {
    let link = LinkConfig::default();
    let tape = RecorderConfig {
        frames_per_playback: usize::MAX,
        overlap_frames: 0,
        lost_frames: 0.0005,
        repeats: 0.05,
        shuffled: false,
        ..RecorderConfig::messy()
    };
    let (mut packetiser, mut framer) = (Packetiser::default(), Framer::new(link, 1, 0));
    let (mut frames, mut fresh, mut flown_s) = (Vec::new(), 0, 0u32);
    let start = Instant::now();
    let send_down = |frames: &[Vec<u8>], flown_s: u32| -> Result<()> {
        if let Speed::Times(times) = speed {
            let due = start + Duration::from_secs_f64(f64::from(flown_s) / times);
            while Instant::now() < due && !over.is_cancelled() {
                std::thread::sleep(Duration::from_millis(50).min(due.saturating_duration_since(Instant::now())));
            }
        }
        for playback in playbacks(frames, &link, &tape, seed ^ u64::from(flown_s)) {
            if over.is_cancelled() {
                return Ok(());
            }
            send(&playback.octets, to, Speed::Max, &link)?;
        }
        Ok(())
    };
    for second in mission.fly() {
        if over.is_cancelled() {
            return Ok(());
        }
        flown_s += 1;
        for sent in &second.sent {
            framer.push(&packetiser.packet(sent), |frame| {
                frames.push(frame);
                fresh += 1;
            });
        }
        if fresh >= PLAYBACK_FRAMES {
            send_down(&frames, flown_s)?;
            frames.drain(..frames.len() - OVERLAP_FRAMES);
            fresh = 0;
        }
    }
    framer.finish(|frame| frames.push(frame));
    send_down(&frames, flown_s)?;
    eprintln!("oare demo: the mission is down; the service stays up");
    Ok(())
}
