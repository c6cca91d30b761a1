//! Calibration, gaps, playbacks, events, anomalies, diagnosis: what is asked now and then. The station answers, off the
//! runtime's own threads, because the writer may hold it for as long as a batch takes.

use std::sync::Arc;

use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::{IntoParams, ToSchema};

use super::App;
use super::problem::Problem;
use super::query::{Asked, optional_clock};
use crate::diagnose::answer::Diagnosis;
use crate::diagnose::live::Progress;
use crate::hub::wire::{AnomalyWire, EventWire, Gap};
use crate::pipeline::Station;
use crate::pipeline::files::{known_json, ledger_json, version_json};

/// When it was known.
#[derive(Debug, Clone, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct AsOf {
    /// The answer that was known at this instrument clock: clock seconds or RFC 3339.
    pub as_of: Option<String>,
}

/// Asks the station on a thread that may wait.
pub(super) async fn ask<T: Send + 'static>(app: &Arc<App>, question: impl FnOnce(&Station) -> T + Send + 'static) -> T {
    let station = app.station.clone();
    let asked = tokio::task::spawn_blocking(move || question(&station.read().expect("no holder panics")));
    asked.await.expect("a question does not panic")
}

/// The calibration in use, or the one known at `as_of`.
#[utoipa::path(get, path = "/calibration", tag = "calibration", params(AsOf),
    responses((status = 200, description = "one version of the calibration, with the ranges that were corrected as of then", body = Object),
        (status = 404, description = "none was known")))]
pub async fn calibration(State(app): State<Arc<App>>, Asked(query): Asked<AsOf>) -> Result<Json<Value>, Problem> {
    let as_of = optional_clock(&app.mission, "as_of", query.as_of.as_deref())?;
    let found = ask(&app, move |station| known_json(station, as_of)).await;
    found.map(Json).ok_or_else(|| Problem::not_found("no calibration is known, or was known then"))
}

/// Every version of the calibration, in the order in which they became known.
#[utoipa::path(get, path = "/calibration/history", tag = "calibration", params(AsOf),
    responses((status = 200, description = "versions of the calibration", body = Object)))]
pub async fn calibration_history(
    State(app): State<Arc<App>>,
    Asked(query): Asked<AsOf>,
) -> Result<Json<Value>, Problem> {
    let as_of = optional_clock(&app.mission, "as_of", query.as_of.as_deref())?;
    let versions = ask(&app, move |station| {
        let known =
            station.derived().timeline.iter().filter(|version| as_of.is_none_or(|at| version.known_since <= at));
        known.map(version_json).collect::<Vec<_>>()
    })
    .await;
    Ok(Json(json!({ "versions": versions })))
}

/// A list of gaps.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Gaps {
    /// Distinct seconds with a science record.
    pub seconds_covered: u64,
    /// In order of time.
    pub gaps: Vec<Gap>,
}

/// Spans between the first and the last second received that are not covered.
#[utoipa::path(get, path = "/gaps", tag = "telemetry", responses((status = 200, description = "seconds that came, and spans that did not", body = Gaps)))]
pub async fn gaps(State(app): State<Arc<App>>) -> Json<Gaps> {
    let picture = app.board.picture();
    let gaps = picture.gaps.iter().map(|(from, to)| Gap::new(&app.mission, *from, *to)).collect();
    Json(Gaps { seconds_covered: picture.seconds_covered, gaps })
}

/// The ledger: every bit, frame and packet accounted for, in total and by playback.
#[utoipa::path(get, path = "/playbacks", tag = "telemetry",
    responses((status = 200, description = "as ledger.json, each playback with the span it covers", body = Object)))]
pub async fn playbacks(State(app): State<Arc<App>>) -> Json<Value> {
    let ledger = ask(&app, |station| {
        let mut ledger = ledger_json(station);
        let accounts = station.ledger().playbacks();
        if let Some(list) = ledger.get_mut("playbacks").and_then(Value::as_array_mut) {
            for (entry, (id, account)) in list.iter_mut().zip(accounts) {
                entry["playback"] = json!(id.0);
                entry["open"] = json!(!account.closed);
                entry["from_clock_s"] = json!(account.seconds.spans().next().map(|(from, _)| from as f64));
                entry["to_clock_s"] = json!(account.seconds.spans().last().map(|(_, to)| to as f64));
            }
        }
        ledger
    });
    Json(ledger.await)
}

/// Events of the instrument, in order.
#[utoipa::path(get, path = "/events", tag = "telemetry", responses((status = 200, description = "in order of time", body = [EventWire])))]
pub async fn events(State(app): State<Arc<App>>) -> Json<Vec<EventWire>> {
    let mission = app.mission;
    Json(ask(&app, move |station| station.events().map(|event| EventWire::new(&mission, event)).collect()).await)
}

/// What the ground found odd, in order of time.
#[utoipa::path(get, path = "/anomalies", tag = "telemetry", responses((status = 200, description = "in order of time", body = [AnomalyWire])))]
pub async fn anomalies(State(app): State<Arc<App>>) -> Json<Vec<AnomalyWire>> {
    let mission = app.mission;
    let told = move |station: &Station| -> Vec<AnomalyWire> {
        station.derived().anomalies.iter().map(|anomaly| AnomalyWire::new(&mission, anomaly)).collect()
    };
    Json(ask(&app, told).await)
}

/// The members of `diagnosis.json`, and of a running diagnosis how far it is.
#[derive(ToSchema)]
#[schema(as = DiagnosisReport)]
#[expect(dead_code, reason = "it describes what the desk tells as it is, and what lies in the data directory")]
struct Told {
    #[serde(flatten)]
    answer: Diagnosis,
    progress: Option<Progress>,
}

/// What the simulation lacks: the running diagnosis with its progress, or, where none runs, the `diagnosis.json` that lies in the
/// data directory.
#[utoipa::path(get, path = "/diagnosis", tag = "diagnosis",
    responses((status = 200, body = Told, description = "as diagnosis.json; of a running diagnosis with its progress"),
        (status = 404, description = "there is none"), (status = 500, description = "the file that lies there is no JSON")))]
pub async fn diagnosis(State(app): State<Arc<App>>) -> Result<Response, Problem> {
    if let Some(report) = app.desk.report(&app.hub) {
        return Ok(Json(&*report).into_response());
    }
    let path = app.data_dir.join("diagnosis.json");
    let text = tokio::fs::read(&path).await.map_err(|_| {
        Problem::not_found(
            "there is no diagnosis: name a simulation in the configuration's [diagnosis], or put one here with `oare diagnose \
             CASE_DIR --out DATA/diagnosis.json`",
        )
    })?;
    serde_json::from_slice::<Value>(&text).map(|value| Json(value).into_response()).map_err(|error| {
        let detail = format!("diagnosis.json in the data directory is no JSON: {error}");
        Problem::new(StatusCode::INTERNAL_SERVER_ERROR, detail)
    })
}
