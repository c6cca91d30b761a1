//! A service on free ports in a directory of its own, telemetry to send it, and clients to ask it.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use futures_util::StreamExt;
use oare_ground::config::Config;
use oare_ground::ingest::wire::coding::SYNC_MARKER;
use oare_ground::ingest::wire::{Apid, FrameId, LinkConfig, frame, packet, record};
use oare_ground::pipeline::{Settings, Station, files};
use oare_ground::service::Service;
use oare_ground::telemetry::{AccRecord, Mode, Range, Step};
use oare_ground::units::Clock;
use serde_json::Value;
use tokio::io::AsyncWriteExt;
use tokio::net::TcpStream;
use tokio_tungstenite::tungstenite;

/// Longest wait for anything: a machine with two busy cores.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// A service and the directory it works in.
pub struct Running {
    pub service: Service,
    pub dir: tempfile::TempDir,
}

/// The standard configuration on free ports, in a directory of its own.
pub fn config(dir: &tempfile::TempDir) -> Config {
    let mut config = Config::standard();
    config.ingest.address = SocketAddr::from(([127, 0, 0, 1], 0));
    config.http.address = SocketAddr::from(([127, 0, 0, 1], 0));
    config.data_dir = dir.path().to_path_buf();
    config
}

pub async fn start() -> Running {
    start_with(|_| {}).await
}

pub async fn start_with(change: impl FnOnce(&mut Config)) -> Running {
    let dir = tempfile::tempdir().unwrap();
    let mut config = config(&dir);
    change(&mut config);
    Running { service: Service::start(config).await.unwrap(), dir }
}

impl Running {
    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.service.http_address)
    }

    pub async fn get(&self, path: &str) -> Value {
        let answer = reqwest::get(self.url(path)).await.unwrap();
        assert_eq!(answer.status(), 200, "{path}");
        answer.json().await.unwrap()
    }

    /// The latest window, as soon as there is one.
    pub async fn first_accel(&self) -> Value {
        let start = Instant::now();
        loop {
            let answer = reqwest::get(self.url("/accel")).await.unwrap();
            // 503 while the log is read again.
            if ![404, 503].contains(&answer.status().as_u16()) {
                assert_eq!(answer.status(), 200, "/accel");
                return answer.json().await.unwrap();
            }
            assert!(start.elapsed() < PATIENCE, "no window came");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// The status and the problem document of a request that must fail.
    pub async fn problem(&self, path: &str) -> (u16, Value) {
        problem_of(reqwest::get(self.url(path)).await.unwrap()).await
    }

    pub async fn send(&self, octets: &[u8]) {
        send(self.service.ingest_address, octets).await;
    }

    /// Waits until a figure of `/status` satisfies a condition.
    pub async fn wait_for(&self, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let status = self.get("/status").await;
            if holds(&status) {
                return status;
            }
            assert!(start.elapsed() < PATIENCE, "{what} did not come about: {status:#}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// Waits until so many playbacks are over and everything of them is published.
    pub async fn wait_for_playbacks(&self, playbacks: u64) -> Value {
        let over = |status: &Value| {
            let ingest = &status["ingest"];
            ingest["playbacks"] == playbacks && ingest["playbacks_open"] == 0 && status["accel"]["settled"] == true
        };
        self.wait_for(&format!("{playbacks} playbacks over"), over).await
    }

    /// The product files as the service would write them.
    pub fn products(&self) -> [String; 3] {
        products(&self.service.station.read().unwrap())
    }

    pub async fn live(&self, query: &str) -> Live {
        live(&format!("ws://{}/accel/live?{query}", self.service.http_address)).await
    }

    /// Ends the service and starts another one on the same directory.
    pub async fn restart(self) -> Running {
        self.service.drain().await.unwrap();
        let config = config(&self.dir);
        Running { service: Service::start(config).await.unwrap(), dir: self.dir }
    }
}

pub async fn problem_of(answer: reqwest::Response) -> (u16, Value) {
    assert_eq!(answer.headers()["content-type"], "application/problem+json");
    (answer.status().as_u16(), answer.json().await.unwrap())
}

pub fn products(station: &Station) -> [String; 3] {
    let json = |value: Value| serde_json::to_string_pretty(&value).unwrap();
    [files::windows_csv(station), json(files::calibration_json(station)), json(files::anomalies_json(station))]
}

pub async fn send(address: SocketAddr, octets: &[u8]) {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(octets).await.unwrap();
    stream.shutdown().await.unwrap();
}

/// A WebSocket client.
pub struct Live(pub tokio_tungstenite::WebSocketStream<tokio_tungstenite::MaybeTlsStream<TcpStream>>);

pub async fn live(url: &str) -> Live {
    let (socket, _) = tokio_tungstenite::connect_async(url).await.unwrap();
    Live(socket)
}

impl Live {
    /// The next JSON message; `None` when the service closed the connection.
    pub async fn next(&mut self) -> Option<Value> {
        loop {
            let message = tokio::time::timeout(PATIENCE, self.0.next()).await.expect("a message in time")?;
            match message.ok()? {
                tungstenite::Message::Text(text) => return Some(serde_json::from_str(&text).unwrap()),
                tungstenite::Message::Close(_) => return None,
                _ => {}
            }
        }
    }

    /// Messages until one of this number has come.
    pub async fn through(&mut self, seq: u64) -> Vec<Value> {
        let mut messages = Vec::new();
        loop {
            let message = self.next().await.expect("the service is there");
            let reached = message["seq"].as_u64().unwrap() >= seq && message["type"] != "hello";
            messages.push(message);
            if reached {
                return messages;
            }
        }
    }
}

/// A second of science data in range C: small counts that differ from second to second.
pub fn science(second: i64) -> AccRecord {
    let clock = Clock::from_tenths(second * 10);
    let value = |sample: usize, axis: usize| {
        let mixed = (second as u64 * 1_000_003 + sample as u64 * 7_919 + axis as u64 * 104_729)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (mixed >> 56) as i16 - 128 + 1000 * (axis as i16 + 1)
    };
    AccRecord {
        clock,
        sequence: second as u16 & 0x3fff,
        orbiter_unix_ms: Settings::sts65().time.utc(clock.seconds()).as_millisecond(),
        counts: std::array::from_fn(|sample| std::array::from_fn(|axis| value(sample, axis))),
        temperature_c: 17.5,
        mode: Mode::Normal,
        quiet: false,
        table_moving: false,
        at_rail: false,
        ranges: [Range::C; 3],
        target: 0,
        step: Step::None,
    }
}

/// One ACC packet.
pub fn acc_packet(record: &AccRecord, data: &[u8]) -> Vec<u8> {
    packet::write(packet::PacketId { apid: Apid::ACC, clock: record.clock, sequence: record.sequence }, data)
}

/// Packets, back to back, in frames of channel 1 from a count on.
pub fn frames(link: &LinkConfig, packets: &[Vec<u8>], first_count: u32) -> Vec<Vec<u8>> {
    let room = link.frame_octets - frame::HEADER_OCTETS - frame::FECF_OCTETS;
    let mut starts = Vec::new();
    let mut stream = Vec::new();
    for packet in packets {
        starts.push(stream.len());
        stream.extend(packet);
    }
    let idle = room - stream.len() % room;
    let idle = if idle < 7 { idle + room } else { idle };
    starts.push(stream.len());
    stream.extend(packet::write_idle(0, idle));
    stream
        .chunks(room)
        .zip(0u32..)
        .map(|(data, n)| {
            let from = n as usize * room;
            let first = starts.iter().find(|start| **start >= from && **start < from + room);
            let pointer = first.map_or(frame::NO_PACKET_STARTS, |start| (start - from) as u16);
            frame::write(link, FrameId { channel: 1, count: first_count + n }, n as u8, pointer, data)
        })
        .collect()
}

/// Frames as they lie on the tape.
pub fn cadus(frames: &[Vec<u8>]) -> Vec<u8> {
    frames.iter().flat_map(|frame| SYNC_MARKER.to_be_bytes().into_iter().chain(frame.iter().copied())).collect()
}

/// A dump of so many seconds of science data.
pub fn dump(from_second: i64, seconds: i64, first_count: u32) -> Vec<u8> {
    let packets: Vec<Vec<u8>> = (from_second..from_second + seconds)
        .map(|second| {
            let record = science(second);
            acc_packet(&record, &record::write_acc(&record))
        })
        .collect();
    cadus(&frames(&LinkConfig::default(), &packets, first_count))
}
