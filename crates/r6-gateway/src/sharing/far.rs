//! What other gateways tell of their robots, over the stream that browsers use.
//!
//! There is a task for each gateway that owns something and lives. It follows `GET /v1/live` there, with
//! values and events of the robots of that gateway alone, and keeps the latest of each robot (`live/far.rs`).
//! An event says that the state of a robot may be another one: then the list of the robots is read again.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use axum::body::Bytes;
use axum::http::{HeaderMap, Method};
use futures_util::StreamExt;
use http_body_util::{BodyExt, Limited};
use r6_api::gateway::{LiveMessage, LiveSent, RobotLink, RobotState, RobotSummary, Robots};
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio::time::{sleep, timeout};
use tokio_tungstenite::tungstenite::Message;

use super::Inner;
use crate::clock;
use crate::core::name::RobotName;
use crate::core::owner::Owned;
use crate::core::pass::Bearer;
use crate::fleet::config::RobotConfig;
use crate::live::far::Far;
use crate::ownership::owners::Place;
use crate::peers::Onward;

/// After a stream that ended, the next one begins so soon.
const AGAIN: Duration = Duration::from_millis(300);

/// How long a stream may say nothing. Its owner says every 2 s that it is alive.
const SILENCE: Duration = Duration::from_secs(3);

/// How long a list of robots may take, and how much of it is read: a robot takes some kilobytes at most.
const LIST_WITHIN: Duration = Duration::from_secs(2);
const MAX_LIST: usize = 8 * 1024 * 1024;

/// How long a look at the rows waits for what the store has of new robots: takeovers must not wait for it.
const KEPT_WITHIN: Duration = Duration::from_millis(300);

/// How long after an event the list is read: what happens together is read once.
const LIST_AFTER: Duration = Duration::from_millis(50);

/// The stream: values, events, and signs of life.
const LIVE: &str = "/v1/live?events=true&alive=true";

/// The tasks, by the numbers of the gateways.
#[derive(Debug, Default)]
pub struct Links(BTreeMap<u64, Link>);

/// A task that ends when this is dropped.
#[derive(Debug)]
struct Link(JoinHandle<()>);

impl Drop for Link {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Links {
    /// Follows these gateways and no others, and knows these robots and no others.
    pub async fn update(&mut self, inner: &Arc<Inner>, robots: &BTreeMap<RobotName, RobotConfig>) {
        let gateways: BTreeSet<_> = robots
            .keys()
            .filter_map(|name| match inner.owners.place(&Owned::Robot(name.clone())) {
                Place::There(number) => Some(number),
                Place::Here | Place::Nowhere => None,
            })
            .collect();
        self.0.retain(|number, link| gateways.contains(number) && !link.0.is_finished());
        for number in gateways {
            let start = || Link(tokio::spawn(follow(Arc::clone(inner), number)));
            self.0.entry(number).or_insert_with(start);
        }
        inner.look_after_far(robots).await;
    }
}

impl Inner {
    /// Adds the robots that are not here, removes those that are gone, and loses those whose owner is another
    /// one, or does not live.
    async fn look_after_far(&self, robots: &BTreeMap<RobotName, RobotConfig>) {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        let mut is_changed = false;
        let is_new = |name: &&RobotName| {
            fleet.station(name.as_str()).is_none() && shared.far.one(name.as_str()).is_none()
        };
        let new: Vec<_> = robots.keys().filter(is_new).cloned().collect();
        // Whether a stop holds, the store knows. Without it the robots are not told of yet.
        let kept = match new.is_empty() {
            true => Vec::new(),
            false => {
                let names = new.clone();
                let kept = shared.keeper.work(move |store| store.kept(&names));
                // The next look asks again.
                timeout(KEPT_WITHIN, kept).await.unwrap_or_else(|_| Ok(Vec::new())).unwrap_or_default()
            }
        };
        let mut kept: BTreeMap<_, _> = new.into_iter().zip(kept.into_iter().map(|(seat, _)| seat)).collect();
        for (name, config) in robots {
            if fleet.station(name.as_str()).is_some() {
                continue;
            }
            match shared.far.one(name.as_str()) {
                None => {
                    let Some(seat) = kept.remove(name) else { continue };
                    let mut state = unknown(config);
                    state.summary.stopped = seat.stopped;
                    state.summary.stopped_by = seat.stopped_by;
                    state.summary.identity = seat.identity;
                    let fresh_for = fresh_for(config);
                    shared.far.put(|| Far::new(state, shared.epoch, fresh_for, shared.draw()));
                    is_changed = true;
                }
                Some(far) => {
                    let place = self.owners.place(&Owned::Robot(name.clone()));
                    let is_told = far.owner().is_none_or(|owner| place == Place::There(owner));
                    is_changed |= !is_told && far.lose(|| shared.draw());
                }
            }
        }
        let is_known = |name: &str| robots.keys().any(|known| known.as_str() == name);
        // Before the lock of the far robots: readers take both in the other order.
        let here: BTreeSet<_> = fleet.stations().iter().map(|station| station.name().to_owned()).collect();
        shared.far.retain(
            |name| is_known(name) && !here.contains(name),
            || {
                shared.note_removal();
            },
        );
        if is_changed {
            shared.wake_readers();
        }
    }
}

impl Inner {
    /// What readers see of a robot of this gateway from when it is let go of until its next owner tells of
    /// it.
    pub fn show_as_far(&self, name: &RobotName) {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        if let Some(station) = fleet.station(name.as_str()) {
            let (state, config) = (station.state(), station.config());
            shared.far.put(|| Far::new(state, shared.epoch, fresh_for(&config), shared.draw()));
        }
    }
}

/// A robot of which nothing is known but how it is configured.
fn unknown(config: &RobotConfig) -> RobotState {
    let summary = RobotSummary {
        name: config.name.to_string(),
        address: config.address.clone(),
        managed_by: config.managed_by,
        model: config.model.clone(),
        guard: config.guard.as_ref().map(|guard| guard.told().clone()),
        link: RobotLink::Down,
        r#virtual: None,
        twin_of: None,
        twin: None,
        panel: false,
        identity: None,
        identity_changed: None,
        lease: None,
        stopped: false,
        stopped_by: None,
        stops_under_way: 0,
        stop_number: 0,
        global_speed: None,
    };
    let period_ms = u64::try_from(config.period.as_millis()).unwrap_or(u64::MAX);
    RobotState { summary, period_ms, epoch: 0, number: 0, signals: Vec::new() }
}

/// The greatest age that a value is told as fresh with.
fn fresh_for(config: &RobotConfig) -> Duration {
    config.period + config.settings.liveness.suspect_after
}

/// Follows a gateway, for as long as it is polled.
async fn follow(inner: Arc<Inner>, number: u64) {
    let dirty = Notify::new();
    loop {
        let stream = read_stream(&inner, number, &dirty);
        let list = keep_list(&inner, number, &dirty);
        let why = tokio::select! {
            why = stream => why,
            () = list => "the list ended".to_owned(),
        };
        tracing::debug!(gateway = number, why, "the stream of another gateway ended");
        lose(&inner, number);
        sleep(AGAIN).await;
    }
}

/// What this gateway told of is not heard of any more.
fn lose(inner: &Inner, number: u64) {
    let shared = &inner.state.shared;
    let all: Vec<_> = shared.far.read().values().cloned().collect();
    for far in all.iter().filter(|far| far.owner() == Some(number)) {
        far.lose(|| shared.draw());
    }
    shared.wake_readers();
}

fn asks(target: &str) -> Onward {
    Onward {
        method: Method::GET,
        target: target.to_owned(),
        headers: HeaderMap::new(),
        body: Bytes::new(),
        bearer: (Bearer::Gateway, None),
    }
}

/// Reads the stream of a gateway to its end. Returns why it ended.
async fn read_stream(inner: &Inner, number: u64, dirty: &Notify) -> String {
    let mut stream = match inner.owners.open_stream(number, asks(LIVE)).await {
        Ok(stream) => stream,
        Err(error) => return error,
    };
    loop {
        let message = match timeout(SILENCE, stream.next()).await {
            Err(_) => return format!("it said nothing for {SILENCE:?}"),
            Ok(None) => return "it was closed".to_owned(),
            Ok(Some(Err(error))) => return error.to_string(),
            Ok(Some(Ok(message))) => message,
        };
        let text = match message {
            Message::Text(text) => text,
            Message::Close(_) => return "it was closed".to_owned(),
            // The answers to pings are given while the stream is read.
            Message::Ping(_) | Message::Pong(_) | Message::Binary(_) | Message::Frame(_) => continue,
        };
        match serde_json::from_str::<LiveSent>(&text) {
            Ok(sent) => {
                if !take(inner, number, sent.message, dirty) {
                    return "something was missed".to_owned();
                }
            }
            // A newer r6 may tell more.
            Err(error) => tracing::debug!(gateway = number, %error, "a message of another gateway"),
        }
    }
}

/// Takes in a message. `false`: something was missed.
fn take(inner: &Inner, number: u64, message: LiveMessage, dirty: &Notify) -> bool {
    let shared = &inner.state.shared;
    match message {
        LiveMessage::Snapshot(state) => {
            let name = state.summary.name.clone();
            // What is not known here is known with the next look at the rows.
            let Some(config) = inner.owners.robot(&name) else { return true };
            match shared.far.one(&name) {
                Some(far) => far.take_snapshot(number, *state, || shared.draw()),
                None if inner.state.fleet.station(&name).is_none() => {
                    let fresh_for = fresh_for(&config);
                    shared.far.put(|| Far::new(unknown(&config), shared.epoch, fresh_for, shared.draw()));
                    if let Some(far) = shared.far.one(&name) {
                        far.take_snapshot(number, *state, || shared.draw());
                    }
                }
                None => {}
            }
            shared.wake_readers();
        }
        LiveMessage::Change(change) => {
            let far = shared.far.one(&change.robot);
            if far.is_some_and(|far| {
                far.owner() == Some(number) && !far.take_change(number, change, || shared.draw())
            }) {
                return false;
            }
            shared.wake_readers();
        }
        LiveMessage::Event(event) => {
            shared.news.add_far(event.time, &event.robot, event.happened);
            dirty.notify_one();
        }
        LiveMessage::Alive(alive) => {
            if let Some(ago) = alive.passed_ms_ago {
                let until = clock::before(clock::now(), Duration::from_millis(ago));
                let all: Vec<_> = shared.far.read().values().cloned().collect();
                all.iter().for_each(|far| far.confirm(number, until));
            }
            // Also without an event: a lease is renewed without one.
            dirty.notify_one();
        }
        LiveMessage::EventsLost(_) | LiveMessage::Reset(_) => dirty.notify_one(),
        LiveMessage::Removed(removed) => {
            // Its next owner tells of it, or the next look says that it is gone.
            if let Some(far) = shared.far.one(&removed.robot).filter(|far| far.owner() == Some(number)) {
                far.lose(|| shared.draw());
                shared.wake_readers();
            }
        }
        LiveMessage::Subscribed(_) | LiveMessage::Problem(_) => {}
    }
    true
}

/// Reads the list of the robots of a gateway again, each time that it may be another one.
async fn keep_list(inner: &Inner, number: u64, dirty: &Notify) {
    loop {
        dirty.notified().await;
        sleep(LIST_AFTER).await;
        match timeout(LIST_WITHIN, read_list(inner, number)).await {
            Ok(Ok(list)) => {
                for summary in list.robots {
                    if let Some(far) = inner.state.shared.far.one(&summary.name) {
                        far.take_summary(number, summary);
                    }
                }
            }
            Ok(Err(error)) => tracing::debug!(gateway = number, error, "the robots of another gateway"),
            Err(_) => tracing::debug!(gateway = number, "another gateway did not list its robots in time"),
        }
    }
}

async fn read_list(inner: &Inner, number: u64) -> Result<Robots, String> {
    let answer =
        inner.owners.send(number, asks("/v1/robots")).await.map_err(|failed| format!("{failed:?}"))?;
    if !answer.status().is_success() {
        return Err(format!("status {}", answer.status()));
    }
    let body =
        Limited::new(answer.into_body(), MAX_LIST).collect().await.map_err(|error| error.to_string())?;
    serde_json::from_slice(&body.to_bytes()).map_err(|error| error.to_string())
}
