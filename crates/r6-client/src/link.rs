//! One connection, without the socket: the jobs under way on it, and the events of its session.

mod identification;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::client::{ClientSession, ClientSettings, Event, Ticket};
use r6_proto::message::Body;
use r6_proto::request::Request;
use r6_proto::time::Instant;

use crate::error::{Effect, NotSent, OutcomeUnknown, RequestError};
use crate::hub::Hub;
use crate::job::{Answer, Answered, Job, Work};
use crate::link::identification::Identification;
use crate::pushed::{LostReason, Pushed};
use crate::query::result::Rows;
use crate::settings::{Heartbeat, RobotSettings};

/// Ordinary requests that may wait for their replies at once. Enough to keep a connection busy, and few
/// enough that a controller whose replies take 20 ms is at most 160 ms behind.
const MAX_IN_FLIGHT: usize = 8;

/// Room beyond [`MAX_IN_FLIGHT`] that only stops, and the queries that confirm them, may take.
const RESERVED_FOR_STOPS: usize = 8;

/// Requests in all that may wait for their replies, including those that their callers gave up. A program
/// that gives up one pause after the other must not make a stop wait for their replies. Nor may it send
/// without end to a controller that does not answer.
const MOST_UNANSWERED: usize = 64;

/// Extra room for the identity query.
const RESERVED_FOR_INTRODUCTION: usize = 1;

/// Timeouts in a row, without a reply in between, after which the connection counts as dead. One is not
/// enough, because a list that is too long for a controller gets no reply either.
const SILENT_TIMEOUTS: u32 = 3;

/// What has to be read after a reconnect before a command may be sent. In the meantime the machine may have
/// been stopped or put into another mode, or may have raised an alarm.
pub(crate) const STATE: [Address; 2] = [Address::CurMode, Address::CurAlarm];

/// One connection's session and the jobs that wait on it.
#[derive(Debug)]
pub(crate) struct Link {
    session: ClientSession,
    in_flight: InFlight,
    /// A job that is done once its bytes are sent.
    leaving: Option<Job>,
    /// Whether any byte of `leaving` was given to the socket.
    leaving_began: bool,
    /// Since when there has been something to write.
    output_since: Option<Instant>,
    /// How long a reply may take, and also how long sending a frame may take.
    reply_timeout: Duration,
    heartbeat: Option<(Duration, Instant)>,
    silent: u32,
    /// When bytes last arrived that did not complete a frame. `unusable`: when the last frame that answered
    /// nothing arrived, and what it was.
    heard: Option<Instant>,
    unusable: Option<(Instant, String)>,
    /// Whether the controller ever answered on this connection.
    answered: bool,
    /// Whether values were handed out over this connection.
    handed_out: bool,
    /// The number of this connection.
    connection: u64,
    /// What has to be read before commands may be sent; empty on a handle's first connection.
    unread: Vec<Address>,
    who: Identification,
    hub: Arc<Hub>,
}

/// The jobs that wait for their replies, oldest first. They are few, and the first is nearly always answered
/// next.
#[derive(Debug, Default)]
struct InFlight(VecDeque<(Ticket, Job)>);

impl InFlight {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// How many of them have a caller that waits.
    fn waited_for(&self) -> usize {
        self.0.iter().filter(|(_, job)| !job.is_given_up()).count()
    }

    fn jobs(&self) -> impl Iterator<Item = &(Ticket, Job)> {
        self.0.iter()
    }

    fn push(&mut self, ticket: Ticket, job: Job) {
        self.0.push_back((ticket, job));
    }

    fn take(&mut self, ticket: Ticket) -> Option<Job> {
        let at = self.0.iter().position(|(waiting, _)| *waiting == ticket)?;
        self.0.remove(at).map(|(_, job)| job)
    }
}

/// The lanes of requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lane {
    /// One frame at a time, behind the requests that wait for a reply.
    Ordinary,
    /// Like ordinary, but its values do not count as read by the caller: they do not unlock commands.
    Background,
    /// Stops and the queries that confirm them: ahead of everything that is not already being written.
    Urgent,
}

impl Link {
    /// `first`: whether this is the handle's first connection. On a later one, the state has to be read
    /// before a command is sent.
    pub fn new(
        settings: &RobotSettings,
        first: bool,
        first_pack_id: u64,
        hub: &Arc<Hub>,
        now: Instant,
    ) -> Self {
        let heartbeat = match settings.heartbeat {
            Heartbeat::Off => None,
            Heartbeat::Managed { every } => Some((every.clamp(Heartbeat::SHORTEST, Heartbeat::LONGEST), now)),
        };
        let session = ClientSession::new(ClientSettings {
            reply_timeout: settings.reply_timeout,
            max_frame_bytes: settings.max_frame_bytes,
            max_in_flight: MOST_UNANSWERED + RESERVED_FOR_INTRODUCTION,
            type_key: settings.type_key,
            ds_id: settings.ds_id,
            first_pack_id,
        });
        let (connection, meant) = {
            let known = hub.known();
            (known.connection, known.expected.is_some())
        };
        Self {
            session,
            in_flight: InFlight::default(),
            leaving: None,
            leaving_began: false,
            output_since: None,
            reply_timeout: settings.reply_timeout,
            heartbeat,
            silent: 0,
            heard: None,
            unusable: None,
            answered: false,
            handed_out: false,
            connection,
            unread: if first { Vec::new() } else { STATE.to_vec() },
            who: Identification::new(first, meant, now),
            hub: Arc::clone(hub),
        }
    }

    /// Whether a job of this lane may be handed over now.
    ///
    /// Ordinary frames are handed over one at a time, so that a stop waits for one frame at most. While the
    /// controller has yet to identify itself, they may have to wait.
    pub fn has_room(&self, lane: Lane) -> bool {
        match lane {
            Lane::Urgent => {
                self.in_flight.len() < MOST_UNANSWERED
                    && self.in_flight.waited_for() < MAX_IN_FLIGHT + RESERVED_FOR_STOPS
            }
            Lane::Ordinary | Lane::Background => {
                self.in_flight.len() + usize::from(self.who.is_under_way()) < self.most_in_flight()
                    && self.output().is_empty()
                    && !self.who.holds_queries()
            }
        }
    }

    /// Firmware that does not name the request it answers gets one request at a time: if a reply is lost, the
    /// next reply would be taken for it. The same holds for firmware that has not answered yet. The identity
    /// query does not count then, because some firmware may not answer it.
    fn most_in_flight(&self) -> usize {
        match self.session.learned().echoes_pack_id {
            Some(false) => 1,
            None => 1 + usize::from(self.who.is_under_way()),
            Some(true) => MAX_IN_FLIGHT,
        }
    }

    /// Whether a stop has to wait until the controller has shown that it is the expected one.
    pub fn holds_stops(&self) -> bool {
        self.who.holds_stops()
    }

    /// Whether this is the handle's first connection.
    pub fn is_first(&self) -> bool {
        self.who.is_first()
    }

    /// Whether the controller owes an answer.
    pub fn awaits_reply(&self) -> bool {
        !self.in_flight.is_empty() || self.who.is_under_way()
    }

    /// Whether the controller has yet to identify itself.
    pub fn is_introducing(&self) -> bool {
        self.who.is_open()
    }

    /// Starts the identity query on a first connection; no ordinary request is sent before the answer.
    pub fn begin_introduction(&mut self) {
        self.who.begin();
    }

    /// The same for a request that is sent even if the controller does not identify itself. Returns whether
    /// it has to wait.
    pub fn begin_introduction_for_query(&mut self, now: Instant) -> bool {
        self.who.begin_for_query(now)
    }

    /// Sends the next identity query, if it is due.
    pub fn introduce(&mut self, now: Instant) {
        while self.output().is_empty()
            && let Some(asked) = self.who.question()
        {
            match self.session.send(now, &Request::Query(asked)) {
                Ok(ticket) => {
                    self.who.asked(ticket);
                    self.output_since.get_or_insert(now);
                    // If the answer is optional, a missing one must not lower the link quality.
                    if self.who.has_to_answer() {
                        self.hub.meter().asked(now);
                    }
                }
                // Too long for a frame of these settings: ask in smaller parts, or not at all.
                Err(error) => {
                    self.who.answered(Err(error.into()));
                    self.end_introduction();
                }
            }
        }
    }

    /// Reports the identity, once the query is over.
    fn end_introduction(&mut self) {
        if let Some(introduction) = self.who.ended() {
            let certain = introduction.is_certain();
            self.hub.introduced(introduction.found(), certain, self.is_first());
        }
    }

    /// Sends the job's request, or tells the job at once why not.
    pub fn hand_over(&mut self, mut job: Job, now: Instant) {
        if job.is_moot() {
            return;
        }
        let unidentified = || !self.is_first() && (self.is_introducing() || self.hub.is_unidentified());
        if job.work.needs_known_state() && (!self.unread.is_empty() || unidentified()) {
            return job.not_sent(NotSent::StateNotRead);
        }
        if job.work.sent().effect == Effect::Moves {
            job.doubt = Some(self.hub.doubts.begin());
        }
        match job.work.send(&mut self.session, now) {
            Err(error) => return job.not_sent(error),
            Ok(Some(ticket)) => {
                job.sent_at = now;
                self.in_flight.push(ticket, job);
                self.hub.meter().asked(now);
            }
            Ok(None) => {
                self.leaving = Some(job);
                self.leaving_began = false;
            }
        }
        self.output_since.get_or_insert(now);
    }

    /// The bytes that wait to be written.
    pub fn output(&self) -> &[u8] {
        self.session.poll_transmit().unwrap_or_default()
    }

    /// Withdraws unsent requests that have no caller or no permission any more, or are overdue. A stop is
    /// never withdrawn.
    pub fn withdraw_moot(&mut self, now: Instant) {
        let why = |job: &Job| NotSent::Busy { waited: now.since(job.asked_at) };
        self.withdraw(|job| job.is_moot() || job.is_overdue(now), why);
        self.withdraw(Job::is_withdrawn, |_| NotSent::Withdrawn);
    }

    /// Withdraws unsent requests that can move the arm and were asked for before the last stop.
    pub fn withdraw_overtaken(&mut self) {
        let stops = self.hub.stops_asked();
        self.withdraw(|job| job.is_overtaken(stops), |_| NotSent::Overtaken);
    }

    fn withdraw(&mut self, unwanted: impl Fn(&Job) -> bool, why: impl Fn(&Job) -> NotSent) {
        let tickets = self.in_flight.jobs().filter(|(_, job)| unwanted(job)).map(|(ticket, _)| *ticket);
        for ticket in tickets.collect::<Vec<_>>() {
            if self.session.withdraw(ticket)
                && let Some(job) = self.in_flight.take(ticket)
            {
                let why = why(&job);
                job.not_sent(why);
            }
        }
        if self.output().is_empty() {
            self.output_since = None;
        }
    }

    /// The socket took the first `bytes` of the output.
    pub fn written(&mut self, bytes: usize) {
        tracing::trace!(sent = %String::from_utf8_lossy(self.output().get(..bytes).unwrap_or_default()));
        self.session.transmitted(bytes);
        self.leaving_began = true;
        if self.output().is_empty() {
            self.output_since = None;
            if let Some(job) = self.leaving.take() {
                job.finish(Ok(Answer::Left));
            }
        }
    }

    /// Takes in bytes from the controller.
    pub fn received(&mut self, bytes: &[u8], now: Instant) -> Result<(), LostReason> {
        tracing::trace!(received = %String::from_utf8_lossy(bytes));
        self.heard = Some(now);
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.session.handle_input(now, rest);
            self.settle(now)?;
            rest = match rest.get(taken..) {
                Some(rest) if taken > 0 => rest,
                // The session has handled its input and still has no room: the rest would make no sense.
                Some(_) | None => return Err(LostReason::OutOfStep),
            };
        }
        Ok(())
    }

    /// When [`Self::tick`] is due.
    pub fn deadline(&self) -> Option<Instant> {
        let stalled = self.output_since.map(|since| since + self.reply_timeout);
        // While bytes are stuck, another heartbeat is useless.
        let beat = self.heartbeat.filter(|_| self.output().is_empty()).map(|(_, due)| due);
        let due = earlier(self.session.poll_timeout(), stalled);
        earlier(earlier(due, beat), self.who.deadline())
    }

    /// Handles what is due: heartbeats, overdue replies, stuck bytes.
    pub fn tick(&mut self, now: Instant) -> Result<(), LostReason> {
        self.who.tick(now);
        if self.output_since.is_some_and(|since| since + self.reply_timeout <= now) {
            return Err(LostReason::Stalled);
        }
        if let Some((every, due)) = self.heartbeat
            && due <= now
            && self.output().is_empty()
        {
            self.heartbeat = Some((every, now + every));
            if self.session.send(now, &Request::Heartbreak).is_ok() {
                self.output_since.get_or_insert(now);
            }
        }
        self.session.handle_timeout(now);
        self.settle(now)
    }

    /// Passes the events of the session to the waiting jobs and the subscribers.
    fn settle(&mut self, now: Instant) -> Result<(), LostReason> {
        let hub = Arc::clone(&self.hub);
        let mut replied = false;
        let mut lost = None;
        while let Some(event) = self.session.poll_event(now) {
            match event {
                Event::Reply { ticket, message, after } => {
                    let on = Answered { connection: self.connection, asked_at: now - after, after };
                    let introduced = self.who.take(ticket);
                    replied = true;
                    self.silent = 0;
                    self.heard = None;
                    if introduced {
                        if let Some(asked) = self.who.question().map(<[Address]>::to_vec) {
                            let most = asked.len();
                            let answer = Work::Query(asked.into()).answer(&message, on, Rows::new());
                            if let Ok(Answer::Mismatch { answered, .. }) = &answer
                                && most > 1
                                && *answered > most
                            {
                                hub.known().doubt_lists(self.connection);
                            }
                            self.who.answered(answer);
                        }
                    } else if let Some(mut job) = self.in_flight.take(ticket) {
                        let rows = std::mem::take(&mut job.rows);
                        if let (Some(asked), Body::QueryReply(reply)) = (job.work.asked(), &message.body) {
                            hub.known().keep_raw(asked, reply, on.connection, on.asked_at);
                        }
                        let answer = job.work.answer(&message, on, rows);
                        if !job.background {
                            self.unread.retain(|address| !reads(*address, &answer));
                        }
                        if !self.handed_out && matches!(answer, Ok(Answer::Values { .. })) {
                            self.handed_out = true;
                            hub.known().handed_out = true;
                        }
                        job.finish(answer);
                    }
                    let measured = self.who.has_to_answer();
                    if measured || !introduced {
                        let waiting = !self.in_flight.is_empty() || (measured && self.who.is_under_way());
                        hub.meter().replied(now, after, waiting);
                    }
                }
                Event::TimedOut(ticket) => {
                    let introducing = self.who.take(ticket);
                    if !introducing || self.who.has_to_answer() {
                        self.silent += 1;
                        hub.meter().counts.timeouts += 1;
                    }
                    if introducing {
                        if self.who.timed_out() {
                            lost = Some(LostReason::Unresponsive);
                        }
                    } else if let Some(job) = self.in_flight.take(ticket) {
                        let (request, after) = (job.work.sent(), self.reply_timeout);
                        hub.happened(crate::Event::NoReply { request: request.word, after });
                        let heard = heard_since(job.sent_at, self.heard, self.unusable.as_ref());
                        job.finish(Err(OutcomeUnknown::TimedOut { request, after, heard }.into()));
                    }
                }
                Event::Photo { cam_id, .. } => {
                    self.heard = None;
                    hub.push(Pushed::Photo { cam_id });
                }
                Event::Stray { reason, message } => {
                    hub.meter().counts.strays += 1;
                    self.unusable = Some((now, reason.to_string()));
                    hub.push(Pushed::stray(reason, message.frame()));
                }
                Event::BadFrame(error) => {
                    hub.meter().counts.garbled += 1;
                    self.unusable = Some((now, error.to_string()));
                    hub.push(Pushed::BadFrame(error));
                }
                Event::NotJson(error) => {
                    hub.meter().counts.garbled += 1;
                    self.unusable = Some((now, error.to_string()));
                    hub.push(Pushed::NotJson(error));
                }
                // Only `abandon` causes these.
                Event::Lost { .. } => {}
                Event::OutOfStep => lost = Some(LostReason::OutOfStep),
            }
        }
        self.end_introduction();
        if replied {
            self.answered = true;
            hub.learn(self.session.learned());
        }
        if self.silent >= SILENT_TIMEOUTS {
            lost = lost.or(Some(LostReason::Unresponsive));
        }
        lost.map_or(Ok(()), Err)
    }

    /// Whether the controller ever answered on this connection.
    pub fn answered(&self) -> bool {
        self.answered
    }

    /// Ends all jobs of a lost connection. An unsent job fails as not sent, a query is handed back once, and
    /// the outcome of any other job is unknown.
    ///
    /// Returns the queries to ask again, and the number for the next session's first request.
    pub fn abandon(mut self, reason: LostReason, now: Instant) -> (VecDeque<Job>, u64) {
        let mut again = VecDeque::new();
        self.session.handle_disconnect();
        while let Some(event) = self.session.poll_event(now) {
            let Event::Lost { ticket, left } = event else { continue };
            let Some(mut job) = self.in_flight.take(ticket) else { continue };
            if left {
                job.lost = Some(reason);
                self.hub.meter().counts.lost += 1;
            }
            match &job.work {
                Work::Query(_) if !job.retried => {
                    job.retried = true;
                    again.push_back(job);
                }
                Work::Query(_)
                | Work::RawQuery(_)
                | Work::Command(_)
                | Work::AddRcc { .. }
                | Work::AddPoints(_)
                | Work::PhotoAnswer(_) => {
                    job.not_sent(NotSent::Disconnected);
                }
            }
        }
        if let Some(mut job) = self.leaving.take() {
            job.lost = self.leaving_began.then_some(reason);
            job.not_sent(NotSent::Disconnected);
        }
        (again, self.session.next_pack_id())
    }
}

/// The earlier of two deadlines.
fn earlier(one: Option<Instant>, other: Option<Instant>) -> Option<Instant> {
    match (one, other) {
        (Some(one), Some(other)) => Some(one.min(other)),
        (one, other) => one.or(other),
    }
}

/// What was received last since a request was sent.
fn heard_since(
    sent: Instant,
    heard: Option<Instant>,
    unusable: Option<&(Instant, String)>,
) -> Option<String> {
    match unusable {
        Some((at, what)) if *at >= sent => Some(what.clone()),
        Some(_) | None => heard.filter(|at| *at >= sent).map(|_| "no whole frame".to_owned()),
    }
}

/// Whether this answer has a value for the address.
fn reads(wanted: Address, answer: &Result<Answer, RequestError>) -> bool {
    let Ok(Answer::Values { rows, .. }) = answer else { return false };
    rows.iter().any(|(address, value)| *address == wanted && value.is_ok())
}

#[cfg(test)]
mod tests {
    use futures_util::FutureExt as _;
    use r6_proto::message::{Command, PhotoAnswer};

    use super::*;
    use crate::reply::Reply;

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    fn link(heartbeat: Heartbeat) -> Link {
        let settings =
            RobotSettings { reply_timeout: Duration::from_secs(2), heartbeat, ..RobotSettings::default() };
        Link::new(&settings, true, 1, &Arc::default(), at(0))
    }

    fn hand_over(link: &mut Link, work: Work) -> Reply {
        let (reply, answer) = link.hub.places.open();
        link.hand_over(Job::new(work, at(0), reply), at(0));
        answer
    }

    fn error(answer: Reply) -> RequestError {
        answer.now_or_never().flatten().expect("an answer").expect_err("an error")
    }

    #[test]
    fn a_motion_whose_caller_gave_up_is_taken_back_while_nothing_of_it_has_left() {
        let mut link = link(Heartbeat::Off);
        drop(hand_over(&mut link, Work::Command(Command::StartButton)));
        link.withdraw_moot(at(0));
        assert!(link.output().is_empty() && link.in_flight.is_empty());
        drop(hand_over(&mut link, Work::Command(Command::StartButton)));
        link.written(1);
        link.withdraw_moot(at(0));
        assert!(!link.output().is_empty(), "a frame that has begun is sent to its end");
        let mut stopping = self::link(Heartbeat::Off);
        drop(hand_over(&mut stopping, Work::Command(Command::ActionStop)));
        stopping.withdraw_moot(at(0));
        assert!(!stopping.output().is_empty(), "a stop is never taken back");
    }

    #[test]
    fn a_frame_that_never_left_was_not_sent() {
        let mut link = link(Heartbeat::Off);
        let answer = hand_over(&mut link, Work::Command(Command::StartButton));
        let (again, _) = link.abandon(LostReason::ClosedByPeer, at(1));
        assert!(again.is_empty());
        assert_eq!(error(answer), NotSent::Disconnected.into());
    }

    #[test]
    fn a_frame_of_which_one_byte_left_has_an_unknown_outcome() {
        for work in [
            Work::Command(Command::StartButton),
            Work::AddRcc { replace: true, instructions: Vec::new() },
            Work::PhotoAnswer(PhotoAnswer { cam_id: 0, ret: 1 }),
        ] {
            let mut link = link(Heartbeat::Off);
            let request = work.sent();
            let answer = hand_over(&mut link, work);
            link.written(1);
            let reason = LostReason::Io(std::io::ErrorKind::ConnectionReset);
            let (again, _) = link.abandon(reason, at(1));
            assert!(again.is_empty());
            assert_eq!(error(answer), OutcomeUnknown::ConnectionLost { request, reason }.into());
        }
    }

    #[test]
    fn a_lost_query_is_handed_back_once() {
        let mut first = link(Heartbeat::Off);
        let answer = hand_over(&mut first, Work::Query([Address::CurMode].into()));
        first.written(1);
        let (mut again, next_pack_id) = first.abandon(LostReason::ClosedByPeer, at(1));
        assert_eq!((again.len(), next_pack_id), (1, 2));
        let mut second = link(Heartbeat::Off);
        second.hand_over(again.pop_front().unwrap(), at(2));
        let (again, _) = second.abandon(LostReason::ClosedByPeer, at(3));
        assert!(again.is_empty());
        // It was never sent the second time, but the first time it was.
        assert!(matches!(error(answer), RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { .. })));
    }

    #[test]
    fn a_frame_that_cannot_leave_ends_the_connection() {
        let mut link = link(Heartbeat::Managed { every: Duration::from_secs(1) });
        assert_eq!(link.tick(at(0)), Ok(()));
        let bytes = link.output().len();
        link.written(bytes - 1);
        // The next heartbeat is due at 1 s but waits behind the first: no deadline lies in the past.
        assert_eq!(link.deadline(), Some(at(2000)));
        assert_eq!(link.tick(at(1999)), Ok(()));
        assert_eq!(link.tick(at(2000)), Err(LostReason::Stalled));
    }

    #[test]
    fn heartbeats_keep_their_time() {
        let mut link = link(Heartbeat::Managed { every: Duration::from_secs(3) });
        for due in [0, 3000, 6000] {
            assert_eq!(link.deadline(), Some(at(due)));
            assert_eq!(link.tick(at(due)), Ok(()));
            let frame = String::from_utf8(link.output().to_vec()).unwrap();
            assert_eq!(frame, "{\"dsID\":\"www.hc-system.com.RemoteMonitor\",\"reqType\":\"heartbreak\"}");
            link.written(frame.len());
        }
    }

    #[test]
    fn eight_may_wait_for_replies_and_a_stop_besides() {
        let mut link = link(Heartbeat::Off);
        let mut answers = Vec::new();
        let _first = hand_over(&mut link, Work::Query([Address::CurMode].into()));
        link.written(link.output().len());
        assert!(
            !link.has_room(Lane::Ordinary),
            "it is not known yet whether this firmware says what it answers"
        );
        assert!(link.has_room(Lane::Urgent));
        link.received(br#"{"reqType":"query","packID":"1","queryData":["2"]}"#, at(0)).unwrap();
        while link.has_room(Lane::Ordinary) {
            answers.push(hand_over(&mut link, Work::Query([Address::CurMode].into())));
            assert!(!link.has_room(Lane::Ordinary), "one frame at a time");
            assert!(link.has_room(Lane::Urgent));
            link.written(link.output().len());
        }
        assert_eq!(answers.len(), MAX_IN_FLIGHT);
        let _stop = hand_over(&mut link, Work::Command(Command::ActionStop));
        assert!(String::from_utf8_lossy(link.output()).contains("actionStop"));
    }

    #[test]
    fn a_stop_does_not_wait_for_replies_that_nobody_waits_for() {
        let mut link = link(Heartbeat::Off);
        let mut answers = Vec::new();
        while link.has_room(Lane::Urgent) {
            answers.push(hand_over(&mut link, Work::Command(Command::ActionPause)));
        }
        assert_eq!(answers.len(), MAX_IN_FLIGHT + RESERVED_FOR_STOPS);
        answers.clear();
        assert!(link.has_room(Lane::Urgent));
        let mut given_up = link.in_flight.len();
        while link.has_room(Lane::Urgent) {
            drop(hand_over(&mut link, Work::Command(Command::ActionPause)));
            given_up += 1;
        }
        assert_eq!(given_up, MOST_UNANSWERED);
    }

    #[test]
    fn a_heartbeat_is_never_slower_than_the_watchdog_bears() {
        let link = link(Heartbeat::Managed { every: Duration::from_secs(15) });
        assert_eq!(link.heartbeat.map(|(every, _)| every), Some(Heartbeat::LONGEST));
    }
}
