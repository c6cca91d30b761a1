//! The WebSocket: numbers without holes, resumption, the seam from history to live, slow readers.

use std::collections::BTreeSet;

use futures_util::{SinkExt, StreamExt};
use oare_ground::hub::Topics;
use oare_ground::ingest::wire::LinkConfig;
use oare_ground::simulate::{Fault, Mission, MissionConfig, recorder};
use serde_json::Value;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{Bytes, Message};

use crate::service_support::*;

/// Every message names the one before it.
fn assert_chain(messages: &[Value]) {
    for pair in messages.windows(2) {
        assert_eq!(pair[1]["prev"], pair[0]["seq"], "{} after {}", pair[1], pair[0]);
        assert!(pair[1]["seq"].as_u64() > pair[0]["seq"].as_u64() || pair[0]["type"] == "hello");
    }
}

fn starts(messages: &[Value], kind: &str) -> Vec<i64> {
    let of_kind = messages.iter().filter(|message| message["type"] == kind);
    of_kind.map(|message| message["window_start_clock_s"].as_f64().unwrap() as i64).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn messages_are_numbered_without_holes_and_a_reader_resumes_where_it_was() {
    let running = start().await;
    let mut live = running.live("topics=window,event").await;
    let hello = live.next().await.unwrap();
    assert_eq!((hello["type"].as_str(), hello["seq"].as_u64()), (Some("hello"), Some(0)));
    running.send(&dump(20_000, 1200, 0)).await;
    let head = running.wait_for_playbacks(1).await["live"]["head_seq"].as_u64().unwrap();
    let last = running.service.hub.last_seq_on(Topics::from_words("window,event").unwrap(), head);
    let mut messages = vec![hello];
    messages.extend(live.through(last).await);
    assert_chain(&messages);
    let whole = starts(&messages, "window");
    assert_eq!(whole.len(), running.get("/status").await["accel"]["windows"].as_u64().unwrap() as usize);

    let from = messages[messages.len() / 2]["seq"].as_u64().unwrap();
    let mut resumed = running.live(&format!("topics=window,event&from=seq:{from}")).await;
    assert_eq!(resumed.next().await.unwrap()["seq"], from);
    let rest = resumed.through(last).await;
    let expected: Vec<&Value> = messages.iter().filter(|message| message["seq"].as_u64() > Some(from)).collect();
    assert_eq!(rest.iter().collect::<Vec<_>>(), expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn numbers_last_over_restarts_and_old_messages_can_be_had_again() {
    let running = start().await;
    running.send(&dump(20_000, 1200, 0)).await;
    let head = running.wait_for_playbacks(1).await["live"]["head_seq"].as_u64().unwrap();
    let mut live = running.live("topics=window,raw&from=seq:0").await;
    let before = live.through(head).await;
    let products = running.products();

    let running = running.restart().await;
    let status = running.get("/status").await;
    assert_eq!(status["live"]["head_seq"], head, "a restart tells nothing new");
    assert_eq!(running.products(), products);
    let mut live = running.live("topics=window,raw&from=seq:0").await;
    let again = live.through(head).await;
    assert_eq!(before.len(), again.len());
    assert_chain(&again);
    for (before, again) in before.iter().zip(&again).skip(1) {
        assert_eq!((&before["seq"], &before["type"]), (&again["seq"], &again["type"]));
        assert_eq!(before["revision"], again["revision"]);
    }
    running.send(&dump(21_200, 600, 2000)).await;
    let next = running.wait_for_playbacks(2).await["live"]["head_seq"].as_u64().unwrap();
    assert!(next > head);
    let more = live.through(running.service.hub.last_seq_on(Topics::from_words("window,raw").unwrap(), next)).await;
    assert_eq!(more[0]["prev"].as_u64(), again.last().unwrap()["seq"].as_u64(), "the chain goes on after the restart");
}

#[tokio::test(flavor = "multi_thread")]
async fn history_goes_over_into_live_without_a_hole_or_a_repeat() {
    let running = start().await;
    running.send(&dump(20_000, 3000, 0)).await;
    running.wait_for_playbacks(1).await;
    let mut live = running.live("from=20000&topics=window").await;
    assert_eq!(live.next().await.unwrap()["type"], "hello");
    // More arrives while the history is on its way.
    running.send(&dump(23_000, 3000, 5000)).await;
    let head = running.wait_for_playbacks(2).await["live"]["head_seq"].as_u64().unwrap();
    let messages = live.through(running.service.hub.last_seq_on(Topics::from_words("window").unwrap(), head)).await;
    assert_chain(&messages);
    let windows = starts(&messages, "window");
    let distinct: BTreeSet<i64> = windows.iter().copied().collect();
    assert_eq!(windows.len(), distinct.len(), "a window came twice");
    let expected: Vec<i64> = (20_000 / 25..6000 / 25 + 20_000 / 25).map(|cell| cell * 25).collect();
    assert_eq!(distinct.into_iter().collect::<Vec<_>>(), expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn raw_samples_of_the_past_come_too_each_second_once() {
    let running = start().await;
    running.send(&dump(20_000, 900, 0)).await;
    let head = running.wait_for_playbacks(1).await["live"]["head_seq"].as_u64().unwrap();
    let topics = Topics::from_words("raw,window").unwrap();
    let mut live = running.live("from=20500&topics=raw,window").await;
    let messages = live.through(running.service.hub.last_seq_on(topics, head)).await;
    assert_chain(&messages);
    let of_kind = |kind: &str| messages.iter().filter(|message| message["type"] == kind).count();
    assert_eq!((of_kind("raw"), of_kind("window")), (400, 400 / 25));
    let seconds = messages.iter().filter(|message| message["type"] == "raw");
    let clocks: BTreeSet<i64> = seconds.map(|message| message["clock_s"].as_f64().unwrap() as i64).collect();
    assert_eq!(clocks, (20_500..20_900).collect());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_late_frame_supersedes_the_windows_it_touches_and_no_other() {
    let running = start().await;
    let whole = dump(20_000, 1000, 0);
    const CADU_OCTETS: usize = 1119;
    let (before, late, after) =
        (&whole[..40 * CADU_OCTETS], &whole[40 * CADU_OCTETS..41 * CADU_OCTETS], &whole[41 * CADU_OCTETS..]);
    running.send(&[before, after].concat()).await;
    let head = running.wait_for_playbacks(1).await["live"]["head_seq"].as_u64().unwrap();
    assert_eq!(running.get("/gaps").await["gaps"].as_array().unwrap().len(), 1);
    let mut live = running.live("topics=window").await;
    live.next().await.unwrap();
    running.send(late).await;
    let last = running.wait_for_playbacks(2).await["live"]["head_seq"].as_u64().unwrap();
    let messages = live.through(running.service.hub.last_seq_on(Topics::from_words("window").unwrap(), last)).await;
    assert!(last > head);
    let touched = starts(&messages, "supersede");
    assert!((1..=3).contains(&touched.len()), "{touched:?}");
    for message in messages.iter().filter(|message| message["type"] == "supersede") {
        assert_ne!(message["supersedes"], message["revision"]);
    }
    assert!(running.get("/gaps").await["gaps"].as_array().unwrap().is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slow_reader_is_told_what_it_missed() {
    let running = start_with(|config| {
        config.http.live_queue_messages = 16;
        config.http.live_behind_messages = 40;
    })
    .await;
    let mut live = running.live("topics=window&from=seq:0").await;
    assert_eq!(live.next().await.unwrap()["type"], "hello");
    running.send(&dump(20_000, 5000, 0)).await;
    let status = running.wait_for_playbacks(1).await;
    // It comes back for messages that are further behind than the bound.
    let mut late = running.live("topics=window&from=seq:1").await;
    assert_eq!(late.next().await.unwrap()["type"], "hello");
    let lag = late.next().await.unwrap();
    assert_eq!(lag["type"], "lag", "{lag}");
    let head = status["live"]["head_seq"].as_u64().unwrap();
    let messages = late.through(running.service.hub.last_seq_on(Topics::from_words("window").unwrap(), head)).await;
    assert_eq!(messages[0]["prev"], lag["seq"]);
    assert_chain(&messages);
    let all = status["accel"]["windows"].as_u64().unwrap()
        + running.get("/gaps").await["gaps"].as_array().unwrap().len() as u64;
    let first_excluded = u64::from(starts(&messages, "window").len() as u64 + lag["count"].as_u64().unwrap() < all);
    assert_eq!(
        messages.len() as u64 + lag["count"].as_u64().unwrap() + first_excluded,
        all,
        "told and missed are all there is"
    );
}

/// The close with which the service ends a connection, if it says one, and the text messages it sent before.
async fn farewell(live: &mut Live) -> (Option<Option<CloseCode>>, usize) {
    let mut texts = 0;
    loop {
        match tokio::time::timeout(PATIENCE, live.0.next()).await.expect("the service answers") {
            Some(Ok(Message::Close(frame))) => return (Some(frame.map(|frame| frame.code)), texts),
            Some(Ok(Message::Text(_))) => texts += 1,
            Some(Ok(_)) => {}
            Some(Err(_)) | None => return (None, texts),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_is_heard_while_it_catches_up_and_its_leave_is_answered() {
    const SECONDS: usize = 9000;
    let running = start().await;
    running.send(&dump(20_000, SECONDS as i64, 0)).await;
    running.wait_for_playbacks(1).await;

    let mut pinging = running.live("topics=raw&from=0").await;
    pinging.0.send(Message::Ping(Bytes::from_static(b"there?"))).await.unwrap();
    let mut before = 0;
    loop {
        match tokio::time::timeout(PATIENCE, pinging.0.next()).await.unwrap().unwrap().unwrap() {
            Message::Pong(said) => break assert_eq!(said, Bytes::from_static(b"there?")),
            _ => before += 1,
        }
    }
    assert!(before < SECONDS, "the ping is answered after all {before} messages");

    let mut leaving = running.live("topics=raw&from=0").await;
    leaving.0.close(None).await.unwrap();
    // It stops sending, answers, and the connection is over.
    let (_, texts) = farewell(&mut leaving).await;
    assert!(texts < SECONDS, "all {texts} messages are sent to one that left");

    let mut quiet = running.live("topics=window").await;
    quiet.next().await.unwrap();
    quiet.0.close(None).await.unwrap();
    assert!(farewell(&mut quiet).await.0.is_some(), "a close is answered");

    let mut loud = running.live("topics=window").await;
    loud.next().await.unwrap();
    loud.0.send(Message::text("x".repeat(10_000))).await.unwrap();
    assert_eq!(farewell(&mut loud).await.0, Some(Some(CloseCode::Size)));
}

/// The anomalies that a reader knows who goes by the messages alone.
fn standing(messages: &[Value]) -> Vec<Value> {
    let mut standing = Vec::new();
    for message in messages {
        let mut anomaly = message.clone();
        for member in ["seq", "prev", "type"] {
            anomaly.as_object_mut().unwrap().remove(member);
        }
        match message["type"].as_str().unwrap() {
            "anomaly" => standing.push(anomaly),
            "anomaly_withdrawn" => {
                let known = standing.iter().position(|known| *known == anomaly);
                standing.remove(known.unwrap_or_else(|| panic!("what was not told is withdrawn: {message}")));
            }
            _ => {}
        }
    }
    standing.sort_by_key(|anomaly| anomaly["sentence"].to_string());
    standing
}

#[tokio::test(flavor = "multi_thread")]
async fn anomalies_that_more_data_take_back_are_withdrawn() {
    let mut config = MissionConfig::sts65(11, 6.0);
    config.faults.push(Fault::RangeMisreport { from_clock_s: 22_013, seconds: 700 });
    let frames = recorder::frames(Mission::new(config).unwrap().fly(), LinkConfig::default());
    let running = start().await;
    // The end comes down first: what it says of the rest changes with every piece.
    for (sent, piece) in (1..).zip(frames.chunks(frames.len().div_ceil(12)).rev()) {
        running.send(&cadus(piece)).await;
        running.wait_for_playbacks(sent).await;
    }
    let told = assert_told_is_what_stands(&running).await;
    let running = running.restart().await;
    running.wait_for_playbacks(12).await;
    assert_eq!(assert_told_is_what_stands(&running).await, told, "a restart tells nothing new");
}

/// What the messages tell of anomalies is what there is; the messages.
async fn assert_told_is_what_stands(running: &Running) -> Vec<Value> {
    let mut there = running.get("/anomalies").await.as_array().unwrap().clone();
    there.sort_by_key(|anomaly| anomaly["sentence"].to_string());
    let hub = &running.service.hub;
    let last = hub.last_seq_on(Topics::from_words("anomaly").unwrap(), hub.head_seq());
    let messages = running.live("topics=anomaly&from=seq:0").await.through(last).await;
    assert!(messages.iter().any(|message| message["type"] == "anomaly_withdrawn"), "{messages:#?}");
    assert!(!there.is_empty());
    assert_eq!(standing(&messages), there);
    messages
}

/// Windows of frames that lose their places to others, seen in more playbacks, are no windows any more: not for those who ask, and not for
/// those who listen.
#[tokio::test(flavor = "multi_thread")]
async fn windows_whose_frames_lose_their_places_are_withdrawn() {
    let running = start().await;
    running.send(&dump(10_000, 600, 0)).await;
    let before = running.wait_for_playbacks(1).await["accel"]["windows"].clone();
    let far = dump(20_000, 130, 5000);
    running.send(&far).await;
    running.wait_for_playbacks(2).await;
    let known = running.get("/accel/history?from=19900&max_points=1000").await["windows"].clone();
    assert!(known.as_u64().unwrap() >= 4, "{known}");
    // The same places with seconds that are known: in two playbacks that differ.
    let known_seconds = dump(10_000, 130, 5000);
    running.send(&known_seconds).await;
    running.send(&[known_seconds, dump(10_600, 60, 9000)].concat()).await;
    let gone = |status: &Value| status["ingest"]["frame_conflicts"] != 0 && status["ingest"]["seconds_covered"] == 660;
    running.wait_for("the vote", gone).await;
    running.wait_for_playbacks(4).await;
    assert_eq!(running.get("/accel/history?from=19900&max_points=1000").await["windows"], 0, "{before} windows before");
    let last = running.service.hub.head_seq();
    let last = running.service.hub.last_seq_on(Topics::from_words("window").unwrap(), last);
    let messages = running.live("topics=window&from=seq:0").await.through(last).await;
    let withdrawn = starts(&messages, "window_withdrawn");
    assert_eq!(withdrawn.len() as u64, known.as_u64().unwrap(), "{withdrawn:?}");
    assert!(withdrawn.iter().all(|start| *start >= 19_900), "{withdrawn:?}");
    let windows = running.get("/status").await["accel"]["windows"].clone();
    let running = running.restart().await;
    assert_eq!(running.wait_for_playbacks(4).await["accel"]["windows"], windows);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_plain_request_is_told_that_a_websocket_is_needed() {
    let running = start().await;
    let answer = reqwest::get(running.url("/accel/live")).await.unwrap();
    assert_eq!(answer.headers()["upgrade"], "websocket");
    assert_eq!(problem_of(answer).await.0, 426);
}
