//! Which parameters a route has. Any other is refused: a filter with a letter wrong would otherwise be none, and its answer be taken
//! for what was asked.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use axum::extract::{Query, Request, State};
use axum::http::{Method, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use utoipa::openapi::path::ParameterIn;
use utoipa::openapi::{OpenApi, RefOr};

use super::problem::Problem;

/// The parameter that every route has: see `guard`.
pub(super) const TOKEN: &str = "access_token";

/// The names of the parameters of every route, as they are described.
pub struct Parameters(BTreeMap<String, Vec<String>>);

impl Parameters {
    /// Those that a description has.
    pub fn of(openapi: &OpenApi) -> Self {
        let names = |item: &utoipa::openapi::PathItem| {
            let described = item.get.iter().flat_map(|get| get.parameters.iter().flatten());
            let in_query = described.filter_map(|parameter| match parameter {
                RefOr::T(parameter) if parameter.parameter_in == ParameterIn::Query => Some(parameter.name.clone()),
                _ => None,
            });
            in_query.collect()
        };
        let mut routes: BTreeMap<_, _> =
            openapi.paths.paths.iter().map(|(path, item)| (path.clone(), names(item))).collect();
        routes.insert("/openapi.json".into(), Vec::new());
        Self(routes)
    }

    /// What is wrong with the parameters of a request, whatever their values.
    fn fault(&self, uri: &Uri) -> Option<String> {
        let (path, known) = self.0.get_key_value(uri.path())?;
        let Ok(Query(given)) = Query::<Vec<(String, String)>>::try_from_uri(uri) else {
            return Some("the query is not made of name=value".into());
        };
        let mut seen = BTreeSet::new();
        for (name, _) in given.iter().filter(|(name, _)| name != TOKEN) {
            if !known.contains(name) {
                return Some(format!("`{name}` is no parameter of {path}, {}", listed(known)));
            }
            if !seen.insert(name) {
                return Some(format!("`{name}` is given more than once, and one value is all that {path} can go by"));
            }
        }
        None
    }
}

fn listed(known: &[String]) -> String {
    match known {
        [] => "which has none".into(),
        [one] => format!("which has `{one}` alone"),
        several => format!("which has `{}`", several.join("`, `")),
    }
}

/// Turns away what has other parameters than its route, or one of them twice.
pub async fn check(State(parameters): State<Arc<Parameters>>, request: Request, next: Next) -> Response {
    let asks = matches!(*request.method(), Method::GET | Method::HEAD);
    match parameters.fault(request.uri()).filter(|_| asks) {
        Some(fault) => Problem::bad_request(fault).into_response(),
        None => next.run(request).await,
    }
}
