//! Nothing lost: kills, drains, restarts, and recordings that say the same.

use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use oare_ground::config::Config;
use oare_ground::ingest::log_replay::rebuild;
use oare_ground::ingest::raw_log::{Entry, RawLog, Stored};
use oare_ground::ingest::wire::{LinkConfig, PlaybackPart, PlaybackReader};
use oare_ground::pipeline::{PlaybackId, Settings, station::replay};
use oare_ground::record::mcap_reader;
use oare_ground::service::Service;

use crate::service_support::*;
use crate::shared_data;

/// The products of dumps taken by the pure core, without sockets or store.
fn undisturbed(dumps: &[Vec<u8>]) -> [String; 3] {
    let station = replay(&Settings::sts65(), None, |station| {
        for (n, dump) in (0..).zip(dumps) {
            let mut playback = n * 1000;
            let mut reader = PlaybackReader::new(LinkConfig::default());
            let mut take = |part: PlaybackPart| match part {
                PlaybackPart::Opened => {
                    playback += 1;
                    station.open_playback(PlaybackId(playback));
                }
                PlaybackPart::Arrival(arrival) => station.take(PlaybackId(playback), &arrival),
                PlaybackPart::Closed { bits } => station.close_playback(PlaybackId(playback), bits),
            };
            reader.push(dump, &mut take);
            reader.finish(&mut take);
        }
    });
    products(&station)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_service_and_the_pure_core_say_the_same_and_a_restart_changes_nothing() {
    let Some(folder) = shared_data("dumps/messy-6h") else { return };
    let dumps: Vec<Vec<u8>> = (1..=6).map(|n| std::fs::read(folder.join(format!("{n}.dump"))).unwrap()).collect();
    let running = start().await;
    for dump in &dumps {
        running.send(dump).await;
    }
    assert_eq!(running.wait_for_playbacks(6).await["ingest"]["seconds_covered"], 21_296);
    let expected = undisturbed(&dumps);
    assert_eq!(running.products(), expected);
    let running = running.restart().await;
    assert_eq!(running.products(), expected);
    assert_eq!(running.get("/status").await["ingest"]["seconds_covered"], 21_296);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_drain_takes_what_was_sent_and_tells_the_readers() {
    let running = start().await;
    let octets = dump(20_000, 2000, 0);
    let mut live = running.live("topics=window").await;
    live.next().await.unwrap();
    let mut sender = TcpStream::connect(running.service.ingest_address).unwrap();
    sender.write_all(&octets).unwrap();
    // The sender stays connected: the drain does not wait for it for ever.
    running.wait_for("something taken", |status| status["ingest"]["frames_durable"].as_u64() > Some(0)).await;
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    drop(sender);
    while live.next().await.is_some() {}
    let settings = Settings::sts65();
    let log = RawLog::open(dir.path(), &settings.mission, &settings.link).unwrap();
    let station = rebuild(&log, &settings).unwrap();
    assert_eq!(station.ledger().seconds.len(), 2000);
    assert_eq!(station.ledger().playbacks().filter(|(_, playback)| !playback.closed).count(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_holds_every_frame_and_reads_back_to_the_same_products() {
    let running = start().await;
    running.send(&dump(20_000, 2000, 0)).await;
    running.send(&dump(21_500, 1500, 300)).await;
    running.wait_for_playbacks(2).await;
    let products = running.products();
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    let recordings = std::fs::read_dir(dir.path().join("recordings")).unwrap();
    let paths: Vec<_> = recordings.map(|entry| entry.unwrap().path()).collect();
    assert_eq!(paths.len(), 1, "{paths:?}");
    let octets = std::fs::read(&paths[0]).unwrap();
    let summary = mcap::Summary::read(&octets).unwrap().expect("an index");
    assert!(
        summary
            .channels
            .values()
            .all(|channel| channel.schema.as_ref().is_some_and(|schema| schema.encoding == "jsonschema"))
    );
    let recorded = mcap_reader::dump(&octets, &LinkConfig::default()).unwrap();
    assert!(recorded.faults.is_empty(), "{:?}", recorded.faults);
    assert_eq!(undisturbed(&[recorded.dump]), products);
    // Cut off, it is read as far as it goes, and that is said.
    let cut = mcap_reader::dump(&octets[..octets.len() / 2], &LinkConfig::default()).unwrap().faults.concat();
    assert!(cut.contains("frames are read of it and no more"), "{cut}");
    read_with_python(&paths[0], &octets);
    // What follows goes into a file of its own.
    let running = Running { service: Service::start(config(&dir)).await.unwrap(), dir };
    running.send(&dump(23_000, 500, 700)).await;
    running.wait_for_playbacks(3).await;
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    assert_eq!(std::fs::read_dir(dir.path().join("recordings")).unwrap().count(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_that_was_altered_or_filled_over_another_link_is_told() {
    let running = start().await;
    running.send(&dump(20_000, 2000, 0)).await;
    running.wait_for_playbacks(1).await;
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    let settings = Settings::sts65();
    let replayed = |frame_octets: usize| {
        let link = LinkConfig { frame_octets, ..settings.link };
        RawLog::open(dir.path(), &settings.mission, &link).and_then(|log| log.replay(|_, _| Ok(())))
    };
    replayed(1115).unwrap();
    let said = replayed(512).unwrap_err().to_string();
    assert!(
        said.ends_with("holds frames of 1115 octets (batch 0), and the configuration has link.frame_octets = 512"),
        "{said}"
    );
    // An octet amid the frames, of which the file's own structure knows nothing.
    let path = dir.path().join("raw.redb");
    let mut octets = std::fs::read(&path).unwrap();
    let sent = dump(20_000, 2000, 0);
    let piece = &sent[sent.len() / 2 / 1119 * 1119 + 500..][..64];
    let at = octets.windows(piece.len()).position(|there| there == piece).unwrap();
    octets[at + 32] ^= 1;
    std::fs::write(&path, octets).unwrap();
    let said = replayed(1115).unwrap_err().to_string();
    assert!(said.contains("raw.redb") && said.to_lowercase().contains("corrupt"), "{said}");
}

/// The package of the format's own makers reads what is written here.
fn read_with_python(path: &std::path::Path, octets: &[u8]) {
    const SCRIPT: &str = "
import sys, json
from mcap.reader import make_reader
counts = {}
with open(sys.argv[1], 'rb') as f:
    reader = make_reader(f, validate_crcs=True)
    for schema, channel, message in reader.iter_messages():
        value = json.loads(message.data)
        required = json.loads(schema.data)['properties']
        assert set(value) <= set(required) | {'supersedes', 'to_utc', 'from_utc', 'from_clock_s', 'to_clock_s', 'from_met_s', 'to_met_s'}, (channel.topic, set(value) - set(required))
        counts[channel.topic] = counts.get(channel.topic, 0) + 1
print(json.dumps(counts))
";
    let output = match Command::new("python3").args(["-c", SCRIPT]).arg(path).output() {
        Ok(output) => output,
        Err(_) => return eprintln!("SKIPPED: no python3 to read the recording with"),
    };
    let told = String::from_utf8_lossy(&output.stderr);
    if told.contains("No module named 'mcap'") {
        return eprintln!("SKIPPED: the Python package mcap is not installed");
    }
    assert!(output.status.success(), "{told}");
    let counts: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let frames =
        mcap::MessageStream::new(octets).unwrap().filter(|m| m.as_ref().unwrap().channel.topic == "/raw/frame").count();
    assert_eq!(counts["/raw/frame"], frames);
    assert!(counts["/accel/window"].as_u64() > Some(0));
}

/// The real program, in a process of its own.
struct Program {
    child: Child,
    ingest: SocketAddr,
    http: SocketAddr,
}

/// A port that is free now.
fn free_port() -> SocketAddr {
    std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

impl Program {
    fn start(data: &std::path::Path) -> Self {
        let (ingest, http) = (free_port(), free_port());
        let child = Command::new(env!("CARGO_BIN_EXE_oare"))
            .arg("serve")
            .args(["--ingest", &ingest.to_string(), "--http", &http.to_string(), "--data"])
            .arg(data)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        Self { child, ingest, http }
    }

    async fn status(&self) -> Option<serde_json::Value> {
        reqwest::get(format!("http://{}/status", self.http)).await.ok()?.json().await.ok()
    }

    async fn wait_until(&self, holds: impl Fn(&serde_json::Value) -> bool) -> serde_json::Value {
        let start = Instant::now();
        loop {
            if let Some(status) = self.status().await
                && holds(&status)
            {
                return status;
            }
            assert!(start.elapsed() < PATIENCE, "the program does not get there");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// As `kill -9`.
    fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

/// Everything there is to send, over and over, and up to where it was taken: after a kill it goes on a little before that.
struct Tape {
    octets: std::sync::Arc<[u8]>,
    at: usize,
}

impl Tape {
    /// What the tape runs back after a kill: more than what lies in the buffers of the system and of the service.
    const BACK_OCTETS: usize = 8 << 20;
    const CHUNK_OCTETS: usize = 1 << 16;

    /// Sends until the service is gone or the tape is at its end; where it is then.
    fn send(self, to: SocketAddr) -> std::thread::JoinHandle<Tape> {
        std::thread::spawn(move || {
            let mut at = self.at.saturating_sub(Self::BACK_OCTETS);
            if let Ok(mut stream) = TcpStream::connect(to) {
                while at < self.octets.len() {
                    let chunk = &self.octets[at..self.octets.len().min(at + Self::CHUNK_OCTETS)];
                    if stream.write_all(chunk).is_err() {
                        break;
                    }
                    at += chunk.len();
                }
            }
            let at = if at < self.octets.len() { at } else { 0 };
            Tape { octets: self.octets, at }
        })
    }
}

/// Kills the service at so many instants of a playback at full speed; whatever it had counted must be there, and in the end the products
/// are those of an undisturbed run.
async fn kill_and_restart(dumps: &[Vec<u8>], kills: u32, within_s: f64, seed: u64) {
    let dir = tempfile::tempdir().unwrap();
    let mut state = seed;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24)
    };
    let expected = undisturbed(dumps);
    let start = Instant::now();
    let mut tape = Tape { octets: dumps.concat().into(), at: 0 };
    for n in 0..kills {
        let program = Program::start(dir.path());
        program.wait_until(|status| status["phase"] == "running").await;
        let sender = tape.send(program.ingest);
        // Some kills fall into the middle of a commit: the instants are spread over the time that a playback takes.
        let until = Instant::now() + Duration::from_secs_f64(random() * within_s);
        let mut counted = 0;
        while Instant::now() < until {
            if let Some(status) = program.status().await {
                counted = status["ingest"]["frames_durable"].as_u64().unwrap();
            }
        }
        program.kill();
        tape = sender.join().unwrap();
        let settings = Settings::sts65();
        let log = RawLog::open(dir.path(), &settings.mission, &settings.link).unwrap();
        let mut durable = 0;
        log.replay(|_, batch| {
            let marks =
                |stored: &&Stored| matches!(stored, Stored::Entry(Entry::Opened { .. } | Entry::Closed { .. }, _));
            durable += (batch.len() - batch.iter().filter(marks).count()) as u64;
            Ok(())
        })
        .unwrap();
        println!(
            "kill {n}: {counted} frames were counted, {durable} are there, {:.1} s",
            start.elapsed().as_secs_f64()
        );
        assert!(durable >= counted, "kill {n}: {counted} frames were counted, {durable} are there");
    }
    let program = Program::start(dir.path());
    program.wait_until(|status| status["phase"] == "running").await;
    for dump in dumps {
        send(program.ingest, dump).await;
    }
    let over = |status: &serde_json::Value| {
        status["ingest"]["playbacks_open"] == 0 && status["ingest"]["connections_open"] == 0
    };
    let status = program.wait_until(over).await;
    // The numbers jump at every kill; nothing is missed for that, unless there really are more messages than a reader may be behind.
    if status["ingest"]["seconds_covered"].as_u64().unwrap() < 1 << 19 {
        let mut live = live(&format!("ws://{}/accel/live?topics=window&from=seq:0", program.http)).await;
        assert_eq!(live.next().await.unwrap()["type"], "hello");
        assert_eq!(live.next().await.unwrap()["type"], "window");
    }
    program.kill();
    let settings = Config::standard().settings;
    let log = RawLog::open(dir.path(), &settings.mission, &settings.link).unwrap();
    assert_eq!(products(&rebuild(&log, &settings).unwrap()), expected);
}

/// A service that can take nothing more says so, and ends as failed.
#[tokio::test(flavor = "multi_thread")]
async fn a_writer_that_ends_before_its_time_is_told_and_the_service_has_failed() {
    let running = start().await;
    running.wait_for("a start", |status| status["phase"] == "running").await;
    let station = running.service.station.clone();
    let holder = std::thread::spawn(move || {
        let _held = station.write().unwrap();
        panic!("a panic on purpose, with the station held");
    });
    holder.join().unwrap_err();
    tokio::time::timeout(PATIENCE, running.service.failed()).await.expect("the failure is told");
    let (status, problem) = running.problem("/readyz").await;
    assert_eq!(status, 503);
    assert!(problem["detail"].as_str().unwrap().contains("the writer ended"), "{problem}");
    let status = running.get("/status").await;
    assert_eq!(status["phase"], "stuck");
    let failure = running.service.drain().await.unwrap_err().to_string();
    assert!(failure.contains("panicked"), "{failure}");
}

/// Frames of one identity that differ by the thousand, as from an instrument that was switched on again: who comes late finds the same.
#[tokio::test(flavor = "multi_thread")]
async fn two_recordings_of_the_same_counts_end_as_if_taken_at_once() {
    let dumps: Vec<Vec<u8>> = [20_000, 60_000, 100_000].map(|second| dump(second, 6000, 0)).into();
    let running = start().await;
    for (n, dump) in dumps.iter().enumerate() {
        running.send(dump).await;
        if n == 0 {
            running.wait_for_playbacks(1).await;
        }
    }
    running.wait_for_playbacks(3).await;
    assert_eq!(running.products(), undisturbed(&dumps));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_service_has_everything_it_counted() {
    let dumps: Vec<Vec<u8>> = (0..2).map(|n| dump(20_000 + n * 9_000, 9_000, n as u32 * 10_000)).collect();
    kill_and_restart(&dumps, 4, 0.6, 7).await;
}

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
async fn twenty_five_kills_in_a_mission_lose_nothing() {
    kills_in_a_mission(25, 65).await;
}

#[tokio::test(flavor = "multi_thread")]
#[cfg_attr(not(feature = "slow"), ignore = "slow")]
async fn twenty_five_kills_in_another_mission_lose_nothing() {
    kills_in_a_mission(25, 66).await;
}

async fn kills_in_a_mission(kills: u32, seed: u64) {
    use oare_ground::simulate::recorder::{RecorderConfig, frames, playbacks};
    use oare_ground::simulate::{Mission, MissionConfig};
    /// The 14.75 days of STS-65.
    const HOURS: f64 = 354.0;
    let mission = Mission::new(MissionConfig::sts65(seed, HOURS)).unwrap();
    let link = LinkConfig::default();
    let passes = playbacks(&frames(mission.fly(), link), &link, &RecorderConfig::messy(), seed);
    let octets: Vec<u8> = passes.into_iter().flat_map(|pass| pass.octets).collect();
    kill_and_restart(&[octets], kills, 2.0, seed).await;
}
