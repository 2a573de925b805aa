//! Versions in headers: which one an answer has, and which one a change is for.

use axum::Json;
use axum::http::header::{ETAG, IF_MATCH, IF_NONE_MATCH};
use axum::http::{HeaderMap, HeaderName, StatusCode};
use axum::response::{IntoResponse, Response};
use r6_http::Refusal;

use super::refusal::bad_value;
use crate::core::library::Condition;

/// Which version a change is for. Several headers of one name are one list.
///
/// # Errors
/// `bad_value`: a header is no text, or its tags have no quotes.
pub fn condition(headers: &HeaderMap) -> Result<Condition, Refusal> {
    let list = |name: HeaderName| {
        let all = headers.get_all(&name).iter().map(|value| value.to_str());
        let all = all.collect::<Result<Vec<_>, _>>();
        let wanted = "has tags such as \"3-9f86d081884c7d65\", and the quotes belong to the tag";
        let wrong = || bad_value(format!("`{name}` {wanted}"));
        let all = all.map_err(|_| wrong())?;
        // Without this, a tag without quotes would be refused as one of another version.
        if all.iter().any(|list| !list.contains('"') && !list.trim().is_empty() && list.trim() != "*") {
            return Err(wrong());
        }
        Ok((!all.is_empty()).then(|| all.join(",")))
    };
    Ok(Condition { matches: list(IF_MATCH)?, none_matches: list(IF_NONE_MATCH)? })
}

/// An answer of this version.
pub fn with_etag(status: StatusCode, etag: String, body: &impl serde::Serialize) -> Response {
    (status, [(ETAG, etag)], Json(body)).into_response()
}
