//! What every request passes: its size, its token where one is configured, and whose page it is of where none is; and what some pass,
//! whether it can be told yet.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{Query, Request, State};
use axum::http::header::{AUTHORIZATION, CONTENT_LENGTH, HOST, ORIGIN, RETRY_AFTER, WWW_AUTHENTICATE};
use axum::http::uri::Authority;
use axum::http::{HeaderValue, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use sha2::{Digest, Sha256};

use super::App;
use super::problem::Problem;
use crate::hub::status::Phase;

/// No request of this interface has a body; this much is read past and forgiven.
pub const BODY_OCTETS_MAX: usize = 64 << 10;
/// Longest path and query.
const URI_OCTETS_MAX: usize = 8 << 10;
/// Answered without a token: they tell nothing but that the service is there.
pub(super) const OPEN_PATHS: [&str; 2] = ["/healthz", "/readyz"];
/// As well: the script and the style of the page, which a browser asks for without its token and which are the same in every program.
const OPEN_PARTS: &str = "/dashboard/";

/// After so many seconds a client may ask again.
const AGAIN_S: &str = "1";

/// Turns away what is too large or has no token, and counts what is answered.
pub async fn guard(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    let response = match refuse(&app, &request) {
        Some(refusal) => refusal,
        None => next.run(request).await,
    };
    app.metrics.count_response(response.status());
    response
}

fn refuse(app: &App, request: &Request) -> Option<Response> {
    let uri_octets = request.uri().path_and_query().map_or(0, |uri| uri.as_str().len());
    if uri_octets > URI_OCTETS_MAX {
        let detail = format!("the path and query have {uri_octets} octets; {URI_OCTETS_MAX} at most");
        return Some(Problem::new(StatusCode::URI_TOO_LONG, detail).into_response());
    }
    let length = request.headers().get(CONTENT_LENGTH).and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    if let Some(octets) = length.filter(|octets| *octets > BODY_OCTETS_MAX as u64) {
        let detail = format!("the body has {octets} octets; {BODY_OCTETS_MAX} at most");
        return Some(Problem::new(StatusCode::PAYLOAD_TOO_LARGE, detail).into_response());
    }
    refuse_token(app, request).or_else(|| refuse_foreign_page(app, request))
}

/// Where no token protects the service, its being on the loopback does; but a browser on this machine would let a page of any site in, and
/// one of a site whose name leads here by its own host.
fn refuse_foreign_page(app: &App, request: &Request) -> Option<Response> {
    if app.token.is_some() {
        return None;
    }
    let of = |name| request.headers().get(name).and_then(|value| value.to_str().ok());
    let detail = if let Some(host) = of(HOST).filter(|host| app.loopback_only && !is_here(host)) {
        format!(
            "{host} is not this machine's own name, which a service without a token is asked by: localhost or 127.0.0.1"
        )
    } else {
        let origin = of(ORIGIN)?;
        let of_site = origin.parse::<Uri>().ok().and_then(|uri| uri.scheme().and(uri.authority()).cloned());
        let is_own = |site: &Authority| of(HOST).is_some_and(|host| host.eq_ignore_ascii_case(site.as_str()));
        // A page of no site says `null`: one from a file, and as well a frame in a page of any.
        if of_site.as_ref().is_some_and(|site| is_here(site.as_str()) || is_own(site)) {
            return None;
        }
        format!(
            "a page of {origin} may not read a service that has no token; http.token in its configuration gives it one"
        )
    };
    Some(Problem::new(StatusCode::FORBIDDEN, detail).into_response())
}

/// Whether a host, with or without a port, is this machine by its own name.
fn is_here(host: &str) -> bool {
    let Ok(authority) = host.parse::<Authority>() else { return false };
    let name = authority.host().trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Turns away what is not all there while the raw log is being read again.
pub async fn refuse_while_reading(State(app): State<Arc<App>>, request: Request, next: Next) -> Response {
    if app.board.phase() != Phase::Replaying {
        return next.run(request).await;
    }
    let detail = "the raw log is being read again after a start; what is asked is known when /readyz says so";
    let mut response = Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail).into_response();
    response.headers_mut().insert(RETRY_AFTER, HeaderValue::from_static(AGAIN_S));
    response
}

fn refuse_token(app: &App, request: &Request) -> Option<Response> {
    let token = app.token.as_ref()?;
    let path = request.uri().path();
    let is_open = OPEN_PATHS.contains(&path) || path.starts_with(OPEN_PARTS);
    if is_open || presented(request).iter().any(|found| same(found, token)) {
        return None;
    }
    let detail = "this service needs its token: Authorization: Bearer TOKEN, or ?access_token=TOKEN";
    let mut response = Problem::new(StatusCode::UNAUTHORIZED, detail).into_response();
    response.headers_mut().insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer realm=\"oare\""));
    Some(response)
}

/// The token of a request: in its header, or in its query where a browser cannot set one, there as it stands or percent-encoded.
fn presented(request: &Request) -> Vec<String> {
    if let Some(value) = request.headers().get(AUTHORIZATION) {
        let bearer = value.to_str().ok().and_then(|value| value.split_once(' '));
        let token = bearer.filter(|(scheme, _)| scheme.eq_ignore_ascii_case("bearer"));
        return token.map(|(_, token)| token.trim().to_string()).into_iter().collect();
    }
    let query = request.uri().query().unwrap_or_default();
    let Some(written) = query.split('&').find_map(|pair| pair.strip_prefix("access_token=")) else { return Vec::new() };
    let decoded = Query::<HashMap<String, String>>::try_from_uri(request.uri()).ok();
    let decoded = decoded.and_then(|Query(mut parameters)| parameters.remove("access_token"));
    [Some(written.to_string()), decoded].into_iter().flatten().collect()
}

/// Compares digests, so that the time taken says nothing about the token.
fn same(found: &str, token: &str) -> bool {
    Sha256::digest(found) == Sha256::digest(token)
}
