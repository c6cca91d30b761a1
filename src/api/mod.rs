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

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use axum::http::{Method, StatusCode, Uri};
use axum::routing::get;
use axum::{Json, Router, middleware};
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use utoipa::openapi::path::Operation;
use utoipa::openapi::security::{ApiKey, ApiKeyValue, Http, HttpAuthScheme, SecurityRequirement, SecurityScheme};
use utoipa::openapi::{ContentBuilder, InfoBuilder, OpenApi, OpenApiBuilder, Ref, RefOr, Response};
use utoipa::{PartialSchema, ToSchema};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::hub::Hub;
use crate::hub::desk::Desk;
use crate::hub::status::Board;
use crate::hub::wire;
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
    /// Served to this machine alone.
    pub loopback_only: bool,
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
    let of_the_log = of_the_log();
    let waits_for_the_log: BTreeSet<String> = of_the_log.get_openapi().paths.paths.keys().cloned().collect();
    let of_the_log = of_the_log.route_layer(middleware::from_fn_with_state(app.clone(), guard::refuse_while_reading));
    let (router, openapi) = at_any_time().merge(of_the_log).with_state(app.clone()).split_for_parts();
    let openapi = Arc::new(described(openapi, &waits_for_the_log));
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

/// What the products and the ledger hold: not told while the raw log is being read again, since the answer would be that of a part of
/// it, and no one could see that.
fn of_the_log() -> OpenApiRouter<Arc<App>> {
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
}

/// What is told whatever the service is at.
fn at_any_time() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new()
        .routes(routes!(records::diagnosis))
        .routes(routes!(status::status))
        .routes(routes!(status::healthz))
        .routes(routes!(status::readyz))
        .routes(routes!(status::metrics_text))
}

fn described(openapi: OpenApi, waits_for_the_log: &BTreeSet<String>) -> OpenApi {
    let info = InfoBuilder::new()
        .title("oare-ground")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some("Quasi-steady acceleration of the Orbiter in body axes, from OARE telemetry"));
    let builder: OpenApiBuilder = openapi.into();
    let mut openapi = builder.info(info.build()).build();
    let components = openapi.components.get_or_insert_default();
    components.schemas.insert("Problem".into(), problem::Document::schema());
    // What WebSocket messages hold, beside their own members: no route answers with them.
    let mut of_messages = vec![(wire::Window::name().into(), wire::Window::schema())];
    of_messages.push((wire::RawSecond::name().into(), wire::RawSecond::schema()));
    wire::Window::schemas(&mut of_messages);
    wire::RawSecond::schemas(&mut of_messages);
    of_messages.into_iter().for_each(|(name, schema)| _ = components.schemas.entry(name).or_insert(schema));
    let in_query = ApiKey::Query(ApiKeyValue::new(parameters::TOKEN));
    for (name, scheme) in [
        ("bearer", SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer))),
        ("query", SecurityScheme::ApiKey(in_query)),
    ] {
        components.add_security_scheme(name, scheme);
    }
    for (path, item) in &mut openapi.paths.paths {
        if let Some(operation) = &mut item.get {
            describe_problems(path, operation, waits_for_the_log.contains(path));
        }
    }
    openapi
}

/// The problems that any route of its kind may answer with, and what a problem looks like.
fn describe_problems(path: &str, operation: &mut Operation, waits_for_the_log: bool) {
    let needs_token = !guard::OPEN_PATHS.contains(&path);
    let problems = [
        ("400", "a parameter makes no sense, is given twice, or is none of this route", true),
        ("401", "the service has a token, and the request does not", needs_token),
        ("403", "the service has no token, and the request is of a page of another site", needs_token),
        ("413", "the request has a body, and that is too long", true),
        ("414", "path and query are too long", true),
        (
            "503",
            "not yet: the raw log is being read again, or as many live clients as are allowed are connected",
            waits_for_the_log,
        ),
    ];
    let responses = &mut operation.responses.responses;
    for (status, description, _) in problems.into_iter().filter(|(_, _, may)| *may) {
        responses.entry(status.to_owned()).or_insert_with(|| Response::new(description).into());
    }
    let of_a_problem = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    for (_, response) in responses.iter_mut().filter(|(status, _)| status.as_str() >= "400") {
        if let RefOr::T(response) = response {
            response.content.insert(problem::MEDIA_TYPE.into(), RefOr::T(of_a_problem.clone()));
        }
    }
    if needs_token {
        let none: [&str; 0] = [];
        // Whichever of them, and none where no token is configured.
        let any = [SecurityRequirement::new("bearer", none), SecurityRequirement::new("query", none)];
        operation.security = Some(any.into_iter().chain([SecurityRequirement::default()]).collect());
    }
}
