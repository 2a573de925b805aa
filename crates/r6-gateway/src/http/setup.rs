//! One-time links: the page that a link opens, and what it sends.

use axum::extract::State as Of;
use axum::http::StatusCode;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use axum::response::IntoResponse;
use r6_api::Problem;
use r6_api::gateway::Setup;
use r6_http::Refusal;

use super::body::Json;
use super::caller::Source;
use super::described::OfBody;
use super::{State, refusal};

const PAGE: &str = include_str!("setup/page.html");
const SCRIPT: &str = include_str!("setup/script.js");

/// The page loads its script and speaks with this gateway. Nothing else is allowed to it, and no other page
/// may frame it.
const POLICY: &str = "default-src 'none'; script-src 'self'; connect-src 'self'; base-uri 'none'; \
                      form-action 'none'; frame-ancestors 'none'";

/// The page of a one-time link. The secret of the link is behind the `#` of its address: a browser sends it
/// to no server when it opens the page, and the page takes it out of the address. A link in a mail may open
/// it.
#[utoipa::path(get, path = "/setup", operation_id = "page_of_setup", security(()), responses(
    (status = 200, description = "The page", content_type = "text/html"),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
))]
pub async fn page() -> impl IntoResponse {
    (headers("text/html; charset=utf-8"), PAGE)
}

/// The script of the page.
#[utoipa::path(get, path = "/setup.js", operation_id = "script_of_setup", security(()), responses(
    (status = 200, description = "The script", content_type = "text/javascript"),
    (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
))]
pub async fn script() -> impl IntoResponse {
    (headers("text/javascript; charset=utf-8"), SCRIPT)
}

fn headers(content_type: &'static str) -> [(HeaderName, &'static str); 5] {
    [
        (CONTENT_TYPE, content_type),
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
    ]
}

/// Uses a one-time link: makes the first admin, or gives the user of the link a new password. A link is valid
/// once, for an hour; that of the first admin also ends with the gateway. The sessions of the user end.
#[utoipa::path(
    post,
    path = "/v1/setup",
    security(()),
    request_body = Setup,
    responses(
        (status = 204, description = "The user can sign in"),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 409, description = "`name_taken`", body = Problem),
        (status = 410, description = "`link_void`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 429, description = "`too_many_requests`", body = Problem),
        (status = 503, description = "`overloaded`, `store_unavailable`, `no_owner`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfBody,
    )
)]
pub async fn set_up(
    Source(source): Source,
    Of(state): Of<State>,
    Json(asked): Json<Setup>,
) -> Result<StatusCode, Refusal> {
    let work = tokio::spawn(async move { state.accounts.set_up(asked, source).await });
    let set_up = work.await.map_err(refusal::of_lost_work)?;
    set_up.map(|()| StatusCode::NO_CONTENT).map_err(refusal::of)
}
