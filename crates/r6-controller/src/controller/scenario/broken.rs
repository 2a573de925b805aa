//! Requests and replies while faults are in force.

use std::time::Duration;

use r6_proto::message::RequestType;
use r6_proto::server::{MAX_UNSENT_BYTES, Outbox};
use r6_proto::time::Instant;

use super::super::dispatch::Dispatcher;
use super::super::{ConnectionId, Controller, Service};
use super::Breakage;
use crate::event::Event;
use crate::fault::reply::{self, Fate, Outgoing};
use crate::fault::{Fault, IgnoredStop, TaskFault};

/// After how many frames no further fault strikes one reply. This is enough to see what each fault does.
const MAX_FRAMES: usize = 16;

/// The faults that strike one request.
#[derive(Clone, Copy, Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "faults that may strike at once, each by itself")]
pub(in crate::controller) struct RequestFaults {
    pub not_executed: bool,
    pub not_acknowledged: bool,
    pub list_full: bool,
    pub rejected_mid_batch: bool,
    pub task_dead: bool,
    pub frozen_values: bool,
    pub stop_ignored: Option<IgnoredStop>,
    pub late_list: Option<Duration>,
}

/// The request that is being handled.
#[derive(Debug, Default)]
pub(in crate::controller) struct Asked {
    pub frame: Vec<u8>,
    /// Its type.
    pub request: Option<RequestType>,
}

impl Breakage {
    /// Draws the faults that strike the next request.
    fn strikes(&mut self) -> RequestFaults {
        let mut strikes = RequestFaults::default();
        for (task, chance) in &self.tasks {
            let hit = self.run.random().strikes(*chance);
            match task {
                TaskFault::NotExecuted => strikes.not_executed |= hit,
                TaskFault::NotAcknowledged => strikes.not_acknowledged |= hit,
                TaskFault::ListFull => strikes.list_full |= hit,
                TaskFault::RejectedMidBatch => strikes.rejected_mid_batch |= hit,
                TaskFault::TaskDead => strikes.task_dead |= hit,
                TaskFault::FrozenValues => strikes.frozen_values |= hit,
                TaskFault::StopIgnored(how) if hit => strikes.stop_ignored = Some(*how),
                TaskFault::LateList { delay } if hit => strikes.late_list = Some(*delay),
                TaskFault::StopIgnored(_) | TaskFault::LateList { .. } => {}
                // These struck when they began.
                TaskFault::ListFrozen | TaskFault::Dwell { .. } => {}
            }
        }
        strikes
    }

    /// Applies the reply faults to the replies to a request. Each fault in force may strike each reply, one
    /// after the other.
    fn fate_of(
        &mut self,
        asked: &Asked,
        frames: Vec<(Option<Instant>, Vec<u8>)>,
    ) -> (Vec<(Option<Instant>, Fate)>, Vec<Event>) {
        let mut fates = Vec::with_capacity(frames.len());
        let mut struck = Vec::new();
        for (due, frame) in frames {
            let mut fate = Fate { to_asker: vec![Outgoing::at_once(frame)], ..Fate::default() };
            for (fault, chance) in &self.replies {
                if self.run.random().strikes(*chance) && !fate.is_full() {
                    struck.push(Event::Struck { fault: Fault::Reply(*fault) });
                    for outgoing in std::mem::take(&mut fate.to_asker) {
                        let next = reply::strike(fault, &asked.frame, outgoing.bytes, self.run.random());
                        fate.take(next, outgoing.later);
                    }
                }
            }
            fates.push((due, fate));
        }
        (fates, struck)
    }
}

impl RequestFaults {
    /// Whether a query gets frozen values.
    fn answers_of_before(self) -> bool {
        self.frozen_values && !self.task_dead
    }

    /// The event to log for a request that gets no answer.
    fn unanswered(self, is_order: bool) -> Option<Event> {
        let fault = if self.task_dead {
            TaskFault::TaskDead
        } else if self.not_acknowledged && is_order {
            TaskFault::NotAcknowledged
        } else {
            return None;
        };
        Some(Event::NotAnswered { fault })
    }
}

impl Controller {
    /// Carries out the next message of a connection while faults are in force.
    pub(in crate::controller) fn serve_broken(&mut self, now: Instant, id: ConnectionId) -> bool {
        let Some(breakage) = &mut self.breakage else { return false };
        let Some(connection) = self.connections.get_mut(&id) else { return false };
        let before = breakage.run.random().clone();
        let strikes = breakage.strikes();
        let (inbox, outbox) = connection.session.split();
        let mut replies = Outbox::default();
        let mut dispatcher = Dispatcher {
            strikes,
            frozen: breakage.frozen.as_deref().filter(|_| strikes.frozen_values),
            asked: Some(Asked::default()),
            ..Dispatcher::new(now, id, &mut self.machine, &mut self.log, &mut self.cameras)
        };
        let served = dispatcher.serve_next(inbox, &mut replies);
        let (reset, asked) = (dispatcher.reset, dispatcher.asked.take().unwrap_or_default());
        if let Some((due, late)) = dispatcher.late.take() {
            breakage.run.take_later(due, late);
        }
        if asked.frame.is_empty() {
            // No request was complete: restore the random state, so that the draws do not depend on how a
            // request is split.
            *breakage.run.random() = before;
        }
        let is_order = matches!(asked.request, Some(RequestType::Command | RequestType::AddRcc));
        let frames = if strikes.not_acknowledged && is_order { Vec::new() } else { replies.into_frames() };
        let mut to_others = Vec::new();
        let (fates, struck) = breakage.fate_of(&asked, frames);
        let unanswered = strikes.unanswered(is_order).filter(|_| may_be_answered(asked.request));
        let is_old = strikes.answers_of_before() && asked.request == Some(RequestType::Query);
        let old = is_old.then_some(Event::OldValues { fault: TaskFault::FrozenValues });
        for event in unanswered.into_iter().chain(old).chain(struck) {
            self.log.add(now, Some(id), event);
        }
        for (due, fate) in fates {
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

    /// Sends these frames to every connection except the asker's.
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
    /// Sends the asker what is left of one reply, and returns the frames for the other connections. A held
    /// reply is sent after the next one. Only one reply is held per connection, so the next one is always
    /// sent, whatever strikes it.
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
                // A late frame does not delay the others.
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

/// Whether a missing answer to such a request is logged. A heartbreak is answered even while the task is
/// dead.
fn may_be_answered(request: Option<RequestType>) -> bool {
    match request {
        Some(RequestType::Query | RequestType::Command | RequestType::AddPoints | RequestType::AddRcc) => {
            true
        }
        Some(RequestType::Heartbreak | RequestType::Photo) | None => false,
    }
}

impl Outgoing {
    fn at_once(bytes: Vec<u8>) -> Self {
        Self { later: Duration::ZERO, bytes }
    }
}

impl Fate {
    /// Whether no further fault strikes, because several faults of one kind double a reply each time.
    fn is_full(&self) -> bool {
        let bytes: usize = self.to_asker.iter().map(|outgoing| outgoing.bytes.len()).sum();
        self.to_asker.len() >= MAX_FRAMES || bytes >= MAX_UNSENT_BYTES
    }

    /// Adds the frames made from one frame that was already this late.
    fn take(&mut self, next: Self, later: Duration) {
        let frames = next.to_asker.into_iter();
        self.to_asker.extend(frames.map(|frame| Outgoing { later: frame.later + later, ..frame }));
        self.to_others.extend(next.to_others);
        self.held.extend(next.held);
    }
}
