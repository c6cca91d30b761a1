//! `/status`, health, readiness, metrics.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use metrics::{counter, gauge};
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle, PrometheusRecorder};
use serde::Serialize;
use utoipa::ToSchema;

use super::App;
use super::problem::Problem;
use crate::diagnose::live::{Report, State as Progress};
use crate::hub::status::{Phase, counted};

/// What the service says of itself. Every figure of `ingest` is of what is durable.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Status {
    /// `replaying`, `running`, `stuck` or `draining`.
    pub phase: &'static str,
    /// Why it is stuck; or why nothing is recorded, where the rest goes on.
    pub trouble: Option<String>,
    /// Version of the program.
    pub version: &'static str,
    /// Mission in every key.
    pub mission: String,
    /// Spacecraft in every key.
    pub spacecraft_id: u16,
    /// Time since the start, s.
    pub uptime_s: f64,
    /// The dump port.
    pub ingest: IngestStatus,
    /// The products.
    pub accel: AccelStatus,
    /// The WebSocket.
    pub live: LiveStatus,
    /// The running diagnosis; null where none runs.
    pub diagnosis: Option<DiagnosisStatus>,
}

/// The running diagnosis, in short.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct DiagnosisStatus {
    /// `collecting`, `searching`, `current`, `refused` or `failed`.
    pub state: &'static str,
    /// One or two sentences for an operator.
    pub sentence: String,
    /// `consistent`, `explained`, `ambiguous` or `unexplained`; null while there is no answer.
    pub verdict: Option<&'static str>,
    /// Last window of the look that raised the alarm that stands, clock s.
    pub alarm_clock_s: Option<f64>,
    /// The name that stands; empty where there is none.
    pub name: Vec<String>,
}

impl DiagnosisStatus {
    fn of(report: &Report) -> Self {
        let progress = &report.progress;
        Self {
            state: progress.state.word(),
            sentence: progress.sentence.clone(),
            verdict: report.answer.as_ref().map(|answer| answer.verdict.word()),
            alarm_clock_s: progress.milestones.alarm_clock_s,
            name: progress.milestones.name.clone(),
        }
    }
}

/// The dump port and the raw log.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct IngestStatus {
    /// Frames in the raw log: new + repeated + refused.
    pub frames_durable: u64,
    /// Good frames, each once.
    pub frames_new: u64,
    /// Good frames seen before.
    pub frames_repeated: u64,
    /// Frames refused, by reason.
    pub frames_refused: BTreeMap<&'static str, u64>,
    /// Frames of one identity that check and differ.
    pub frame_conflicts: u64,
    /// Packets read, by the name of their APID.
    pub packets: BTreeMap<&'static str, u64>,
    /// Packets refused, by reason.
    pub packets_refused: BTreeMap<&'static str, u64>,
    /// Distinct seconds with a science record.
    pub seconds_covered: u64,
    /// Gaps between them.
    pub gaps: usize,
    /// End of the last second received, clock s.
    pub latest_clock_s: Option<f64>,
    /// Start of that second: what is answered now is answered again `as_of` this clock.
    pub as_of_clock_s: Option<f64>,
    /// Bits of the playbacks that are over.
    pub bits_in: u64,
    /// Playbacks begun.
    pub playbacks: u64,
    /// Playbacks not over yet.
    pub playbacks_open: u64,
    /// Octets read from senders since the start, durable or not.
    pub octets_in: u64,
    /// Connections open.
    pub connections_open: u64,
}

/// The products.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct AccelStatus {
    /// Windows known.
    pub windows: usize,
    /// Version of the calibration in use; 0: none.
    pub calibration: u32,
    /// Events known.
    pub events: u64,
    /// Anomalies known.
    pub anomalies: u64,
    /// Everything durable is in the products: no window waits for its other half, no calibration for its turn.
    pub settled: bool,
}

/// The WebSocket.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct LiveStatus {
    /// Number of the last message.
    pub head_seq: u64,
    /// Clients connected.
    pub clients: u64,
    /// Messages delivered since the start.
    pub delivered: u64,
    /// Messages that slow clients were told they missed.
    pub lagged: u64,
}

fn phase_word(phase: &Phase) -> &'static str {
    match phase {
        Phase::Replaying => "replaying",
        Phase::Running => "running",
        Phase::Stuck(_) => "stuck",
        Phase::Draining => "draining",
    }
}

/// What the service says of itself.
#[utoipa::path(get, path = "/status", tag = "service", responses((status = 200, description = "the ledger and the state of the service", body = Status)))]
pub async fn status(State(app): State<Arc<App>>) -> Json<Status> {
    let picture = app.board.picture();
    let counters = &app.board.counters;
    let phase = app.board.phase();
    Json(Status {
        phase: phase_word(&phase),
        trouble: if let Phase::Stuck(sentence) = &phase {
            Some(sentence.clone())
        } else {
            app.board.recording_trouble()
        },
        version: env!("CARGO_PKG_VERSION"),
        mission: app.hub.mission().into(),
        spacecraft_id: app.hub.spacecraft_id(),
        uptime_s: (app.started.elapsed().as_secs_f64() * 1000.0).round() / 1000.0,
        ingest: IngestStatus {
            frames_durable: picture.frames_durable,
            frames_new: picture.frames_new,
            frames_repeated: picture.frames_repeated,
            frames_refused: picture.frames_refused.clone(),
            frame_conflicts: picture.frame_conflicts,
            packets: picture.packets.clone(),
            packets_refused: picture.packets_refused.clone(),
            seconds_covered: picture.seconds_covered,
            gaps: picture.gaps.len(),
            latest_clock_s: picture.latest_clock_s,
            as_of_clock_s: picture.latest_clock_s.map(|end_s| end_s - 1.0),
            bits_in: picture.bits_in,
            playbacks: picture.playbacks,
            playbacks_open: picture.playbacks_open,
            octets_in: counted(&counters.octets_in),
            connections_open: counted(&counters.connections_open),
        },
        accel: AccelStatus {
            windows: app.hub.windows(),
            calibration: picture.calibration,
            events: picture.events,
            anomalies: picture.anomalies,
            settled: picture.settled,
        },
        live: LiveStatus {
            head_seq: app.hub.head_seq(),
            clients: counted(&counters.live_clients),
            delivered: counted(&counters.live_delivered),
            lagged: counted(&counters.live_lagged),
        },
        diagnosis: app.desk.report(&app.hub).map(|report| DiagnosisStatus::of(&report)),
    })
}

/// Whether the process answers.
#[utoipa::path(get, path = "/healthz", tag = "service", responses((status = 200, description = "it does", body = String)))]
pub async fn healthz() -> &'static str {
    "ok\n"
}

/// Whether frames are being taken.
#[utoipa::path(get, path = "/readyz", tag = "service",
    responses((status = 200, description = "they are", body = String), (status = 503, description = "they are not, and why")))]
pub async fn readyz(State(app): State<Arc<App>>) -> Response {
    let not_ready = match app.board.phase() {
        Phase::Running => return "ready\n".into_response(),
        Phase::Replaying => "the raw log is being read again".to_string(),
        Phase::Draining => "the service is ending".to_string(),
        Phase::Stuck(sentence) => format!("nothing is taken: {sentence}"),
    };
    Problem::new(StatusCode::SERVICE_UNAVAILABLE, not_ready).into_response()
}

/// The figures of this service in the Prometheus text format.
#[utoipa::path(get, path = "/metrics", tag = "service", responses((status = 200, description = "text format 0.0.4", body = String)))]
pub async fn metrics_text(State(app): State<Arc<App>>) -> Response {
    let text = app.metrics.render(&app);
    ([("content-type", "text/plain; version=0.0.4")], text).into_response()
}

/// The metrics of one service; nothing global, so that several can live in one process.
pub struct Metrics {
    recorder: PrometheusRecorder,
    handle: PrometheusHandle,
}

impl Default for Metrics {
    fn default() -> Self {
        let recorder = PrometheusBuilder::new().build_recorder();
        let handle = recorder.handle();
        Self { recorder, handle }
    }
}

impl Metrics {
    /// Counts an answer.
    pub fn count_response(&self, status: StatusCode) {
        metrics::with_local_recorder(&self.recorder, || {
            counter!("oare_http_responses_total", "status" => status.as_str().to_string()).increment(1);
        });
    }

    fn render(&self, app: &App) -> String {
        metrics::with_local_recorder(&self.recorder, || note(app));
        self.handle.render()
    }
}

fn note(app: &App) {
    let picture = app.board.picture();
    let counters = &app.board.counters;
    counter!("oare_frames_durable_total").absolute(picture.frames_durable);
    counter!("oare_frames_new_total").absolute(picture.frames_new);
    counter!("oare_frames_repeated_total").absolute(picture.frames_repeated);
    for (reason, n) in &picture.frames_refused {
        counter!("oare_frames_refused_total", "reason" => *reason).absolute(*n);
    }
    for (name, n) in &picture.packets {
        counter!("oare_packets_total", "apid" => *name).absolute(*n);
    }
    for (reason, n) in &picture.packets_refused {
        counter!("oare_packets_refused_total", "reason" => *reason).absolute(*n);
    }
    counter!("oare_octets_in_total").absolute(counted(&counters.octets_in));
    counter!("oare_connections_total").absolute(counted(&counters.connections));
    counter!("oare_connections_refused_total").absolute(counted(&counters.connections_refused));
    counter!("oare_connections_idle_total").absolute(counted(&counters.connections_idle));
    counter!("oare_batches_total").absolute(counted(&counters.batches));
    counter!("oare_store_faults_total").absolute(counted(&counters.store_faults));
    counter!("oare_recording_faults_total").absolute(counted(&counters.recording_faults));
    counter!("oare_live_delivered_total").absolute(counted(&counters.live_delivered));
    counter!("oare_live_lagged_total").absolute(counted(&counters.live_lagged));
    counter!("oare_recorded_total").absolute(counted(&counters.recorded));
    gauge!("oare_connections_open").set(counted(&counters.connections_open) as f64);
    gauge!("oare_live_clients").set(counted(&counters.live_clients) as f64);
    gauge!("oare_seconds_covered").set(picture.seconds_covered as f64);
    gauge!("oare_gaps").set(picture.gaps.len() as f64);
    gauge!("oare_windows").set(app.hub.windows() as f64);
    gauge!("oare_calibration_version").set(f64::from(picture.calibration));
    gauge!("oare_anomalies").set(picture.anomalies as f64);
    gauge!("oare_head_seq").set(app.hub.head_seq() as f64);
    gauge!("oare_ready").set(f64::from(u8::from(app.board.phase() == Phase::Running)));
    gauge!("oare_uptime_seconds").set(app.started.elapsed().as_secs_f64());
    if let Some(report) = app.desk.report(&app.hub) {
        note_diagnosis(&report);
    }
}

/// A time that nothing gave, or that was taken back, is no number.
fn note_diagnosis(report: &Report) {
    let progress = &report.progress;
    counter!("oare_diagnosis_searches_total").absolute(progress.milestones.searches);
    counter!("oare_diagnosis_searches_failed_total").absolute(progress.milestones.searches_failed);
    counter!("oare_diagnosis_alarms_withdrawn_total").absolute(progress.milestones.alarms_withdrawn);
    for state in Progress::ALL {
        let is_here = f64::from(u8::from(progress.state == state));
        gauge!("oare_diagnosis_state", "state" => state.word()).set(is_here);
    }
    gauge!("oare_diagnosis_searching").set(f64::from(u8::from(progress.state == Progress::Searching)));
    gauge!("oare_diagnosis_windows_seen").set(progress.windows_seen as f64);
    gauge!("oare_diagnosis_windows_beyond").set(progress.windows_beyond as f64);
    gauge!("oare_diagnosis_windows_searched").set(progress.windows_searched as f64);
    gauge!("oare_diagnosis_alarm").set(f64::from(u8::from(progress.milestones.alarm_clock_s.is_some())));
    gauge!("oare_diagnosis_time_to_detect_seconds").set(progress.time_to_detect_s.unwrap_or(f64::NAN));
    gauge!("oare_diagnosis_time_to_name_seconds").set(progress.time_to_name_s.unwrap_or(f64::NAN));
}
