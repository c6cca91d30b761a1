//! The service, wired together from start to drain: ports, raw log, station, hub, API, recording.

pub mod diagnosing;
mod http;

use std::any::Any;
use std::io;
use std::net::SocketAddr;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, RwLock};
use std::time::{Duration, Instant};

use tokio::net::TcpListener;
use tokio::sync::{Semaphore, mpsc};
use tokio::task::JoinHandle;
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::api::{self, App, Metrics};
use crate::config::{Config, ConfigFaults};
use crate::diagnose::case::Expectation;
use crate::diagnose::live::{Report, digest};
use crate::hub::Hub;
use crate::hub::desk::Desk;
use crate::hub::status::{Board, Phase};
use crate::ingest::listener::{self, QUEUED_READS_MAX, Rules};
use crate::ingest::priority::{PRODUCTS_GIVE_WAY, SEARCHES_GIVE_WAY, give_way};
use crate::ingest::raw_log::{RawLog, StoreError};
use crate::ingest::writer::{SharedStation, StationSamples, Writer};
use crate::pipeline::Station;
use crate::record::{RecordError, recorder};

use diagnosing::{Diagnosing, Gate};

/// HTTP requests under way have this long to end after the drain.
const HTTP_PATIENCE: Duration = Duration::from_secs(5);

/// Why the service did not start, or ended otherwise than it was asked to.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// An address cannot be listened at.
    #[error("cannot listen at {address} for {purpose}: {source}")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What for.
        purpose: &'static str,
        /// What the system says.
        source: io::Error,
    },
    /// An address that nothing protects, or files of the diagnosis that cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigFaults),
    /// The raw log.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The recording.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Serving HTTP ended.
    #[error("serving HTTP ended: {0}")]
    Http(io::Error),
    /// A part of the service panicked.
    #[error("a part of the service panicked: {0}")]
    Panicked(String),
}

/// A running service.
pub struct Service {
    /// Where dumps are taken.
    pub ingest_address: SocketAddr,
    /// Where products are served.
    pub http_address: SocketAddr,
    /// The products.
    pub hub: Arc<Hub>,
    /// What it says of itself.
    pub board: Arc<Board>,
    /// The pipeline.
    pub station: SharedStation,
    drain: CancellationToken,
    give_up: CancellationToken,
    /// Cancelled when nothing more can be taken, for good.
    broken: CancellationToken,
    closing: CancellationToken,
    listening: JoinHandle<()>,
    writing: JoinHandle<Result<(), StoreError>>,
    recording: Option<(CancellationToken, JoinHandle<Result<(), RecordError>>)>,
    serving: JoinHandle<()>,
    diagnosing: Option<(DropGuard, JoinHandle<()>)>,
    drain_timeout: Duration,
}

async fn bind(address: SocketAddr, purpose: &'static str) -> Result<TcpListener, ServiceError> {
    TcpListener::bind(address).await.map_err(|source| ServiceError::Bind { address, purpose, source })
}

impl Service {
    /// Starts everything: the ports first, so that a busy one is told before anything is touched; then the raw log is read again
    /// (`/readyz` says so); then dumps are taken.
    ///
    /// # Errors
    /// When a port is busy, the configuration exposes the service, or the store cannot be used.
    pub async fn start(config: Config) -> Result<Self, ServiceError> {
        Self::start_gated(config, Arc::new(|| {})).await
    }

    /// As [`Service::start`], with something that every search of the running diagnosis must pass first.
    ///
    /// # Errors
    /// As [`Service::start`].
    pub async fn start_gated(config: Config, gate: Gate) -> Result<Self, ServiceError> {
        let expected = checked(&config)?;
        shared_work_gives_way();
        let ingest = bind(config.ingest.address, "dumps").await?;
        let http = bind(config.http.address, "HTTP").await?;
        let address_of = |listener: &TcpListener| listener.local_addr().map_err(ServiceError::Http);
        let (ingest_address, http_address) = (address_of(&ingest)?, address_of(&http)?);
        let settings = config.settings.clone();
        let log = Arc::new(RawLog::open(&config.data_dir, &settings.mission, &settings.link)?);
        let station: SharedStation = Arc::new(RwLock::new(Station::new(settings.clone(), None)));
        let samples = Arc::new(StationSamples(station.clone()));
        let queue = config.http.live_queue_messages;
        let hub = Arc::new(Hub::new(&settings.mission, settings.link.spacecraft_id, queue, samples));
        let board = Arc::new(Board::default());
        if log.is_empty()? {
            // There is nothing to read again: whoever asks at once is told that there is nothing, and not to wait.
            board.enter(Phase::Running);
            for held in log.held_for()? {
                tracing::warn!(held, "the store has no frame of this mission and spacecraft, and some of another");
            }
        }
        let desk = Arc::new(Desk::default());
        // Read before anybody is answered: what was found before the start is there from the first answer on.
        let journal = {
            let log = log.clone();
            blocking(move || log.journal()).await??
        };
        let diagnosis = expected.zip(config.diagnosis.as_ref());
        let earlier = diagnosis.as_ref().and_then(|(expected, diagnosis)| {
            let earlier = diagnosing::earlier(&journal.entries, expected, &diagnosis.policy);
            let waiting = || Report::waiting(&expected.header.id, digest(expected, &diagnosis.policy));
            desk.show(earlier.as_ref().map_or_else(waiting, Report::taken_up), 0);
            earlier
        });
        let closing = CancellationToken::new();
        let app = Arc::new(App {
            hub: hub.clone(),
            board: board.clone(),
            desk: desk.clone(),
            station: station.clone(),
            mission: settings.time,
            started: Instant::now(),
            token: config.http.token.clone(),
            loopback_only: config.http.address.ip().is_loopback() && !config.http.insecure,
            live_permits: Arc::new(Semaphore::new(config.http.live_clients_max)),
            live_behind_max: config.http.live_behind_messages as u64,
            data_dir: config.data_dir.clone(),
            closing: closing.clone(),
            metrics: Metrics::default(),
        });
        let serving = tokio::spawn(http::serve(http, api::router(app), closing.clone()));
        let writer = {
            let (log, station, hub, board) = (log.clone(), station.clone(), hub.clone(), board.clone());
            blocking(move || Writer::restore(log, journal, station, hub, board)).await??
        };
        let recording = match config.recording {
            false => None,
            true => Some(start_recording(&config, &log, &hub, &board)?),
        };
        board.enter(Phase::Running);
        let (drain, give_up) = (CancellationToken::new(), CancellationToken::new());
        let (parts_in, parts_out) = mpsc::channel(QUEUED_READS_MAX);
        let broken = CancellationToken::new();
        let writing = {
            let (runtime, give_up) = (tokio::runtime::Handle::current(), give_up.clone());
            let end = End { board: board.clone(), drain: drain.clone(), broken: broken.clone() };
            in_background(PRODUCTS_GIVE_WAY, move || {
                let written = catch_unwind(AssertUnwindSafe(|| writer.run(&runtime, parts_out, &give_up)));
                end.tell(&written);
                written.unwrap_or_else(|panic| resume_unwind(panic))
            })
        };
        let diagnosing = diagnosis.map(|(expected, diagnosis)| {
            let stop = CancellationToken::new();
            let (station, hub, policy) = (station.clone(), hub.clone(), diagnosis.policy.clone());
            let work = Diagnosing { station, hub, desk, expected, policy, earlier, gate, stop: stop.clone() };
            let runtime = tokio::runtime::Handle::current();
            (stop.drop_guard(), in_background(SEARCHES_GIVE_WAY, move || work.run(&runtime)))
        });
        let rules = Rules {
            link: settings.link,
            allow: config.ingest.allow.clone(),
            open: config.http.insecure,
            connections_max: config.ingest.connections_max,
            idle_timeout: config.ingest.idle_timeout,
            drain_timeout: config.ingest.drain_timeout,
        };
        let listening = tokio::spawn(listener::run(ingest, rules, parts_in, board.clone(), drain.clone()));
        let drain_timeout = config.ingest.drain_timeout;
        Ok(Self {
            ingest_address,
            http_address,
            hub,
            board,
            station,
            drain,
            give_up,
            broken,
            closing,
            listening,
            writing,
            recording,
            serving,
            diagnosing,
            drain_timeout,
        })
    }

    /// Waits until a part without which nothing can be taken has ended, though it was not asked to. What is left is to end.
    pub async fn failed(&self) {
        self.broken.cancelled().await;
    }

    /// Ends in order: no new connection, what is being sent is taken and made durable, recordings are finished, readers are told.
    ///
    /// # Errors
    /// When the store refused to the end, or a part of the service had failed.
    pub async fn drain(self) -> Result<(), ServiceError> {
        self.board.enter(Phase::Draining);
        self.drain.cancel();
        if let Some((stop, diagnosing)) = self.diagnosing {
            drop(stop);
            // Neither its pace nor a panic there is one of the products'.
            match tokio::time::timeout(HTTP_PATIENCE, diagnosing).await {
                Ok(Ok(())) => {}
                Ok(Err(error)) => tracing::error!(%error, "the running diagnosis broke off"),
                Err(_) => tracing::warn!("the search under way did not end in time"),
            }
        }
        let give_up = self.give_up.clone();
        let patience = self.drain_timeout + HTTP_PATIENCE;
        let hurry = tokio::spawn(async move {
            tokio::time::sleep(patience).await;
            give_up.cancel();
        });
        joined(self.listening.await)?;
        let written = joined(self.writing.await).and_then(|written| Ok(written?));
        hurry.abort();
        let recorded = match self.recording {
            None => Ok(()),
            Some((finish, recording)) => {
                finish.cancel();
                joined(recording.await)?
            }
        };
        self.closing.cancel();
        match tokio::time::timeout(HTTP_PATIENCE, self.serving).await {
            Ok(served) => joined(served)?,
            Err(_) => tracing::warn!("some HTTP clients did not end in time"),
        }
        written?;
        recorded?;
        Ok(())
    }
}

/// What the end of the writer is told to.
struct End {
    board: Arc<Board>,
    drain: CancellationToken,
    broken: CancellationToken,
}

impl End {
    /// An end before the drain is a failure: whoever asks, reads the log or waits for it is told.
    fn tell(&self, written: &Result<Result<(), StoreError>, Box<dyn Any + Send>>) {
        if self.drain.is_cancelled() {
            return;
        }
        let why = match written {
            Ok(Ok(())) => "nothing sends to it any more".to_string(),
            Ok(Err(error)) => error.to_string(),
            Err(panic) => {
                let said = panic.downcast_ref::<String>().map(String::as_str);
                said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("it panicked").to_string()
            }
        };
        tracing::error!(why, "the writer ended before its time: nothing more is taken; what is durable is not lost");
        self.board.enter(Phase::Stuck(format!("the writer ended: {why}")));
        self.broken.cancel();
    }
}

/// What the running diagnosis compares with, where one is wanted; every fault of the configuration that shows only now.
fn checked(config: &Config) -> Result<Option<Expectation>, ConfigFaults> {
    let mut faults = config.exposure_faults();
    let expected = config.diagnosis.as_ref().map(|diagnosis| diagnosis.expectation(&config.settings.time));
    match expected.transpose() {
        Ok(expected) if faults.is_empty() => Ok(expected),
        Ok(_) => Err(ConfigFaults(faults)),
        Err(more) => {
            faults.extend(more);
            Err(ConfigFaults(faults))
        }
    }
}

fn start_recording(
    config: &Config,
    log: &Arc<RawLog>,
    hub: &Arc<Hub>,
    board: &Arc<Board>,
) -> Result<(CancellationToken, JoinHandle<Result<(), RecordError>>), ServiceError> {
    let finish = CancellationToken::new();
    let recorder =
        recorder::Recorder::start(&config.data_dir, &config.settings, log.clone(), hub.clone(), board.clone())?;
    let (runtime, finished) = (tokio::runtime::Handle::current(), finish.clone());
    Ok((finish, in_background(PRODUCTS_GIVE_WAY, move || recorder.run(&runtime, &finished))))
}

/// A thread of this niceness for work that lasts as long as the service.
fn in_background<T: Send + 'static>(niceness: i32, work: impl FnOnce() -> T + Send + 'static) -> JoinHandle<T> {
    tokio::task::spawn_blocking(move || {
        give_way(niceness);
        work()
    })
}

/// All processors but one, which is left to those who answer.
fn others() -> usize {
    std::thread::available_parallelism().map_or(1, |processors| processors.get().saturating_sub(1).max(1))
}

/// The threads that share the work of a calibration give way too, and leave one processor to those who answer. A pool that the process
/// has already stays as it is.
fn shared_work_gives_way() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(others()).start_handler(|_| give_way(PRODUCTS_GIVE_WAY));
    if let Err(error) = pool.build_global() {
        tracing::debug!(%error, "the threads of shared work keep their priority");
    }
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, ServiceError> {
    joined(tokio::task::spawn_blocking(work).await)
}

fn joined<T>(result: Result<T, tokio::task::JoinError>) -> Result<T, ServiceError> {
    result.map_err(|error| ServiceError::Panicked(error.to_string()))
}
