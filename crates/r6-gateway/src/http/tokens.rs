//! The tokens, for admins.

use axum::Json;
use axum::extract::State as Of;
use axum::http::StatusCode;
use axum::http::header::CACHE_CONTROL;
use axum::response::IntoResponse;
use r6_api::gateway::{Secret, Token, TokenMade, TokenWanted, Tokens};
use r6_api::{Code, Problem};
use r6_http::Refusal;

use super::body;
use super::caller::{ManageUsers, Manager};
use super::described::{OfBody, OfChange, OfRight};
use super::range::{instant, shown};
use super::refusal::bad_value;
use super::users::robots_of;
use super::{State, refusal};
use crate::core::role::Grant;
use crate::expiry::Expiry;
use crate::problem;
use crate::store::NewToken;
use crate::tokens;

/// The longest name of a token, in characters.
const MAX_NAME: usize = 64;

/// The tokens that are not revoked, without their secrets.
#[utoipa::path(get, path = "/v1/tokens", operation_id = "tokens", responses(
    (status = 200, description = "In the order of their numbers", body = Tokens),
    (status = 503, description = "`store_unavailable`", body = Problem),
    OfRight,
))]
pub async fn list(_manager: Manager<ManageUsers>, Of(state): Of<State>) -> Result<Json<Tokens>, Refusal> {
    let tokens = state.shared.keeper.tokens().await.map_err(|error| refusal::of(error.into()))?;
    let told = |token: crate::store::Token| Token {
        number: token.number,
        role: token.grant.role,
        robot: token.grant.robots.map(|robots| robots.to_string()),
        name: token.name,
        expires_at: token.expires.as_ref().map(ToString::to_string),
    };
    Ok(Json(Tokens { tokens: tokens.into_iter().map(told).collect() }))
}

/// Makes a token. It is shown this once.
#[utoipa::path(
    post,
    path = "/v1/tokens",
    operation_id = "make_token",
    request_body = TokenWanted,
    responses(
        (status = 201, description = "The token", body = TokenMade),
        (status = 409, description = "`no_room` for another token", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
        OfBody,
    )
)]
pub async fn make(
    manager: Manager<ManageUsers>,
    Of(state): Of<State>,
    body::Json(wanted): body::Json<TokenWanted>,
) -> Result<impl IntoResponse, Refusal> {
    let TokenWanted { role, robot, name, expires_at } = wanted;
    if name.chars().take(MAX_NAME + 1).count() > MAX_NAME || name.chars().any(char::is_control) {
        let wanted = format!("name: at most {MAX_NAME} characters, and no control characters");
        return Err(bad_value(wanted));
    }
    let grant = Grant { role, robots: robots_of(robot, role)? };
    let expires = expires_at.as_deref().map(end).transpose()?;
    let (text, hash) = tokens::draw().map_err(|error| {
        let message = format!("no random numbers: {error}");
        refusal::of(problem::Problem::new(Code::StoreUnavailable, message))
    })?;
    let author = manager.caller.author();
    let work = tokio::spawn(async move {
        state.shared.keeper.add_token(NewToken { hash, grant, name, expires }, author).await
    });
    let number = work.await.map_err(refusal::of_lost_work)?.map_err(|error| refusal::of(error.into()))?;
    let made = TokenMade { number, token: Secret(text) };
    Ok((StatusCode::CREATED, [(CACHE_CONTROL, "no-store")], Json(made)))
}

/// Revokes a token. It is refused from now on, and its streams end within a second.
#[utoipa::path(
    delete,
    path = "/v1/tokens/{number}",
    operation_id = "revoke_token",
    params(("number" = i64, Path, description = "The number of the token")),
    responses(
        (status = 204, description = "The token is revoked"),
        (status = 404, description = "`no_such_token`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfChange,
    )
)]
pub async fn revoke(manager: Manager<ManageUsers>, Of(state): Of<State>) -> Result<StatusCode, Refusal> {
    let no_such = || {
        let message = "there is no valid token with this number";
        refusal::of(problem::Problem::new(Code::NoSuchToken, message))
    };
    let number: i64 = manager.named.parse().map_err(|_| no_such())?;
    let author = manager.caller.author();
    let work = tokio::spawn(async move {
        let revoked = state.shared.keeper.revoke_token(number, author).await?;
        // If it fails, the tokens are read again within a second.
        if let Err(error) = state.tokens.refresh().await {
            tracing::error!(%error, "the tokens could not be read again");
        }
        Ok(revoked)
    });
    match work.await.map_err(refusal::of_lost_work)? {
        Ok(true) => Ok(StatusCode::NO_CONTENT),
        Ok(false) => Err(no_such()),
        Err(error) => Err(refusal::of(crate::store::StoreError::into(error))),
    }
}

/// When a token shall end: a time to come.
fn end(text: &str) -> Result<Expiry, Refusal> {
    let seconds = instant(text).and_then(|at| u64::try_from(at.0 / 1_000_000).ok());
    seconds.map(Expiry).filter(|end| !end.is_over()).ok_or_else(|| {
        let shown = shown(text);
        bad_value(format!("expires_at: `{shown}` is not a time to come in UTC, such as 2027-01-31T00:00:00Z"))
    })
}
