//! The dashboard at `/`: one page, its script and one plotting library, all inside the program. No build step, no other network.

use axum::Router;
use axum::http::HeaderValue;
use axum::http::header::{CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use axum::routing::get;

const PAGE: &str = include_str!("index.html");
const SCRIPT: &str = include_str!("dashboard.js");
const STYLE: &str = include_str!("dashboard.css");
const UPLOT_SCRIPT: &str = include_str!("vendor/uPlot.iife.min.js");
const UPLOT_STYLE: &str = include_str!("vendor/uPlot.min.css");

/// Nothing but this origin, whatever the page says.
const POLICY: &str =
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; img-src 'self' data:";

/// The page and its parts.
pub fn routes() -> Router {
    Router::new()
        .route("/", get(|| async { part("text/html; charset=utf-8", PAGE) }))
        .route("/dashboard/dashboard.js", get(|| async { part("text/javascript; charset=utf-8", SCRIPT) }))
        .route("/dashboard/dashboard.css", get(|| async { part("text/css; charset=utf-8", STYLE) }))
        .route("/dashboard/uPlot.iife.min.js", get(|| async { part("text/javascript; charset=utf-8", UPLOT_SCRIPT) }))
        .route("/dashboard/uPlot.min.css", get(|| async { part("text/css; charset=utf-8", UPLOT_STYLE) }))
}

fn part(kind: &'static str, text: &'static str) -> Response {
    let mut response = text.into_response();
    let headers = response.headers_mut();
    headers.insert(CONTENT_TYPE, HeaderValue::from_static(kind));
    headers.insert(CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    response
}
