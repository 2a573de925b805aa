//! The messages of one reader, made one at a time as the reader takes them.
//!
//! Nothing waits for a slow reader: a value is read when its message is made, so each value waits once at
//! most, and the reader costs no memory but the message that is made ahead.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use std::vec;

use r6_api::gateway::{LiveChange, LiveMessage, LiveNothing, LiveRemoved, LiveReset, LiveSent, Signal};
use tokio::sync::watch;
use tokio::time::Instant;

use super::super::State;
use super::super::caller::Caller;
use super::subscription::{BeginEvents, Subscription};
use crate::clock;
use crate::core::live::follower::{Begin, Follower, Step};
use crate::core::live::point::Point;
use crate::live::far::Shown;
use crate::live::news::{Reading, Told};

/// The shortest time between two looks for changes: 50 messages a second and robot are more than a screen
/// shows.
const PACE: Duration = Duration::from_millis(20);

/// The messages of one reader.
pub struct Feed {
    caller: Caller,
    state: State,
    subscription: Subscription,
    follower: Follower,
    pass: Option<Pass>,
    /// The message before the next one. If it is the last one of its pass, it tells the place to resume at.
    held: Option<LiveMessage>,
    /// The number of the last pass that was sent to its end.
    passed: Option<u64>,
    /// When that pass began.
    passed_at: Option<Instant>,
    /// Whether to look for changes, if the last look was long enough ago.
    due: bool,
    looked_at: Option<Instant>,
    pulse: watch::Receiver<u64>,
    events: Option<Events>,
    /// An event that waits for the messages that were made before it.
    event: Option<LiveMessage>,
}

struct Events {
    reading: Reading,
    last: watch::Receiver<u64>,
}

/// A way through all robots.
struct Pass {
    number: u64,
    /// Messages to make before those of the next robot: two for a robot that begins anew, and at the begin of
    /// the pass one for each robot that is gone.
    ready: VecDeque<LiveMessage>,
    stations: vec::IntoIter<Arc<dyn Shown>>,
}

impl Feed {
    /// The messages for this subscription.
    pub fn new(caller: Caller, state: State, subscription: Subscription) -> Self {
        let pulse = state.shared.pulse.subscribe();
        let mut feed = Self {
            caller,
            state,
            follower: Follower::new(Begin::New),
            subscription: subscription.clone(),
            pass: None,
            held: None,
            passed: None,
            passed_at: None,
            due: true,
            looked_at: None,
            pulse,
            events: None,
            event: None,
        };
        feed.subscribe(subscription);
        feed
    }

    /// Begins with this subscription in place of the one before. What was not taken yet of that is lost.
    pub fn subscribe(&mut self, subscription: Subscription) {
        let news = &self.state.shared.news;
        self.events = subscription.events.map(|begin| Events {
            reading: {
                let reading = match begin {
                    BeginEvents::Now => Reading::from_now(news),
                    BeginEvents::After(id) => Reading::after(news, id),
                };
                if self.caller.is_gateway() { reading.of_own() } else { reading }
            },
            last: news.watch(),
        });
        self.follower = Follower::new(subscription.begin.clone());
        (self.pass, self.held, self.event, self.passed, self.due) = (None, None, None, None, true);
        self.passed_at = None;
        self.subscription = subscription;
    }

    /// Who reads.
    pub fn caller(&self) -> &Caller {
        &self.caller
    }

    /// What it reads of.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Whether the reader may still read.
    pub fn is_allowed(&self) -> bool {
        self.caller.is_still_valid(&self.state)
    }

    /// The next message, once there is one. Nothing is lost if this is dropped before it returns.
    pub async fn next(&mut self) -> LiveSent {
        loop {
            if let Some(sent) = self.make() {
                return sent;
            }
            self.wait().await;
        }
    }

    /// How long ago the last whole pass began of which everything was taken; `None` before the first one is
    /// over. Nothing has changed since a pass after which there was no reason to look again, but what other
    /// gateways did not tell yet.
    pub fn passed_ago(&self) -> Option<Duration> {
        let is_all = self.pass.is_none() && self.held.is_none() && self.event.is_none();
        let has_events =
            self.events.as_ref().is_some_and(|events| *events.last.borrow() > events.reading.at());
        let is_still = is_all && !has_events && !self.due && !self.pulse.has_changed().unwrap_or(true);
        let ago = self.passed_at?.elapsed();
        let ago = if is_still { Duration::ZERO } else { ago };
        Some(if self.caller.is_gateway() { ago } else { ago.max(self.behind()) })
    }

    /// How far the robots of other gateways may be behind.
    fn behind(&self) -> Duration {
        let (fleet, now) = (&self.state.fleet, clock::now());
        let mut all = self.state.shared.far.all();
        all.retain(|far| {
            self.subscription.covers(&self.caller, far.name()) && fleet.station(far.name()).is_none()
        });
        all.iter().map(|far| far.behind(now)).max().unwrap_or_default()
    }

    /// Waits until there may be something to tell.
    async fn wait(&mut self) {
        let Self { events, pulse, due, looked_at, .. } = self;
        let event = async {
            if let Some(Events { reading, last }) = events {
                let at = reading.at();
                if last.wait_for(|last| *last > at).await.is_ok() {
                    return;
                }
            }
            std::future::pending().await
        };
        if *due {
            let next = looked_at.map(|looked_at| looked_at + PACE);
            let paced = async {
                if let Some(next) = next {
                    tokio::time::sleep_until(next).await;
                }
            };
            // Events are looked for after each wait, so they cannot be kept waiting by values.
            tokio::select! { biased; () = paced => {}, () = event => {} }
        } else {
            let changed = async {
                if pulse.changed().await.is_err() {
                    std::future::pending().await
                }
            };
            tokio::select! { biased; () = changed => *due = true, () = event => {} }
        }
    }

    fn make(&mut self) -> Option<LiveSent> {
        if self.event.is_none() {
            self.event = self.next_event();
        }
        if self.event.is_some() {
            // What was made before the event may be older than it.
            let made = self.held.take().or_else(|| self.pass.as_mut()?.ready.pop_front());
            return match made {
                Some(message) => Some(LiveSent { message, resume: None }),
                None => self.event.take().map(|message| LiveSent { message, resume: self.point() }),
            };
        }
        loop {
            if self.pass.is_none() && !self.begin_pass() {
                return None;
            }
            match self.of_pass() {
                Some(message) => {
                    if let Some(message) = self.held.replace(message) {
                        return Some(LiveSent { message, resume: None });
                    }
                }
                None => {
                    self.follower.end_pass();
                    self.passed = self.pass.take().map(|pass| pass.number);
                    self.passed_at = self.looked_at;
                    if let Some(message) = self.held.take() {
                        return Some(LiveSent { message, resume: self.point() });
                    }
                }
            }
        }
    }

    /// The place up to which everything was sent, unless the first pass is not over.
    fn point(&self) -> Option<String> {
        let event = self.events.as_ref().map(|events| events.reading.at());
        let point = |number| Point { epoch: self.state.shared.epoch, number, event };
        self.passed.map(|number| point(number).to_string())
    }

    fn next_event(&mut self) -> Option<LiveMessage> {
        let Events { reading, .. } = self.events.as_mut()?;
        loop {
            match reading.next(&self.state.shared.news)? {
                Told::Lost => return Some(LiveMessage::EventsLost(LiveNothing {})),
                Told::Event(event) if self.subscription.covers(&self.caller, &event.robot) => {
                    return Some(LiveMessage::Event(event));
                }
                Told::Event(_) => {}
            }
        }
    }

    /// Begins a pass if it is due, and the last one is long enough ago.
    fn begin_pass(&mut self) -> bool {
        let now = Instant::now();
        if !self.due || self.looked_at.is_some_and(|looked_at| now < looked_at + PACE) {
            return false;
        }
        (self.due, self.looked_at) = (false, Some(now));
        // What changes from here on is a reason to look again.
        self.pulse.mark_unchanged();
        let (top, mut stations) = self.state.fleet.shown_now(!self.caller.is_gateway());
        stations.retain(|station| self.subscription.covers(&self.caller, station.name()));
        // Both are in the order of the names.
        let is_there = |robot: &str| stations.binary_search_by(|station| station.name().cmp(robot)).is_ok();
        let (reset, gone) = self.follower.begin_pass(top, is_there);
        let reset = reset.then_some(LiveMessage::Reset(LiveReset { robot: None }));
        let gone = gone.into_iter().map(|robot| LiveMessage::Removed(LiveRemoved { robot }));
        let ready = reset.into_iter().chain(gone).collect();
        self.pass = Some(Pass { number: top.number, ready, stations: stations.into_iter() });
        true
    }

    /// The next message of the pass; `None` at its end.
    fn of_pass(&mut self) -> Option<LiveMessage> {
        let pass = self.pass.as_mut()?;
        loop {
            if let Some(message) = pass.ready.pop_front() {
                return Some(message);
            }
            let station = pass.stations.next()?;
            let robot = station.name().to_owned();
            let (span, step, mut signals) = station.tell_reader(&mut |at| self.follower.step(&robot, at));
            keep(&self.subscription, &mut signals);
            let message = match step {
                Step::Nothing => None,
                Step::Snapshot { reset } => {
                    if reset {
                        let reset = LiveReset { robot: Some(robot.clone()) };
                        pass.ready.push_back(LiveMessage::Reset(reset));
                    }
                    Some(LiveMessage::Snapshot(Box::new(station.state_with(span.number, signals))))
                }
                Step::Changes { .. } if signals.is_empty() => None,
                Step::Changes { after } => {
                    let robot = robot.clone();
                    Some(LiveMessage::Change(LiveChange { robot, after, number: span.number, signals }))
                }
            };
            self.follower.done(&robot, span, step, message.is_some());
            pass.ready.extend(message);
        }
    }
}

/// Keeps the values that are followed.
fn keep(subscription: &Subscription, signals: &mut Vec<Signal>) {
    if let Some(followed) = &subscription.signals {
        signals.retain(|signal| followed.contains(&signal.address));
    }
}
