//! HTTP and WebSocket: routes, live messages, wire types, errors, the dashboard.
//!
//! Handlers read what the hub and the board hold; none of them waits for the writer but those in `records`, which do so off
//! the runtime's threads.

mod accel;
mod dashboard;
mod guard;
mod live;
mod parameters;
mod problem;
mod query;
mod records;
mod status;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use axum::http::{Method, StatusCode, Uri};
use axum::routing::get;
use axum::{Json, Router, middleware};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use utoipa::openapi::path::Operation;
use utoipa::openapi::{Content, InfoBuilder, OpenApi, OpenApiBuilder, Response};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::hub::Hub;
use crate::hub::desk::Desk;
use crate::hub::status::Board;
use crate::ingest::writer::SharedStation;
use crate::units::MissionTime;
use parameters::Parameters;
use problem::Problem;
pub use status::Metrics;

/// What handlers share.
pub struct App {
    /// The products.
    pub hub: Arc<Hub>,
    /// What the service says of itself.
    pub board: Arc<Board>,
    /// The running diagnosis.
    pub desk: Arc<Desk>,
    /// The pipeline, for questions about the past.
    pub station: SharedStation,
    /// The mission's times.
    pub mission: MissionTime,
    /// When the service started.
    pub started: Instant,
    /// The bearer token, if one is needed.
    pub token: Option<String>,
    /// A permit per WebSocket client.
    pub live_permits: Arc<Semaphore>,
    /// A WebSocket client further behind than this many messages is told what it missed.
    pub live_behind_max: u64,
    /// Where a diagnosis may lie.
    pub data_dir: PathBuf,
    /// Cancelled when WebSocket clients must go.
    pub closing: CancellationToken,
    /// The metrics.
    pub metrics: Metrics,
}

/// Every route.
pub fn router(app: Arc<App>) -> Router {
    let (router, openapi) = documented().with_state(app.clone()).split_for_parts();
    let openapi = Arc::new(described(openapi));
    let parameters = Arc::new(Parameters::of(&openapi));
    router
        .route("/openapi.json", get(move || async move { Json(OpenApi::clone(&openapi)) }))
        .merge(dashboard::routes())
        .fallback(|uri: Uri| async move { Problem::not_found(format!("there is nothing at {}", uri.path())) })
        .method_not_allowed_fallback(|method: Method, uri: Uri| async move {
            let detail = format!("{} does not take {method}; GET", uri.path());
            Problem::new(StatusCode::METHOD_NOT_ALLOWED, detail)
        })
        .layer(middleware::from_fn_with_state(parameters, parameters::check))
        .layer(middleware::from_fn_with_state(app, guard::guard))
}

fn documented() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new()
        .routes(routes!(accel::accel))
        .routes(routes!(accel::history))
        .routes(routes!(live::live))
        .routes(routes!(records::calibration))
        .routes(routes!(records::calibration_history))
        .routes(routes!(records::gaps))
        .routes(routes!(records::playbacks))
        .routes(routes!(records::events))
        .routes(routes!(records::anomalies))
        .routes(routes!(records::diagnosis))
        .routes(routes!(status::status))
        .routes(routes!(status::healthz))
        .routes(routes!(status::readyz))
        .routes(routes!(status::metrics_text))
}

fn described(openapi: OpenApi) -> OpenApi {
    let info = InfoBuilder::new()
        .title("oare-ground")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some("Quasi-steady acceleration of the Orbiter in body axes, from OARE telemetry"));
    let builder: OpenApiBuilder = openapi.into();
    let mut openapi = builder.info(info.build()).build();
    for (path, item) in &mut openapi.paths.paths {
        if let Some(operation) = &mut item.get {
            describe_problems(path, operation);
        }
    }
    openapi
}

/// The problems that any route of its kind may answer with.
fn describe_problems(path: &str, operation: &mut Operation) {
    let problems = [
        ("400", "a parameter makes no sense, is given twice, or is none of this route", true),
        ("401", "the service has a token, and the request does not", !guard::OPEN_PATHS.contains(&path)),
        ("414", "path and query are too long", true),
    ];
    for (status, description, _) in problems.into_iter().filter(|(_, _, may)| *may) {
        let problem = Response::builder().description(description).content(problem::MEDIA_TYPE, Content::default());
        operation.responses.responses.entry(status.to_owned()).or_insert_with(|| problem.build().into());
    }
}
