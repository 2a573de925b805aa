//! Requests for what another gateway owns: passed on to it, once.
//!
//! Who asks is found out here. The owner is told with a pass (`peers.rs`), and looks itself what that token
//! or user may do. A request that came with a pass is never passed on again. What was sent and not answered
//! may have been carried out: that is told, and nothing is sent again. A stop is the exception (`stop`). A
//! request whose pass the owner does not take has done nothing; the owner says so in the header of the pass.

mod gather;
mod places;
mod stop;

use std::net::SocketAddr;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::extract::{Request, State as Of};
use axum::http::header::{
    AUTHORIZATION, CONNECTION, CONTENT_LENGTH, COOKIE, EXPECT, HOST, ORIGIN, SET_COOKIE, TE, TRAILER,
    TRANSFER_ENCODING, UPGRADE,
};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use r6_api::Code;
use r6_http::{Refusal, Shown};
use tokio::time::{Instant, sleep, timeout};

pub use self::gather::{gather, robots};
use self::places::Places;
use super::caller::Caller;
use super::{State, body, refusal};
use crate::certificate::fingerprint_of;
use crate::core::name::RobotName;
use crate::core::owner::{Owned, Phase};
use crate::core::pass::Bearer;
use crate::core::role::Right;
use crate::fleet::station::Station;
use crate::ownership::owners::Place;
use crate::peers::{self, ADMITTED, Failed, Onward, PASS, REFUSED, is_admitted};
use crate::problem::Problem;

/// How long an answer may take. The longest is that of an admin who takes the lease while a run is stopped.
const ANSWER_WITHIN: Duration = Duration::from_secs(60);

/// How long a pass of a gateway waits that this one does not know yet, and a request for a robot whose rows
/// it has not seen.
const KNOWN_WITHIN: Duration = Duration::from_millis(1_500);

/// How often to look whether the owner is another one.
const LOOK: Duration = Duration::from_millis(50);

static PLACES: Places = Places::new();

/// Whom a gateway asks for: the caller of a request that came with a pass.
#[derive(Clone, Debug)]
pub struct Passed {
    /// The gateway that passes it on.
    pub from: u64,
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
        let (mut answer, mark) = match admit(&state, request).await {
            Ok(request) => (next.run(request).await, ADMITTED),
            Err(refusal) => (refusal.into_response(), REFUSED),
        };
        answer.headers_mut().insert(PASS, HeaderValue::from_static(mark));
        return answer;
    }
    until_known(&state, request.uri().path()).await;
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
    let onward = match onward(&state, &owned, &parts, body, is_stop).await {
        Ok(onward) => onward,
        Err(refusal) => return refusal.into_response(),
    };
    if !is_stop {
        return forward(&state, &owned, onward).await.unwrap_or_else(|refusal| refusal.into_response());
    }
    match stop::stop(&state, &owned, &onward).await {
        Ok(Some(answer)) => answer,
        // It is this gateway by now.
        Ok(None) => next.run(Request::from_parts(parts, Body::from(onward.body))).await,
        Err(refusal) => refusal.into_response(),
    }
}

/// Who can answer for this. A robot that this gateway has taken and has not begun with has no owner yet, and
/// a robot that it is about to lose has none any more.
fn place(state: &State, owned: &Owned) -> Place {
    let lasts = |station: &Station| station.term.ownership.phase() < Phase::StopLists;
    let is_here = |name: &RobotName| state.fleet.station(name.as_str()).is_some_and(|here| lasts(&here));
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
    // What cannot be the name of a robot is refused here.
    let name = named(path)?;
    let (owners, owned) = (&state.shared.owners, Owned::Robot(name.clone()));
    // It may be in the file of another gateway alone.
    let has_owner = || owners.place(&owned) != Place::Nowhere;
    if owners.is_known(&name) || state.fleet.station(name.as_str()).is_some() || has_owner() {
        return Some(owned);
    }
    // The owner of the hall adds robots.
    (*method == Method::PUT).then_some(Owned::Hall)
}

/// Waits for the rows of a robot that another gateway tells of already: it was added, or has changed its
/// owner, a moment ago.
async fn until_known(state: &State, path: &str) {
    let Some(name) = named(path) else { return };
    let (owned, owners) = (Owned::Robot(name.clone()), &state.shared.owners);
    let is_new = || {
        let told = state.shared.far.one(name.as_str()).is_some_and(|far| far.is_told());
        told && owners.place(&owned) == Place::Nowhere && !owners.is_blind()
    };
    let begun = Instant::now();
    while is_new() && begun.elapsed() < KNOWN_WITHIN {
        sleep(LOOK).await;
    }
}

/// The robot that a path names.
fn named(path: &str) -> Option<RobotName> {
    RobotName::new(&decoded(path.strip_prefix("/v1/robots/")?.split('/').next()?)?)
}

/// A name in a path as the routes read it.
fn decoded(name: &str) -> Option<String> {
    let mut parts = name.split('%');
    let mut text = parts.next()?.to_owned();
    for part in parts {
        let (code, rest) = part.split_at_checked(2)?;
        text.push(char::from(u8::from_str_radix(code, 16).ok().filter(u8::is_ascii)?));
        text.push_str(rest);
    }
    Some(text)
}

fn is_stop(method: &Method, path: &str) -> bool {
    *method == Method::POST && path.starts_with("/v1/robots/") && path.ends_with("/stop")
}

/// A request as it is passed on.
async fn onward(
    state: &State,
    owned: &Owned,
    parts: &Parts,
    body: Body,
    is_stop: bool,
) -> Result<Onward, Refusal> {
    // Strangers go no further. What the caller may do, the owner looks.
    let caller = Caller::known(parts, state).await?;
    // What will be refused is no stop.
    let may_stop = |robot: &RobotName| caller.grant().allows(Right::Stop, robot.as_str());
    if !is_stop || !owned.robot().is_some_and(may_stop) {
        caller.count(state)?;
    }
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

/// Takes a request that another gateway passes on. Nothing of it is read before its head is known to be of
/// one.
async fn admit(state: &State, request: Request) -> Result<Request, Refusal> {
    let (mut parts, body) = request.into_parts();
    let owners = &state.shared.owners;
    let refused = || {
        let message = "this pass is not valid: gateways pass requests on with one of their own";
        Refusal::new(StatusCode::UNAUTHORIZED, Code::NoToken, message)
    };
    let target = parts.uri.path_and_query().map_or("/", |target| target.as_str());
    let head = peers::head(&parts.method, target, &parts.headers);
    let text = parts.headers.get(PASS).and_then(|text| text.to_str().ok()).unwrap_or_default();
    // The other one may have been started a moment ago, or have another certificate since: a look at the rows
    // comes twice a second.
    let shown = parts.extensions.get().map(|Shown(certificate)| fingerprint_of(certificate));
    let shown = shown.as_deref();
    let begun = Instant::now();
    while owners.is_from_unknown(text, shown) && begun.elapsed() < KNOWN_WITHIN {
        sleep(LOOK).await;
    }
    let pass = owners.open(text, &head, shown).ok_or_else(refused)?;
    let body = body::bytes(body).await?;
    let pass = owners.admit(pass, &body).ok_or_else(refused)?;
    parts.headers.remove(PASS);
    parts.extensions.insert(Passed { from: pass.from, bearer: pass.bearer, source: pass.source });
    Ok(Request::from_parts(parts, Body::from(body)))
}

/// What was asked for.
#[derive(Clone, Copy, Debug)]
struct Kind {
    is_stop: bool,
    is_head: bool,
}

/// What became of a request that was passed on.
enum Outcome {
    /// The owner answered.
    Answer(Response),
    /// It did nothing, or was not reached.
    Nothing(String),
    /// That is not known.
    Unknown(String),
}

/// Passes a request on, once.
async fn forward(state: &State, owned: &Owned, onward: Onward) -> Result<Response, Refusal> {
    let owners = &state.shared.owners;
    let Place::There(number) = owners.place(owned) else {
        return Err(refusal::of(owners.no_owner(owned)));
    };
    let _place = PLACES.request(&onward.bearer.0, number).ok_or_else(|| {
        refusal::of(Problem::new(
            Code::Overloaded,
            "too many requests are passed on to its gateway: ask again",
        ))
    })?;
    let is_read = matches!(onward.method, Method::GET | Method::HEAD);
    let is_head = onward.method == Method::HEAD;
    let sent = async {
        match owners.send(number, onward).await {
            Ok(answer) => outcome(answer, Kind { is_stop: false, is_head }).await,
            Err(Failed::NotSent(why)) => Outcome::Nothing(why),
            Err(Failed::Unknown(why)) => Outcome::Unknown(why),
        }
    };
    let sent = tokio::select! {
        biased;
        sent = timeout(ANSWER_WITHIN, sent) => {
            sent.unwrap_or_else(|_| Outcome::Unknown(format!("no answer within {ANSWER_WITHIN:?}")))
        }
        changed = is_another(state, owned, number) => Outcome::Unknown(changed.to_owned()),
    };
    match sent {
        Outcome::Answer(answer) => Ok(answer),
        Outcome::Nothing(why) => {
            let message = format!("the gateway that owns {} cannot be reached: {why}", told(owned));
            Err(refusal::of(Problem::new(Code::NoOwner, message)))
        }
        Outcome::Unknown(why) if is_read => {
            let message = format!("the gateway that owns {} did not answer: {why}. Ask again", told(owned));
            Err(refusal::of(Problem::new(Code::NoOwner, message)))
        }
        Outcome::Unknown(why) => {
            let message = format!(
                "the request was passed on to the gateway that owns {}, and no answer came: {why}. It may have been \
                 carried out, and is not sent again: look at the robot",
                told(owned)
            );
            Err(refusal::of(Problem::new(Code::OutcomeUnknown, message)))
        }
    }
}

/// Waits until it was seen that another gateway than this one owns something, or none that lives, or until
/// that was not seen for too long. Returns which.
async fn is_another(state: &State, owned: &Owned, number: u64) -> &'static str {
    let owners = &state.shared.owners;
    loop {
        sleep(LOOK).await;
        match owners.place(owned) {
            Place::There(now) if now == number => {}
            Place::Here | Place::There(_) => return "it has another owner by now",
            Place::Nowhere if owners.is_blind() => {
                return "the database does not answer, so it is not known whether that gateway still owns it";
            }
            Place::Nowhere => return "no gateway that lives owns it any more",
        }
    }
}

/// What an answer means. A stop asks again where no owner is.
async fn outcome(answer: hyper::Response<hyper::body::Incoming>, kind: Kind) -> Outcome {
    let is_refused = answer.headers().get(PASS).is_some_and(|mark| mark == REFUSED);
    let is_admitted = is_admitted(answer.headers());
    if is_refused || (!is_admitted && answer.status() == StatusCode::UNAUTHORIZED) {
        let message = "what answers there takes no request of this gateway, and did nothing: it was just started, or \
                       is another one";
        return Outcome::Nothing(message.to_owned());
    }
    // What our own server refuses before a route is asked has no mark; what is done has one.
    if !is_admitted && answer.status().is_success() {
        return Outcome::Unknown("what answers there is no gateway of this database".to_owned());
    }
    if !kind.is_stop || answer.status() != StatusCode::SERVICE_UNAVAILABLE {
        return Outcome::Answer(passed_back(answer, kind.is_head));
    }
    let (parts, body) = passed_back(answer, false).into_parts();
    let Ok(body) = to_bytes(body, body::MAX_BYTES).await else {
        return Outcome::Unknown("its answer broke off".to_owned());
    };
    match serde_json::from_slice::<r6_api::Problem>(&body) {
        Ok(problem) if problem.code == Code::NoOwner => Outcome::Nothing(problem.message),
        _ => Outcome::Answer(Response::from_parts(parts, Body::from(body))),
    }
}

/// The answer of another gateway.
fn passed_back(answer: hyper::Response<hyper::body::Incoming>, is_head: bool) -> Response {
    let (mut parts, body) = answer.into_parts();
    parts.headers.remove(PASS);
    for name in [CONNECTION, SET_COOKIE, TRANSFER_ENCODING, UPGRADE] {
        parts.headers.remove(name);
    }
    // The length of the body that `HEAD` does not have.
    if !is_head {
        parts.headers.remove(CONTENT_LENGTH);
    }
    Response::from_parts(parts, Body::new(body))
}

fn told(owned: &Owned) -> String {
    match owned {
        Owned::Hall => "the hall".to_owned(),
        Owned::Robot(name) => format!("`{name}`"),
    }
}
