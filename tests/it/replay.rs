//! `oare replay`: dumps and recordings sent at the pace of the tape, over links with and without channel coding.

use std::process::Command;
use std::time::Instant;

use oare_ground::ingest::wire::coding::{SYNC_MARKER, encode};
use oare_ground::ingest::wire::{LinkConfig, record};

use crate::service_support::*;

const CODED: &str = "[link]\nrandomised = true\nreed_solomon_interleave = 5\n";

fn coded_dump(link: &LinkConfig, from_second: i64, seconds: i64) -> Vec<u8> {
    let packet = |second| {
        let record = science(second);
        acc_packet(&record, &record::write_acc(&record))
    };
    let packets: Vec<Vec<u8>> = (from_second..from_second + seconds).map(packet).collect();
    let sent = frames(link, &packets, 0).into_iter();
    sent.flat_map(|frame| [SYNC_MARKER.to_be_bytes().to_vec(), encode(link, &frame)].concat()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_coded_dump_is_replayed_at_its_pace_and_its_recording_replays_to_the_same() {
    const SECONDS: i64 = 2000;
    const SPEED: f64 = 4000.0;
    let link = LinkConfig { randomised: true, reed_solomon_interleave: Some(5), ..LinkConfig::default() };
    let running = start_with(|config| config.settings.link = link).await;
    let dump = running.dir.path().join("coded.dump");
    std::fs::write(&dump, coded_dump(&link, 20_000, SECONDS)).unwrap();
    let config = running.dir.path().join("coded.toml");
    std::fs::write(&config, CODED).unwrap();
    let begun = Instant::now();
    replay(&dump, &running, &["--speed", &SPEED.to_string(), "--config", config.to_str().unwrap()]).await;
    let status = running.wait_for_playbacks(1).await;
    assert_eq!(status["ingest"]["seconds_covered"], SECONDS);
    // The last frame leaves when its first second is due, a frame earlier than the end.
    let tape_s = (SECONDS - 20) as f64 / SPEED;
    assert!(begun.elapsed().as_secs_f64() > tape_s, "{:?} for {tape_s} s of tape", begun.elapsed());
    let products = running.products();
    let Running { service, dir } = running;
    service.drain().await.unwrap();

    let recording = std::fs::read_dir(dir.path().join("recordings")).unwrap().next().unwrap().unwrap().path();
    let second = start_with(|config| config.settings.link = link).await;
    replay(&recording, &second, &["--config", config.to_str().unwrap()]).await;
    second.wait_for_playbacks(1).await;
    assert_eq!(second.products(), products);
}

async fn replay(file: &std::path::Path, to: &Running, more: &[&str]) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_oare"));
    command.arg("replay").arg(file).args(["--to", &to.service.ingest_address.to_string()]).args(more);
    let output = tokio::task::spawn_blocking(move || command.output().unwrap()).await.unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
