//! What other gateways tell of their robots, over the stream that browsers use.
//!
//! There is a task for each gateway that lives. It follows `GET /v1/live` there, with values and events of
//! the robots of that gateway alone, and keeps the latest of each robot (`live/far.rs`). An event says that
//! the state of a robot may be another one: then the list of the robots is read again, and readers here get
//! the event after that. So what they read first is as new as the events that they do not get.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use futures_util::StreamExt;
use r6_api::gateway::{Event, LiveMessage, LiveSent, RobotLink, RobotState, RobotSummary, Robots};
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, timeout};
use tokio_tungstenite::tungstenite::Message;

use super::Inner;
use crate::clock;
use crate::core::name::RobotName;
use crate::core::owner::Owned;
use crate::fleet::config::RobotConfig;
use crate::live::far::{Far, HEARD, Shown, Teller};
use crate::live::news::News;
use crate::ownership::owners::Place;
use crate::peers::{asks, read};

/// After a stream that ended, the next one begins so soon.
const AGAIN: Duration = Duration::from_millis(300);

/// How long a stream may say nothing. Its gateway says twice a second that it is alive.
const SILENCE: Duration = HEARD;

/// How long a list of robots may take.
const LIST_WITHIN: Duration = Duration::from_secs(1);

/// How long after an event the list is read: what happens together is read once.
const LIST_AFTER: Duration = Duration::from_millis(20);

/// How many events wait for a list: as many as a gateway keeps.
const MAX_WAITING: usize = 1_000;

/// How old the list may be without an event: a lease is renewed without one.
const LIST_EACH: Duration = Duration::from_secs(2);

/// How long a look at the rows waits for what the store has of new robots: takeovers must not wait for it.
const KEPT_WITHIN: Duration = Duration::from_millis(300);

/// The stream: values, events, and signs of life.
const LIVE: &str = "/v1/live?events=true&alive=true";

/// The tasks, by the numbers of the gateways.
#[derive(Debug, Default)]
pub struct Links(BTreeMap<u64, Link>);

/// A task that ends when this is dropped.
#[derive(Debug)]
struct Link {
    task: JoinHandle<()>,
    /// Whether its stream was open since it was lost last.
    is_open: Arc<AtomicBool>,
}

impl Drop for Link {
    fn drop(&mut self) {
        self.task.abort();
    }
}

impl Links {
    /// Follows the gateways that live and no others, and knows these robots and no others.
    pub async fn update(&mut self, inner: &Arc<Inner>, robots: &BTreeMap<RobotName, RobotConfig>) {
        let gateways = inner.owners.alive();
        let gone: Vec<_> = self.0.keys().filter(|number| !gateways.contains(number)).copied().collect();
        for number in gone {
            if let Some(link) = self.0.remove(&number) {
                link.task.abort();
                lose(inner, number, &link.is_open);
            }
        }
        for number in gateways.iter().copied() {
            self.0.entry(number).or_insert_with(|| {
                let is_open = Arc::new(AtomicBool::new(false));
                let task = tokio::spawn(follow(Arc::clone(inner), number, Arc::clone(&is_open)));
                Link { task, is_open }
            });
        }
        inner.look_after_far(robots, &gateways).await;
    }
}

impl Inner {
    /// Adds the robots that are not known yet, removes those that are gone, and says whose copy counts.
    async fn look_after_far(&self, robots: &BTreeMap<RobotName, RobotConfig>, gateways: &BTreeSet<u64>) {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        let mut is_changed = self.add_new(robots).await;
        for name in robots.keys() {
            let Some(far) = shared.far.one(name.as_str()) else { continue };
            let owner = match self.owners.place(&Owned::Robot(name.clone())) {
                Place::There(number) => Some(number),
                Place::Here | Place::Nowhere => None,
            };
            is_changed |= far.settle(owner, gateways, || shared.draw());
        }
        let is_known = |name: &str| RobotName::new(name).is_some_and(|name| robots.contains_key(&name));
        // A robot that was just added somewhere else may be told of before the rows have it. A copy of a
        // robot of this gateway stays, because its next owner may tell of it before this gateway has let go
        // of it.
        let stays = |far: &Far, name: &str| far.is_told() || is_known(name) || fleet.station(name).is_some();
        let gone: BTreeSet<_> = {
            let all = shared.far.all();
            let names = all.iter().map(|far| (far, far.name()));
            names.filter(|(far, name)| !stays(far, name)).map(|(_, name)| name.to_owned()).collect()
        };
        if !gone.is_empty() {
            // Readers take the lock of the fleet before that of the far robots, so no robot is looked for
            // here.
            shared.far.retain(|far| !gone.contains(far.name()) || far.is_told(), || shared.note_removal());
            is_changed = true;
        }
        if is_changed {
            shared.wake_readers();
        }
    }

    /// Adds the robots that are not known yet. Returns whether there are any.
    async fn add_new(&self, robots: &BTreeMap<RobotName, RobotConfig>) -> bool {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        let is_new = |name: &&RobotName| {
            fleet.station(name.as_str()).is_none() && shared.far.one(name.as_str()).is_none()
        };
        let new: Vec<_> = robots.keys().filter(is_new).cloned().collect();
        if new.is_empty() {
            return false;
        }
        // Whether a stop holds, the store knows. Without it the robots are not told of yet; the next look
        // asks again.
        let names = new.clone();
        let kept = shared.keeper.work(move |store| store.kept(&names));
        let Ok(Ok(kept)) = timeout(KEPT_WITHIN, kept).await else { return false };
        for (config, (seat, _)) in new.iter().filter_map(|name| robots.get(name)).zip(kept) {
            let mut state = unknown(config);
            state.summary.stopped = seat.stopped;
            state.summary.stopped_by = seat.stopped_by;
            state.summary.identity = seat.identity;
            shared.far.one_or(config.name.as_str(), || Far::new(state, shared.epoch, shared.draw()));
        }
        true
    }

    /// Lets go of a robot, until this is over. From then on readers see what this gateway knew of it, until
    /// its next owner tells of it.
    pub async fn let_go(&self, name: &RobotName, over: impl Future<Output = ()>) {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        let Some(station) = fleet.station(name.as_str()) else { return };
        let make = || Far::new(unknown(&station.config()), shared.epoch, shared.draw());
        let far = shared.far.one_or(name.as_str(), make);
        far.leave(station.state(), || shared.draw());
        fleet.let_go(name, over).await;
        // The arm may have been stopped in the end.
        far.take_last(station.summary());
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

/// Events that wait until the list was read again.
#[derive(Debug, Default)]
struct Waiting {
    /// `None`: some were lost.
    events: Mutex<VecDeque<Option<Event>>>,
    /// The list may be another one.
    dirty: Notify,
}

impl Waiting {
    fn add(&self, event: Option<Event>) {
        let mut events = self.events();
        if events.len() < MAX_WAITING {
            events.push_back(event);
        } else if let Some(last) = events.back_mut() {
            *last = None;
        }
        self.dirty.notify_one();
    }

    fn count(&self) -> usize {
        self.events().len()
    }

    /// Tells the first so many to the readers.
    fn tell(&self, news: &News, count: usize) {
        let told: Vec<_> = {
            let mut events = self.events();
            let count = count.min(events.len());
            events.drain(..count).collect()
        };
        for event in told {
            match event {
                Some(Event { time, robot, happened, .. }) => news.add_far(time, &robot, happened),
                None => news.lose_far(),
            }
        }
    }

    fn events(&self) -> MutexGuard<'_, VecDeque<Option<Event>>> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Follows a gateway, for as long as it is polled.
async fn follow(inner: Arc<Inner>, number: u64, is_open: Arc<AtomicBool>) {
    let waiting = Waiting::default();
    loop {
        let stream = read_stream(&inner, number, &is_open, &waiting);
        let list = keep_list(&inner, number, &waiting);
        let why = tokio::select! {
            why = stream => why,
            why = list => why,
        };
        tracing::debug!(gateway = number, why, "the stream of another gateway ended");
        waiting.tell(&inner.state.shared.news, usize::MAX);
        lose(&inner, number, &is_open);
        sleep(AGAIN).await;
    }
}

/// What this gateway told of is not heard of any more.
fn lose(inner: &Inner, number: u64, is_open: &AtomicBool) {
    let shared = &inner.state.shared;
    for far in shared.far.all() {
        far.forget(number, || shared.draw());
    }
    if is_open.swap(false, Ordering::SeqCst) {
        // The next stream begins with what happens from then on.
        shared.news.lose_far();
    }
    shared.wake_readers();
}

/// Reads the stream of a gateway to its end. Returns why it ended.
async fn read_stream(inner: &Inner, number: u64, is_open: &AtomicBool, waiting: &Waiting) -> String {
    let mut stream = match inner.owners.open_stream(number, asks(LIVE)).await {
        Ok(stream) => stream,
        Err(error) => return error,
    };
    is_open.store(true, Ordering::SeqCst);
    let teller = Arc::new(Teller::new(number));
    let mut listed = Instant::now();
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
                if !take(inner, &teller, sent.message, waiting) {
                    return "something was missed".to_owned();
                }
            }
            // A newer r6 may tell more.
            Err(error) => tracing::debug!(gateway = number, %error, "a message of another gateway"),
        }
        if listed.elapsed() >= LIST_EACH {
            listed = Instant::now();
            waiting.dirty.notify_one();
        }
    }
}

/// Takes in a message. `false`: something was missed.
fn take(inner: &Inner, teller: &Arc<Teller>, message: LiveMessage, waiting: &Waiting) -> bool {
    let shared = &inner.state.shared;
    let number = teller.number();
    match message {
        LiveMessage::Snapshot(state) => {
            let config = inner.owners.robot(&state.summary.name);
            let is_its = |name| inner.owners.place(&Owned::Robot(name)) == Place::There(number);
            if !RobotName::new(&state.summary.name).is_some_and(is_its) {
                // The rows say more: it was just added, or has another owner.
                inner.look_soon.notify_one();
            }
            let settings =
                config.map_or_else(|| inner.sharing.robot_settings.clone(), |config| config.settings);
            let suspect_after = settings.liveness.suspect_after;
            let fresh_for = Duration::from_millis(state.period_ms).saturating_add(suspect_after);
            let make = || Far::new((*state).clone(), shared.epoch, shared.draw());
            let far = shared.far.one_or(&state.summary.name, make);
            far.take_snapshot(teller, *state, fresh_for, || shared.draw());
            shared.wake_readers();
        }
        LiveMessage::Change(change) => {
            // A robot that was removed here is told of with `removed`.
            if let Some(far) = shared.far.one(&change.robot)
                && !far.take_change(number, change, || shared.draw())
            {
                return false;
            }
            shared.wake_readers();
        }
        LiveMessage::Event(event) => waiting.add(Some(event)),
        LiveMessage::Alive(alive) => {
            if let Some(ago) = alive.passed_ms_ago {
                teller.confirm(clock::before(clock::now(), Duration::from_millis(ago)));
            }
        }
        LiveMessage::EventsLost(_) => waiting.add(None),
        LiveMessage::Reset(_) => waiting.dirty.notify_one(),
        LiveMessage::Removed(removed) => {
            // Its next owner tells of it, or the next look says that it is gone.
            if shared.far.one(&removed.robot).is_some_and(|far| far.forget(number, || shared.draw())) {
                shared.wake_readers();
            }
        }
        LiveMessage::Subscribed(_) | LiveMessage::Problem(_) => {}
    }
    true
}

/// Reads the list of the robots of a gateway again, each time that it may be another one. Returns why that
/// cannot be done: then the stream begins anew, because what is told of its robots would grow old.
async fn keep_list(inner: &Inner, number: u64, waiting: &Waiting) -> String {
    let mut is_failed = false;
    loop {
        waiting.dirty.notified().await;
        sleep(LIST_AFTER).await;
        let count = waiting.count();
        let list = timeout(LIST_WITHIN, read_list(inner, number)).await;
        match list.unwrap_or_else(|_| Err(format!("no list of robots within {LIST_WITHIN:?}"))) {
            Ok(list) => {
                is_failed = false;
                for summary in list.robots {
                    if let Some(far) = inner.state.shared.far.one(&summary.name) {
                        far.take_summary(number, summary);
                    }
                }
                waiting.tell(&inner.state.shared.news, count);
            }
            Err(error) if is_failed => return error,
            Err(error) => {
                tracing::debug!(gateway = number, error, "the robots of another gateway");
                is_failed = true;
                waiting.dirty.notify_one();
            }
        }
    }
}

async fn read_list(inner: &Inner, number: u64) -> Result<Robots, String> {
    let answer = inner.owners.send(number, asks("/v1/robots")).await;
    read(answer.map_err(|failed| format!("{failed:?}"))?).await
}
