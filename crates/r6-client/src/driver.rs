//! The task behind a handle: one loop that carries bytes, time and jobs between the handles, the session and the socket.

mod wake;

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, sleep, timeout};

use crate::backoff::Backoff;
use crate::clock::Clock;
use crate::connect::{Connect, Dialer};
use crate::driver::wake::{Waiter, Woken};
use crate::error::{Effect, NotSent};
use crate::identity::asks_who_is_there;
use crate::job::{Job, Work};
use crate::link::{Lane, Link};
use crate::pushed::LostReason;
use crate::robot::Hub;
use crate::settings::RobotSettings;

/// How long a closing connection may take to write what waits, and then to say that it has read everything. A
/// controller that gets a reset instead of an orderly end may keep the connection's slot for good.
const CLOSE_WAIT: Duration = Duration::from_millis(500);

/// What comes through the urgent lane.
#[derive(Debug)]
pub(crate) enum Urgent {
    Job(Job),
    /// End the connection, then answer.
    Close(oneshot::Sender<()>),
}

/// Why the loop over one connection ended.
enum Ended {
    /// The connection broke.
    Lost(LostReason),
    /// No handle is left, or one asked for the end.
    Closed(Option<oneshot::Sender<()>>),
}

/// The task behind a handle.
#[derive(Debug)]
pub(crate) struct Driver<C> {
    target: Arc<Dialer<C>>,
    pub settings: RobotSettings,
    pub urgent: mpsc::Receiver<Urgent>,
    pub ordinary: mpsc::Receiver<Job>,
    pub hub: Arc<Hub>,
    pub backoff: Backoff,
    /// The hub's.
    clock: Clock,
    /// Jobs for the next connection: the one that asked for it, and queries that the last one lost. On a connection, what
    /// waits until the controller has said who it is.
    held: VecDeque<Job>,
    next_pack_id: u64,
}

impl<C: Connect> Driver<C> {
    pub fn new(
        target: Arc<Dialer<C>>,
        settings: RobotSettings,
        urgent: mpsc::Receiver<Urgent>,
        ordinary: mpsc::Receiver<Job>,
        hub: Arc<Hub>,
        backoff: Backoff,
    ) -> Self {
        let clock = hub.clock;
        Self {
            target,
            settings,
            urgent,
            ordinary,
            hub,
            backoff,
            clock,
            held: VecDeque::new(),
            next_pack_id: 1,
        }
    }

    /// Serves the handles until the last is gone. Where it is known already who is meant, this connection has to say first who is
    /// there, like one that was made anew.
    pub async fn run(mut self, mut stream: C::Stream) {
        let first = self.hub.known().expected.is_none();
        let mut link = Link::new(&self.settings, first, self.next_pack_id, &self.hub, self.clock.now());
        loop {
            let begun = Instant::now();
            let ended = self.serve(&mut stream, &mut link).await;
            if link.answered() {
                self.backoff.had_answers_for(begun.elapsed());
            }
            let reason = match &ended {
                Ended::Lost(reason) => *reason,
                Ended::Closed(_) => LostReason::ClosedHere,
            };
            if reason == LostReason::ClosedHere {
                close(&mut stream, &mut link).await;
            }
            drop(stream);
            tracing::info!(controller = self.target.name(), %reason, "connection ended");
            let unidentified = !link.is_first() && link.is_introducing();
            let (again, next_pack_id) = link.abandon(reason, self.clock.now());
            let waiting: Vec<Job> = self.held.drain(..).chain(again).collect();
            waiting.into_iter().for_each(|job| self.hold(job));
            self.next_pack_id = next_pack_id;
            if let Ended::Closed(done) = ended {
                return self.refuse_all(&NotSent::Closed, done);
            }
            self.hub.connection_lost(reason);
            if self.target.takes_whoever_comes() {
                // The next controller that dials may be another robot.
                self.hub.doubt_who_answers();
            }
            if unidentified {
                // One attempt answers everybody who waited for it.
                self.tell_unconnected(&NotSent::Unidentified {
                    address: self.target.name().to_owned(),
                    reason,
                });
            }
            stream = match self.reconnect().await {
                Ok(stream) => stream,
                Err(done) => return self.refuse_all(&NotSent::Closed, done),
            };
            link = Link::new(&self.settings, false, self.next_pack_id, &self.hub, self.clock.now());
            tracing::info!(controller = self.target.name(), "connected anew");
            self.hub.meter().reconnected();
        }
    }

    /// One connection, from its first byte to its end.
    async fn serve(&mut self, stream: &mut C::Stream, link: &mut Link) -> Ended {
        let mut waiter = Waiter::new();
        // The watchdog is armed before anything moves: a timer may come a millisecond late, and this process may die in it.
        if let Err(reason) = link.tick(self.clock.now()) {
            return Ended::Lost(reason);
        }
        loop {
            self.hand_over_held(link);
            if link.is_introducing() {
                link.introduce(self.clock.now());
                if !link.is_introducing() {
                    // Not one of its questions fits into a frame: nothing will wake who waits for the answer.
                    self.hand_over_held(link);
                }
            }
            let (urgent, ordinary) = (&mut self.urgent, &mut self.ordinary);
            let woken = waiter.woken(stream, link, urgent, ordinary, self.clock).await;
            let mut alive = Ok(());
            match woken {
                Woken::Urgent(Some(Urgent::Job(job))) => {
                    link.withdraw_overtaken();
                    self.hand_over_urgent(job, link);
                }
                Woken::Urgent(Some(Urgent::Close(done))) => return Ended::Closed(Some(done)),
                Woken::Urgent(None) | Woken::Ordinary(None) => return Ended::Closed(None),
                Woken::Ordinary(Some(job)) => self.hand_over_once_known(job, link),
                Woken::Written(Ok(0)) => return Ended::Lost(LostReason::ClosedByPeer),
                Woken::Written(Ok(bytes)) => link.written(bytes),
                Woken::Read(Ok(0)) => return Ended::Lost(LostReason::ClosedByPeer),
                Woken::Read(Ok(bytes)) => {
                    alive = link.received(waiter.bytes(bytes), self.clock.now());
                }
                Woken::Written(Err(error)) | Woken::Read(Err(error)) => {
                    return Ended::Lost(LostReason::Io(error.kind()));
                }
                Woken::Time => alive = link.tick(self.clock.now()),
            }
            if let Err(reason) = alive {
                return Ended::Lost(reason);
            }
        }
    }

    /// A stop leaves at once, unless the controller has yet to say whether it is the one that is meant; what confirms the stop leaves
    /// behind it.
    fn hand_over_urgent(&mut self, job: Job, link: &mut Link) {
        if link.holds_stops() {
            self.held.push_back(job);
            return;
        }
        let stops = job.work.sent().effect == Effect::Stops;
        self.hand_over_unless_another(job, link);
        if stops && link.is_first() && self.hub.known().present.is_none() {
            // Over another connection it has to be known whom the stop was meant for.
            link.begin_introduction();
        }
    }

    /// What waited for this connection, or until the controller has said who it is. Stops come first and wait for neither.
    fn hand_over_held(&mut self, link: &mut Link) {
        while let Some(job) = self.held.front() {
            let lane = match job.work.sent().effect {
                Effect::Stops => Lane::Urgent,
                Effect::Reads | Effect::Changes | Effect::Moves => Lane::Ordinary,
            };
            if !link.has_room(lane) || (lane == Lane::Urgent && link.holds_stops()) {
                return;
            }
            if let Some(job) = self.held.pop_front() {
                self.hand_over_once_known(job, link);
            }
        }
    }

    /// Holds commands back until the controller has said who it is, and queries for a while. A stop and the answer to a photo leave at once.
    /// The next connection is compared with that identity.
    fn hand_over_once_known(&mut self, job: Job, link: &mut Link) {
        if !link.is_first() || job.is_moot() || self.hub.known().present.is_some() {
            return self.hand_over_unless_stale(job, link);
        }
        let waits = match &job.work {
            work if work.needs_known_state() => {
                link.begin_introduction();
                true
            }
            Work::Query(addresses) => {
                !asks_who_is_there(addresses) && link.begin_introduction_for_query(self.clock.now())
            }
            // A photo cannot wait. What stops does not come this way on a first connection.
            Work::PhotoAnswer(_) | Work::Command(_) | Work::AddRcc { .. } | Work::AddPoints(_) => {
                link.begin_introduction_for_query(self.clock.now());
                false
            }
        };
        if waits {
            self.held.push_front(job);
        } else {
            self.hand_over_unless_stale(job, link);
        }
    }

    /// A command that waited long must not leave as a surprise; a query may.
    fn hand_over_unless_stale(&self, job: Job, link: &mut Link) {
        match job.work.sent().effect {
            Effect::Changes | Effect::Moves => {
                let waited = job.asked_at.elapsed();
                if waited > self.settings.reply_timeout || job.is_overdue() {
                    return job.not_sent(NotSent::Busy { waited });
                }
            }
            Effect::Reads | Effect::Stops => {}
        }
        self.hand_over_unless_another(job, link);
    }

    /// What was meant for one robot is not sent to another, and what was meant for one connection not over another.
    fn hand_over_unless_another(&self, job: Job, link: &mut Link) {
        if job.is_overtaken(self.hub.stops_asked()) {
            return job.not_sent(NotSent::Overtaken);
        }
        if job.only_on.is_some_and(|only| only != self.hub.known().connection) {
            return job.not_sent(NotSent::Disconnected);
        }
        if job.work.is_for_one_robot()
            && let Some(another) = self.hub.stranger()
        {
            return job.not_sent(another);
        }
        link.hand_over(job, self.clock.now());
    }

    /// Waits until a query or a stop wants a connection, then makes one. `Err`: it is time to end.
    async fn reconnect(&mut self) -> Result<C::Stream, Option<oneshot::Sender<()>>> {
        loop {
            while self.held.is_empty() {
                tokio::select! {
                    biased;
                    urgent = self.urgent.recv() => self.hold_urgent(urgent)?,
                    job = self.ordinary.recv() => self.hold(job.ok_or(None)?),
                }
            }
            // A stop does not wait for the end of the backoff; it is sent again at its own pace.
            let backoff = sleep(self.backoff.next_wait(self.hub.board.pace()));
            tokio::pin!(backoff);
            while !self.held.iter().any(|job| job.work.sent().effect == Effect::Stops) {
                tokio::select! {
                    biased;
                    urgent = self.urgent.recv() => self.hold_urgent(urgent)?,
                    () = &mut backoff => break,
                }
            }
            match self.connect().await? {
                Ok(stream) => return Ok(stream),
                // One attempt answers everybody who waited for it.
                Err(error) => self.tell_unconnected(&error),
            }
        }
    }

    /// One attempt to connect. Closing the handle ends it at once, with `Err`.
    async fn connect(&mut self) -> Result<Result<C::Stream, NotSent>, Option<oneshot::Sender<()>>> {
        let target = Arc::clone(&self.target);
        let attempt = target.connect(self.settings.connect_timeout);
        tokio::pin!(attempt);
        loop {
            tokio::select! {
                biased;
                urgent = self.urgent.recv() => self.hold_urgent(urgent)?,
                made = &mut attempt => return Ok(made),
            }
        }
    }

    fn hold_urgent(&mut self, urgent: Option<Urgent>) -> Result<(), Option<oneshot::Sender<()>>> {
        match urgent {
            Some(Urgent::Job(job)) => self.hold(job),
            Some(Urgent::Close(done)) => return Err(Some(done)),
            None => return Err(None),
        }
        Ok(())
    }

    /// Keeps a job that is worth a new connection, refuses any other: what a command was meant for may have changed.
    /// Stops come first.
    fn hold(&mut self, job: Job) {
        if job.is_moot() {
            return;
        }
        match job.work.sent().effect {
            Effect::Stops => {
                // A stop that its caller gave up still leaves, but only once.
                let sent = job.work.sent();
                self.held.retain(|held| !(held.is_given_up() && held.work.sent() == sent));
                self.held.push_front(job);
            }
            Effect::Reads => self.held.push_back(job),
            Effect::Changes | Effect::Moves => job.not_sent(NotSent::Disconnected),
        }
    }

    fn tell_unconnected(&mut self, error: &NotSent) {
        tracing::info!(controller = self.target.name(), %error, "no connection");
        self.refuse_waiting(error);
    }

    fn refuse_waiting(&mut self, error: &NotSent) {
        for job in self.held.drain(..) {
            job.not_sent(error.clone());
        }
        while let Ok(job) = self.ordinary.try_recv() {
            job.not_sent(error.clone());
        }
    }

    fn refuse_all(mut self, error: &NotSent, done: Option<oneshot::Sender<()>>) {
        self.urgent.close();
        self.ordinary.close();
        self.hub.board.close();
        self.hub.end_pushed();
        self.refuse_waiting(error);
        let mut done: Vec<_> = done.into_iter().collect();
        while let Ok(urgent) = self.urgent.try_recv() {
            match urgent {
                Urgent::Job(job) => job.not_sent(error.clone()),
                Urgent::Close(also) => done.push(also),
            }
        }
        for done in done {
            done.send(()).ok();
        }
    }
}

/// Ends a connection in order: what waits is written, our end is closed, what still comes is read.
async fn close<S: AsyncRead + AsyncWrite + Unpin>(stream: &mut S, link: &mut Link) {
    link.withdraw_moot();
    let goodbye = async {
        while !link.output().is_empty() {
            let bytes = stream.write(link.output()).await?;
            link.written(bytes);
        }
        stream.shutdown().await?;
        let mut rest = [0; 1024];
        while stream.read(&mut rest).await? > 0 {}
        io::Result::Ok(())
    };
    // Whatever goes wrong here, the socket is closed next.
    drop(timeout(CLOSE_WAIT, goodbye).await);
}

#[cfg(test)]
mod tests {
    use r6_proto::address::Address;
    use r6_proto::message::Command;
    use r6_proto::time::Instant;

    use super::*;

    #[tokio::test]
    async fn a_command_that_waited_long_does_not_leave_and_a_query_does() {
        let settings = RobotSettings::default();
        let (_urgent, urgent) = mpsc::channel(1);
        let (_ordinary, ordinary) = mpsc::channel(1);
        let backoff = Backoff::new(settings.reconnect, || 0);
        let target = Arc::new(Dialer::new(crate::connect::Tcp::parse("robot").unwrap()));
        let hub = Arc::default();
        let mut link = Link::new(&settings, true, 1, &hub, Instant::ORIGIN);
        let driver = Driver::new(target, settings, urgent, ordinary, hub, backoff);

        let waited = Duration::from_millis(2001);
        let job = |work| {
            let (reply, answer) = oneshot::channel();
            let mut job = Job::new(work, reply);
            job.asked_at -= waited;
            (job, answer)
        };
        let (start, answer) = job(Work::Command(Command::StartButton));
        driver.hand_over_unless_stale(start, &mut link);
        assert!(link.output().is_empty());
        match answer.await.unwrap().unwrap_err() {
            crate::RequestError::NotSent(NotSent::Busy { waited: told }) => assert!(told >= waited),
            other => panic!("{other:?}"),
        }
        let (query, _answer) = job(Work::Query(vec![Address::CurMode]));
        driver.hand_over_unless_stale(query, &mut link);
        assert!(!link.output().is_empty());
    }
}
