//! Streams: values that change, and what happens.
//!
//! [`feed`] makes the messages, one at a time, as its reader takes them. Server-sent events (here) and
//! WebSockets ([`socket`]) carry them. [`subscription`] reads what a reader asks for.

mod feed;
mod socket;
mod subscription;

use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::extract::rejection::QueryRejection;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::{Query, State as Of};
use axum::http::header::UPGRADE;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream::{Stream, unfold};
use r6_api::gateway::{LiveMessage, LiveSent};
use r6_api::{Code, Problem};
use r6_http::{EndsWith, Refusal};
use serde::Serialize;
use tokio::sync::watch;
use tokio::time::Instant;

use super::State;
use super::caller::Caller;
use super::described::OfRight;
use super::refusal;
use crate::http::streams::feed::Feed;
use crate::http::streams::subscription::{Followed, Subscription, Which, bad_value, only};
use crate::live::news::{Reading, Told};

/// How often a stream looks whether its caller is still valid.
const LOOK: Duration = Duration::from_millis(250);

/// How long after that a stream that does not end itself is closed: its peer does not read.
const GRACE: Duration = Duration::from_millis(500);

/// How long a peer may read nothing while something waits for it.
const READ_TIME: Duration = Duration::from_secs(5);

/// What happens, from now on, as server-sent events: `event` with an event as JSON. With `Last-Event-ID` it
/// goes on behind that event. If events in between are lost, `reset` comes first.
#[utoipa::path(get, path = "/v1/events", params(Which), responses(
    (status = 200, description = "The stream", content_type = "text/event-stream", body = r6_api::gateway::Event),
    (status = 404, description = "`no_such_robot`", body = Problem),
    (status = 422, description = "`bad_value`", body = Problem),
    OfRight,
))]
pub async fn events(
    caller: Caller,
    Of(state): Of<State>,
    which: Result<Query<Which>, QueryRejection>,
    headers: HeaderMap,
) -> Result<Response, Refusal> {
    let Which { robot } = read(which)?;
    let only = robot.map(|robot| only(&caller, &state, robot)).transpose()?;
    let news = &state.shared.news;
    let reading = match last_event_id(&headers) {
        None => Reading::from_now(news),
        Some(id) => Reading::after(news, resume(id, state.shared.epoch)),
    };
    let last = news.watch();
    let watched = Watched::new();
    let end = watched.clone().end(caller.clone(), state.clone());
    let stream = EventStream { state, caller, only, reading, last, watched };
    Ok(with_end(unfold(stream, EventStream::next), end))
}

/// The values of the robots: a `snapshot` of each robot, then a `change` with the values that changed. A slow
/// reader gets the latest values, and misses those in between. `removed` ends a robot. With `?resume=` or
/// `Last-Event-ID` the stream goes on at that place. `reset` says that something was missed.
///
/// With `Upgrade: websocket` it is a WebSocket: each message is a `LiveSent` as JSON, and the reader may send
/// `LiveRequest`. Otherwise it is server-sent events: the type of the message is the `event`, the rest the
/// `data`, and the place to resume at the `id`.
#[utoipa::path(get, path = "/v1/live", params(Followed), responses(
    (status = 101, description = "The WebSocket", body = LiveSent),
    (status = 200, description = "The stream", content_type = "text/event-stream", body = LiveMessage),
    (status = 400, description = "`bad_request`: the handshake of the WebSocket is wrong", body = Problem),
    (status = 404, description = "`no_such_robot`", body = Problem),
    (status = 422, description = "`bad_value`", body = Problem),
    OfRight,
))]
pub async fn live(
    caller: Caller,
    Of(state): Of<State>,
    followed: Result<Query<Followed>, QueryRejection>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Refusal> {
    let followed = read(followed)?;
    let manner = followed.manner();
    let subscription = Subscription::of_query(&caller, &state, followed, last_event_id(&headers))?;
    let feed = Feed::new(caller, state, subscription);
    if is_for_websocket(&headers) {
        let upgrade = upgrade.map_err(|error| {
            let message = format!("this is no handshake of a WebSocket: {}", error.body_text());
            Refusal::new(StatusCode::BAD_REQUEST, Code::BadRequest, message)
        })?;
        return Ok(socket::open(upgrade, feed, manner));
    }
    if manner.begins_later {
        return Err(bad_value("subscribe=later is for WebSockets: this stream takes no messages".to_owned()));
    }
    if manner.tells_alive {
        return Err(bad_value("alive=true is for WebSockets: this stream has comments for that".to_owned()));
    }
    let watched = Watched::new();
    let end = watched.clone().end(feed.caller().clone(), feed.state().clone());
    Ok(with_end(unfold((feed, watched), next), end))
}

/// A stream of server-sent events whose connection ends with `end`.
fn with_end(
    stream: impl Stream<Item = Result<Event, Infallible>> + Send + 'static,
    end: impl Future<Output = ()> + Send + 'static,
) -> Response {
    let mut response = Sse::new(stream).keep_alive(KeepAlive::default()).into_response();
    response.extensions_mut().insert(EndsWith::new(end));
    response
}

/// Other protocols than WebSocket are not for this server: it answers as if they were not named.
fn is_for_websocket(headers: &HeaderMap) -> bool {
    let mut words = headers.get_all(UPGRADE).iter().filter_map(|value| value.to_str().ok());
    words.any(|value| value.split(',').any(|word| word.trim().eq_ignore_ascii_case("websocket")))
}

/// When a stream was taken from last. It is asked again and again, unless its peer does not read.
#[derive(Clone, Debug)]
struct Watched(Arc<Mutex<Instant>>);

impl Watched {
    fn new() -> Self {
        Self(Arc::new(Mutex::new(Instant::now())))
    }

    fn taken(&self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    /// Waits until the caller may not read any more, or does not read.
    async fn end(self, caller: Caller, state: State) {
        let is_read = || self.0.lock().unwrap_or_else(PoisonError::into_inner).elapsed() < READ_TIME;
        while caller.is_still_valid(&state) && is_read() {
            tokio::time::sleep(LOOK).await;
        }
        tokio::time::sleep(GRACE).await;
        tracing::debug!(by = caller.by().actor, "a stream ends");
    }
}

fn read<T>(query: Result<Query<T>, QueryRejection>) -> Result<T, Refusal> {
    query.map(|Query(read)| read).map_err(refusal::of_query)
}

fn last_event_id(headers: &HeaderMap) -> Option<&str> {
    // An id that is no text was not given out by this gateway.
    headers.get("last-event-id").map(|id| id.to_str().unwrap_or_default())
}

/// The number of an event of this start of the gateway.
fn resume(id: &str, epoch: u64) -> Option<u64> {
    let (of, number) = id.split_once('-')?;
    (of.parse() == Ok(epoch)).then(|| number.parse().ok()).flatten()
}

/// The next server-sent event of a feed.
async fn next((mut feed, watched): (Feed, Watched)) -> Option<(Result<Event, Infallible>, (Feed, Watched))> {
    loop {
        watched.taken();
        if !feed.is_allowed() {
            return None;
        }
        // The time is up: look at the caller again.
        let Ok(LiveSent { message, resume }) = tokio::time::timeout(LOOK, feed.next()).await else {
            continue;
        };
        let event = match &message {
            LiveMessage::Reset(data) => of("reset", data),
            LiveMessage::Snapshot(data) => of("snapshot", data),
            LiveMessage::Change(data) => of("change", data),
            LiveMessage::Removed(data) => of("removed", data),
            LiveMessage::Event(data) => of("event", data),
            LiveMessage::EventsLost(data) => of("events_lost", data),
            // This stream is not asked for it.
            LiveMessage::Alive(data) => of("alive", data),
            // These two answer messages, which this stream does not take.
            LiveMessage::Subscribed(data) => of("subscribed", data),
            LiveMessage::Problem(data) => of("problem", data),
        };
        let event = match resume {
            Some(resume) => event.id(resume),
            None => event,
        };
        return Some((Ok(event), (feed, watched)));
    }
}

fn of(kind: &str, data: &impl Serialize) -> Event {
    // Our own types always become JSON.
    Event::default().event(kind).json_data(data).unwrap_or_default()
}

struct EventStream {
    state: State,
    caller: Caller,
    only: Option<String>,
    reading: Reading,
    last: watch::Receiver<u64>,
    watched: Watched,
}

impl EventStream {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        loop {
            self.watched.taken();
            if !self.caller.is_still_valid(&self.state) {
                return None;
            }
            match self.reading.next(&self.state.shared.news) {
                Some(Told::Lost) => return Some((Ok(Event::default().event("reset").data("{}")), self)),
                Some(Told::Event(event)) => {
                    let covered = self.caller.grant().covers(&event.robot);
                    if covered && self.only.as_ref().is_none_or(|only| *only == event.robot) {
                        let id = format!("{}-{}", self.state.shared.epoch, event.id);
                        return Some((Ok(of("event", &event).id(id)), self));
                    }
                }
                None => {
                    let at = self.reading.at();
                    let more = async { drop(self.last.wait_for(|last| *last > at).await) };
                    // The time is up: look at the caller again.
                    let _ = tokio::time::timeout(LOOK, more).await;
                }
            }
        }
    }
}
