//! A handle's connection over all its lives, without a socket: its queues, what is sent when, and
//! reconnecting.
//!
//! ```text
//!                 ┌────────────── lost ──────────────┐
//!                 ▼                                  │
//!  (made) ──▶    Up ◀──connected── Connecting ◀──over── Backoff ◀──a query or a stop waits── Down
//!                 │                     └────────not_connected: all waiting calls fail─────────▲
//!               close
//!                 ▼
//!              Closing ──goodbye said, or half a second──▶ Closed ◀──close── (Down, Backoff, Connecting)
//! ```
//!
//! A hand ([`crate::drive`]) carries out what [`Connection::wants`] says, and reports the result.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::time::Instant;

use crate::backoff::Backoff;
use crate::conditions::Permission;
use crate::error::{Effect, NotSent};
use crate::event::Event;
use crate::hub::Hub;
use crate::identity::asks_who_is_there;
use crate::job::{Job, Work};
use crate::link::{Lane, Link};
use crate::pushed::LostReason;
use crate::settings::RobotSettings;

/// How long a closing connection may take to write its queue, and then to confirm that it has read
/// everything. A controller that gets a reset instead of an orderly end may keep the connection's slot for
/// good.
const CLOSE_WAIT: Duration = Duration::from_millis(500);

/// At this length, and at each doubling of it, requests that their callers gave up are removed from a lane.
/// So a lane holds at most twice as many requests as there are waiting callers, or this many.
const SWEPT_FROM: usize = 64;

/// What a hand has to do for a connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wants {
    /// Write its output, and read.
    Carry,
    /// Make a connection.
    Connect,
    /// Write its output, end our side of the connection, then read until the other side has ended, too.
    Goodbye,
    /// Drop the connection, or the attempt to make one.
    Nothing,
}

/// The connection of one handle and its clones.
#[derive(Debug)]
pub(crate) struct Connection {
    name: String,
    takes_whoever_comes: bool,
    settings: RobotSettings,
    hub: Arc<Hub>,
    backoff: Backoff,
    /// Stops, and the queries that confirm them.
    urgent: VecDeque<Job>,
    ordinary: VecDeque<Job>,
    /// Jobs for the next connection: the job that asked for it, and queries that the last one lost. While
    /// connected: jobs that wait until the controller has identified itself.
    held: VecDeque<Job>,
    next_pack_id: u64,
    close_asked: bool,
    phase: Phase,
}

#[derive(Debug)]
enum Phase {
    Up {
        link: Box<Link>,
        begun: Instant,
    },
    /// Nothing wants a connection.
    Down,
    Backoff {
        until: Instant,
    },
    Connecting,
    Closing {
        link: Box<Link>,
        until: Instant,
    },
    Closed,
}

impl Connection {
    /// Wraps an existing connection. If the expected robot is already known, the controller has to identify
    /// itself first, as after a reconnect.
    pub fn new(
        (name, takes_whoever_comes): (String, bool),
        settings: RobotSettings,
        hub: Arc<Hub>,
        backoff: Backoff,
    ) -> Self {
        let now = hub.time.now();
        let first = hub.known().expected.is_none();
        let link = Box::new(Link::new(&settings, first, 1, &hub, now));
        hub.name.set(name.as_str().into()).ok();
        hub.happened(Event::Connected);
        let mut this = Self {
            name,
            takes_whoever_comes,
            settings,
            hub,
            backoff,
            urgent: VecDeque::new(),
            ordinary: VecDeque::new(),
            held: VecDeque::new(),
            next_pack_id: 1,
            close_asked: false,
            phase: Phase::Up { link, begun: now },
        };
        // Arm the watchdog before anything moves: a timer may fire a millisecond late, and this process may
        // die in that time.
        this.tick(now);
        this
    }

    /// The controller's name in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// As [`crate::Connect::takes_whoever_comes`].
    pub fn takes_whoever_comes(&self) -> bool {
        self.takes_whoever_comes
    }

    /// Queues a request in its lane. The urgent lane is sent first.
    pub fn give(&mut self, lane: Lane, job: Job) {
        if self.is_closed() {
            return job.not_sent(NotSent::Closed);
        }
        let lane = match lane {
            Lane::Urgent => &mut self.urgent,
            Lane::Ordinary | Lane::Background => &mut self.ordinary,
        };
        if lane.len() >= SWEPT_FROM && lane.len().is_power_of_two() {
            sweep(lane);
        }
        lane.push_back(job);
    }

    /// Asks for the end: urgent requests that already wait are still sent, then the connection ends.
    pub fn close(&mut self) {
        self.close_asked = true;
    }

    /// Whether it has ended for good.
    pub fn is_closed(&self) -> bool {
        matches!(self.phase, Phase::Closed)
    }

    /// What the hand has to do, after [`Self::go_on`].
    pub fn wants(&self) -> Wants {
        match &self.phase {
            Phase::Up { .. } => Wants::Carry,
            Phase::Connecting => Wants::Connect,
            Phase::Closing { .. } => Wants::Goodbye,
            Phase::Down | Phase::Backoff { .. } | Phase::Closed => Wants::Nothing,
        }
    }

    /// Whether there is work to do now that no call may be waiting for.
    pub fn is_busy(&self) -> bool {
        let waits = !(self.urgent.is_empty() && self.ordinary.is_empty() && self.held.is_empty());
        match &self.phase {
            Phase::Up { link, .. } => {
                waits || self.close_asked || !link.output().is_empty() || link.is_introducing()
            }
            Phase::Down => waits || self.close_asked,
            Phase::Backoff { .. } | Phase::Connecting | Phase::Closing { .. } => true,
            Phase::Closed => false,
        }
    }

    /// Whether the controller owes an answer, or the end of the connection.
    pub fn awaits_reply(&self) -> bool {
        match &self.phase {
            Phase::Up { link, .. } => link.awaits_reply(),
            Phase::Closing { .. } => true,
            Phase::Down | Phase::Backoff { .. } | Phase::Connecting | Phase::Closed => false,
        }
    }

    /// Hands over the jobs that can be sent now, and changes phase when it is time.
    pub fn go_on(&mut self, now: Instant) {
        match &mut self.phase {
            Phase::Up { link, .. } => {
                let waits = !(self.ordinary.is_empty() && self.urgent.is_empty() && self.held.is_empty());
                if waits || self.close_asked || link.is_introducing() {
                    self.go_on_up(now);
                }
            }
            Phase::Down => {
                while self.held.is_empty()
                    && let Some(job) = self.urgent.pop_front().or_else(|| self.ordinary.pop_front())
                {
                    self.hold(job);
                }
                if self.close_asked {
                    self.end(&NotSent::Closed);
                } else if !self.held.is_empty() {
                    let until = now + self.backoff.next_wait(self.hub.board.pace());
                    self.phase = Phase::Backoff { until };
                    self.go_on(now);
                }
            }
            Phase::Backoff { until } => {
                let over = *until <= now;
                self.hold_urgent();
                if self.close_asked {
                    self.end(&NotSent::Closed);
                } else if over || self.held.iter().any(|job| job.work.sent().effect == Effect::Stops) {
                    // A stop does not wait for the end of the backoff; it is sent again at its own pace.
                    self.phase = Phase::Connecting;
                }
            }
            Phase::Connecting => {
                self.hold_urgent();
                if self.close_asked {
                    self.end(&NotSent::Closed);
                }
            }
            Phase::Closing { .. } | Phase::Closed => {}
        }
    }

    fn go_on_up(&mut self, now: Instant) {
        let Phase::Up { link, .. } = &mut self.phase else { return };
        loop {
            hand_over_held(&mut self.held, link, &self.hub, &self.settings, now);
            if link.is_introducing() {
                link.introduce(now);
                if !link.is_introducing() {
                    // None of its questions fits into a frame: no reply will wake the callers that wait for
                    // one.
                    continue;
                }
            }
            while link.has_room(Lane::Urgent)
                && let Some(job) = self.urgent.pop_front()
            {
                link.withdraw_overtaken();
                hand_over_urgent(&mut self.held, job, link, &self.hub, now);
            }
            if self.close_asked && self.urgent.is_empty() {
                return self.begin_closing(now);
            }
            if !link.has_room(Lane::Ordinary) {
                return;
            }
            let Some(job) = self.ordinary.pop_front() else { return };
            hand_over_once_known(&mut self.held, job, link, &self.hub, &self.settings, now);
        }
    }

    /// The bytes that wait to be written, without those of withdrawn requests. None without the permission of
    /// the settings.
    pub fn output(&mut self, now: Instant) -> &[u8] {
        if self.settings.permission.as_ref().is_some_and(Permission::is_withdrawn) {
            return &[];
        }
        match &mut self.phase {
            Phase::Up { link, .. } | Phase::Closing { link, .. } => {
                if !link.output().is_empty() {
                    link.withdraw_moot(now);
                }
                link.output()
            }
            Phase::Down | Phase::Backoff { .. } | Phase::Connecting | Phase::Closed => &[],
        }
    }

    /// The socket took the first `bytes` of the output.
    pub fn written(&mut self, bytes: usize) {
        if let Phase::Up { link, .. } | Phase::Closing { link, .. } = &mut self.phase {
            link.written(bytes);
        }
    }

    /// Takes in bytes from the controller. Bytes that arrive while closing are ignored.
    pub fn received(&mut self, bytes: &[u8], now: Instant) {
        if let Phase::Up { link, .. } = &mut self.phase
            && let Err(reason) = link.received(bytes, now)
        {
            self.lost(reason, now);
        }
    }

    /// The hand made the connection.
    pub fn connected(&mut self, now: Instant) {
        self.hub.happened(Event::ConnectedAnew);
        let link = Link::new(&self.settings, false, self.next_pack_id, &self.hub, now);
        self.hub.meter().reconnected();
        self.phase = Phase::Up { link: Box::new(link), begun: now };
        self.tick(now);
    }

    /// The hand could not make the connection. This one attempt answers all callers that waited for it.
    pub fn not_connected(&mut self, error: &NotSent) {
        self.phase = Phase::Down;
        self.tell_unconnected(error);
    }

    /// The connection ended.
    pub fn lost(&mut self, reason: LostReason, now: Instant) {
        match std::mem::replace(&mut self.phase, Phase::Down) {
            Phase::Up { link, begun } => {
                if link.answered() {
                    self.backoff.had_answers_for(now.since(begun));
                }
                let unidentified = !link.is_first() && link.is_introducing();
                self.abandon(*link, reason, now);
                self.hub.connection_lost(reason);
                if self.takes_whoever_comes {
                    // The next controller that dials may be another robot.
                    self.hub.doubt_who_answers();
                }
                if unidentified {
                    // One attempt answers all callers that waited for it.
                    self.tell_unconnected(&NotSent::Unidentified { address: self.name.clone(), reason });
                }
            }
            Phase::Closing { link, .. } => {
                self.abandon(*link, LostReason::ClosedHere, now);
                self.end(&NotSent::Closed);
            }
            other @ (Phase::Down | Phase::Backoff { .. } | Phase::Connecting | Phase::Closed) => {
                self.phase = other
            }
        }
    }

    /// Does what is due at this time.
    pub fn tick(&mut self, now: Instant) {
        if self.deadline().is_none_or(|due| due > now) {
            return;
        }
        match &mut self.phase {
            Phase::Up { link, .. } => {
                if let Err(reason) = link.tick(now) {
                    self.lost(reason, now);
                }
            }
            Phase::Closing { until, .. } if *until <= now => self.lost(LostReason::ClosedHere, now),
            Phase::Closing { .. }
            | Phase::Down
            | Phase::Backoff { .. }
            | Phase::Connecting
            | Phase::Closed => {}
        }
    }

    /// When [`Self::tick`] and [`Self::go_on`] are due, if nothing else happens.
    pub fn deadline(&self) -> Option<Instant> {
        match &self.phase {
            Phase::Up { link, .. } => link.deadline(),
            Phase::Backoff { until } | Phase::Closing { until, .. } => Some(*until),
            Phase::Down | Phase::Connecting | Phase::Closed => None,
        }
    }

    fn begin_closing(&mut self, now: Instant) {
        if let Phase::Up { mut link, .. } = std::mem::replace(&mut self.phase, Phase::Down) {
            link.withdraw_moot(now);
            self.phase = Phase::Closing { link, until: now + CLOSE_WAIT };
        }
    }

    /// The driver is gone: no waiting request will be answered.
    pub fn abandoned(&mut self) {
        self.phase = Phase::Closed;
        self.urgent.clear();
        self.ordinary.clear();
        self.held.clear();
        self.hub.end();
    }

    fn abandon(&mut self, link: Link, reason: LostReason, now: Instant) {
        self.hub.happened(Event::ConnectionEnded { reason });
        let (again, next_pack_id) = link.abandon(reason, now);
        let waiting: Vec<Job> = self.held.drain(..).chain(again).collect();
        waiting.into_iter().for_each(|job| self.hold(job));
        self.next_pack_id = next_pack_id;
    }

    fn hold_urgent(&mut self) {
        while let Some(job) = self.urgent.pop_front() {
            self.hold(job);
        }
    }

    /// Keeps a query or a stop for the next connection. Refuses any other job, because the machine that it
    /// was meant for may have changed. Stops come first.
    fn hold(&mut self, job: Job) {
        if job.is_moot() {
            return;
        }
        match job.work.sent().effect {
            Effect::Stops => {
                // A stop that its caller gave up is still sent, but only once.
                let sent = job.work.sent();
                self.held.retain(|held| !(held.is_given_up() && held.work.sent() == sent));
                self.held.push_front(job);
            }
            Effect::Reads => self.held.push_back(job),
            Effect::Changes | Effect::Moves => job.not_sent(NotSent::Disconnected),
        }
    }

    fn tell_unconnected(&mut self, error: &NotSent) {
        self.hub.happened(Event::NotConnected { error: error.clone() });
        self.refuse_waiting(error);
    }

    fn refuse_waiting(&mut self, error: &NotSent) {
        self.held.drain(..).for_each(|job| job.not_sent(error.clone()));
        self.ordinary.drain(..).for_each(|job| job.not_sent(error.clone()));
    }

    /// Ends the connection for good.
    fn end(&mut self, error: &NotSent) {
        self.phase = Phase::Closed;
        self.refuse_waiting(error);
        self.urgent.drain(..).for_each(|job| job.not_sent(error.clone()));
        self.hub.end();
    }
}

/// Drops requests that their callers gave up. A stop that was given up is still sent, but only once.
fn sweep(lane: &mut VecDeque<Job>) {
    let mut given_up = Vec::new();
    lane.retain(|job| {
        let again = job.is_given_up() && given_up.contains(&job.work.sent());
        if job.is_given_up() {
            given_up.push(job.work.sent());
        }
        !(again || job.is_moot())
    });
}

/// Sends a stop at once, unless the controller still has to show that it is the expected one. The queries
/// that confirm the stop follow it.
fn hand_over_urgent(held: &mut VecDeque<Job>, job: Job, link: &mut Link, hub: &Hub, now: Instant) {
    if link.holds_stops() {
        held.push_back(job);
        return;
    }
    let stops = job.work.sent().effect == Effect::Stops;
    hand_over_unless_another(job, link, hub, now);
    if stops && link.is_first() && hub.known().present.is_none() {
        // To repeat the stop over another connection, the client has to know which robot it was meant for.
        link.begin_introduction();
    }
}

/// Hands over the jobs that waited for this connection, or until the controller identified itself. Stops come
/// first and wait for neither, unless [`Link::holds_stops`].
fn hand_over_held(
    held: &mut VecDeque<Job>,
    link: &mut Link,
    hub: &Hub,
    settings: &RobotSettings,
    now: Instant,
) {
    while let Some(job) = held.front() {
        let lane = match job.work.sent().effect {
            Effect::Stops => Lane::Urgent,
            Effect::Reads | Effect::Changes | Effect::Moves => Lane::Ordinary,
        };
        if !link.has_room(lane) || (lane == Lane::Urgent && link.holds_stops()) {
            return;
        }
        if let Some(job) = held.pop_front() {
            hand_over_once_known(held, job, link, hub, settings, now);
        }
    }
}

/// Holds commands back until the controller has identified itself, and queries for a limited time. A stop and
/// the answer to a photo are sent at once. The next connection is compared with that identity.
fn hand_over_once_known(
    held: &mut VecDeque<Job>,
    job: Job,
    link: &mut Link,
    hub: &Hub,
    settings: &RobotSettings,
    now: Instant,
) {
    if !link.is_first() || job.is_moot() || hub.known().present.is_some() {
        return hand_over_unless_stale(job, link, hub, settings, now);
    }
    let waits = match &job.work {
        work if work.needs_known_state() => {
            link.begin_introduction();
            true
        }
        Work::Query(addresses) | Work::RawQuery(addresses) => {
            !asks_who_is_there(addresses) && link.begin_introduction_for_query(now)
        }
        // A photo cannot wait. On a first connection, stops do not come this way.
        Work::PhotoAnswer(_) | Work::Command(_) | Work::AddRcc { .. } | Work::AddPoints(_) => {
            link.begin_introduction_for_query(now);
            false
        }
    };
    if waits {
        held.push_front(job);
    } else {
        hand_over_unless_stale(job, link, hub, settings, now);
    }
}

/// Refuses a command that waited too long, because it must not come as a surprise. A query may still be sent.
fn hand_over_unless_stale(job: Job, link: &mut Link, hub: &Hub, settings: &RobotSettings, now: Instant) {
    match job.work.sent().effect {
        Effect::Changes | Effect::Moves => {
            let waited = now.since(job.asked_at);
            if waited > settings.reply_timeout || job.is_overdue(now) {
                return job.not_sent(NotSent::Busy { waited });
            }
        }
        Effect::Reads | Effect::Stops => {}
    }
    hand_over_unless_another(job, link, hub, now);
}

/// Refuses a job that a stop has overtaken, or that was meant for another robot or another connection.
fn hand_over_unless_another(job: Job, link: &mut Link, hub: &Hub, now: Instant) {
    if job.is_overtaken(hub.stops_asked()) {
        return job.not_sent(NotSent::Overtaken);
    }
    if job.is_withdrawn() {
        return job.not_sent(NotSent::Withdrawn);
    }
    if job.only_on.is_some_and(|only| only != hub.known().connection) {
        return job.not_sent(NotSent::Disconnected);
    }
    if job.work.is_for_one_robot()
        && let Some(another) = hub.stranger()
    {
        return job.not_sent(another);
    }
    link.hand_over(job, now);
}

#[cfg(test)]
mod tests;
