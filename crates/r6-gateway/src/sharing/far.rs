//! What other gateways tell of their robots, over the stream that browsers use.
//!
//! There is a task for each gateway that lives. It follows `GET /v1/live` there, with values and events of
//! the robots of that gateway alone, and keeps the latest of each robot (`live/far.rs`). Some events say that
//! the state of a robot is another one: then the list of the robots is read again, and readers here get the
//! event after that. So what they read first is as new as the events that they do not get. Of a robot that
//! no gateway tells of, the store says twice a second whether a stop holds.

mod waiting;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use r6_api::gateway::{
    Happened, LeaseEnd, LiveMessage, LiveSent, RobotLink, RobotState, RobotSummary, Robots,
};
use r6_proto::time::Instant as Time;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, timeout};
use tokio_tungstenite::tungstenite::Message;

use self::waiting::Waiting;
use super::Inner;
use crate::clock;
use crate::core::name::RobotName;
use crate::core::owner::{LOOK, Owned};
use crate::core::seat::Saved;
use crate::fleet::config::RobotConfig;
use crate::fleet::group::PollGroup;
use crate::live::far::{Far, HEARD, Shown as _, Teller};
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

/// The shortest time between two lists, which may have hundreds of robots.
const LIST_PACE: Duration = Duration::from_millis(200);

/// After this time without a list the stream begins anew. One list that is slow ends no stream: the values
/// come, and readers are told how far the rest is behind.
const LIST_FAILS: Duration = Duration::from_secs(5);

/// After this time without a stream of a gateway that lives, the log says so. A takeover takes less.
const WARN_AFTER: Duration = Duration::from_secs(5);

/// How old the list may be without an event: a lease is renewed without one.
const LIST_EACH: Duration = Duration::from_secs(2);

/// How often the store is asked for robots that no gateway tells of: a gateway that ends may leave a
/// thousand, and they are taken over meanwhile.
const KEPT_EACH: Duration = LOOK;

/// How long a look at the rows waits for what the store has of new robots: takeovers must not wait for it.
const KEPT_WITHIN: Duration = Duration::from_millis(300);

/// The stream: values, events, and signs of life.
const LIVE: &str = "/v1/live?events=true&alive=true";

/// The tasks, by the numbers of the gateways.
#[derive(Debug, Default)]
pub struct Links {
    links: BTreeMap<u64, Link>,
    /// What asks the store, and since when. There is one question at a time.
    asked: Option<(JoinHandle<()>, Instant)>,
}

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
        let gone: Vec<_> = self.links.keys().filter(|number| !gateways.contains(number)).copied().collect();
        for number in gone {
            if let Some(link) = self.links.remove(&number) {
                link.task.abort();
                lose(inner, number, &link.is_open);
            }
        }
        for number in gateways.iter().copied() {
            self.links.entry(number).or_insert_with(|| {
                let is_open = Arc::new(AtomicBool::new(false));
                let task = tokio::spawn(follow(Arc::clone(inner), number, Arc::clone(&is_open)));
                Link { task, is_open }
            });
        }
        self.look_into_store(inner, robots).await;
        if inner.look_after_far(robots, &gateways) {
            inner.state.shared.wake_readers();
        }
    }

    /// Asks the store for robots that no gateway tells of: whether a stop holds, it knows first. Robots that
    /// are not known here are told of from then on.
    async fn look_into_store(&mut self, inner: &Arc<Inner>, robots: &BTreeMap<RobotName, RobotConfig>) {
        let is_due =
            |(task, since): &(JoinHandle<()>, Instant)| task.is_finished() && since.elapsed() >= KEPT_EACH;
        let untold = inner.untold(robots);
        if untold.is_empty() || self.asked.as_ref().is_some_and(|asked| !is_due(asked)) {
            return;
        }
        let is_new = |config: &RobotConfig| inner.state.shared.far.one(config.name.as_str()).is_none();
        let waits = untold.iter().any(is_new);
        let mut task = tokio::spawn(ask_store(Arc::clone(inner), untold));
        if waits {
            let _ = timeout(KEPT_WITHIN, &mut task).await;
        }
        self.asked = Some((task, Instant::now()));
    }
}

/// Asks the store for these robots, and takes in what it has.
async fn ask_store(inner: Arc<Inner>, robots: Vec<RobotConfig>) {
    let (asked, shared) = (clock::now(), &inner.state.shared);
    let names: Vec<_> = robots.iter().map(|config| config.name.clone()).collect();
    match shared.keeper.work(move |store| store.kept(&names)).await {
        Ok(kept) => {
            let all = robots.iter().zip(kept.into_iter().map(|(saved, _)| saved));
            let changed = all.filter(|(config, saved)| inner.take_saved(config, saved, asked));
            if changed.count() > 0 {
                shared.wake_readers();
            }
        }
        // The next look asks again.
        Err(error) => tracing::debug!(%error, "robots that no gateway tells of"),
    }
}

impl Inner {
    /// The robots that no gateway tells of.
    fn untold(&self, robots: &BTreeMap<RobotName, RobotConfig>) -> Vec<RobotConfig> {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        let has_owner = |name: &str| shared.far.one(name).is_some_and(|far| far.has_owner());
        let is_untold =
            |name: &RobotName| fleet.station(name.as_str()).is_none() && !has_owner(name.as_str());
        robots.values().filter(|config| is_untold(&config.name)).cloned().collect()
    }

    /// Takes in what the store had of a robot, which was asked for then. Returns whether readers are told.
    fn take_saved(&self, config: &RobotConfig, saved: &Saved, asked: Time) -> bool {
        let shared = &self.state.shared;
        let known = shared.far.one(config.name.as_str());
        let is_new = known.is_none();
        let far = known.unwrap_or_else(|| {
            let make = || Far::new(of_store(config, saved), shared.epoch, shared.draw());
            shared.far.one_or(config.name.as_str(), make)
        });
        far.take_saved(saved, asked, || shared.draw()) || is_new
    }

    /// Says whose copy counts, and removes robots that are gone. Returns whether readers are told.
    fn look_after_far(&self, robots: &BTreeMap<RobotName, RobotConfig>, gateways: &BTreeSet<u64>) -> bool {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        let mut is_changed = false;
        // Some may be in the file of another gateway alone.
        for far in shared.far.all() {
            let owned = RobotName::new(far.name()).map(Owned::Robot);
            let owner = match owned.map(|owned| self.owners.place(&owned)) {
                Some(Place::There(number)) => Some(number),
                Some(Place::Here | Place::Nowhere) | None => None,
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
        is_changed
    }

    /// Lets go of a robot, until this is over. From then on readers see what this gateway knew of it, until
    /// its next owner tells of it.
    pub async fn let_go(&self, name: &RobotName, cause: LeaseEnd, over: impl Future<Output = ()>) {
        let (shared, fleet) = (&self.state.shared, &self.state.fleet);
        let Some(station) = fleet.station(name.as_str()) else { return };
        let make = || Far::new(unknown(&station.config()), shared.epoch, shared.draw());
        let far = shared.far.one_or(name.as_str(), make);
        far.leave(station.state(), || shared.draw());
        fleet.let_go(name, cause, over).await;
        // The arm may have been stopped in the end.
        far.take_last(station.summary(), || shared.draw());
        shared.wake_readers();
    }
}

/// A robot of which nothing is known but what the store has.
fn of_store(config: &RobotConfig, saved: &Saved) -> RobotState {
    let mut state = unknown(config);
    state.summary.stopped = saved.stopped;
    state.summary.stopped_by.clone_from(&saved.stopped_by);
    state.summary.identity.clone_from(&saved.identity);
    state
}

/// A robot of which nothing is known but how it is configured.
fn unknown(config: &RobotConfig) -> RobotState {
    let summary = RobotSummary {
        name: config.name.to_string(),
        address: config.address.clone(),
        managed_by: config.managed_by,
        model: config.model.clone(),
        guard: config.guard.as_ref().map(|guard| guard.told()),
        parts: config.parts().map(|address| address.to_string()),
        owner: None,
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
    let groups = config.groups.iter().map(PollGroup::told).collect();
    RobotState { summary, period_ms, groups, epoch: 0, number: 0, signals: Vec::new() }
}

/// Follows a gateway, for as long as it is polled.
async fn follow(inner: Arc<Inner>, number: u64, is_open: Arc<AtomicBool>) {
    let mut lost_at = Instant::now();
    let mut is_told = false;
    loop {
        let (teller, waiting) = (Arc::new(Teller::new(number)), Waiting::default());
        let stream = read_stream(&inner, &teller, &is_open, &waiting);
        let list = keep_list(&inner, &teller, &waiting);
        let why = tokio::select! {
            why = stream => why,
            why = list => why,
        };
        tracing::debug!(gateway = number, why, "the stream of another gateway ended");
        if is_open.load(Ordering::SeqCst) {
            (lost_at, is_told) = (Instant::now(), false);
        }
        waiting.tell(&inner, number, usize::MAX);
        lose(&inner, number, &is_open);
        if lost_at.elapsed() >= WARN_AFTER && !std::mem::replace(&mut is_told, true) {
            tracing::warn!(
                gateway = number,
                why,
                "another gateway lives and does not tell of its robots: nothing new is known of them here"
            );
        }
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
        // It may have told more.
        shared.news.lose_far();
        // Whether a stop holds, the store says.
        inner.look_soon.notify_one();
    }
    shared.wake_readers();
}

/// Reads the stream of a gateway to its end. Returns why it ended.
async fn read_stream(inner: &Inner, teller: &Arc<Teller>, is_open: &AtomicBool, waiting: &Waiting) -> String {
    let number = teller.number();
    let mut stream = match inner.owners.open_stream(number, asks(LIVE)).await {
        Ok(stream) => stream,
        Err(error) => return error,
    };
    is_open.store(true, Ordering::SeqCst);
    // It begins with what happens from now on.
    inner.state.shared.news.lose_far();
    let (mut listed, mut heard) = (Instant::now(), clock::now());
    // When the last ping left that was answered: what comes now left there after that.
    let mut answered = None;
    loop {
        let message = match timeout(SILENCE, stream.next()).await {
            Err(_) => return format!("it said nothing for {SILENCE:?}"),
            Ok(None) => return "it was closed".to_owned(),
            Ok(Some(Err(error))) => return error.to_string(),
            Ok(Some(Ok(message))) => message,
        };
        let now = clock::now();
        if now.since(std::mem::replace(&mut heard, now)) > SILENCE {
            // What waits to be read is as old as that.
            return format!("this gateway did nothing for {SILENCE:?}");
        }
        let text = match message {
            Message::Text(text) => text,
            Message::Close(_) => return "it was closed".to_owned(),
            Message::Pong(sent) => {
                answered = sent.as_ref().try_into().ok().map(u64::from_be_bytes).map(Time::from_nanos);
                continue;
            }
            // The answers to pings are given while the stream is read.
            Message::Ping(_) | Message::Binary(_) | Message::Frame(_) => continue,
        };
        match serde_json::from_str::<LiveSent>(&text) {
            Ok(LiveSent { message: LiveMessage::Alive(alive), .. }) => {
                if let (Some(ago), Some(left)) = (alive.passed_ms_ago, answered) {
                    teller.confirm(clock::before(left, Duration::from_millis(ago)));
                }
                let ping = Message::Ping(clock::now().as_nanos().to_be_bytes().to_vec().into());
                match timeout(SILENCE, stream.send(ping)).await {
                    Ok(Ok(())) => {}
                    Ok(Err(error)) => return error.to_string(),
                    Err(_) => return format!("it took nothing for {SILENCE:?}"),
                }
            }
            Ok(sent) => {
                if !take(inner, teller, sent.message, waiting) {
                    return "something was missed".to_owned();
                }
            }
            Err(error) => {
                // A newer r6 may tell of more.
                tracing::debug!(gateway = number, %error, "a message of another gateway cannot be read");
                waiting.lose();
            }
        }
        teller.hold_back(waiting.since());
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
            let make = || Far::new((*state).clone(), shared.epoch, shared.draw());
            let far = shared.far.one_or(&state.summary.name, make);
            far.take_snapshot(teller, *state, suspect_after, || shared.draw());
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
        LiveMessage::Event(event) => {
            if let (Happened::StopBegan { holds: true, .. }, Some(far)) =
                (&event.happened, shared.far.one(&event.robot))
            {
                far.take_stop(number);
            }
            waiting.add(event, inner, number);
        }
        LiveMessage::EventsLost(_) => waiting.lose(),
        LiveMessage::Reset(_) => waiting.dirty.notify_one(),
        LiveMessage::Removed(removed) => {
            // Its next owner tells of it, or the next look says that it is gone.
            if shared.far.one(&removed.robot).is_some_and(|far| far.forget(number, || shared.draw())) {
                shared.wake_readers();
            }
        }
        LiveMessage::Alive(_) | LiveMessage::Subscribed(_) | LiveMessage::Problem(_) => {}
    }
    true
}

/// Reads the list of the robots of a gateway again, each time that it may be another one. Returns why that
/// cannot be done: then the stream begins anew, because what is told of its robots would grow old.
async fn keep_list(inner: &Inner, teller: &Teller, waiting: &Waiting) -> String {
    let number = teller.number();
    let mut failed_since = None;
    loop {
        waiting.dirty.notified().await;
        sleep(LIST_AFTER).await;
        let (count, begun, asked) = (waiting.count(), Instant::now(), clock::now());
        let list = timeout(LIST_WITHIN, read_list(inner, number)).await;
        match list.unwrap_or_else(|_| Err(format!("no list of robots within {LIST_WITHIN:?}"))) {
            Ok(list) => {
                failed_since = None;
                for summary in list.robots {
                    if let Some(far) = inner.state.shared.far.one(&summary.name) {
                        far.take_summary(number, summary, asked);
                    }
                }
                waiting.tell(inner, number, count);
                teller.hold_back(waiting.since());
            }
            Err(error) => {
                let since = *failed_since.get_or_insert(begun);
                if since.elapsed() >= LIST_FAILS {
                    return error;
                }
                tracing::debug!(gateway = number, error, "the robots of another gateway");
                waiting.dirty.notify_one();
            }
        }
        sleep(LIST_PACE.saturating_sub(begun.elapsed())).await;
    }
}

async fn read_list(inner: &Inner, number: u64) -> Result<Robots, String> {
    let answer = inner.owners.send(number, asks("/v1/robots")).await;
    read(answer.map_err(|failed| format!("{failed:?}"))?).await
}
