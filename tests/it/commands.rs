//! The commands on files and stores: what they make is what the service has, and what they cannot use they tell.

use std::process::Command;

use oare_ground::ingest::wire::LinkConfig;
use oare_ground::simulate::{Mission, MissionConfig, recorder};

use crate::service_support::*;

/// The program, in a directory of its own.
fn oare(dir: &tempfile::TempDir, arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_oare")).current_dir(dir.path()).args(arguments).output().unwrap()
}

/// A recording made of a dump holds what its product files do, topic by topic.
#[test]
fn a_recording_of_a_dump_holds_its_calibrations_events_and_anomalies() {
    let dir = tempfile::tempdir().unwrap();
    for arguments in [
        &["simulate", "--hours", "6", "--seed", "3", "--out", "a.dump"][..],
        &["process", "a.dump", "--out", "products"],
    ] {
        let output = oare(&dir, arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let read = |name: &str| std::fs::read(dir.path().join("products").join(name)).unwrap();
    let octets = read("recording.mcap");
    let count = |topic: &str| {
        let messages = mcap::MessageStream::new(&octets).unwrap();
        messages.filter(|message| message.as_ref().unwrap().channel.topic == topic).count()
    };
    let list = |name: &str| serde_json::from_slice::<serde_json::Value>(&read(name)).unwrap();
    let versions = list("calibration.json")["versions"].as_array().map(Vec::len);
    assert_eq!(Some(count("/accel/calibration")), versions.filter(|versions| *versions > 0));
    assert_eq!(count("/accel/anomaly"), list("anomalies.json").as_array().unwrap().len());
    assert!(count("/accel/event") > 0);
}

/// A mission on paper is a page and its figures, each as SVG and as PNG.
#[test]
fn every_figure_of_a_report_is_there_as_svg_and_as_png() {
    let dir = tempfile::tempdir().unwrap();
    for arguments in [
        &["simulate", "--hours", "6", "--seed", "3", "--out", "a.dump"][..],
        &["process", "a.dump", "--out", "products", "--report", "paper"],
    ] {
        let output = oare(&dir, arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let paper = dir.path().join("paper");
    let stems = |extension: &str| {
        let files = std::fs::read_dir(&paper).unwrap().map(|file| file.unwrap().path());
        let of_kind = files.filter(|file| file.extension().is_some_and(|e| e == extension));
        of_kind.map(|file| file.file_stem().unwrap().to_owned()).collect::<std::collections::BTreeSet<_>>()
    };
    assert!(stems("svg").contains(std::ffi::OsStr::new("scale")), "{:?}", stems("svg"));
    assert_eq!(stems("svg"), stems("png"));
    assert!(std::fs::read(paper.join("scale.png")).unwrap().starts_with(b"\x89PNG\r\n"));
    assert_eq!(stems("html").len(), 1);
}

/// A radius of the table's turn that is written in another unit, or twice what it is, makes every value wrong by as much.
#[test]
fn a_scale_factor_that_no_sensor_has_is_told() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("wrong.toml"), "[instrument]\nradius_m = [0.1016, 0.2032, 0.1016]\n").unwrap();
    let told = |arguments: &[&str]| {
        let output = oare(&dir, arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let anomalies = std::fs::read(dir.path().join("products/anomalies.json")).unwrap();
        let anomalies: Vec<serde_json::Value> = serde_json::from_slice(&anomalies).unwrap();
        let defects = anomalies.into_iter().filter(|anomaly| anomaly["kind"] == "scale_record_defect");
        defects.collect::<Vec<_>>()
    };
    assert!(oare(&dir, &["simulate", "--hours", "24", "--seed", "3", "--out", "a.dump"]).status.success());
    assert_eq!(told(&["process", "a.dump", "--out", "products"]), Vec::<serde_json::Value>::new());
    let defects = told(&["process", "a.dump", "--out", "products", "--config", "wrong.toml"]);
    assert_eq!(defects.len(), 1, "{defects:#?}");
    assert_eq!(defects[0]["axes"], serde_json::json!(["y"]));
    assert!(defects[0]["sentence"].as_str().unwrap().contains("radius_m"), "{defects:#?}");
    assert!((defects[0]["value"].as_f64().unwrap() / 2.0 - 1.0).abs() < 0.3, "{defects:#?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_export_has_the_products_of_the_service() {
    let running = start().await;
    let mission = MissionConfig::sts65(3, 6.0);
    let frames = recorder::frames(Mission::new(mission).unwrap().fly(), LinkConfig::default());
    running.send(&cadus(&frames)).await;
    running.wait_for_playbacks(1).await;
    let served = running.products();
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    for format in ["csv", "mcap"] {
        let output = oare(&dir, &["export", "--data", ".", "--format", format, "--out", "out"]);
        assert!(output.status.success(), "{format}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let read = |name: &str| std::fs::read(dir.path().join("out").join(name)).unwrap();
    let text = |name: &str| String::from_utf8(read(name)).unwrap();
    assert_eq!(text("windows.csv"), served[0]);
    for (name, served) in ["calibration.json", "anomalies.json"].into_iter().zip(&served[1..]) {
        let json = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        assert_eq!(json(&text(name)), json(served), "{name}");
    }
    let count = |topic: &str| {
        let recording = read("recording.mcap");
        let recorded = mcap::MessageStream::new(&recording).unwrap();
        recorded.filter(|message| message.as_ref().unwrap().channel.topic == topic).count()
    };
    assert!(count("/accel/window") > 400 && count("/accel/calibration") > 0 && count("/accel/anomaly") > 0);
    // Of a part, with the calibration its windows are made with, and the anomalies that reach into it.
    let part = ["export", "--data", ".", "--format", "mcap", "--out", "out", "--from", "34500", "--to", "35000"];
    assert!(oare(&dir, &part).status.success());
    assert!((10..30).contains(&count("/accel/window")), "{}", count("/accel/window"));
    assert!(count("/accel/calibration") > 0 && count("/accel/anomaly") > 0);
}

/// What cannot be used is told with its name, and by the exit code: 2 where nothing is done, 3 where the rest is.
#[test]
fn what_a_command_cannot_use_is_told_and_no_input_is_written_over() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, octets: &[u8]| std::fs::write(dir.path().join(name), octets).unwrap();
    let random: Vec<u8> = (0..50_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let push = "hours = 6\n[[forces.push]]\nfrom_clock_s = 20000.0\nbody_ng = [500.0, 0.0, 0.0]\n";
    write("random.bin", &random);
    write("mission.toml", push.as_bytes());
    std::fs::create_dir(dir.path().join("nothing")).unwrap();
    let simulate = ["simulate", "--config", "mission.toml", "--out", "a.dump", "--case", "case"];
    assert!(oare(&dir, &simulate).status.success());
    let dump = std::fs::read(dir.path().join("a.dump")).unwrap();
    std::fs::write(dir.path().join("windows.csv"), &dump).unwrap();
    std::fs::write(dir.path().join("b.instrument.json"), push).unwrap();
    let cases: [(&[&str], i32, &str); 11] = [
        (&["process", "windows.csv", "--out", "."], 2, "windows.csv: that is an input"),
        (&["process", "a.dump", "--calibration", "calibration.json", "--out", "."], 2, "calibration.json"),
        (&["simulate", "--config", "mission.toml", "--out", "mission.toml"], 2, "mission.toml: that is an input"),
        (&["simulate", "--config", "b.instrument.json", "--out", "b.dump"], 2, "b.instrument.json: that is an input"),
        (&["process", "a.dump", "random.bin", "--out", "products"], 3, "random.bin: no frame in 50000 octets"),
        (&["diagnose", "case", "--out", "a.dump"], 2, "a file of the case"),
        (&["simulate", "--config", "no.toml", "--out", "b.dump"], 2, "no.toml"),
        (&["simulate", "--out", "b.dump", "--truth", "b.dump"], 2, "b.dump"),
        (&["challenge", "--effect", "weather"], 2, "no such effect or law"),
        (&["challenge", "--open", "nowhere"], 2, "nowhere"),
        (&["challenge", "--open", "nothing"], 2, "truth.json"),
    ];
    for (arguments, code, named) in cases {
        let output = oare(&dir, arguments);
        let told = String::from_utf8_lossy(&output.stderr).to_string();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {told}");
        assert!(told.contains(named), "{arguments:?}: {told}");
    }
    for unharmed in ["a.dump", "windows.csv"] {
        assert_eq!(std::fs::read(dir.path().join(unharmed)).unwrap(), dump);
    }
    assert_eq!(std::fs::read(dir.path().join("mission.toml")).unwrap(), push.as_bytes());
}

#[tokio::test(flavor = "multi_thread")]
async fn an_export_of_another_spacecraft_says_whose_frames_there_are() {
    let running = start().await;
    running.send(&dump(20_000, 300, 0)).await;
    running.wait_for_playbacks(1).await;
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    std::fs::write(dir.path().join("other.toml"), "[link]\nspacecraft_id = 66\n").unwrap();
    let arguments = ["export", "--config", "other.toml", "--data", ".", "--format", "csv", "--out", "out"];
    let output = oare(&dir, &arguments);
    let told = String::from_utf8_lossy(&output.stderr).to_string();
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(
        told.contains(
            "no frame of mission \"sts-65\", spacecraft 0x42; it holds those of mission \"sts-65\", spacecraft 0x41"
        ),
        "{told}"
    );
}
