//! The running diagnosis: a mission with a concealed leak through the dump port, the answer at `/diagnosis` and over the WebSocket;
//! a search that is held back and the dump port that does not care; what is wrong with its configuration.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, OnceLock};
use std::time::Instant;

use oare_ground::config::Config;
use oare_ground::diagnose::{self, recorder};
use oare_ground::ingest::wire::LinkConfig;
use oare_ground::math::shared_work;
use oare_ground::physics::Vec3;
use oare_ground::service::Service;
use oare_ground::service::diagnosing::Gate;
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
    with_case_and(config, "");
}

/// The same with more lines.
fn with_case_and(config: &mut Config, lines: &str) {
    write_case(&config.data_dir.join("case"));
    let text = format!("[diagnosis]\ncase = \"case\"\n{lines}");
    config.diagnosis = Config::from_toml_in(&text, &config.data_dir).unwrap().diagnosis;
}

/// The members of an answer that a schema of the service's own description does not name, each with its place.
fn undescribed(openapi: &Value, schema: &Value, answer: &Value, place: &str) -> Vec<String> {
    let schemas = with_parts(openapi, schema);
    let within = |key: &str| schemas.iter().filter_map(|schema| schema.get(key)).collect::<Vec<&Value>>();
    match answer {
        Value::Null => Vec::new(),
        Value::Object(members) => members
            .iter()
            .flat_map(|(name, value)| {
                let place = format!("{place}.{name}");
                match within("properties").into_iter().find_map(|properties| properties.get(name)) {
                    Some(schema) => undescribed(openapi, schema, value, &place),
                    None => vec![place],
                }
            })
            .collect(),
        Value::Array(values) => match within("items").first() {
            Some(items) => values.iter().flat_map(|value| undescribed(openapi, items, value, place)).collect(),
            None => vec![format!("{place}[]")],
        },
        Value::String(_) => of_kind(&within("type"), &["string"], answer, place),
        Value::Bool(_) => of_kind(&within("type"), &["boolean"], answer, place),
        Value::Number(_) => of_kind(&within("type"), &["number", "integer"], answer, place),
    }
}

fn of_kind(types: &[&Value], kinds: &[&str], answer: &Value, place: &str) -> Vec<String> {
    let is_one = |kind: &Value| kinds.iter().any(|one| kind == one);
    let is_described =
        types.iter().any(|kind| is_one(kind) || kind.as_array().is_some_and(|any| any.iter().any(is_one)));
    if is_described { Vec::new() } else { vec![format!("{place} = {answer}")] }
}

/// A schema and all that it is made of.
fn with_parts<'a>(openapi: &'a Value, schema: &'a Value) -> Vec<&'a Value> {
    let named = schema["$ref"].as_str().map(|name| {
        let schema = openapi.pointer(name.trim_start_matches('#'));
        schema.unwrap_or_else(|| panic!("{name} is described nowhere"))
    });
    let parts = ["allOf", "oneOf", "anyOf"].into_iter().filter_map(|key| schema[key].as_array()).flatten().chain(named);
    std::iter::once(schema).chain(parts.flat_map(|part| with_parts(openapi, part))).collect()
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

    /// The value of a metric, named with its labels.
    async fn metric(&self, name: &str) -> f64 {
        let text = reqwest::get(self.url("/metrics")).await.unwrap().text().await.unwrap();
        let value = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' ')?.parse().ok());
        value.unwrap_or_else(|| panic!("{name} is not in: {text}"))
    }

    /// Waits until every usable window that the station has is in the answer, more than so many.
    async fn settled(&self, windows_min: u64) -> Value {
        let is_whole = |d: &Value| {
            let (p, there) =
                (&d["progress"], recorder::seen(&self.service.station.read().unwrap(), recorder::ALL_TIME));
            let is_known = p["windows_seen"] == there.windows && p["windows_searched"].as_u64() > Some(windows_min);
            is_known && p["at_rest"] == true
        };
        self.wait_for_diagnosis("an answer to all windows", is_whole).await
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_concealed_leak_is_named_as_the_windows_come_and_everybody_is_told() {
    let [first, second] = &mission().0;
    let running = start_with(with_case).await;
    let waiting = running.get("/diagnosis").await;
    assert_eq!((&waiting["verdict"], &waiting["false_alarm_probability"]), (&Value::Null, &Value::Null));
    assert_eq!(waiting["progress"]["state"], "collecting");
    let mut live = running.live("topics=diagnosis").await;
    assert_eq!(live.next().await.unwrap()["type"], "hello");

    running.send(first).await;
    let before = running.settled(200).await;
    assert_eq!(before["verdict"], "consistent", "{before:#}");
    assert!(before["progress"]["last_clock_s"].as_f64().unwrap() < ONSET_S, "{:#}", before["progress"]);
    assert!(before["progress"]["time_to_detect_s"].is_null());

    running.send(second).await;
    let named = running.wait_for_diagnosis("a name", |d| d["verdict"] == "explained").await;
    let openapi = running.get("/openapi.json").await;
    let schema = &openapi["paths"]["/diagnosis"]["get"]["responses"]["200"]["content"]["application/json"]["schema"];
    for answer in [&waiting, &named] {
        let undescribed = undescribed(&openapi, schema, answer, "diagnosis");
        assert!(undescribed.is_empty(), "{undescribed:?}");
    }
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

    // After a restart the answer and what led to it are there before the first search; that finds the same, and nothing is told twice.
    let settled = running.settled(0).await;
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    let mut again = config(&dir);
    with_case(&mut again);
    let held = Arc::new(Held::default());
    let running = Running { service: Service::start_gated(again, held.gate()).await.unwrap(), dir };
    let head = running.service.hub.head_seq();
    let at_once = running.get("/diagnosis").await;
    assert_eq!((&at_once["verdict"], &at_once["progress"]["state"]), (&"explained".into(), &"searching".into()));
    for same in ["alarm_clock_s", "name_clock_s", "revision", "windows_searched", "searches", "looks", "inputs"] {
        assert_eq!(at_once["progress"][same], settled["progress"][same], "{same}");
    }
    assert!(settled["progress"]["looks"].as_array().unwrap().len() > 1, "{settled:#}");
    assert_eq!(running.metric("oare_diagnosis_alarm").await, 1.0);
    held.release();
    let restarted = running.settled(0).await;
    for same in ["effects", "located", "verdict"] {
        assert_eq!(restarted[same], settled[same], "{same}");
    }
    for same in ["alarm_clock_s", "name_clock_s", "revision", "windows_searched", "searches"] {
        assert_eq!(restarted["progress"][same], settled["progress"][same], "{same}");
    }
    tokio::time::sleep(std::time::Duration::from_millis(300)).await;
    assert_eq!(running.service.hub.head_seq(), head, "a restart tells nothing new");

    // Of another vehicle nothing is inherited.
    let Running { service, dir } = running;
    service.drain().await.unwrap();
    let mut other = config(&dir);
    with_case_and(&mut other, "set = [\"vehicle.mass_kg=104500\"]\n");
    let held = Arc::new(Held::default());
    let running = Running { service: Service::start_gated(other, held.gate()).await.unwrap(), dir };
    let anew = running.get("/diagnosis").await;
    let progress = &anew["progress"];
    assert_eq!((&anew["verdict"], &progress["alarm_clock_s"]), (&Value::Null, &Value::Null), "{anew:#}");
    assert_eq!((&progress["searches"], progress.get("looks")), (&0.into(), None), "{progress:#}");
    assert_eq!(running.metric("oare_diagnosis_alarm").await, 0.0);
    held.release();
    running.service.drain().await.unwrap();
}

/// Once nothing more comes the answer is one of the windows alone: what came before, and where the searches fell, leaves no trace.
#[tokio::test(flavor = "multi_thread")]
async fn at_rest_the_answer_is_the_same_whatever_came_before() {
    let [first, second] = &mission().0;
    let mut answers = Vec::new();
    for (is_apart, playbacks) in [(true, [first, second]), (false, [second, first])] {
        let running = start_with(with_case).await;
        for (n, playback) in (1..).zip(playbacks) {
            running.send(playback).await;
            running.wait_for_playbacks(n).await;
            if is_apart {
                running.wait_for_diagnosis("a search", |d| d["progress"]["searches"].as_u64() > Some(0)).await;
            }
        }
        let mut answer = running.settled(800).await;
        answer.as_object_mut().unwrap().remove("progress").unwrap();
        answers.push(serde_json::to_string(&answer).unwrap());
        running.service.drain().await.unwrap();
    }
    assert_eq!(answers[0], answers[1]);
    // It is that of `oare diagnose`, but for the level of proof.
    let file = |name: &str| {
        let text = mission().1.iter().find(|(file, _)| *file == name).map(|(_, text)| text.clone().into_bytes());
        Ok(text.or_else(|| (name == "recording.dump").then(|| [&first[..], second].concat())))
    };
    let case = recorder::case(file, &[]).unwrap();
    let alone = serde_json::to_value(diagnose::diagnose(&case, &diagnose::Settings::default()).unwrap()).unwrap();
    let answer: Value = serde_json::from_str(&answers[0]).unwrap();
    for same in ["case", "verdict", "statistic", "effects", "located", "fit", "upper_limits"] {
        assert_eq!(answer[same], alone[same], "{same}");
    }
}

/// Nobody believes that windows are watched which the simulation does not reach, and those it reaches are not searched for them again.
#[tokio::test(flavor = "multi_thread")]
async fn windows_beyond_the_simulation_are_told_and_cause_no_search() {
    let [first, second] = &mission().0;
    let running = start_with(|config| {
        with_case_and(config, "set = [\"case.end_s=40000.0\"]\n");
    })
    .await;
    running.send(first).await;
    let before = running.settled(200).await;
    let progress = &before["progress"];
    let (end_s, beyond) = (progress["last_clock_s"].as_f64().unwrap(), progress["windows_beyond"].as_u64().unwrap());
    assert!(end_s <= 40_000.0 && beyond > 0, "{progress:#}");
    let sentence = progress["sentence"].as_str().unwrap();
    assert!(sentence.contains(&format!("{beyond} of")) && sentence.contains("to 40000 s"), "{sentence}");
    let mut live = running.live("topics=diagnosis").await;
    live.next().await.unwrap();
    running.send(second).await;
    let is_known = |d: &Value| d["progress"]["windows_beyond"].as_u64() > Some(beyond + 500);
    running.wait_for_diagnosis("windows beyond", is_known).await;
    let after = running.settled(200).await;
    for same in ["windows_searched", "last_clock_s"] {
        assert_eq!(after["progress"][same], before["progress"][same], "{same}");
    }
    // The second tape has calibrations that bear on the windows before; its 800 windows would be twelve searches.
    let searches = |d: &Value| d["progress"]["searches"].as_u64().unwrap();
    assert!(searches(&after) <= searches(&before) + 4, "{after:#}");
    running.service.drain().await.unwrap();
}

/// A comparison that cannot be made says so everywhere, and nobody can take it for "all is well".
#[tokio::test(flavor = "multi_thread")]
async fn windows_that_cannot_be_compared_have_no_verdict() {
    let running = start_with(|config| {
        with_case_and(config, "set = [\"case.start_s=9000000.0\", \"case.end_s=9100000.0\"]\n");
    })
    .await;
    let mut live = running.live("topics=diagnosis").await;
    live.next().await.unwrap();
    running.send(&mission().0[0]).await;
    let refused = running.wait_for_diagnosis("a refusal", |d| d["progress"]["state"] == "refused").await;
    assert_eq!((&refused["verdict"], &refused["false_alarm_probability"]), (&Value::Null, &Value::Null), "{refused:#}");
    assert!(refused["progress"]["sentence"].as_str().unwrap().contains("9100000"), "{refused:#}");
    let told = live.next().await.unwrap();
    assert_eq!((&told["verdict"], &told["progress"]["state"]), (&Value::Null, &"refused".into()), "{told:#}");
    assert_eq!(running.get("/status").await["diagnosis"]["state"], "refused");
    for (state, is_here) in [("refused", 1.0), ("current", 0.0), ("collecting", 0.0)] {
        assert_eq!(running.metric(&format!("oare_diagnosis_state{{state=\"{state}\"}}")).await, is_here, "{state}");
    }
    running.service.drain().await.unwrap();
}

/// A gate that is opened by hand.
#[derive(Default)]
struct Held {
    open: Mutex<bool>,
    moved: Condvar,
}

impl Held {
    fn gate(self: &Arc<Self>) -> Gate {
        let held = self.clone();
        Arc::new(move || {
            let open = held.open.lock().unwrap();
            drop(held.moved.wait_while(open, |open| !*open).unwrap());
        })
    }

    fn release(&self) {
        *self.open.lock().unwrap() = true;
        self.moved.notify_all();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_search_that_does_not_end_delays_no_window_and_what_came_meanwhile_is_one_search_more() {
    let [first, second] = &mission().0;
    let held = Arc::new(Held::default());
    let dir = tempfile::tempdir().unwrap();
    let mut config = config(&dir);
    with_case(&mut config);
    // It holds every thread that a search may have, and products are derived all the same.
    let gate = held.gate();
    let on_all_threads = move || drop(shared_work::map(&[(); 64], |()| gate()));
    let running = Running { service: Service::start_gated(config, Arc::new(on_all_threads)).await.unwrap(), dir };
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

    held.release();
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
    assert_eq!((&failed["verdict"], &failed["progress"]["searches"]), (&Value::Null, &0.into()), "{failed:#}");
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
    // Simulation and ancillary data alone: whatever is missing of the vehicle is told at once, and what is there is enough.
    write_case(dir.path());
    let files = "[diagnosis]\nsimulation = \"simulation.csv\"\nancillary = \"ancillary.csv\"\n";
    let alone = told(files);
    for word in ["4 faults", "diagnosis.set", "vehicle.mass_kg", "drag_coefficient", "area_m2", "sensor_offset_m"] {
        assert!(alone.contains(word), "{word} is not in: {alone}");
    }
    let vehicle = "\"vehicle.mass_kg=104500\", \"vehicle.drag_coefficient=2.2\", \"vehicle.area_m2=[64.1, 255.0, 367.0]\", \
                   \"vehicle.sensor_offset_m=[-1.5, 0.1, 0.6]\"";
    let config = Config::from_toml_in(&format!("{files}set = [{vehicle}]\n"), dir.path()).unwrap();
    config.diagnosis.unwrap().expectation(&config.settings.time).unwrap();
    // Each sentence names what the operator wrote.
    for (set, word) in
        [("vehicle.mass_kg", "key=value"), ("vehicle.mas_kg=5", "vehicle.mas_kg"), ("vehicle.mass_kg=-5", "positive")]
    {
        let said = told(&format!("[diagnosis]\ncase = \".\"\nset = [\"{set}\"]\n"));
        assert!(said.contains("diagnosis.set") && said.contains(word), "{said}");
    }
    let csv = told("[diagnosis]\ncase = \"simulation.csv\"\n");
    assert!(csv.contains("simulation.csv: ") && !csv.contains("case.toml"), "{csv}");
    let orbits = told("[diagnosis]\ncase = \".\"\nset = [\"recording.kind=orbit_sp3\"]\n");
    assert!(orbits.contains("1 fault") && orbits.contains("orbit_sp3"), "{orbits}");
}
