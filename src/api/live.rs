//! `/accel/live`: the messages of the hub over a WebSocket, numbered, from history to live without a hole or a repeat.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message as Frame, Utf8Bytes, WebSocket, WebSocketUpgrade, close_code};
use axum::http::header::{CONNECTION, UPGRADE};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use bytes::Bytes;
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{FutureExt, SinkExt, StreamExt};
use serde::Deserialize;
use utoipa::IntoParams;

use super::App;
use super::problem::Problem;
use super::query::{Asked, clock};
use crate::hub::status::count;
use crate::hub::wire::message_members;
use crate::hub::{Message, Step, Topic, Topics};
use crate::units::Clock;

/// Messages written before the socket is flushed.
const AT_ONCE: usize = 256;
/// A client that takes nothing for this long is gone.
const WRITE_PATIENCE: Duration = Duration::from_secs(60);
/// The answer to a client that goes is written within this time.
const CLOSE_PATIENCE: Duration = Duration::from_secs(5);
/// A ping goes out after this much silence.
const PING_EVERY: Duration = Duration::from_secs(20);
/// A client sends nothing but pongs; larger messages end the connection.
const CLIENT_MESSAGE_OCTETS_MAX: usize = 4 << 10;

/// From where, and what.
#[derive(Debug, Clone, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct Wish {
    /// `now` (the default), a clock (seconds or RFC 3339): history from there on first, or `seq:N`: what came after message N.
    pub from: Option<String>,
    /// Topics with commas between: window (the default), raw, calibration, event, anomaly, diagnosis.
    pub topics: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum From {
    Now,
    Clock(Clock),
    Seq(u64),
}

/// Live messages over a WebSocket.
#[utoipa::path(get, path = "/accel/live", tag = "acceleration", params(Wish),
    responses(
        (status = 101, description = "one JSON object a message: seq, prev, type (hello, lag, window, supersede, window_withdrawn, gap, raw, \
            calibration, event, anomaly, anomaly_withdrawn, diagnosis), and the members of that type. window_withdrawn has the start of a \
            window that there is no longer, for its frames have lost their places to others, and the revision told; anomaly_withdrawn has those of the anomaly that more data take \
            back, so that what was told and not withdrawn is what /anomalies gives; diagnosis has those of /diagnosis, of its looks the last alone"),
        (status = 426, description = "the request is none for a WebSocket")))]
pub async fn live(
    State(app): State<Arc<App>>,
    Asked(wish): Asked<Wish>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    let words = wish.topics.as_deref().unwrap_or("window");
    let topics = Topics::from_words(words).ok().filter(|topics| *topics != Topics::NONE).ok_or_else(|| {
        let known = Topic::ALL.map(Topic::word).join(", ");
        Problem::bad_request(format!("topics is {words:?}; one or more of {known}, with commas between"))
    })?;
    let from = match wish.from.as_deref() {
        None | Some("now" | "") => From::Now,
        Some(text) => match text.strip_prefix("seq:") {
            Some(seq) => From::Seq(
                seq.parse().map_err(|_| Problem::bad_request(format!("from is {text:?}; seq:N has a whole number")))?,
            ),
            None => From::Clock(clock(&app.mission, "from", text)?),
        },
    };
    let head = app.hub.head_seq();
    if let From::Seq(seq) = from
        && seq > head
    {
        return Err(Problem::bad_request(format!("from is seq:{seq}; the last message so far is {head}")));
    }
    let upgrade = match upgrade {
        Ok(upgrade) => upgrade,
        Err(rejection) => return Ok(no_upgrade(&headers, &rejection)),
    };
    let permit = app.live_permits.clone().try_acquire_owned().map_err(|_| {
        Problem::new(
            StatusCode::SERVICE_UNAVAILABLE,
            "as many WebSocket clients as are allowed (http.live_clients_max) are connected",
        )
    })?;
    Ok(upgrade.max_message_size(CLIENT_MESSAGE_OCTETS_MAX).on_upgrade(move |socket| async move {
        let counters = &app.board.counters;
        count(&counters.live_clients, 1);
        let _ = serve(&app, socket, from, topics).await;
        counters.live_clients.fetch_sub(1, std::sync::atomic::Ordering::Relaxed);
        drop(permit);
    }))
}

/// A request that asks for no WebSocket needs one; one that asks wrongly is a bad one.
fn no_upgrade(headers: &HeaderMap, rejection: &WebSocketUpgradeRejection) -> Response {
    if headers.contains_key(UPGRADE) {
        return Problem::bad_request(rejection.to_string()).into_response();
    }
    let detail = "this address speaks WebSocket alone; /accel and /accel/history answer plain requests";
    let mut response = Problem::new(StatusCode::UPGRADE_REQUIRED, detail).into_response();
    response.headers_mut().insert(UPGRADE, HeaderValue::from_static("websocket"));
    response.headers_mut().insert(CONNECTION, HeaderValue::from_static("Upgrade"));
    response
}

/// The client is gone, or took nothing for too long.
struct Gone;

struct Client<'a> {
    app: &'a App,
    socket: SplitSink<WebSocket, Frame>,
    topics: Topics,
    /// Number of the last message sent on its topics.
    prev: u64,
}

async fn serve(app: &Arc<App>, socket: WebSocket, from: From, topics: Topics) -> Result<(), Gone> {
    let (sink, mut incoming) = socket.split();
    let history = match from {
        From::Clock(clock) => Some(app.hub.known_from(clock, topics)),
        From::Now | From::Seq(_) => None,
    };
    let after = match (from, &history) {
        (From::Seq(seq), _) => seq,
        (_, Some(history)) => history.after(),
        (_, None) => app.hub.head_seq(),
    };
    let prev = match from {
        From::Now | From::Seq(_) => app.hub.last_seq_on(topics, after),
        From::Clock(_) => 0,
    };
    let mut client = Client { app, socket: sink, topics, prev };
    client.hello(from, after).await?;
    if let Some(mut history) = history {
        loop {
            let messages = off_the_runtime(topics, || history.next(AT_ONCE));
            if messages.is_empty() {
                break;
            }
            client.send(&messages).await?;
            client.hear_what_is_there(&mut incoming).await?;
        }
    }
    let mut reader = app.hub.reader(topics, after, Some(app.live_behind_max));
    let mut ping = tokio::time::interval(PING_EVERY);
    loop {
        match off_the_runtime(topics, || reader.next(AT_ONCE)) {
            Some(Step::Messages(messages)) => {
                client.send(&messages).await?;
                client.hear_what_is_there(&mut incoming).await?;
            }
            Some(Step::Lag { from_seq, to_seq, count }) => client.lag(from_seq, to_seq, count).await?,
            None => tokio::select! {
                there = reader.wait() => if !there { return client.close().await },
                frame = incoming.next() => client.hear(frame).await?,
                _ = ping.tick() => client.write([Frame::Ping(Bytes::new())]).await?,
                () = app.closing.cancelled() => return client.close().await,
            },
        }
    }
}

/// Raw samples come out of the station, which the writer may hold: other tasks must not wait with this one.
fn off_the_runtime<T>(topics: Topics, read: impl FnOnce() -> T) -> T {
    if topics.has(Topic::Raw) { tokio::task::block_in_place(read) } else { read() }
}

/// Why a connection ends of which nothing more can be understood, from what the reader of its frames says.
fn fault_code(sentence: &str) -> u16 {
    match sentence {
        long if long.contains("too long") || long.contains("too big") => close_code::SIZE,
        text if text.to_ascii_lowercase().contains("utf-8") => close_code::INVALID,
        _ => close_code::PROTOCOL,
    }
}

impl Client<'_> {
    /// Takes what a client says: nothing but that it goes is of interest, and that is answered.
    async fn hear(&mut self, frame: Option<Result<Frame, axum::Error>>) -> Result<(), Gone> {
        match frame {
            Some(Ok(Frame::Close(_))) => {
                let _ = tokio::time::timeout(CLOSE_PATIENCE, self.socket.close()).await;
                Err(Gone)
            }
            Some(Ok(_)) => Ok(()),
            Some(Err(error)) => {
                let code = fault_code(&error.to_string());
                let farewell = Frame::Close(Some(CloseFrame { code, reason: Utf8Bytes::default() }));
                let _ = tokio::time::timeout(CLOSE_PATIENCE, self.socket.send(farewell)).await;
                Err(Gone)
            }
            None => Err(Gone),
        }
    }

    /// Takes what the client has said while it was written to, without waiting for more.
    async fn hear_what_is_there(&mut self, incoming: &mut SplitStream<WebSocket>) -> Result<(), Gone> {
        while let Some(frame) = incoming.next().now_or_never() {
            self.hear(frame).await?;
        }
        Ok(())
    }

    async fn hello(&mut self, from: From, after: u64) -> Result<(), Gone> {
        let from = match from {
            From::Now => "now".into(),
            From::Clock(clock) => format!("{}", clock.seconds()),
            From::Seq(seq) => format!("seq:{seq}"),
        };
        let hello = serde_json::json!({
            "seq": self.prev,
            "prev": self.prev,
            "type": "hello",
            "mission": self.app.hub.mission(),
            "spacecraft_id": self.app.hub.spacecraft_id(),
            "frame": "orbiter_body",
            "from": from,
            "live_after_seq": after,
            "topics": self.topics.iter().map(Topic::word).collect::<Vec<_>>(),
        });
        self.write([Frame::Text(hello.to_string().into())]).await
    }

    async fn lag(&mut self, from_seq: u64, to_seq: u64, missed: u64) -> Result<(), Gone> {
        count(&self.app.board.counters.live_lagged, missed);
        let prev = std::mem::replace(&mut self.prev, to_seq);
        let text = format!(
            r#"{{"seq":{to_seq},"prev":{prev},"type":"lag","from_seq":{from_seq},"to_seq":{to_seq},"count":{missed}}}"#
        );
        self.write([Frame::Text(text.into())]).await
    }

    async fn send(&mut self, messages: &[Arc<Message>]) -> Result<(), Gone> {
        let app = self.app;
        let prev = &mut self.prev;
        let frames: Vec<Frame> = messages
            .iter()
            .map(|message| {
                let text = whole_text(app, message, *prev);
                *prev = message.seq;
                Frame::Text(text)
            })
            .collect();
        self.write(frames).await?;
        count(&self.app.board.counters.live_delivered, messages.len() as u64);
        Ok(())
    }

    /// Writes frames and flushes once.
    async fn write(&mut self, frames: impl IntoIterator<Item = Frame>) -> Result<(), Gone> {
        let written = tokio::time::timeout(WRITE_PATIENCE, async {
            for frame in frames {
                self.socket.feed(frame).await?;
            }
            self.socket.flush().await
        });
        match written.await {
            Ok(Ok(())) => Ok(()),
            _ => Err(Gone),
        }
    }

    async fn close(&mut self) -> Result<(), Gone> {
        let reason = CloseFrame { code: close_code::AWAY, reason: Utf8Bytes::from_static("the service is ending") };
        self.write([Frame::Close(Some(reason))]).await
    }
}

/// The text of a message for a reader; readers of the same topics share one.
fn whole_text(app: &App, message: &Message, prev: u64) -> Utf8Bytes {
    let members = || String::from_utf8_lossy(message_members(&app.mission, message));
    let make = || format!(r#"{{"seq":{},"prev":{prev},{}}}"#, message.seq, members());
    let (shared_prev, shared) = message.whole.get_or_init(|| (prev, Bytes::from(make())));
    if *shared_prev != prev {
        return make().into();
    }
    Utf8Bytes::try_from(shared.clone()).unwrap_or_default()
}
