//! One connection, without the socket: which jobs are under way on it, and what its session says about them.

mod identification;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::client::{ClientSession, ClientSettings, Event, Ticket};
use r6_proto::request::Request;
use r6_proto::time::Instant;

use crate::error::{Effect, NotSent, OutcomeUnknown, RequestError};
use crate::hub::Hub;
use crate::job::{Answer, Answered, Job, Work};
use crate::link::identification::Identification;
use crate::pushed::{LostReason, Pushed};
use crate::query::result::Rows;
use crate::settings::{Heartbeat, RobotSettings};

/// Ordinary requests that may wait for their replies at once: enough to keep a connection busy, few enough that
/// a controller whose replies take 20 ms is at most 160 ms behind.
const MAX_IN_FLIGHT: usize = 8;

/// Room beyond [`MAX_IN_FLIGHT`] that only stops, and the queries that confirm them, may take.
const RESERVED_FOR_STOPS: usize = 8;

/// Requests in all that may wait for their replies, those that their callers gave up among them: a program that gives up one pause after
/// the other must not keep a stop waiting for the replies to them, nor send without end to a controller that answers nothing.
const MOST_UNANSWERED: usize = 64;

/// Room beyond that for the query that asks who is there.
const RESERVED_FOR_INTRODUCTION: usize = 1;

/// Time-outs in a row, without a reply in between, after which the connection counts as dead. One list that is
/// too long for a controller gets no reply either, so one is not enough.
const SILENT_TIMEOUTS: u32 = 3;

/// What has to be read on a connection that was made anew before a command may leave: behind our back the machine may
/// have been stopped, put into another mode, or have raised an alarm.
pub(crate) const STATE: [Address; 2] = [Address::CurMode, Address::CurAlarm];

/// One connection's session and the jobs that wait on it.
#[derive(Debug)]
pub(crate) struct Link {
    session: ClientSession,
    in_flight: InFlight,
    /// A job that is done once its bytes have left.
    leaving: Option<Job>,
    /// Whether any byte of `leaving` was given to the socket.
    leaving_began: bool,
    /// Since when there has been something to write.
    output_since: Option<Instant>,
    /// How long a reply may take, and a frame to leave.
    reply_timeout: Duration,
    heartbeat: Option<(Duration, Instant)>,
    silent: u32,
    /// When bytes last came that were no frame yet, and when the last frame that answered nothing, with what it was.
    heard: Option<Instant>,
    unusable: Option<(Instant, String)>,
    /// Whether the controller ever answered on this connection.
    answered: bool,
    /// Whether values were handed out over this connection.
    handed_out: bool,
    /// The number of this connection.
    connection: u64,
    /// What has to be read before commands may leave; nothing on a handle's first connection.
    unread: Vec<Address>,
    who: Identification,
    hub: Arc<Hub>,
}

/// The jobs that wait for their replies, the longest waiting first: few, and the first is nearly always the next to be answered.
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

/// The two lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lane {
    /// One frame at a time, behind those that wait for a reply.
    Ordinary,
    /// Like ordinary, and what it reads was not looked at by the caller of a command: it lets no command through.
    Background,
    /// Stops and what confirms them: ahead of everything that is not already being written.
    Urgent,
}

impl Link {
    /// `first` tells whether this is the handle's first connection; on a later one the state has to be read before
    /// a command leaves.
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
    /// Ordinary frames are handed over one at a time, so that a stop waits for one frame at most, and not before the
    /// controller has said who it is.
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

    /// A firmware that does not say which request it answers gets one at a time: where one reply is lost, the next one would be
    /// taken for it. So does one that has not answered yet, besides the question who is there, which some may not answer.
    fn most_in_flight(&self) -> usize {
        match self.session.learned().echoes_pack_id {
            Some(false) => 1,
            None => 1 + usize::from(self.who.is_under_way()),
            Some(true) => MAX_IN_FLIGHT,
        }
    }

    /// Whether a stop has to wait: the controller is about to say whether it is the one that the stop is meant for.
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

    /// Whether the controller has yet to say who it is.
    pub fn is_introducing(&self) -> bool {
        self.who.is_open()
    }

    /// Has the controller asked who it is, on a first connection; nothing ordinary leaves before it has said so.
    pub fn begin_introduction(&mut self) {
        self.who.begin();
    }

    /// The same for a request that leaves without it where the controller does not say who it is. Whether it has to wait.
    pub fn begin_introduction_for_query(&mut self, now: Instant) -> bool {
        self.who.begin_for_query(now)
    }

    /// Sends the introduction's next query, if it is its turn.
    pub fn introduce(&mut self, now: Instant) {
        while self.output().is_empty()
            && let Some(asked) = self.who.question()
        {
            match self.session.send(now, &Request::Query(asked)) {
                Ok(ticket) => {
                    self.who.asked(ticket);
                    self.output_since.get_or_insert(now);
                    // A controller that answers all else is no worse link.
                    if self.who.has_to_answer() {
                        self.hub.meter().asked(now);
                    }
                }
                // Too long for the frames of these settings: then in smaller parts, or not at all.
                Err(error) => {
                    self.who.answered(Err(error.into()));
                    self.end_introduction();
                }
            }
        }
    }

    /// Tells who is there, once that is known.
    fn end_introduction(&mut self) {
        if let Some(introduction) = self.who.ended() {
            let certain = introduction.is_certain();
            self.hub.introduced(introduction.found(), certain, self.is_first());
        }
    }

    /// Sends the job's request, or says at once why not.
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

    /// Takes back what no longer has a caller, or should have left before now, and of which nothing has left; a stop is never taken back.
    pub fn withdraw_moot(&mut self, now: Instant) {
        let why = |job: &Job| NotSent::Busy { waited: now.since(job.asked_at) };
        self.withdraw(|job| job.is_moot() || job.is_overdue(now), why);
    }

    /// Takes back what can move the arm, was asked for before the last stop, and of which nothing has left.
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

    /// The first `bytes` of the output were given to the socket.
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

    /// Bytes came from the controller.
    pub fn received(&mut self, bytes: &[u8], now: Instant) -> Result<(), LostReason> {
        tracing::trace!(received = %String::from_utf8_lossy(bytes));
        self.heard = Some(now);
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.session.handle_input(now, rest);
            self.settle(now)?;
            rest = match rest.get(taken..) {
                Some(rest) if taken > 0 => rest,
                // The session has read all it had and still has no room: what follows would make no sense.
                Some(_) | None => return Err(LostReason::OutOfStep),
            };
        }
        Ok(())
    }

    /// When [`Self::tick`] is due.
    pub fn deadline(&self) -> Option<Instant> {
        let stalled = self.output_since.map(|since| since + self.reply_timeout);
        // Behind bytes that do not leave, another heartbeat is of no use.
        let beat = self.heartbeat.filter(|_| self.output().is_empty()).map(|(_, due)| due);
        let due = earlier(self.session.poll_timeout(), stalled);
        earlier(earlier(due, beat), self.who.deadline())
    }

    /// Time passed: heartbeats, overdue replies, bytes that do not leave.
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

    /// Tells the waiting jobs and the subscribers what the session has to say.
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
                // Only after `abandon`.
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

    /// The connection ended: what never left says so, queries that left once are handed back, all else is unknown.
    ///
    /// Returns the queries that are to be asked again and the number that the next session's first request has.
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

/// What came last since a request was sent.
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

/// Whether this answer tells the value of the address.
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
        // It never left the second time, but it did the first time.
        assert!(matches!(error(answer), RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { .. })));
    }

    #[test]
    fn a_frame_that_cannot_leave_ends_the_connection() {
        let mut link = link(Heartbeat::Managed { every: Duration::from_secs(1) });
        assert_eq!(link.tick(at(0)), Ok(()));
        let bytes = link.output().len();
        link.written(bytes - 1);
        // The next heartbeat is due at 1 s, but stands behind the first: no deadline lies in the past.
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
            "nobody knows yet whether this firmware says what it answers"
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
