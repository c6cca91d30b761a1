//! The service under load: a whole 14.75-day mission through TCP to queryable products with the store and the recording written;
//! `/accel` meanwhile; WebSocket fan-out. `cargo bench --bench service` prints a line a figure.
//!
//! These are single long runs of everything together, not loops over a function, so the harness is this file's own. The yardstick for
//! the mission is the same octets through the pure core alone.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use futures_util::StreamExt;
use oare_ground::config::Config;
use oare_ground::hub::Body;
use oare_ground::ingest::wire::{LinkConfig, PlaybackPart, PlaybackReader};
use oare_ground::pipeline::{PlaybackId, Settings, Station};
use oare_ground::service::Service;
use oare_ground::simulate::recorder::{RecorderConfig, frames, playbacks};
use oare_ground::simulate::{Mission, MissionConfig};
use serde_json::Value;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;

/// STS-65: 14.75 days.
const HOURS: f64 = 354.0;
/// WebSocket clients of the fan-out.
const CLIENTS: usize = 50;
/// Windows told to each of them.
const FANNED_OUT: usize = 40_000;

fn main() {
    // `cargo test` runs benches with --test: nothing to check here.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let hours = std::env::var("OARE_BENCH_HOURS").ok().and_then(|text| text.parse().ok()).unwrap_or(HOURS);
    let octets = mission(hours);
    println!("machine: {}", machine());
    println!("mission: {hours} h, {:.1} MB", octets.len() as f64 / 1e6);
    core_alone(&octets);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        whole_mission(octets, hours).await;
        fan_out().await;
    });
}

/// What this runs on.
fn machine() -> String {
    let cpus = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = cpus.lines().find_map(|line| line.strip_prefix("model name")?.split(':').nth(1));
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    format!("{}, {cores} cores", model.map_or("an unnamed processor", str::trim))
}

fn mission(hours: f64) -> Vec<u8> {
    let mission = Mission::new(MissionConfig::sts65(65, hours)).unwrap();
    let link = LinkConfig::default();
    playbacks(&frames(mission.fly(), link), &link, &RecorderConfig::clean(), 65)
        .into_iter()
        .flat_map(|pass| pass.octets)
        .collect()
}

fn core_alone(octets: &[u8]) {
    let start = Instant::now();
    let mut station = Station::new(Settings::sts65(), None);
    let mut reader = PlaybackReader::new(LinkConfig::default());
    let mut take = |part: PlaybackPart| match part {
        PlaybackPart::Opened => station.open_playback(PlaybackId(0)),
        PlaybackPart::Arrival(arrival) => station.take(PlaybackId(0), &arrival),
        PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(0), bits),
    };
    octets.chunks(1 << 16).for_each(|chunk| reader.push(chunk, &mut take));
    reader.finish(&mut take);
    station.flush();
    println!(
        "yardstick: core alone, one thread, no store, no recording: {:.2} s, {} windows",
        start.elapsed().as_secs_f64(),
        station.products().count()
    );
}

fn config(dir: &tempfile::TempDir) -> Config {
    let mut config = Config::standard();
    config.ingest.address = SocketAddr::from(([127, 0, 0, 1], 0));
    config.http.address = SocketAddr::from(([127, 0, 0, 1], 0));
    config.data_dir = dir.path().to_path_buf();
    config
}

/// The real program, in a process of its own.
struct Program {
    child: Child,
    ingest: SocketAddr,
    http: SocketAddr,
}

impl Program {
    async fn start(data: &Path) -> Self {
        let free = || TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let (ingest, http) = (free(), free());
        let mut command = Command::new(env!("CARGO_BIN_EXE_oare"));
        command.args(["serve", "--ingest", &ingest.to_string(), "--http", &http.to_string(), "--data"]).arg(data);
        let child = command.stderr(Stdio::null()).spawn().unwrap();
        let program = Self { child, ingest, http };
        while program.status().await.is_none_or(|status| status["phase"] != "running") {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        program
    }

    async fn status(&self) -> Option<Value> {
        reqwest::get(format!("http://{}/status", self.http)).await.ok()?.json().await.ok()
    }

    /// The peak of its resident memory, MB.
    fn peak_mb(&self) -> f64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap_or_default();
        let line = status.lines().find(|line| line.starts_with("VmHWM:"));
        let kb = line.and_then(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok());
        kb.unwrap_or(f64::NAN) / 1024.0
    }

    /// Ends it in order.
    fn drain(mut self) {
        let _ = Command::new("kill").arg(self.child.id().to_string()).status();
        let _ = self.child.wait();
    }
}

async fn whole_mission(octets: Vec<u8>, hours: f64) {
    let dir = tempfile::tempdir().unwrap();
    let program = Program::start(dir.path()).await;
    let over = Arc::new(AtomicBool::new(false));
    let asked = {
        let (http, over) = (program.http, over.clone());
        std::thread::spawn(move || ask_for_accel(http, &over))
    };
    let start = Instant::now();
    let mut stream = TcpStream::connect(program.ingest).await.unwrap();
    stream.write_all(&octets).await.unwrap();
    stream.shutdown().await.unwrap();
    let sent_s = start.elapsed().as_secs_f64();
    let seconds = (hours * 3600.0) as u64;
    let windows = loop {
        let status = program.status().await.unwrap();
        let (ingest, accel) = (&status["ingest"], &status["accel"]);
        let covered = ingest["seconds_covered"].as_u64() >= Some(seconds);
        if covered && ingest["playbacks_open"] == 0 && accel["settled"] == true {
            break accel["windows"].as_u64().unwrap();
        }
        tokio::time::sleep(Duration::from_millis(5)).await;
    };
    let products_s = start.elapsed().as_secs_f64();
    over.store(true, Ordering::Relaxed);
    let mut latencies = asked.join().unwrap();
    let peak_mb = program.peak_mb();
    program.drain();
    let recorded_s = start.elapsed().as_secs_f64();
    println!(
        "mission through TCP to queryable, settled products, store and recording written: products {products_s:.2} s (aim 5), \
         recording finished {recorded_s:.2} s (sent in {sent_s:.2} s; {:.0} times real time; {windows} windows)",
        hours * 3600.0 / products_s
    );
    println!("resident memory of the service, peak: {peak_mb:.0} MB (aim 300)");
    latencies.sort_by(f64::total_cmp);
    let at = |share: f64| latencies.get(((latencies.len() as f64 - 1.0) * share) as usize).copied().unwrap_or(f64::NAN);
    println!(
        "/accel under that load: p50 {:.3} ms, p99 {:.3} ms (aim 2), max {:.3} ms ({} requests)",
        at(0.5),
        at(0.99),
        at(1.0),
        latencies.len()
    );
}

/// Asks over one kept-alive connection, a request every 2 ms, from a thread that does nothing else; latencies in ms.
fn ask_for_accel(http: SocketAddr, over: &AtomicBool) -> Vec<f64> {
    let mut stream = std::net::TcpStream::connect(http).unwrap();
    stream.set_nodelay(true).unwrap();
    let request = format!("GET /accel HTTP/1.1\r\nhost: {http}\r\n\r\n");
    let mut buffer = vec![0u8; 1 << 16];
    let mut latencies = Vec::new();
    while !over.load(Ordering::Relaxed) {
        let start = Instant::now();
        stream.write_all(request.as_bytes()).unwrap();
        let n = stream.read(&mut buffer).unwrap();
        assert!(n > 0, "the service closed the connection");
        latencies.push(start.elapsed().as_secs_f64() * 1e3);
        std::thread::sleep(Duration::from_millis(2));
    }
    latencies
}

async fn fan_out() {
    let dir = tempfile::tempdir().unwrap();
    let mut config = config(&dir);
    config.recording = false;
    config.http.live_queue_messages = FANNED_OUT + 1;
    let service = Service::start(config).await.unwrap();
    let url = format!("ws://{}/accel/live?topics=window", service.http_address);
    let received = Arc::new(AtomicU64::new(0));
    let missed = Arc::new(AtomicU64::new(0));
    let mut clients = Vec::new();
    for _ in 0..CLIENTS {
        let (mut socket, _) = tokio_tungstenite::connect_async(&url).await.unwrap();
        socket.next().await.unwrap().unwrap();
        let (received, missed) = (received.clone(), missed.clone());
        clients.push(tokio::spawn(async move {
            let mut had = 0;
            while had < FANNED_OUT as u64 {
                let message = socket.next().await.unwrap().unwrap();
                let text = message.into_text().unwrap();
                if text.contains("\"type\":\"lag\"") {
                    let lag: Value = serde_json::from_str(&text).unwrap();
                    let count = lag["count"].as_u64().unwrap();
                    missed.fetch_add(count, Ordering::Relaxed);
                    had += count;
                } else {
                    received.fetch_add(1, Ordering::Relaxed);
                    had += 1;
                }
            }
        }));
    }
    let bodies = windows();
    let start = Instant::now();
    let hub = service.hub.clone();
    tokio::task::spawn_blocking(move || {
        for some in bodies.chunks(500) {
            hub.publish(some.to_vec());
        }
    })
    .await
    .unwrap();
    for client in clients {
        client.await.unwrap();
    }
    let elapsed_s = start.elapsed().as_secs_f64();
    let delivered = received.load(Ordering::Relaxed);
    let all = (CLIENTS * FANNED_OUT) as u64;
    println!(
        "WebSocket fan-out: {:.0} deliveries/s (aim 500000; {CLIENTS} clients in the same process, {delivered} delivered, {} told missed, {} unreported)",
        delivered as f64 / elapsed_s,
        missed.load(Ordering::Relaxed),
        all - delivered - missed.load(Ordering::Relaxed)
    );
    service.drain().await.unwrap();
}

/// Windows of a short mission, told again and again under other starts.
fn windows() -> Vec<Body> {
    let mut station = Station::new(Settings::sts65(), None);
    station.open_playback(PlaybackId(0));
    let mut reader = PlaybackReader::new(LinkConfig::default());
    let octets = mission(6.0);
    let mut take = |part: PlaybackPart| {
        if let PlaybackPart::Arrival(arrival) = part {
            station.take(PlaybackId(0), &arrival);
        }
    };
    reader.push(&octets, &mut take);
    reader.finish(&mut take);
    station.flush();
    let products: Vec<_> = station.products().copied().collect();
    let again = products.iter().cycle().take(FANNED_OUT).zip(0i64..);
    again
        .map(|(product, n)| {
            let mut product = *product;
            product.start = oare_ground::units::Clock::from_tenths(n * 250);
            Body::Window(product.into())
        })
        .collect()
}
