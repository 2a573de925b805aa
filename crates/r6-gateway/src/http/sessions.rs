//! Signing in and out.

use std::net::SocketAddr;
use std::time::Duration;

use axum::extract::State as Of;
use axum::http::StatusCode;
use axum::http::header::{CACHE_CONTROL, SET_COOKIE};
use axum::response::{IntoResponse, Response};
use r6_api::gateway::{Deed, LinkSignIn, PasswordChange, Secret, Session, SignIn, TokenSignIn};
use r6_api::{Code, Problem};
use r6_http::Refusal;
use r6_proto::time::Instant;

use super::body::Json;
use super::caller::{Caller, Source, User, Who};
use super::described::{OfBody, OfChange, OfToken};
use super::{Cookie, State, refusal};
use crate::accounts::SignedIn;
use crate::clock;
use crate::fleet::station::By;
use crate::problem;
use crate::tokens::{Known, Page};

/// Signs a user in: sets the cookie `r6_session_PORT`, with the port that the gateway listens on; with TLS
/// it is `__Host-r6_session_PORT`. The answer has the `csrf` that every later request with the cookie needs
/// in `X-CSRF-Token`, unless it is a `GET`. A session ends 15 minutes after its last request, or after 8
/// hours. Wrong passwords make the next tries wait.
#[utoipa::path(
    post,
    path = "/v1/session",
    security(()),
    request_body = SignIn,
    responses(
        (status = 200, description = "The session, with `Set-Cookie`", body = Session),
        (status = 401, description = "`wrong_password`; `no_session`: the user was changed meanwhile", body = Problem),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 429, description = "`too_many_requests`", body = Problem),
        (status = 503, description = "`overloaded`, `store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfBody,
    )
)]
pub async fn sign_in(
    Source(source): Source,
    Of(state): Of<State>,
    Json(asked): Json<SignIn>,
) -> Result<Response, Refusal> {
    // A caller that hangs up has tried a password all the same.
    let work = tokio::spawn(async move { state.accounts.sign_in(asked, source).await });
    let (secret, signed_in) = work.await.map_err(refusal::of_lost_work)?.map_err(refusal::of)?;
    Ok(with_cookie(&state.cookie, &secret, of_user(&signed_in)))
}

/// Gives a browser a session for a token: the cookie of [`sign_in`], with the same ends, and what the token
/// allows. A browser cannot send a token over a WebSocket. The session also ends within a second after the
/// token is revoked. A token has 8 sessions at most: a new one ends the session whose last request is oldest.
#[utoipa::path(
    post,
    path = "/v1/session/token",
    security(()),
    request_body = TokenSignIn,
    responses(
        (status = 200, description = "The session, with `Set-Cookie`", body = Session),
        (status = 401, description = "`no_token`: it is not valid", body = Problem),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 429, description = "`too_many_requests`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfBody,
    )
)]
pub async fn sign_in_with_token(
    Source(source): Source,
    Of(state): Of<State>,
    Json(asked): Json<TokenSignIn>,
) -> Result<Response, Refusal> {
    let token = state.tokens.find(&asked.token.0).await.ok_or_else(|| {
        let message = "this token is not valid; `r6 gateway token` makes one";
        Refusal::new(StatusCode::UNAUTHORIZED, Code::NoToken, message)
    })?;
    begin_session(&state, &token, source).await
}

/// Gives a browser a session for the token that a link stands for, as [`sign_in_with_token`] does. `r6 up`
/// prints such a link. The secret of the link is no token: it opens sessions and nothing else, any number of
/// them, until the gateway ends. With `look` it opens none, and the answer says for whom it would be.
#[utoipa::path(
    post,
    path = "/v1/session/link",
    security(()),
    request_body = LinkSignIn,
    responses(
        (status = 200, description = "The session, with `Set-Cookie`; without it and `csrf` for `look`", body = Session),
        (status = 403, description = "`foreign_host`, `foreign_origin`", body = Problem),
        (status = 410, description = "`link_void`: it is of an earlier start, or its token was revoked", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 429, description = "`too_many_requests`", body = Problem),
        (status = 503, description = "`store_unavailable`", body = Problem),
        OfBody,
    )
)]
pub async fn sign_in_with_link(
    Source(source): Source,
    Of(state): Of<State>,
    Json(LinkSignIn { secret, look }): Json<LinkSignIn>,
) -> Result<Response, Refusal> {
    let token = state.tokens.of_link(&secret.0).ok_or_else(|| {
        let message = "this link is not valid: it is of an earlier start, or its token was revoked";
        refusal::of(problem::Problem::new(Code::LinkVoid, message))
    })?;
    if look {
        state.tokens.request(token.number).map_err(Refusal::too_many)?;
        return Ok(([(CACHE_CONTROL, "no-store")], axum::Json(of_token(&token, None))).into_response());
    }
    begin_session(&state, &token, source).await
}

/// Opens a session of a browser for a token.
async fn begin_session(state: &State, token: &Known, source: SocketAddr) -> Result<Response, Refusal> {
    state.tokens.request(token.number).map_err(Refusal::too_many)?;
    let (secret, page) = state.tokens.begin_session(token).map_err(|error| {
        let message = format!("no random numbers: {error}");
        Refusal::new(StatusCode::SERVICE_UNAVAILABLE, Code::StoreUnavailable, message)
    })?;
    tracing::info!(token = token.label, %source, "a browser signed in with a token");
    let by = By { actor: token.label.clone(), source: Some(source.to_string()) };
    state.accounts.ledger.tell_once_a_minute(&by, source.ip(), Deed::SignedIn {}).await;
    Ok(with_cookie(&state.cookie, &secret, of_token(token, Some(&page))))
}

/// The answer that gives a browser its session.
fn with_cookie(cookie: &Cookie, secret: &Secret, session: Session) -> Response {
    let headers = [(SET_COOKIE, cookie.set(&secret.0)), (CACHE_CONTROL, "no-store".to_owned())];
    (headers, axum::Json(session)).into_response()
}

/// Who calls, and until when the session is open. This counts as a request of the session.
#[utoipa::path(get, path = "/v1/session", operation_id = "session", responses(
    (status = 200, description = "The caller", body = Session),
    OfToken,
))]
pub async fn show(caller: Caller) -> Result<impl IntoResponse, Refusal> {
    let session = match caller.who() {
        Who::Token(token) => of_token(token, None),
        Who::Page(token, page) => of_token(token, Some(page)),
        Who::User(signed_in) => of_user(signed_in),
        Who::Passed(_) | Who::Gateway(_) => {
            let message = "the session is at another gateway";
            return Err(Refusal::new(StatusCode::FORBIDDEN, Code::NotAllowed, message));
        }
    };
    Ok(([(CACHE_CONTROL, "no-store")], axum::Json(session)))
}

/// Signs out. Streams of the session end within a second.
#[utoipa::path(delete, path = "/v1/session", responses(
    (status = 204, description = "The session has ended"),
    OfChange,
))]
pub async fn sign_out(caller: Caller, Of(state): Of<State>) -> Result<impl IntoResponse, Refusal> {
    let unset = state.cookie.unset();
    match (caller.session(), caller.page()) {
        (Some(signed_in), _) => {
            let (id, by) = (signed_in.id, caller.by());
            let work = tokio::spawn(async move { state.accounts.sign_out(&id, &by).await });
            work.await.map_err(refusal::of_lost_work)?;
        }
        (None, Some(page)) => {
            state.tokens.end_session(&page.id);
            if let Some(source) = caller.source() {
                let ledger = &state.accounts.ledger;
                ledger.tell_once_a_minute(&caller.by(), source.ip(), Deed::SignedOut {}).await;
            }
        }
        (None, None) => {
            let message = "there is no session to end: the request has a token";
            return Err(Refusal::new(StatusCode::FORBIDDEN, Code::NotAllowed, message));
        }
    }
    Ok((StatusCode::NO_CONTENT, [(SET_COOKIE, unset)]))
}

/// Gives the caller another password. The other sessions of the user end.
#[utoipa::path(
    put,
    path = "/v1/session/password",
    request_body = PasswordChange,
    responses(
        (status = 204, description = "The new password is valid"),
        (
            status = 401,
            description = "`no_token`, `no_session`; `wrong_password`: the old one is wrong",
            body = Problem
        ),
        (status = 403, description = "`not_allowed` for a token; `bad_csrf`, `foreign_host`, `foreign_origin`", body = Problem),
        (status = 422, description = "`bad_value`", body = Problem),
        (status = 429, description = "`too_many_requests`", body = Problem),
        (status = 503, description = "`overloaded`, `store_unavailable`", body = Problem),
        (status = 504, description = "`outcome_unknown`: the gateway ends", body = Problem),
        OfBody,
    )
)]
pub async fn change_password(
    user: User,
    Source(source): Source,
    Of(state): Of<State>,
    Json(asked): Json<PasswordChange>,
) -> Result<StatusCode, Refusal> {
    let (signed_in, author) = (user.signed_in, user.caller.author());
    let work =
        tokio::spawn(async move { state.accounts.change_password(&signed_in, asked, author, source).await });
    let changed = work.await.map_err(refusal::of_lost_work)?;
    changed.map(|()| StatusCode::NO_CONTENT).map_err(refusal::of)
}

fn of_user(signed_in: &SignedIn) -> Session {
    let account = &signed_in.user.account;
    Session {
        user: Some(account.name.to_string()),
        token: None,
        token_name: None,
        role: account.grant.role,
        robot: account.grant.robots.as_ref().map(ToString::to_string),
        csrf: Some(signed_in.csrf.clone()),
        idle_ends_in_ms: Some(left(signed_in.ends.0)),
        ends_in_ms: Some(left(signed_in.ends.1)),
    }
}

fn of_token(token: &Known, page: Option<&Page>) -> Session {
    let Known { number, name, grant, .. } = token;
    // The session ends with its token.
    let of_token = token.expires.map(|expires| millis(expires.left()));
    let with_token = |end| of_token.map_or(left(end), |of_token| left(end).min(of_token));
    Session {
        user: None,
        token: Some(*number),
        token_name: Some(name.clone()).filter(|name| !name.is_empty()),
        role: grant.role,
        robot: grant.robots.as_ref().map(ToString::to_string),
        csrf: page.map(|page| page.csrf.clone()),
        idle_ends_in_ms: page.map(|page| with_token(page.ends.0)),
        ends_in_ms: page.map_or(of_token, |page| Some(with_token(page.ends.1))),
    }
}

fn left(until: Instant) -> u64 {
    millis(until.since(clock::now()))
}

fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}
