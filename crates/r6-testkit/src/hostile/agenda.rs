//! Events whose time is already known.

use std::time::Duration;

use super::Foreign;
use super::character::Reaction;
use super::step::Step;

/// A future event.
#[derive(Clone, Debug)]
pub(super) enum Due {
    /// A stop takes effect.
    Halt { robot: usize, reaction: Reaction },
    /// The list is cleared.
    Clear { robot: usize, reaction: Reaction },
    /// A list is taken.
    Take { robot: usize, replace: bool, steps: Vec<Step> },
    /// Another client sends something.
    Foreign(Foreign),
    /// The taught program begins.
    Program(Vec<serde_json::Value>),
    /// Another robot takes the place.
    Swap,
    /// The controller restarts.
    Reboot,
}

/// All future events, the earliest first. Events with the same time keep the order in which they were added.
#[derive(Clone, Debug, Default)]
pub(super) struct Agenda(Vec<(Duration, Due)>);

impl Agenda {
    pub(super) fn put(&mut self, at: Duration, due: Due) {
        let place = self.0.partition_point(|(other, _)| *other <= at);
        self.0.insert(place, (at, due));
    }

    pub(super) fn next(&self) -> Option<Duration> {
        self.0.first().map(|(at, _)| *at)
    }

    /// Takes the first event, if its time is not after `now`.
    pub(super) fn take(&mut self, now: Duration) -> Option<(Duration, Due)> {
        (self.next()? <= now).then(|| self.0.remove(0))
    }

    /// Drops the events that a power cut of `robot` removes.
    pub(super) fn forget(&mut self, robot: usize) {
        self.0.retain(|(_, due)| match due {
            Due::Halt { robot: other, .. }
            | Due::Clear { robot: other, .. }
            | Due::Take { robot: other, .. } => *other != robot,
            Due::Foreign(_) | Due::Program(_) | Due::Swap | Due::Reboot => true,
        });
    }
}
