//! Requests for what another gateway owns: passed on to it, once.
//!
//! Who asks is found out here. The owner is told with a pass (`peers.rs`), and looks itself what that token or
//! user may do. A request that came with a pass is never passed on again. What was sent and not answered may
//! have been carried out: that is told, and nothing is sent again. A stop is the exception: it goes to the next
//! owner too, because a second stop does no harm.

use std::net::SocketAddr;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::extract::{Request, State as Of};
use axum::http::header::{
    AUTHORIZATION, CONNECTION, CONTENT_LENGTH, COOKIE, EXPECT, HOST, ORIGIN, SET_COOKIE, TE, TRAILER,
    TRANSFER_ENCODING, UPGRADE,
};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use r6_api::Code;
use r6_http::Refusal;
use tokio::sync::Semaphore;
use tokio::time::{Instant, sleep, timeout};

use super::caller::Caller;
use super::{State, body, refusal};
use crate::core::name::RobotName;
use crate::core::owner::Owned;
use crate::core::pass::{self, Bearer};
use crate::ownership::owners::Place;
use crate::peers::{Failed, Onward, PASS};
use crate::problem::Problem;

/// How long an answer may take. The longest is that of an admin who takes the lease while a run is stopped.
const ANSWER_WITHIN: Duration = Duration::from_secs(60);

/// How long a stop waits for a robot to get an owner: a takeover takes 5 s.
const STOP_WAITS: Duration = Duration::from_secs(5);

/// How long a pass of a gateway waits that this one does not know yet.
const KNOWN_WITHIN: Duration = Duration::from_millis(1_500);

/// How often to look whether the owner is another one.
const LOOK: Duration = Duration::from_millis(50);

/// To how many owners a stop goes, one after the other: the one that froze, and who took over.
const STOP_TRIES: usize = 3;

/// How many requests are passed on at once: each has a connection, and a gateway takes 128 of one peer.
const MAX_PASSED: usize = 64;

/// How many stops besides: they do not wait for anything else.
const MAX_STOPS: usize = 32;

static PASSED: Semaphore = Semaphore::const_new(MAX_PASSED);
static STOPS: Semaphore = Semaphore::const_new(MAX_STOPS);

/// Whom a gateway asks for: the caller of a request that came with a pass.
#[derive(Clone, Debug)]
pub struct Passed {
    /// Who asks.
    pub bearer: Bearer,
    /// The address that the request came from.
    pub source: Option<SocketAddr>,
}

/// Passes a request on, if another gateway has to answer it.
pub async fn pass_on(Of(state): Of<State>, request: Request, next: Next) -> Response {
    let owners = &state.shared.owners;
    if owners.is_alone() {
        return next.run(request).await;
    }
    if request.headers().contains_key(PASS) {
        return match admit(&state, request).await {
            Ok(request) => next.run(request).await,
            Err(refusal) => refusal.into_response(),
        };
    }
    let Some(owned) = asked_for(&state, request.method(), request.uri().path()) else {
        return next.run(request).await;
    };
    let is_stop = is_stop(request.method(), request.uri().path());
    match place(&state, &owned) {
        Place::There(_) => {}
        Place::Nowhere if is_stop => {}
        // Without an owner, the routes say so.
        Place::Here | Place::Nowhere => return next.run(request).await,
    }
    let (parts, body) = request.into_parts();
    let onward = match onward(&state, &parts, body).await {
        Ok(onward) => onward,
        Err(refusal) => return refusal.into_response(),
    };
    if !is_stop {
        return forward(&state, &owned, onward).await.unwrap_or_else(|refusal| refusal.into_response());
    }
    match stop(&state, &owned, &onward).await {
        Ok(Some(answer)) => answer,
        // It is this gateway by now.
        Ok(None) => next.run(Request::from_parts(parts, Body::from(onward.body))).await,
        Err(refusal) => refusal.into_response(),
    }
}

/// Who can answer for this. A robot that this gateway has taken and has not begun with is nobody's yet.
fn place(state: &State, owned: &Owned) -> Place {
    let is_here = |name: &RobotName| state.fleet.station(name.as_str()).is_some();
    match (state.shared.owners.place(owned), owned.robot()) {
        (Place::Here, Some(name)) if !is_here(name) => Place::Nowhere,
        (place, _) => place,
    }
}

/// What a request is about, if that has an owner.
fn asked_for(state: &State, method: &Method, path: &str) -> Option<Owned> {
    let is_read = matches!(*method, Method::GET | Method::HEAD);
    if path == "/v1/audit/head" || (path == "/v1/settings" && !is_read) {
        return Some(Owned::Hall);
    }
    let name = path.strip_prefix("/v1/robots/")?.split('/').next()?;
    // What cannot be the name of a robot is refused here.
    let name = RobotName::new(name)?;
    if state.shared.owners.is_known(&name) || state.fleet.station(name.as_str()).is_some() {
        return Some(Owned::Robot(name));
    }
    // The owner of the hall adds robots.
    (*method == Method::PUT).then_some(Owned::Hall)
}

fn is_stop(method: &Method, path: &str) -> bool {
    *method == Method::POST && path.starts_with("/v1/robots/") && path.ends_with("/stop")
}

/// A request as it is passed on.
async fn onward(state: &State, parts: &Parts, body: Body) -> Result<Onward, Refusal> {
    // Strangers go no further. What the caller may do, and how often, the owner looks.
    let caller = Caller::known(parts, state).await?;
    let target = parts.uri.path_and_query().map_or("/", |target| target.as_str()).to_owned();
    let mut headers = HeaderMap::new();
    for (name, value) in parts.headers.iter().filter(|(name, _)| !is_kept_back(name)) {
        headers.append(name.clone(), value.clone());
    }
    let (method, body) = (parts.method.clone(), body::bytes(body).await?);
    Ok(Onward { method, target, headers, body, bearer: (caller.bearer(), caller.source()) })
}

/// Headers about the connection of the caller, and those that say who asks.
fn is_kept_back(name: &HeaderName) -> bool {
    const KEPT_BACK: [HeaderName; 11] = [
        AUTHORIZATION,
        CONNECTION,
        CONTENT_LENGTH,
        COOKIE,
        EXPECT,
        HOST,
        ORIGIN,
        TE,
        TRAILER,
        TRANSFER_ENCODING,
        UPGRADE,
    ];
    let is_of_browser = name.as_str().starts_with("sec-") || name.as_str() == "x-csrf-token";
    KEPT_BACK.contains(name) || is_of_browser
}

/// Takes a request that another gateway passes on.
async fn admit(state: &State, request: Request) -> Result<Request, Refusal> {
    let (mut parts, body) = request.into_parts();
    let body = body::bytes(body).await?;
    let owners = &state.shared.owners;
    let target = parts.uri.path_and_query().map_or("/", |target| target.as_str());
    let text = parts.headers.get(PASS).and_then(|text| text.to_str().ok()).unwrap_or_default();
    // It may have been started a moment ago: a look at the rows comes twice a second.
    let begun = Instant::now();
    while !owners.knows_sender(text) && begun.elapsed() < KNOWN_WITHIN && pass::claimed(text).is_some() {
        sleep(LOOK).await;
    }
    let pass = owners.admit(text, (&parts.method, target, &body)).ok_or_else(|| {
        let message = "this pass is not valid: gateways pass requests on with one of their own";
        Refusal::new(StatusCode::UNAUTHORIZED, Code::NoToken, message)
    })?;
    parts.headers.remove(PASS);
    parts.extensions.insert(Passed { bearer: pass.bearer, source: pass.source });
    Ok(Request::from_parts(parts, Body::from(body)))
}

/// Passes a request on, once.
async fn forward(state: &State, owned: &Owned, onward: Onward) -> Result<Response, Refusal> {
    let _place = PASSED.try_acquire().map_err(|_| {
        refusal::of(Problem::new(Code::Overloaded, "too many requests are passed on to other gateways"))
    })?;
    let owners = &state.shared.owners;
    let Place::There(number) = owners.place(owned) else {
        return Err(refusal::of(owners.no_owner(owned)));
    };
    let is_read = matches!(onward.method, Method::GET | Method::HEAD);
    let sent = owners.send(owned, onward);
    let answer = tokio::select! {
        biased;
        answer = timeout(ANSWER_WITHIN, sent) => {
            answer.unwrap_or_else(|_| Err(Failed::Unknown(format!("no answer within {ANSWER_WITHIN:?}"))))
        }
        () = is_another(state, owned, number) => {
            Err(Failed::Unknown("it has another owner by now".to_owned()))
        }
    };
    match answer {
        Ok(answer) => Ok(passed_back(answer)),
        Err(Failed::NotSent(why)) => {
            let message = format!("the gateway that owns {} cannot be reached: {why}", told(owned));
            Err(refusal::of(Problem::new(Code::NoOwner, message)))
        }
        Err(Failed::Unknown(why)) if is_read => {
            let message = format!("the gateway that owns {} did not answer: {why}. Ask again", told(owned));
            Err(refusal::of(Problem::new(Code::NoOwner, message)))
        }
        Err(Failed::Unknown(why)) => {
            let message = format!(
                "the request was passed on to the gateway that owns {}, and no answer came: {why}. It may have been \
                 carried out, and is not sent again: look at the robot",
                told(owned)
            );
            Err(refusal::of(Problem::new(Code::OutcomeUnknown, message)))
        }
    }
}

/// Passes a stop on, to whoever owns the robot, and to the next owner if the first one gives no answer. `None`:
/// this gateway owns it.
async fn stop(state: &State, owned: &Owned, onward: &Onward) -> Result<Option<Response>, Refusal> {
    let not_stopped = |why: &str| {
        let message =
            format!("it is NOT known that the arm of {} stands: {why}; use the emergency stop", told(owned));
        refusal::of(Problem::new(Code::NotStopped, message))
    };
    let _place = STOPS.try_acquire().map_err(|_| not_stopped("too many stops are under way"))?;
    let owners = &state.shared.owners;
    let mut why = "no gateway owns it".to_owned();
    for _ in 0..STOP_TRIES {
        let begun = Instant::now();
        let number = loop {
            match place(state, owned) {
                Place::Here => return Ok(None),
                Place::There(number) => break number,
                Place::Nowhere if begun.elapsed() >= STOP_WAITS => return Err(not_stopped(&why)),
                Place::Nowhere => sleep(LOOK).await,
            }
        };
        let sent = owners.send(owned, onward.clone());
        let answer = tokio::select! {
            biased;
            answer = timeout(ANSWER_WITHIN, sent) => answer.unwrap_or_else(|_| {
                Err(Failed::Unknown(format!("no answer within {ANSWER_WITHIN:?}")))
            }),
            () = is_another(state, owned, number) => {
                Err(Failed::Unknown("the gateway that owned it gave no answer".to_owned()))
            }
        };
        match answer {
            Ok(answer) => match unless_no_owner(answer).await {
                Some(answer) => return Ok(Some(answer)),
                None => why = "its owner has just changed".to_owned(),
            },
            Err(Failed::NotSent(failed) | Failed::Unknown(failed)) => why = failed,
        }
        // It may be dead. Then another gateway takes the robot.
        let _ = timeout(STOP_WAITS, is_another(state, owned, number)).await;
    }
    Err(not_stopped(&why))
}

/// Waits until another gateway than this one owns something, or none.
async fn is_another(state: &State, owned: &Owned, number: u64) {
    loop {
        sleep(LOOK).await;
        match state.shared.owners.place(owned) {
            Place::There(now) if now == number => {}
            Place::Here | Place::There(_) | Place::Nowhere => return,
        }
    }
}

/// The answer of another gateway; `None` if it does not own the robot any more, and did nothing.
async fn unless_no_owner(answer: hyper::Response<hyper::body::Incoming>) -> Option<Response> {
    if answer.status() != StatusCode::SERVICE_UNAVAILABLE {
        return Some(passed_back(answer));
    }
    let (parts, body) = passed_back(answer).into_parts();
    let body = to_bytes(body, body::MAX_BYTES).await.unwrap_or_default();
    let problem = serde_json::from_slice::<r6_api::Problem>(&body);
    let is_no_owner = problem.is_ok_and(|problem| problem.code == Code::NoOwner);
    (!is_no_owner).then(|| Response::from_parts(parts, Body::from(body)))
}

/// The answer of another gateway.
fn passed_back(answer: hyper::Response<hyper::body::Incoming>) -> Response {
    let (mut parts, body) = answer.into_parts();
    for name in [CONNECTION, CONTENT_LENGTH, SET_COOKIE, TRANSFER_ENCODING, UPGRADE] {
        parts.headers.remove(name);
    }
    Response::from_parts(parts, Body::new(body))
}

fn told(owned: &Owned) -> String {
    match owned {
        Owned::Hall => "the hall".to_owned(),
        Owned::Robot(name) => format!("`{name}`"),
    }
}
