//! Events of another gateway that wait here: what its robots are like then is read first.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use r6_api::gateway::{Event, Happened};
use r6_proto::time::Instant;
use tokio::sync::Notify;

use super::super::Inner;
use crate::clock;

/// How many events wait for a list: as many as a gateway keeps.
const MAX_WAITING: usize = 1_000;

/// Events that wait until the list was read again, in their order, each with when it came.
#[derive(Debug, Default)]
pub struct Waiting {
    /// `None`: some were lost.
    events: Mutex<VecDeque<(Option<Event>, Instant)>>,
    /// The list may be another one.
    pub dirty: Notify,
}

impl Waiting {
    /// Some may be missing from here on.
    pub fn lose(&self) {
        self.push(None);
        self.dirty.notify_one();
    }

    /// Keeps an event until the list was read, if it says that a robot is in another state, or others wait.
    /// One task alone adds and tells, so they stay in their order.
    pub fn add(&self, event: Event, inner: &Inner, number: u64) {
        let is_dirty = changes_summary(&event.happened);
        if !is_dirty && self.events().is_empty() {
            tell(event, inner, number);
            return;
        }
        self.push(Some(event));
        if is_dirty {
            self.dirty.notify_one();
        }
    }

    fn push(&self, event: Option<Event>) {
        let mut events = self.events();
        if events.len() < MAX_WAITING {
            events.push_back((event, clock::now()));
        } else if let Some((last, _)) = events.back_mut() {
            *last = None;
        }
    }

    pub fn count(&self) -> usize {
        self.events().len()
    }

    /// Since when the first of them waits.
    pub fn since(&self) -> Option<Instant> {
        self.events().front().map(|(_, since)| *since)
    }

    /// Tells the first `count` events to the readers. `number`: the gateway that they are of.
    pub fn tell(&self, inner: &Inner, number: u64, count: usize) {
        let told: Vec<_> = {
            let mut events = self.events();
            let count = count.min(events.len());
            events.drain(..count).collect()
        };
        for (event, _) in told {
            match event {
                Some(event) => tell(event, inner, number),
                None => inner.state.shared.news.lose_far(),
            }
        }
    }

    fn events(&self) -> MutexGuard<'_, VecDeque<(Option<Event>, Instant)>> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Tells an event of this gateway to the readers. If the robot is another gateway's by now, which tells of it
/// itself, it came too late: it would stand behind what happened later.
fn tell(event: Event, inner: &Inner, number: u64) {
    let Event { time, robot, happened, .. } = event;
    let shared = &inner.state.shared;
    let is_its = shared.far.one(&robot).is_none_or(|far| far.may_be_of(number));
    if is_its && inner.state.fleet.station(&robot).is_none() {
        shared.news.add_far(time, &robot, happened);
    } else {
        shared.news.lose_far();
    }
}

/// Whether a robot is in another state after this: the list tells of it.
fn changes_summary(happened: &Happened) -> bool {
    match happened {
        Happened::RobotAdded {}
        | Happened::RobotChanged {}
        | Happened::RobotRemoved {}
        | Happened::LinkUp {}
        | Happened::LinkDown {}
        | Happened::IdentityChanged(_)
        | Happened::IdentityAccepted { .. }
        | Happened::LeaseBegan { .. }
        | Happened::LeaseEnded { .. }
        | Happened::StopBegan { .. }
        | Happened::StopEnded { .. }
        | Happened::StopCleared {}
        | Happened::GlobalSpeed { .. } => true,
        Happened::CommandBegan { .. }
        | Happened::CommandEnded { .. }
        | Happened::RunBegan { .. }
        | Happened::RunProgress { .. }
        | Happened::RunEnded { .. }
        | Happened::AlarmBegan { .. }
        | Happened::AlarmEnded { .. }
        | Happened::AlarmAcknowledged { .. }
        | Happened::AlarmShelved { .. }
        | Happened::AlarmUnshelved { .. }
        | Happened::ModeChanged { .. }
        | Happened::ProgramChanged { .. }
        | Happened::CycleDone { .. }
        | Happened::Parts { .. }
        | Happened::PartsReset { .. }
        | Happened::LinkLost {}
        | Happened::LinkBack {}
        | Happened::MoreHappened {}
        | Happened::Unseen { .. }
        | Happened::PhotoRequested { .. } => false,
    }
}
