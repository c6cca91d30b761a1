//! The running diagnosis: a mission with a concealed leak through the dump port, the answer at `/diagnosis` and over the WebSocket;
//! a search that is held back and the dump port that does not care; what is wrong with its configuration.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, OnceLock};
use std::time::Instant;

use oare_ground::config::Config;
use oare_ground::ingest::wire::LinkConfig;
use oare_ground::physics::Vec3;
use oare_ground::service::Service;
use oare_ground::simulate::expected::case_files;
use oare_ground::simulate::forces::Push;
use oare_ground::simulate::noise::NoisePlan;
use oare_ground::simulate::recorder::{RecorderConfig, frames};
use oare_ground::simulate::{Mission, MissionConfig, playbacks};
use serde_json::Value;

use crate::service_support::*;

/// Instrument clock at which the concealed leak begins.
const ONSET_S: f64 = 45_000.0;
/// Frames of about eight hours: the first playback ends well before the leak.
const FIRST_FRAMES: usize = 2600;

/// Two playbacks, and the files of the case by name.
type Flown = ([Vec<u8>; 2], Vec<(&'static str, String)>);

/// A mission of 16 h with a leak.
fn mission() -> &'static Flown {
    static FLOWN: OnceLock<Flown> = OnceLock::new();
    FLOWN.get_or_init(|| {
        let mut config = MissionConfig::sts65(11, 16.0);
        config.noise = NoisePlan::quiet();
        config.forces.pushes.push(Push {
            from_clock_s: ONSET_S,
            until_clock_s: f64::INFINITY,
            tau_s: Some(9000.0),
            body_ng: Vec3::new(250.0, -120.0, 300.0),
        });
        let mission = Mission::new(config).unwrap();
        let link = LinkConfig::default();
        let frames = frames(mission.fly(), link);
        let tape = |frames: &[Vec<u8>]| {
            playbacks(frames, &link, &RecorderConfig::clean(), 1).into_iter().flat_map(|p| p.octets).collect()
        };
        let files = case_files(&mission, "leak", "recording.dump").unwrap();
        ([tape(&frames[..FIRST_FRAMES]), tape(&frames[FIRST_FRAMES..])], files)
    })
}

fn write_case(folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    mission().1.iter().for_each(|(name, text)| std::fs::write(folder.join(name), text).unwrap());
}

/// The `[diagnosis]` of a case in the directory of a service.
fn with_case(config: &mut Config) {
    write_case(&config.data_dir.join("case"));
    let text = "[diagnosis]\ncase = \"case\"\n";
    config.diagnosis = Config::from_toml_in(text, &config.data_dir).unwrap().diagnosis;
}

impl Running {
    /// Waits until `/diagnosis` satisfies a condition.
    async fn wait_for_diagnosis(&self, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let diagnosis: Value = reqwest::get(self.url("/diagnosis")).await.unwrap().json().await.unwrap();
            if holds(&diagnosis) {
                return diagnosis;
            }
            assert!(start.elapsed() < 2 * PATIENCE, "{what} did not come about: {diagnosis:#}");
            tokio::time::sleep(std::time::Duration::from_millis(50)).await;
        }
    }

    /// Waits until every window known is in the answer.
    async fn settled(&self, windows_min: u64) -> Value {
        let all = |d: &Value| {
            let p = &d["progress"];
            p["state"] == "current" && p["windows_searched"].as_u64() > Some(windows_min)
        };
        let known = self.wait_for_diagnosis("an answer", all).await;
        // The windows after the last calibration come with the flush; what comes later is looked at when it is quiet.
        let seen = known["progress"]["windows_seen"].as_u64().unwrap();
        self.wait_for_diagnosis("an answer to all windows", |d| {
            d["progress"]["state"] == "current" && d["progress"]["windows_seen"].as_u64() >= Some(seen)
        })
        .await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_concealed_leak_is_named_as_the_windows_come_and_everybody_is_told() {
    let [first, second] = &mission().0;
    let running = start_with(with_case).await;
    let waiting = running.get("/diagnosis").await;
    assert_eq!((&waiting["verdict"], &waiting["progress"]["state"]), (&"consistent".into(), &"collecting".into()));
    let mut live = running.live("topics=diagnosis").await;
    assert_eq!(live.next().await.unwrap()["type"], "hello");

    running.send(first).await;
    let before = running.settled(200).await;
    assert_eq!(before["verdict"], "consistent", "{before:#}");
    assert!(before["progress"]["last_clock_s"].as_f64().unwrap() < ONSET_S, "{:#}", before["progress"]);
    assert!(before["progress"]["time_to_detect_s"].is_null());

    running.send(second).await;
    let named = running.wait_for_diagnosis("a name", |d| d["verdict"] == "explained").await;
    assert_eq!(named["effects"][0]["id"], "vent_leak", "{named:#}");
    let onset = named["effects"][0]["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "onset_s").unwrap();
    let (value, sigma) = (onset["value"].as_f64().unwrap(), onset["sigma"].as_f64().unwrap());
    assert!((value - ONSET_S).abs() < 4.0 * sigma.max(25.0), "{onset}");
    let progress = &named["progress"];
    assert_eq!((&progress["counted_from"], &progress["name"][0]), (&"onset".into(), &"vent_leak".into()), "{named:#}");
    let alarm_s = progress["alarm_clock_s"].as_f64().unwrap();
    let to_detect_s = progress["time_to_detect_s"].as_f64().unwrap();
    assert!((alarm_s - value - to_detect_s).abs() < 1e-6 && to_detect_s > 0.0, "{progress:#}");
    assert!(progress["time_to_name_s"].as_f64().unwrap() >= to_detect_s);

    let metrics = reqwest::get(running.url("/metrics")).await.unwrap().text().await.unwrap();
    for name in ["searches_total", "windows_searched", "alarm 1", "time_to_detect_seconds", "time_to_name_seconds"] {
        assert!(metrics.contains(&format!("oare_diagnosis_{name}")), "{name} is not in: {metrics}");
    }

    let mut told = live.next().await.unwrap();
    let mut prev = told["prev"].as_u64();
    while told["verdict"] != "explained" {
        assert_eq!((&told["type"], told["prev"].as_u64()), (&"diagnosis".into(), prev));
        prev = told["seq"].as_u64();
        told = live.next().await.unwrap();
    }
    assert_eq!(told["effects"][0]["id"], "vent_leak");
    assert_eq!(told["progress"]["revision"].as_str().map(str::len), Some(16));

    // After a restart: the same answer, the milestones as they were, and nothing told twice.
    let settled = running.settled(0).await;
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    let mut again = config(&dir);
    with_case(&mut again);
    let running = Running { service: Service::start(again).await.unwrap(), dir };
    let head = running.service.hub.head_seq();
    let restarted = running.settled(0).await;
    assert_eq!(restarted["effects"][0]["id"], "vent_leak");
    for same in ["alarm_clock_s", "name_clock_s", "revision", "windows_searched"] {
        assert_eq!(restarted["progress"][same], settled["progress"][same], "{same}");
    }
    tokio::time::sleep(std::time::Duration::from_millis(300)).await;
    assert_eq!(running.service.hub.head_seq(), head, "a restart tells nothing new");
    running.service.drain().await.unwrap();
}

/// A gate that is opened by hand.
#[derive(Default)]
struct Held {
    open: Mutex<bool>,
    moved: Condvar,
}

#[tokio::test(flavor = "multi_thread")]
async fn a_search_that_does_not_end_delays_no_window_and_what_came_meanwhile_is_one_search_more() {
    let [first, second] = &mission().0;
    let held = Arc::new(Held::default());
    let dir = tempfile::tempdir().unwrap();
    let mut config = config(&dir);
    with_case(&mut config);
    let gate = held.clone();
    let wait = move || {
        let open = gate.open.lock().unwrap();
        drop(gate.moved.wait_while(open, |open| !*open).unwrap());
    };
    let running = Running { service: Service::start_gated(config, Arc::new(wait)).await.unwrap(), dir };
    running.send(first).await;
    running.wait_for_diagnosis("a search", |d| d["progress"]["state"] == "searching").await;

    // The search is held. Everything else goes on: frames become durable, windows are published and can be had.
    let mut live = running.live("topics=window").await;
    live.next().await.unwrap();
    let windows = running.get("/status").await["accel"]["windows"].as_u64().unwrap();
    running.send(second).await;
    let status = running.wait_for_playbacks(2).await;
    assert!(status["accel"]["windows"].as_u64().unwrap() > windows + 500, "{status:#}");
    assert!(live.next().await.is_some());
    assert!(running.get("/accel").await["clock_s"].as_f64().unwrap() > ONSET_S);
    let meanwhile = running.get("/diagnosis").await;
    assert_eq!((&meanwhile["progress"]["state"], &meanwhile["progress"]["searches"]), (&"searching".into(), &0.into()));

    *held.open.lock().unwrap() = true;
    held.moved.notify_all();
    let named = running.wait_for_diagnosis("a name", |d| d["verdict"] == "explained").await;
    assert_eq!(named["progress"]["searches"], 2, "the one that was held, and one for all that came since: {named:#}");
    running.service.drain().await.unwrap();
}

/// Whatever fails in a search costs that search: it is told and counted, and the next one answers.
#[tokio::test(flavor = "multi_thread")]
async fn a_search_that_fails_is_told_and_the_next_one_answers() {
    let [first, second] = &mission().0;
    let fails = Arc::new(AtomicBool::new(true));
    let dir = tempfile::tempdir().unwrap();
    let mut config = config(&dir);
    with_case(&mut config);
    let failing = fails.clone();
    let gate = move || assert!(!failing.load(Ordering::SeqCst), "a search that fails on purpose");
    let running = Running { service: Service::start_gated(config, Arc::new(gate)).await.unwrap(), dir };
    running.send(first).await;
    let failed = running.wait_for_diagnosis("a failure", |d| d["progress"]["state"] == "failed").await;
    assert_eq!((&failed["verdict"], &failed["progress"]["searches"]), (&"consistent".into(), &0.into()), "{failed:#}");
    assert!(failed["progress"]["sentence"].as_str().unwrap().contains("failed"), "{failed:#}");
    assert!(running.first_accel().await["clock_s"].as_f64().is_some());
    fails.store(false, Ordering::SeqCst);
    running.send(second).await;
    let named = running.wait_for_diagnosis("a name", |d| d["verdict"] == "explained").await;
    assert!(named["progress"]["searches_failed"].as_u64() > Some(0), "{named:#}");
    let metrics = reqwest::get(running.url("/metrics")).await.unwrap().text().await.unwrap();
    assert!(metrics.contains("oare_diagnosis_searches_failed_total"), "{metrics}");
    running.service.drain().await.unwrap();
}

#[test]
fn what_is_wrong_with_the_diagnosis_is_told_whole_with_exit_code_2() {
    let dir = tempfile::tempdir().unwrap();
    let told = |toml: &str| {
        let path = dir.path().join("serve.toml");
        std::fs::write(&path, toml).unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_oare")).args(["serve", "--config"]).arg(&path).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    let paths = told(
        "[diagnosis]\nsimulation = \"no.csv\"\nancillary = \"none.csv\"\nevents = \"nil.csv\"\nsearch_every_s = 0\n",
    );
    for word in ["4 faults", "diagnosis.simulation", "no.csv", "none.csv", "nil.csv", "search_every_s"] {
        assert!(paths.contains(word), "{word} is not in: {paths}");
    }
    // Files that are there and cannot be used: every one of them is told, with its line.
    write_case(dir.path());
    let spoil = |name: &str, from: &str, to: &str| {
        let text = std::fs::read_to_string(dir.path().join(name)).unwrap();
        std::fs::write(dir.path().join(name), text.replacen(from, to, 1)).unwrap();
    };
    spoil("simulation.csv", "14400.0,", "NaN,");
    spoil("ancillary.csv", "temperature_c", "temp");
    spoil("case.toml", "1994-07-08", "1994-07-09");
    let contents = told("[diagnosis]\ncase = \".\"\n");
    for word in [
        "3 faults",
        "diagnosis.case",
        "1994-07-09",
        "diagnosis.simulation",
        "line 2",
        "diagnosis.ancillary",
        "temperature_c",
    ] {
        assert!(contents.contains(word), "{word} is not in: {contents}");
    }
}
