//! Requests and replies while something is broken.

use std::time::Duration;

use r6_proto::message::RequestType;
use r6_proto::server::Outbox;
use r6_proto::time::Instant;

use super::super::desk::Desk;
use super::super::{ConnectionId, Controller, Service};
use super::Breakage;
use crate::fault::TaskFault;
use crate::fault::reply::{self, Fate, Outgoing};

/// What is wrong with one request.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "faults that may strike at once, each by itself")]
pub(in crate::controller) struct Strikes {
    pub not_executed: bool,
    pub not_acknowledged: bool,
    pub list_full: bool,
    pub rejected_mid_batch: bool,
    pub task_dead: bool,
    pub frozen_values: bool,
}

/// The request that is being dealt with.
#[derive(Debug, Default)]
pub(in crate::controller) struct Asked {
    /// Its frame.
    pub frame: Vec<u8>,
    /// What it asks for.
    pub request: Option<RequestType>,
}

impl Breakage {
    /// What is wrong with the next request: drawn anew for each.
    fn strikes(&mut self) -> Strikes {
        let mut strikes = Strikes::default();
        for (task, chance) in &self.tasks {
            let hit = self.run.random().strikes(*chance);
            match task {
                TaskFault::NotExecuted => strikes.not_executed |= hit,
                TaskFault::NotAcknowledged => strikes.not_acknowledged |= hit,
                TaskFault::ListFull => strikes.list_full |= hit,
                TaskFault::RejectedMidBatch => strikes.rejected_mid_batch |= hit,
                TaskFault::TaskDead => strikes.task_dead |= hit,
                TaskFault::FrozenValues => strikes.frozen_values |= hit,
                // Struck when it began.
                TaskFault::ListFrozen => {}
            }
        }
        strikes
    }

    /// What becomes of the replies to a request: each fault in force may strike each of them, one after the other.
    fn fate_of(
        &mut self,
        asked: &Asked,
        frames: Vec<(Option<Instant>, Vec<u8>)>,
    ) -> Vec<(Option<Instant>, Fate)> {
        let mut fates = Vec::with_capacity(frames.len());
        for (due, frame) in frames {
            let mut fate = Fate { to_asker: vec![Outgoing::at_once(frame)], ..Fate::default() };
            for (fault, chance) in &self.replies {
                if self.run.random().strikes(*chance) {
                    for outgoing in std::mem::take(&mut fate.to_asker) {
                        let next = reply::strike(fault, &asked.frame, outgoing.bytes, self.run.random());
                        fate.take(next, outgoing.later);
                    }
                }
            }
            fates.push((due, fate));
        }
        fates
    }
}

impl Controller {
    /// Carries out the next message of a connection while something is broken.
    pub(in crate::controller) fn serve_broken(&mut self, now: Instant, id: ConnectionId) -> bool {
        let Some(breakage) = &mut self.breakage else { return false };
        let Some(connection) = self.connections.get_mut(&id) else { return false };
        let before = breakage.run.random().clone();
        let strikes = breakage.strikes();
        let (inbox, outbox) = connection.session.split();
        let mut replies = Outbox::default();
        let mut desk = Desk {
            now,
            id,
            machine: &mut self.machine,
            log: &mut self.log,
            cameras: &mut self.cameras,
            reset: false,
            strikes,
            frozen: breakage.frozen.as_deref().filter(|_| strikes.frozen_values),
            asked: Some(Asked::default()),
        };
        let served = desk.serve_next(inbox, &mut replies);
        let (reset, asked) = (desk.reset, desk.asked.take().unwrap_or_default());
        if asked.frame.is_empty() {
            // Nothing was asked: in how many pieces a request comes changes nothing of what is drawn.
            *breakage.run.random() = before;
        }
        let is_order = matches!(asked.request, Some(RequestType::Command | RequestType::AddRcc));
        let frames = if strikes.not_acknowledged && is_order { Vec::new() } else { replies.into_frames() };
        let mut to_others = Vec::new();
        for (due, fate) in breakage.fate_of(&asked, frames) {
            to_others.extend(breakage.send(now, id, due, fate, outbox));
        }
        if reset || outbox.is_overfull() {
            connection.service = Service::Over;
        }
        self.send_to_others(id, &to_others);
        self.collect_machine_events();
        self.react(now);
        served
    }

    /// Everybody but the asker gets these frames.
    fn send_to_others(&mut self, asker: ConnectionId, frames: &[Vec<u8>]) {
        if frames.is_empty() {
            return;
        }
        for (other, connection) in &mut self.connections {
            if *other != asker && connection.service == Service::Served {
                let (_, outbox) = connection.session.split();
                frames.iter().for_each(|frame| outbox.send(|out| out.extend_from_slice(frame)));
                if outbox.is_overfull() {
                    connection.service = Service::Over;
                }
                self.woken.push_back(*other);
            }
        }
    }
}

impl Breakage {
    /// Sends the asker what is left of one reply, and tells what everybody else gets. A reply that is held goes behind the next one, and
    /// only one reply is held for each connection: the next one leaves, whatever strikes it.
    fn send(
        &mut self,
        now: Instant,
        id: ConnectionId,
        due: Option<Instant>,
        fate: Fate,
        outbox: &mut Outbox,
    ) -> Vec<Vec<u8>> {
        let Fate { mut to_asker, to_others, held } = fate;
        let held_before: Vec<_> = self.held.extract_if(.., |(holder, _)| *holder == id).collect();
        if held_before.is_empty() {
            self.held.extend(held.into_iter().map(|frame| (id, frame)));
        } else {
            to_asker.extend(held.into_iter().map(Outgoing::at_once));
            to_asker.extend(held_before.into_iter().map(|(_, frame)| Outgoing::at_once(frame)));
        }
        for Outgoing { later, bytes } in to_asker {
            match due {
                // One that is late keeps no other one waiting.
                _ if !later.is_zero() => {
                    outbox.send_at(due.unwrap_or(now) + later, |out| out.extend_from_slice(&bytes));
                }
                Some(due) => outbox.send_in_turn(due, |out| out.extend_from_slice(&bytes)),
                None => outbox.send(|out| out.extend_from_slice(&bytes)),
            }
        }
        to_others
    }
}

impl Outgoing {
    fn at_once(bytes: Vec<u8>) -> Self {
        Self { later: Duration::ZERO, bytes }
    }
}

impl Fate {
    /// Adds what became of one frame that was this late already.
    fn take(&mut self, next: Self, later: Duration) {
        let frames = next.to_asker.into_iter();
        self.to_asker.extend(frames.map(|frame| Outgoing { later: frame.later + later, ..frame }));
        self.to_others.extend(next.to_others);
        self.held.extend(next.held);
    }
}
