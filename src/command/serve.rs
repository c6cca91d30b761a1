//! `oare serve`: the service, until it is told to end.

use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result};
use oare_ground::config::Config;
use oare_ground::ingest::raw_log::StoreError;
use oare_ground::service::{Service, ServiceError};
use tokio::signal::unix::{SignalKind, signal};

/// Arguments of `oare serve`.
#[derive(clap::Args)]
pub struct Args {
    /// Configuration file; STS-65 on loopback without it.
    #[arg(long)]
    config: Option<PathBuf>,
    /// Where the raw log and the recordings are kept.
    #[arg(long)]
    data: Option<PathBuf>,
    /// Where dumps are taken, such as 127.0.0.1:7650.
    #[arg(long)]
    ingest: Option<SocketAddr>,
    /// Where products are served, such as 127.0.0.1:8080.
    #[arg(long)]
    http: Option<SocketAddr>,
}

/// Runs the command.
pub fn run(args: Args) -> Result<ExitCode> {
    super::log_to_stderr();
    let mut config = match read_config(args.config) {
        Ok(config) => config,
        Err(error) => {
            eprintln!("oare serve: {error:#}");
            return Ok(super::unusable());
        }
    };
    config.data_dir = args.data.unwrap_or(config.data_dir);
    config.ingest.address = args.ingest.unwrap_or(config.ingest.address);
    config.http.address = args.http.unwrap_or(config.http.address);
    super::runtime()?.block_on(async {
        let service = match Service::start(config).await {
            Ok(service) => service,
            Err(ServiceError::Config(faults)) => {
                eprintln!("oare serve: {faults}");
                return Ok(super::unusable());
            }
            Err(ServiceError::Store(fault @ StoreError::FrameOctets { .. })) => {
                eprintln!("oare serve: {fault}");
                return Ok(super::unusable());
            }
            Err(error) => return Err(error.into()),
        };
        eprintln!("oare serve: dumps at {}, products at http://{}/", service.ingest_address, service.http_address);
        tokio::select! {
            told = told_to_end() => told?,
            // The drain says why, and with it the exit code.
            () = service.failed() => {}
        }
        eprintln!("oare serve: ending; what is being sent is taken first");
        service.drain().await?;
        Ok(super::DONE)
    })
}

/// The configuration in a file, or the standard one.
pub fn read_config(path: Option<PathBuf>) -> Result<Config> {
    let Some(path) = path else { return Ok(Config::standard()) };
    let text = fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    Config::from_toml_in(&text, folder).with_context(|| format!("cannot use {}", path.display()))
}

/// Waits for SIGTERM or Ctrl-C.
pub async fn told_to_end() -> Result<()> {
    let mut term = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::select! {
        _ = term.recv() => {}
        _ = interrupt.recv() => {}
    }
    Ok(())
}
