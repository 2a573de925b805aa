//! What happens at one robot, from the values of each poll.

use r6_api::gateway::Happened;
use r6_client::Recorded;
use r6_proto::time::Instant;

use super::config::RobotConfig;
use super::station::Station;
use crate::clock;
use crate::core::history::event::{Event, Kind};
use crate::core::history::sample::Micros;
use crate::core::live::flood::{Flood, Passage};
use crate::core::watch::{Before, Value, Watcher};
use crate::live::happened::happened;

/// Watches one robot, and publishes what happens.
pub(super) struct Observer<'s> {
    station: &'s Station,
    watcher: Watcher,
    flood: Flood,
}

impl<'s> Observer<'s> {
    /// Watches a robot of which this is known from before.
    pub fn new(station: &'s Station, config: &RobotConfig, before: Before) -> Self {
        Self {
            station,
            watcher: Watcher::new(|address| config.period_of(address), config.parts(), before),
            flood: Flood::default(),
        }
    }

    /// Takes in the values of a poll. Returns what happened.
    pub fn take(
        &mut self,
        now: Instant,
        values: &[Recorded],
        time: impl Fn(Instant) -> Micros,
    ) -> Vec<Event> {
        // All values of a poll came over one connection.
        let Some(connection) = values.first().map(|value| value.connection) else { return Vec::new() };
        // Most values of a poll were asked for together.
        let mut last = None;
        let poll = values.iter().map(|Recorded { address, reading, age, connection: _ }| {
            let at = clock::before(now, *age);
            let (_, time) = last.filter(|(of, _)| *of == at).unwrap_or_else(|| (at, time(at).kept()));
            last = Some((at, time));
            // The reply was there before the value came here.
            Value { address: *address, reading: reading.as_ref(), by: now.max(at), at, time }
        });
        let events = self.watcher.take(connection, &poll.collect::<Vec<_>>());
        self.publish(now, &events);
        events
    }

    /// Looks whether values are overdue.
    pub fn look(&mut self, now: Instant, time: impl Fn(Instant) -> Micros) -> Option<Event> {
        let event = self.watcher.look(now, time(now).kept());
        self.publish(now, event.as_slice());
        event
    }

    /// Another robot answers in place of this one.
    pub fn replaced(&mut self, now: Instant, time: impl Fn(Instant) -> Micros) -> Option<Event> {
        let event = self.watcher.replaced(now, time(now).kept());
        self.publish(now, event.as_slice());
        event
    }

    /// Values were lost before they came here.
    pub fn miss(&mut self) {
        self.watcher.miss();
    }

    fn publish(&mut self, now: Instant, events: &[Event]) {
        // The seat publishes the link: it knows sooner.
        let news = events.iter().filter(|event| !matches!(event.kind(), Kind::LinkLost | Kind::LinkBack));
        for Event { time, observed, .. } in news.cloned() {
            // What the seat publishes, such as leases, has no limit: persons make that, not values.
            let passage = self.flood.event(now);
            if passage != Passage::Told {
                self.station.counts.skip_event();
            }
            let happened = match passage {
                Passage::Told => happened(observed),
                Passage::More => Happened::MoreHappened {},
                Passage::Skipped => continue,
            };
            self.station.publish_of(clock::text(time), happened);
        }
    }
}
