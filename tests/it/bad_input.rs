//! What is wrong from outside, a test a row: what the service makes of it, and that the next sender is served.

use std::path::Path;
use std::process::Command;
use std::time::Duration;

use oare_ground::config::Config;
use oare_ground::ingest::wire::{Apid, LinkConfig, packet, record};
use oare_ground::service::{Service, ServiceError};
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::service_support::*;

/// Good telemetry after whatever came before: two minutes, all of it taken.
async fn assert_the_next_sender_is_served(running: &Running) {
    let before = running.get("/status").await;
    running.send(&dump(90_000, 120, 900_000)).await;
    let covered = before["ingest"]["seconds_covered"].as_u64().unwrap() + 120;
    let status =
        running.wait_for("good telemetry taken", |status| status["ingest"]["seconds_covered"] == covered).await;
    assert_sums_close(&status);
}

fn assert_sums_close(status: &Value) {
    let ingest = &status["ingest"];
    let refused: u64 = ingest["frames_refused"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    let sum = ingest["frames_new"].as_u64().unwrap() + ingest["frames_repeated"].as_u64().unwrap() + refused;
    assert_eq!(ingest["frames_durable"].as_u64(), Some(sum), "{ingest}");
}

/// Ten minutes in which one packet is another one.
fn dump_with(second: i64, strange: Vec<u8>) -> Vec<u8> {
    let packets: Vec<Vec<u8>> = (20_000..20_600)
        .map(|at| match at == second {
            true => strange.clone(),
            false => acc_packet(&science(at), &record::write_acc(&science(at))),
        })
        .collect();
    cadus(&frames(&LinkConfig::default(), &packets, 0))
}

#[tokio::test(flavor = "multi_thread")]
async fn garbage_at_the_port_yields_nothing_and_stops_nothing() {
    let running = start().await;
    let mut state = 1u64;
    let garbage: Vec<u8> = std::iter::repeat_with(|| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    })
    .take(1 << 20)
    .collect();
    running.send(&garbage).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["frames_new"], 0);
    assert_eq!(status["ingest"]["bits_in"], 8 << 20);
    assert_sums_close(&status);
    assert_the_next_sender_is_served(&running).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn half_a_frame_and_silence_is_counted_and_the_connection_closed() {
    let running = start_with(|config| config.ingest.idle_timeout = Duration::from_millis(300)).await;
    let whole = dump(20_000, 60, 0);
    let mut stream = TcpStream::connect(running.service.ingest_address).await.unwrap();
    stream.write_all(&whole[..1119 + 600]).await.unwrap();
    let closed = tokio::time::timeout(PATIENCE, stream.read(&mut [0u8; 16])).await.expect("closed in time");
    assert!(matches!(closed, Ok(0) | Err(_)), "the listener never writes");
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(
        (&status["ingest"]["frames_new"], &status["ingest"]["frames_refused"]["truncated"]),
        (&1.into(), &1.into())
    );
    assert_the_next_sender_is_served(&running).await;
}

/// An octet now and then is no frame: sixteen such would hold the port.
#[tokio::test(flavor = "multi_thread")]
async fn a_sender_that_drips_is_closed_as_a_silent_one_is() {
    let running = start_with(|config| config.ingest.idle_timeout = Duration::from_millis(300)).await;
    let mut stream = TcpStream::connect(running.service.ingest_address).await.unwrap();
    let drips = async {
        while stream.write_all(&[0]).await.is_ok() {
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::time::timeout(PATIENCE, drips).await.expect("closed in time");
    let metrics = reqwest::get(running.url("/metrics")).await.unwrap().text().await.unwrap();
    assert!(metrics.contains("oare_connections_idle_total 1"), "{metrics}");
    assert_the_next_sender_is_served(&running).await;
}

/// A sender that says it is done, and waits for the end of file, knows then that nothing of it can be lost.
#[tokio::test(flavor = "multi_thread")]
async fn a_connection_is_closed_when_all_it_brought_is_durable() {
    let running = start().await;
    let octets = dump(20_000, 40_000, 0);
    let mut stream = TcpStream::connect(running.service.ingest_address).await.unwrap();
    stream.write_all(&octets).await.unwrap();
    stream.shutdown().await.unwrap();
    let closed = tokio::time::timeout(PATIENCE, stream.read(&mut [0u8; 16])).await.expect("closed in time");
    assert_eq!(closed.unwrap(), 0);
    let status = running.get("/status").await;
    assert_eq!(status["ingest"]["frames_durable"], octets.len() / 1119, "{status}");
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_of_another_spacecraft_are_refused_by_that_reason() {
    let running = start().await;
    let packets: Vec<Vec<u8>> =
        (20_000..20_300).map(|at| acc_packet(&science(at), &record::write_acc(&science(at)))).collect();
    let other = LinkConfig { spacecraft_id: 0x42, ..LinkConfig::default() };
    let sent = frames(&other, &packets, 0);
    running.send(&cadus(&sent)).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["frames_refused"]["spacecraft"], sent.len());
    assert_eq!(status["ingest"]["frames_new"], 0);
    assert_the_next_sender_is_served(&running).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_of_another_length_do_not_check() {
    let running = start().await;
    let packets: Vec<Vec<u8>> =
        (20_000..20_300).map(|at| acc_packet(&science(at), &record::write_acc(&science(at)))).collect();
    let other = LinkConfig { frame_octets: 892, ..LinkConfig::default() };
    running.send(&cadus(&frames(&other, &packets, 0))).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["frames_new"], 0);
    assert!(status["ingest"]["frames_refused"]["fecf"].as_u64() > Some(0), "{status}");
    assert_sums_close(&status);
    assert_the_next_sender_is_served(&running).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_packet_of_an_unknown_apid_is_counted_and_the_next_one_read() {
    let running = start().await;
    let strange =
        packet::write(packet::PacketId { apid: Apid(0x123), clock: science(20_300).clock, sequence: 9 }, &[7; 40]);
    running.send(&dump_with(20_300, strange)).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["seconds_covered"], 599);
    let refused: u64 =
        status["ingest"]["packets_refused"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(refused, 1, "{status}");
    assert_the_next_sender_is_served(&running).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_record_of_the_wrong_length_is_counted_and_its_second_missing() {
    let running = start().await;
    let record = science(20_300);
    running.send(&dump_with(20_300, acc_packet(&record, &record::write_acc(&record)[..70]))).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["seconds_covered"], 599);
    let gaps = running.get("/gaps").await;
    assert_eq!(gaps["gaps"][0]["from_clock_s"], 20_300.0);
    assert_eq!(gaps["gaps"][0]["to_clock_s"], 20_301.0);
    assert_the_next_sender_is_served(&running).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_date_that_is_no_bcd_is_counted_and_its_second_missing() {
    let running = start().await;
    let record = science(20_300);
    let mut octets = record::write_acc(&record);
    octets[2] = 0xFA;
    running.send(&dump_with(20_300, acc_packet(&record, &octets))).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["seconds_covered"], 599);
    assert_the_next_sender_is_served(&running).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_jump_of_the_clock_is_a_gap_and_no_more() {
    let running = start().await;
    running.send(&dump(20_000, 300, 0)).await;
    running.send(&dump(4_000_000_000, 300, 100)).await;
    let status = running.wait_for_playbacks(2).await;
    assert_eq!(status["ingest"]["seconds_covered"], 600);
    assert_eq!(status["ingest"]["gaps"], 1);
    assert_the_next_sender_is_served(&running).await;
}

/// A small file system of its own, if this process may mount one.
struct SmallDisk(std::path::PathBuf);

impl SmallDisk {
    fn mount(at: &Path, size: &str) -> Option<Self> {
        std::fs::create_dir_all(at).ok()?;
        let mounted =
            Command::new("mount").args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"]).arg(at).output();
        match mounted {
            Ok(output) if output.status.success() => Some(Self(at.into())),
            _ => {
                eprintln!("SKIPPED: no right to mount a small tmpfs for the full-disk test");
                None
            }
        }
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg("-l").arg(&self.0).output();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_stops_the_taking_and_loses_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let Some(disk) = SmallDisk::mount(&dir.path().join("disk"), "12m") else { return };
    let mut config = config(&dir);
    config.data_dir = disk.0.clone();
    config.recording = false;
    let filler = disk.0.join("filler");
    std::fs::write(&filler, vec![1u8; 7 << 20]).unwrap();
    let running = Running { service: Service::start(config.clone()).await.unwrap(), dir };
    let dumps: Vec<Vec<u8>> = (0..8).map(|n| dump(20_000 + n * 8000, 8000, n as u32 * 10_000)).collect();
    let sent = dumps.concat();
    let address = running.service.ingest_address;
    let sender = tokio::spawn(async move { send(address, &sent).await });
    let status = running.wait_for("the store stuck", |status| status["phase"] == "stuck").await;
    assert!(status["trouble"].as_str().unwrap().contains("raw.redb"), "{status}");
    let (code, problem) = running.problem("/readyz").await;
    assert_eq!(code, 503);
    assert!(problem["detail"].as_str().unwrap().contains("nothing is taken"), "{problem}");
    running.get("/accel/history").await;
    std::fs::remove_file(&filler).unwrap();
    drop(Command::new("mount").args(["-o", "remount,size=200m"]).arg(&disk.0).output());
    sender.await.unwrap();
    let status =
        running.wait_for("everything taken after all", |status| status["ingest"]["seconds_covered"] == 64_000).await;
    assert_eq!(status["phase"], "running");
    assert_sums_close(&status);
    running.service.drain().await.unwrap();
    drop(disk);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_that_broke_off_is_told_and_written_anew() {
    let dir = tempfile::tempdir().unwrap();
    let Some(disk) = SmallDisk::mount(&dir.path().join("recordings"), "64k") else { return };
    let mut config = config(&dir);
    config.recording = true;
    let running = Running { service: Service::start(config).await.unwrap(), dir };
    running.send(&dump(20_000, 20_000, 0)).await;
    let told = |status: &serde_json::Value| status["trouble"].as_str().is_some_and(|s| s.contains("recording"));
    let status = running.wait_for("trouble told", told).await;
    assert_eq!(status["phase"], "running", "the rest goes on");
    drop(Command::new("mount").args(["-o", "remount,size=200m"]).arg(&disk.0).output());
    running.wait_for_playbacks(1).await;
    running.wait_for("the trouble over", |status| status["trouble"].is_null()).await;
    running.service.drain().await.unwrap();
    let names: Vec<String> =
        std::fs::read_dir(&disk.0).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    assert!(names.len() == 1 && names[0].starts_with("recording-b0-") && names[0].ends_with(".mcap"), "{names:?}");
    drop(disk);
}

/// Whoever opens connections and says half of what he wants holds up nobody, and not for long.
#[tokio::test(flavor = "multi_thread")]
async fn half_a_request_is_not_waited_for_without_end() {
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    let running = start_with(|config| config.recording = false).await;
    let mut half = Vec::new();
    for _ in 0..300 {
        let mut stream = tokio::net::TcpStream::connect(running.service.http_address).await.unwrap();
        stream.write_all(b"GET /accel HTTP/1.1\r\nHost: x\r\n").await.unwrap();
        half.push(stream);
    }
    running.send(&dump(20_000, 600, 0)).await;
    running.wait_for_playbacks(1).await;
    for mut stream in half {
        let mut answer = Vec::new();
        let over = tokio::time::timeout(PATIENCE, stream.read_to_end(&mut answer)).await.expect("it is closed");
        assert!(over.is_err() || answer.is_empty() || answer.starts_with(b"HTTP/1.1 408"), "{answer:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_busy_port_is_told_with_its_address() {
    let running = start().await;
    let dir = tempfile::tempdir().unwrap();
    let mut second = config(&dir);
    second.http.address = running.service.http_address;
    let Err(error) = Service::start(second).await else { panic!("two services on one port") };
    assert!(matches!(error, ServiceError::Bind { .. }));
    assert!(error.to_string().contains(&running.service.http_address.to_string()), "{error}");
}

#[test]
fn a_bad_configuration_is_told_whole_with_exit_code_2() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("bad.toml");
    std::fs::write(
        &path,
        "[link]\nframe_octets = 9000\n[http]\naddress = \"0.0.0.0:1\"\nport = 80\n[ingest]\nallow = 3\n",
    )
    .unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_oare")).args(["serve", "--config"]).arg(&path).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let told = String::from_utf8(output.stderr).unwrap();
    for place in ["9000", "http.port", "http.address", "ingest.allow", "4 faults"] {
        assert!(told.contains(place), "{place} is not in: {told}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_oversized_request_is_turned_away_by_size() {
    let running = start().await;
    let (code, problem) = running.problem(&format!("/accel/history?from={}", "1".repeat(10_000))).await;
    assert_eq!(code, 414, "{problem}");
    // Only the header of a body of 1 MiB: it is turned away by its announced size, before any of it is sent.
    let mut stream = TcpStream::connect(running.service.http_address).await.unwrap();
    stream.write_all(b"GET /accel HTTP/1.1\r\nHost: oare\r\nContent-Length: 1048576\r\n\r\n").await.unwrap();
    let mut answer = [0u8; 12];
    stream.read_exact(&mut answer).await.unwrap();
    assert_eq!(&answer, b"HTTP/1.1 413");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sender_that_is_not_on_the_list_is_turned_away() {
    let running = start_with(|config| config.ingest.allow = vec!["192.0.2.1".parse().unwrap()]).await;
    let mut stream = TcpStream::connect(running.service.ingest_address).await.unwrap();
    let _ = stream.write_all(&dump(20_000, 60, 0)).await;
    let closed = tokio::time::timeout(PATIENCE, stream.read(&mut [0u8; 1])).await.expect("closed in time");
    assert!(matches!(closed, Ok(0) | Err(_)));
    assert_eq!(running.get("/status").await["ingest"]["octets_in"], 0);
}

#[test]
fn every_configuration_file_is_read_and_the_standard_one_says_the_defaults() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
    let standard = Config::from_toml(&std::fs::read_to_string(folder.join("sts-65.toml")).unwrap()).unwrap();
    let defaults = Config::standard();
    assert_eq!(standard.settings, defaults.settings);
    assert_eq!(
        format!("{:?}{:?}", standard.ingest, standard.http),
        format!("{:?}{:?}", defaults.ingest, defaults.http)
    );
    Config::from_toml(&std::fs::read_to_string(folder.join("container.toml")).unwrap()).unwrap();
}
