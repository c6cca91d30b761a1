//! The dump port: connections in, parts of playbacks out to the one writer.
//!
//! A connection is read by a task and decoded by a thread of its own that gives way to those who answer. It never writes to a
//! sender; it closes its end once all that came is durable. How a stream is cut into reads changes nothing. Not here: what is
//! durable (see `raw_log`) and what the frames mean (see `pipeline`).

use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use tokio::io::AsyncReadExt;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, mpsc, oneshot};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;

use super::priority::{PRODUCTS_GIVE_WAY, give_way};
use crate::hub::status::{Board, count};
use crate::ingest::wire::LinkConfig;
use crate::ingest::wire::playback::{PlaybackPart, PlaybackReader};

/// One read: long enough that a full-speed playback costs few wake-ups, short enough to decode in a millisecond.
const READ_OCTETS: usize = 64 << 10;
/// Reads waiting for the writer, of all connections: with `READ_OCTETS` the bound of what is decoded and not yet durable.
pub const QUEUED_READS_MAX: usize = 64;
/// Reads of one connection waiting to be decoded: one is at hand while the next comes in.
const UNDECODED_READS_MAX: usize = 2;
/// A drain is over for a sender that was silent for this long.
const DRAIN_SILENCE: Duration = Duration::from_millis(200);

/// What one read of one connection brought.
#[derive(Debug)]
pub struct Parts {
    /// Number of the connection.
    pub connection: u64,
    /// Parts of its playbacks, in order.
    pub parts: Vec<PlaybackPart>,
    /// Told when these, and so all before, are durable and counted.
    pub durable: Option<oneshot::Sender<()>>,
}

/// What the listener is told.
#[derive(Debug, Clone)]
pub struct Rules {
    /// The link of every connection.
    pub link: LinkConfig,
    /// Who may send; empty: loopback only, or everybody where `open`.
    pub allow: Vec<IpAddr>,
    /// Everybody may send while `allow` is empty.
    pub open: bool,
    /// Connections at once.
    pub connections_max: usize,
    /// A connection that brings less than a frame is closed after this.
    pub idle_timeout: Duration,
    /// How long a drain waits for what is still being sent.
    pub drain_timeout: Duration,
}

impl Rules {
    fn may_send(&self, address: IpAddr) -> bool {
        let address = address.to_canonical();
        match self.allow.is_empty() {
            true => self.open || address.is_loopback(),
            false => self.allow.contains(&address),
        }
    }
}

/// Accepts connections until the drain, then waits for the open ones to end.
pub async fn run(
    listener: TcpListener,
    rules: Rules,
    writer: mpsc::Sender<Parts>,
    board: Arc<Board>,
    drain: CancellationToken,
) {
    // A permit per connection: the next one waits in the system's queue until one ends.
    let permits = Arc::new(Semaphore::new(rules.connections_max));
    let connections = TaskTracker::new();
    let rules = Arc::new(rules);
    let mut number = 0u64;
    loop {
        let permit = tokio::select! {
            permit = permits.clone().acquire_owned() => permit.expect("the semaphore is never closed"),
            () = drain.cancelled() => break,
        };
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = drain.cancelled() => break,
        };
        let (stream, peer) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                // Out of file descriptors, most likely: waiting is all that helps.
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        if !rules.may_send(peer.ip()) {
            count(&board.counters.connections_refused, 1);
            tracing::warn!(%peer, "turned away: not among the addresses that may send (ingest.allow)");
            continue;
        }
        number += 1;
        let connection = Connection {
            number,
            peer,
            rules: rules.clone(),
            writer: writer.clone(),
            board: board.clone(),
            drain: drain.clone(),
        };
        connections.spawn(async move {
            connection.run(stream).await;
            drop(permit);
        });
    }
    connections.close();
    connections.wait().await;
}

struct Connection {
    number: u64,
    peer: SocketAddr,
    rules: Arc<Rules>,
    writer: mpsc::Sender<Parts>,
    board: Arc<Board>,
    drain: CancellationToken,
}

/// Why a connection ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    BySender,
    Idle,
    Drained,
    Broken,
}

/// How long a sender is waited for. Its own waiting for room does not count.
struct Progress {
    whole: Duration,
    patience: Duration,
    frame_octets: usize,
    of_frame: usize,
}

impl Progress {
    fn new(rules: &Rules) -> Self {
        Self {
            whole: rules.idle_timeout,
            patience: rules.idle_timeout,
            frame_octets: rules.link.frame_octets,
            of_frame: 0,
        }
    }

    /// Some octets came after some waiting: with a whole frame of them, patience is what it was.
    fn came(&mut self, octets: usize, waited: Duration) {
        self.of_frame += octets;
        self.patience = self.patience.saturating_sub(waited);
        if self.of_frame >= self.frame_octets {
            (self.of_frame, self.patience) = (0, self.whole);
        }
    }
}

impl Connection {
    async fn run(self, mut stream: TcpStream) {
        let counters = &self.board.counters;
        count(&counters.connections, 1);
        count(&counters.connections_open, 1);
        tracing::info!(connection = self.number, peer = %self.peer, "a sender is connected");
        let (decoder, decoded) = match self.start_decoder() {
            Ok(started) => started,
            Err(error) => {
                count(&counters.connections_refused, 1);
                counters.connections_open.fetch_sub(1, Ordering::Relaxed);
                tracing::warn!(connection = self.number, %error, "turned away: no thread can be had to decode it");
                return;
            }
        };
        let mut octets = vec![0u8; READ_OCTETS];
        let mut drain_ends = None;
        let mut progress = Progress::new(&self.rules);
        let end = loop {
            let patience = match drain_ends {
                None => progress.patience,
                Some(_) => DRAIN_SILENCE,
            };
            let waits_since = tokio::time::Instant::now();
            let read = tokio::select! {
                read = tokio::time::timeout(patience, stream.read(&mut octets)) => read,
                () = self.drain.cancelled(), if drain_ends.is_none() => {
                    drain_ends = Some(tokio::time::Instant::now() + self.rules.drain_timeout);
                    continue;
                }
            };
            let taken = match read {
                Ok(Ok(0)) => break End::BySender,
                Ok(Ok(taken)) => taken,
                Ok(Err(error)) => {
                    tracing::warn!(connection = self.number, %error, "the connection broke");
                    break End::Broken;
                }
                Err(_) if drain_ends.is_some() => break End::Drained,
                Err(_) => break End::Idle,
            };
            count(&counters.octets_in, taken as u64);
            progress.came(taken, waits_since.elapsed());
            // Waits for room: a sender is held back by what is not durable yet.
            if decoder.send(octets[..taken].to_vec()).await.is_err() {
                break End::Drained;
            }
            if drain_ends.is_some_and(|ends| tokio::time::Instant::now() >= ends) {
                break End::Drained;
            }
        };
        drop(decoder);
        let bits = decoded.await;
        if end == End::Idle {
            count(&counters.connections_idle, 1);
        }
        counters.connections_open.fetch_sub(1, Ordering::Relaxed);
        match bits {
            Ok(bits) => tracing::info!(connection = self.number, ?end, bits, "a sender is gone"),
            Err(_) => tracing::error!(connection = self.number, ?end, "decoding broke off"),
        }
    }

    /// A thread that decodes what it is sent and hands it on to the writer, and the bits it had when there is no more and all is durable.
    fn start_decoder(&self) -> std::io::Result<(mpsc::Sender<Vec<u8>>, oneshot::Receiver<u64>)> {
        let (reads, mut undecoded) = mpsc::channel::<Vec<u8>>(UNDECODED_READS_MAX);
        let (done, decoded) = oneshot::channel();
        let (connection, link, writer) = (self.number, self.rules.link, self.writer.clone());
        let decode = move || {
            give_way(PRODUCTS_GIVE_WAY);
            let hand_on = |parts: Vec<PlaybackPart>| {
                parts.is_empty() || writer.blocking_send(Parts { connection, parts, durable: None }).is_ok()
            };
            let mut reader = PlaybackReader::new(link);
            while let Some(octets) = undecoded.blocking_recv() {
                let mut parts = Vec::new();
                reader.push(&octets, |part| parts.push(part));
                if !hand_on(parts) {
                    break;
                }
            }
            let mut parts = Vec::new();
            reader.finish(|part| parts.push(part));
            let (durable, is_durable) = oneshot::channel();
            // Without a writer nothing more will be: its end is told by itself.
            if writer.blocking_send(Parts { connection, parts, durable: Some(durable) }).is_ok() {
                let _ = is_durable.blocking_recv();
            }
            // Nobody may be waiting any more.
            let _ = done.send(reader.received_bits());
        };
        std::thread::Builder::new().name(format!("decode-{connection}")).spawn(decode)?;
        Ok((reads, decoded))
    }
}
