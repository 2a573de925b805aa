//! What is told of a robot over the API.

use std::sync::atomic::Ordering;

use r6_api::gateway::{LeaseHolder, RobotLink, RobotState, RobotSummary, Signal};
use r6_api::status::is_virtual;

use super::{Station, millis};
use crate::clock;
use crate::core::live::follower::Step;
use crate::core::live::numbers::Span;
use crate::fleet::config::RobotConfig;
use crate::fleet::group::PollGroup;
use crate::live::far::Shown;

impl Station {
    /// The robot without its values.
    pub fn summary(&self) -> RobotSummary {
        let config = self.config();
        let parts = config.parts().map(|address| address.to_string());
        let RobotConfig { address, managed_by, model, guard, twin_of, twin, panel, .. } = config;
        let owner = self.shared.owners.url();
        self.seat(|seat, now| {
            let (stopped, stops_under_way) = seat.stops();
            let identity_changed = seat.identity_change();
            let is_met = self.is_met.load(Ordering::SeqCst) || identity_changed.is_some();
            let present = identity_changed.as_ref().map(|change| change.found.clone());
            let identity = present.or_else(|| seat.saved().identity.clone());
            let lease = seat.lease(now).map(|lease| LeaseHolder {
                number: lease.number,
                holder: lease.holder,
                expires_in_ms: millis(lease.left),
            });
            let stopped_by = seat.saved().stopped_by.clone();
            let global_speed = seat.global_speed(now).cloned();
            let named = identity.as_ref().and_then(|robot| robot.machine_name.as_deref().map(is_virtual));
            RobotSummary {
                name: self.name().to_owned(),
                address,
                managed_by,
                model,
                guard: guard.map(|guard| guard.told()),
                parts,
                owner,
                link: if seat.is_up() { RobotLink::Up } else { RobotLink::Down },
                // What another machine of this name was says nothing about what is at this address.
                r#virtual: if twin_of.is_some() { Some(true) } else { named.filter(|_| is_met) },
                twin_of: twin_of.map(|name| name.to_string()),
                twin: twin.map(|name| name.to_string()),
                panel: panel.is_some(),
                identity,
                identity_changed,
                lease,
                stopped,
                stopped_by,
                stops_under_way,
                stop_number: seat.stop_number(),
                global_speed,
            }
        })
    }

    /// The robot with its values.
    pub fn state(&self) -> RobotState {
        let (span, signals) = {
            let board = self.board();
            (board.span(), board.all(clock::now()))
        };
        self.state_with(span.number, signals)
    }

    /// The robot with these values.
    pub fn state_with(&self, number: u64, signals: Vec<Signal>) -> RobotState {
        let (period_ms, groups) = {
            let config = self.config();
            (millis(config.period), config.groups.iter().map(PollGroup::told).collect())
        };
        RobotState { summary: self.summary(), period_ms, groups, epoch: self.shared.epoch, number, signals }
    }
}

impl Shown for Station {
    fn name(&self) -> &str {
        self.name()
    }

    fn summary(&self) -> RobotSummary {
        self.summary()
    }

    fn state_with(&self, number: u64, signals: Vec<Signal>) -> RobotState {
        self.state_with(number, signals)
    }

    /// All values for a snapshot, and those that changed for changes.
    fn tell_reader(&self, step: &mut dyn FnMut(Span) -> Step) -> (Span, Step, Vec<Signal>) {
        let board = self.board();
        let span = board.span();
        let step = step(span);
        let signals = match step {
            Step::Nothing => Vec::new(),
            Step::Snapshot { .. } => board.all(clock::now()),
            Step::Changes { after } => board.since(clock::now(), after),
        };
        (span, step, signals)
    }
}
