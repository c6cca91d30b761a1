//! Errors as RFC 9457 problem documents.

use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use problem_details::ProblemDetails;
use utoipa::ToSchema;

/// The media type of a problem document.
pub const MEDIA_TYPE: &str = "application/problem+json";

/// A problem document (RFC 9457), as it is described.
#[derive(ToSchema)]
#[expect(dead_code, reason = "a description: `problem_details` writes the document")]
pub struct Document {
    /// Short, the same for every problem of the status.
    title: String,
    /// The HTTP status.
    status: u16,
    /// What is wrong with this request, with its value and place.
    detail: String,
}

/// What a handler answers when it cannot answer.
#[derive(Debug)]
pub struct Problem {
    status: StatusCode,
    detail: String,
}

impl Problem {
    /// A problem of a status, in one sentence.
    pub fn new(status: StatusCode, detail: impl Into<String>) -> Self {
        Self { status, detail: detail.into() }
    }

    /// The request cannot be understood.
    pub fn bad_request(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, detail)
    }

    /// There is no such thing, or not yet.
    pub fn not_found(detail: impl Into<String>) -> Self {
        Self::new(StatusCode::NOT_FOUND, detail)
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        ProblemDetails::from_status_code(self.status).with_detail(self.detail).into_response()
    }
}
