//! Streams of server-sent events: values that change, and what happens.

use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State as Of};
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use futures_util::stream::{Stream, unfold};
use r6_api::gateway::{LiveChange, LiveRemoved, Signal};
use r6_api::{Code, Problem};
use r6_client::Address;
use r6_http::Refusal;
use serde::{Deserialize, Serialize};
use tokio::sync::watch;
use utoipa::IntoParams;

use super::State;
use super::caller::Caller;
use super::described::OfRight;
use crate::core::role::Right;
use crate::fleet::station::Station;
use crate::live::board::Place;

/// How often a stream looks whether its token is still valid.
const LOOK: Duration = Duration::from_millis(500);

/// The shortest time between two looks for changes: 50 messages a second and robot are more than a screen
/// shows.
const PACE: Duration = Duration::from_millis(20);

/// Which robot.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Which {
    /// Only this robot; all that the token may see if it is missing.
    robot: Option<String>,
}

/// Which robot, and which of its values.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Followed {
    /// Only this robot; all that the token may see if it is missing.
    robot: Option<String>,
    /// Only these values: query addresses with commas between them, such as `axis-0,isMoving`. All if it is
    /// missing.
    signal: Option<String>,
}

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
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, Refusal> {
    let Which { robot } = read(which)?;
    let only = only(&caller, &state, robot)?;
    let last = state.shared.news.watch();
    let now = *last.borrow();
    let asked = headers.get("last-event-id").and_then(|id| id.to_str().ok());
    let (at, is_lost) = match asked.map(|id| resume(id, state.epoch)) {
        None => (now, false),
        Some(Some(id)) if id <= now => (id, false),
        // Of an earlier start of the gateway, or from the future: tell all that is kept.
        Some(_) => (0, true),
    };
    let stream = EventStream { state, caller, only, at, is_lost, last };
    Ok(Sse::new(unfold(stream, EventStream::next)).keep_alive(KeepAlive::default()))
}

/// The values of the robots as server-sent events: a `snapshot` of each robot, then a `change` with the
/// values that changed. Numbers grow by robot. A slow reader gets the latest values, and misses those in
/// between. A robot that is added or configured anew begins with a `snapshot`, and `removed` ends one.
#[utoipa::path(get, path = "/v1/live", params(Followed), responses(
    (status = 200, description = "The stream", content_type = "text/event-stream", body = LiveChange),
    (status = 404, description = "`no_such_robot`", body = Problem),
    (status = 422, description = "`bad_value`", body = Problem),
    OfRight,
))]
pub async fn live(
    caller: Caller,
    Of(state): Of<State>,
    followed: Result<Query<Followed>, QueryRejection>,
) -> Result<Sse<impl Stream<Item = Result<Event, Infallible>>>, Refusal> {
    let Followed { robot, signal } = read(followed)?;
    let only = only(&caller, &state, robot)?;
    let signals = signal.map(|words| signals(&words)).transpose()?;
    if let Some(signal) =
        signals.iter().flatten().find(|signal| !is_read(&caller, &state, only.as_deref(), signal))
    {
        let advice = "name it in `read` of the robot";
        return Err(bad_value(format!("signal: `{signal}` is not read from any robot: {advice}")));
    }
    let pulse = state.shared.pulse.subscribe();
    let stream = LiveStream {
        state,
        caller,
        only,
        signals,
        looked: false,
        sent: BTreeMap::new(),
        ready: VecDeque::new(),
        pulse,
    };
    Ok(Sse::new(unfold(stream, LiveStream::next)).keep_alive(KeepAlive::default()))
}

fn read<T>(query: Result<Query<T>, QueryRejection>) -> Result<T, Refusal> {
    query.map(|Query(read)| read).map_err(|error| bad_value(error.body_text()))
}

fn bad_value(message: String) -> Refusal {
    Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, Code::BadValue, message)
}

/// The query addresses in a text with commas between them, as the values are named.
fn signals(words: &str) -> Result<Vec<String>, Refusal> {
    let named = |word| Address::parse(word).map(|address| address.to_string());
    words
        .split(',')
        .map(named)
        .collect::<Result<_, _>>()
        .map_err(|error| bad_value(format!("signal: {error}")))
}

/// Whether a robot that the caller follows has this value among those that are read.
fn is_read(caller: &Caller, state: &State, only: Option<&str>, signal: &str) -> bool {
    let stations = state.fleet.stations();
    let mut seen = stations.iter().filter(|station| sees(caller, only, station.name()));
    seen.any(|station| station.config().all_addresses().iter().any(|address| address.to_string() == signal))
}

/// The robot that the caller wants to see, if it may.
fn only(caller: &Caller, state: &State, robot: Option<String>) -> Result<Option<String>, Refusal> {
    let Some(robot) = robot else { return Ok(None) };
    caller.must(Right::Read, &robot)?;
    match state.fleet.station(&robot) {
        Some(_) => Ok(Some(robot)),
        None => Err(Refusal::not_found(Code::NoSuchRobot, "there is no robot with this name")),
    }
}

/// The number of an event of this start of the gateway.
fn resume(id: &str, epoch: u64) -> Option<u64> {
    let (of, number) = id.split_once('-')?;
    (of.parse() == Ok(epoch)).then(|| number.parse().ok()).flatten()
}

struct EventStream {
    state: State,
    caller: Caller,
    only: Option<String>,
    /// The number of the last event that was looked at.
    at: u64,
    is_lost: bool,
    last: watch::Receiver<u64>,
}

impl EventStream {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        loop {
            if !self.state.tokens.is_valid(self.caller.token.number) {
                return None;
            }
            if std::mem::take(&mut self.is_lost) {
                return Some((Ok(Event::default().event("reset").data("{}")), self));
            }
            match self.state.shared.news.after(self.at) {
                Err(oldest) => (self.at, self.is_lost) = (oldest - 1, true),
                Ok(Some(event)) => {
                    self.at = event.id;
                    if sees(&self.caller, self.only.as_deref(), &event.robot) {
                        let id = format!("{}-{}", self.state.epoch, event.id);
                        return Some((Ok(message("event", &event).id(id)), self));
                    }
                }
                Ok(None) => {
                    let at = self.at;
                    let more = async { drop(self.last.wait_for(|last| *last > at).await) };
                    // The time is up: look at the token again.
                    let _ = tokio::time::timeout(LOOK, more).await;
                }
            }
        }
    }
}

struct LiveStream {
    state: State,
    caller: Caller,
    only: Option<String>,
    /// The values that are sent. `None` for all.
    signals: Option<Vec<String>>,
    /// Whether the snapshots were made.
    looked: bool,
    /// How far each robot was sent.
    sent: BTreeMap<String, Place>,
    /// Messages of the last look, at most one for each robot.
    ready: VecDeque<Event>,
    pulse: watch::Receiver<u64>,
}

impl LiveStream {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Some((Ok(event), self));
            }
            if !self.state.tokens.is_valid(self.caller.token.number) {
                return None;
            }
            if self.looked {
                tokio::time::sleep(PACE).await;
                let _ = tokio::time::timeout(LOOK, self.pulse.changed()).await;
            }
            self.look();
        }
    }

    fn look(&mut self) {
        self.looked = true;
        let stations = self.state.fleet.stations();
        let gone = |robot: &String| stations.iter().all(|station| station.name() != robot);
        let gone: Vec<_> = self.sent.keys().filter(|robot| gone(robot)).cloned().collect();
        for robot in gone {
            self.sent.remove(&robot);
            self.ready.push_back(message("removed", &LiveRemoved { robot }));
        }
        let seen = |station: &&Arc<Station>| sees(&self.caller, self.only.as_deref(), station.name());
        for station in stations.iter().filter(seen) {
            let robot = station.name().to_owned();
            let sent = self.sent.get(&robot).copied();
            match sent.and_then(|sent| station.changes_since(sent)) {
                None => {
                    let (place, mut state) = station.snapshot();
                    keep(self.signals.as_deref(), &mut state.signals);
                    self.sent.insert(robot, place);
                    self.ready.push_back(message("snapshot", &state));
                }
                Some((place, _)) if sent == Some(place) => {}
                Some((place, mut signals)) => {
                    self.sent.insert(robot.clone(), place);
                    keep(self.signals.as_deref(), &mut signals);
                    if signals.is_empty() {
                        continue;
                    }
                    let number = place.number;
                    self.ready.push_back(message("change", &LiveChange { robot, number, signals }));
                }
            }
        }
    }
}

/// Keeps the values that are followed.
fn keep(followed: Option<&[String]>, signals: &mut Vec<Signal>) {
    if let Some(followed) = followed {
        signals.retain(|signal| followed.contains(&signal.address));
    }
}

fn sees(caller: &Caller, only: Option<&str>, robot: &str) -> bool {
    caller.token.grant.covers(robot) && only.is_none_or(|only| only == robot)
}

fn message(kind: &str, data: &impl Serialize) -> Event {
    // Our own types always become JSON.
    Event::default().event(kind).json_data(data).unwrap_or_default()
}
