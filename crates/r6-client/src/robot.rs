//! The handle.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use r6_proto::address::Address;
use r6_proto::client::LearnedDialect;
use r6_proto::message::{Command, PhotoAnswer};
use tokio::runtime::Handle;
use tokio::sync::mpsc::{self, error::TrySendError};
use tokio::sync::{
    Mutex as AsyncMutex, OwnedMutexGuard, OwnedSemaphorePermit, Semaphore, broadcast, oneshot, watch,
};
use tokio::time::timeout;

use crate::backoff::Backoff;
use crate::board::Board;
use crate::clock::Clock;
use crate::connect::{Connect, Dial, Dialer, Once, Tcp};
use crate::doubt::Doubts;
use crate::driver::{Driver, Urgent};
use crate::error::{Effect, NotSent, OutcomeUnknown, RequestError, Sent};
use crate::evidence::About;
use crate::guard::{Envelope, Reckoning};
use crate::identity::{Found, Identity};
use crate::job::{Answer, CameraSet, Job, Terms, Work};
use crate::link::Lane;
use crate::link_quality::Meter;
use crate::motions::Motions;
use crate::pushed::{KEPT_FOR_SUBSCRIBERS, LostReason, Pushed};
use crate::query::around_query;
use crate::settings::{Heartbeat, RobotSettings};
use crate::stop::{STOP_WITHIN, SecondConnection, Stopping};
use crate::stream::MotionError;
use crate::told::{self, Tell};

/// Requests that may wait in each lane; a caller beyond that waits for room.
const LANE_LENGTH: usize = 64;

/// A handle on one controller. Clones share one connection; dropping the last one closes it.
///
/// All methods may be called at the same time from many tasks: requests share the connection, each reply goes to
/// whom it belongs. Dropping the future of a request that has not left yet takes the request back, except for a stop.
#[derive(Clone, Debug)]
pub struct Robot {
    lanes: Arc<Lanes>,
    /// What every list is checked against before it is sent.
    guard: Option<Arc<Envelope>>,
    /// How often a tool or a workbench had been told when the guard was made: its limits are of the one in use then.
    guarded_at: u64,
}

#[derive(Debug)]
struct Lanes {
    address: String,
    settings: RobotSettings,
    /// [`around_query`] of the settings.
    around_query: usize,
    urgent: mpsc::Sender<Urgent>,
    ordinary: mpsc::Sender<Job>,
    hub: Arc<Hub>,
    /// Where the poller of the subscriptions runs.
    runtime: Handle,
    /// Counts the stops and pauses that handles asked for: a path that is being streamed ends with the next one.
    stops: watch::Sender<u64>,
    /// The stops that are under way: a motion that one of them ended waits for it.
    stopping: watch::Sender<Stopping>,
    /// Held by the motion that is being streamed: two motions would mix in one list.
    streaming: Arc<Semaphore>,
    /// The motions of this handle and its clones.
    motions: Motions,
    /// Makes connections: a stop may need a second one.
    dial: Arc<dyn Dial>,
    /// Set when the handle is being closed: a motion that is streamed ends then.
    closing: watch::Sender<bool>,
    /// Locked from the look at the arm, through the check of a list against that place, until the list is
    /// answered. Another list in between would move the arm, and the check would be for the wrong place.
    lists: Arc<AsyncMutex<()>>,
    tell: Tell,
    /// Held by the task that serves photos: two tasks would both answer each request.
    photos: Arc<Semaphore>,
}

/// The controller accepted the request. This does not mean that the arm moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Accepted {
    /// How long the reply took.
    pub after: Duration,
    /// How many points were taken; only AddPoints tells.
    pub points: Option<u64>,
}

impl Robot {
    /// Connects to a controller: `host` or `host:port`, port 9760 where none is given.
    ///
    /// Nothing is sent: who is there is asked with the first [`Robot::status`], or else before the first query or command. Needs
    /// a tokio runtime with time and network.
    ///
    /// # Errors
    /// [`Invalid::BadAddress`](crate::Invalid::BadAddress) if the text is no address, [`RequestError::NotSent`] if no connection can
    /// be made within [`RobotSettings::connect_timeout`].
    pub async fn connect(address: &str, settings: RobotSettings) -> Result<Self, RequestError> {
        Self::connect_with(Tcp::parse(address)?, settings).await
    }

    /// The same over connections that the caller makes.
    ///
    /// # Errors
    /// As [`Self::connect`].
    pub async fn connect_with<C: Connect>(target: C, settings: RobotSettings) -> Result<Self, RequestError> {
        let dialer = Dialer::new(target);
        let stream = dialer.connect(settings.connect_timeout).await?;
        tracing::info!(controller = dialer.name(), "connected");
        Ok(Self::over(dialer, stream, settings, None))
    }

    /// A second handle with a connection of its own to the same robot, for a stop when the first connection does not answer. No
    /// command leaves on it before the controller has said that it is the robot that is meant.
    pub(crate) async fn second_connection(&self) -> Result<Self, SecondConnection> {
        let unidentified = self.hub().known().expected.is_none();
        if unidentified && self.lanes.dial.takes_whoever_comes() {
            return Err(SecondConnection::Unidentified);
        }
        let settings = RobotSettings { heartbeat: Heartbeat::Off, ..self.settings().clone() };
        let made = self.lanes.dial.dial(settings.connect_timeout).await;
        let stream = made.map_err(SecondConnection::NotMade)?;
        tracing::info!(controller = self.address(), "second connection");
        let (expected, of_nobody) = {
            let known = self.hub().known();
            let of_nobody = known.read_of_nobody || (known.handed_out && known.expected.is_none());
            (known.expected.clone(), of_nobody)
        };
        let second = Self::over(Dialer::new(Once::new(self.address())), stream, settings, expected);
        second.hub().known().read_of_nobody = of_nobody;
        Ok(second)
    }

    /// A handle on a connection that is there; `expected`: who has to be at its other end, where that is known.
    fn over<C: Connect>(
        dialer: Dialer<C>,
        stream: C::Stream,
        settings: RobotSettings,
        expected: Option<Identity>,
    ) -> Self {
        let (urgent, urgent_jobs) = mpsc::channel(LANE_LENGTH);
        let (ordinary, ordinary_jobs) = mpsc::channel(LANE_LENGTH);
        let hub = Arc::<Hub>::default();
        hub.known().expected = expected;
        let dialer = Arc::new(dialer);
        let lanes = Lanes {
            address: dialer.name().to_owned(),
            settings: settings.clone(),
            around_query: around_query(&settings),
            urgent,
            ordinary,
            hub: Arc::clone(&hub),
            runtime: Handle::current(),
            stops: watch::Sender::new(0),
            stopping: watch::Sender::default(),
            streaming: Arc::new(Semaphore::new(1)),
            motions: Motions::default(),
            dial: Arc::clone(&dialer) as Arc<dyn Dial>,
            closing: watch::Sender::new(false),
            photos: Arc::new(Semaphore::new(1)),
            lists: Arc::default(),
            tell: Tell::default(),
        };
        let backoff = Backoff::new(settings.reconnect, seed_from_clock);
        let driver = Driver::new(dialer, settings, urgent_jobs, ordinary_jobs, hub, backoff);
        tokio::spawn(driver.run(stream));
        Self { lanes: Arc::new(lanes), guard: None, guarded_at: 0 }
    }

    /// Ends the connection for all clones and waits until it is closed.
    ///
    /// It waits for a stop that is under way, for 15 s at most. A motion that is being streamed ends here:
    /// the arm finishes what is in its list ([`crate::RunOptions::stop_on_drop`]: it is stopped), and
    /// [`Closed::cut_short`] tells what was not sent. That end is waited for, too, for 15 s at most. The
    /// orderly end of the connection itself takes half a second at most.
    ///
    /// Dropping the last clone does the same in the background; use this where the runtime ends right after.
    /// Other clones' later requests are not sent ([`NotSent::Closed`]).
    pub async fn close(self) -> Closed {
        self.lanes.closing.send_replace(true);
        self.no_stop_under_way().await;
        let cut_short = match timeout(STOP_WITHIN, self.nothing_streams()).await {
            Ok(()) => self.motions().cut_by_close(),
            Err(_elapsed) => None,
        };
        let (done, closed) = oneshot::channel();
        if self.lanes.urgent.send(Urgent::Close(done)).await.is_ok() {
            closed.await.ok();
        }
        Closed { cut_short }
    }

    /// Ends when the handle is being closed.
    pub(crate) async fn is_closing(&self) {
        let mut closing = self.lanes.closing.subscribe();
        // This handle keeps the sender alive.
        closing.wait_for(|closing| *closing).await.ok();
    }

    pub(crate) fn motions(&self) -> &Motions {
        &self.lanes.motions
    }

    /// Host and port of the controller.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.lanes.address
    }

    /// Sends a command (manual 4.2). A stop or a pause overtakes everything that waits.
    ///
    /// # Errors
    /// [`RequestError`]. It is never sent twice by itself, and only a stop or a pause makes a lost connection anew.
    pub async fn command(&self, command: Command<'static>) -> Result<Accepted, RequestError> {
        let changes_frame = told::tells_frame(&command);
        let work = Work::Command(command);
        let lane = match work.sent().effect {
            Effect::Stops => {
                self.announce_stop();
                Lane::Urgent
            }
            Effect::Reads | Effect::Changes | Effect::Moves => Lane::Ordinary,
        };
        // A list that was checked leaves before the frame changes, or is checked after that.
        let _turn = if changes_frame { Some(self.lists().await) } else { None };
        self.accepted(work, lane).await
    }

    /// Sends the points that cameras found (manual 5.2); [`Accepted::points`] tells how many were taken.
    ///
    /// # Errors
    /// [`RequestError`]. It is never sent twice by itself: a program may wait for these points to move.
    pub async fn add_points(&self, cameras: Vec<CameraSet>) -> Result<Accepted, RequestError> {
        self.accepted(Work::AddPoints(cameras), Lane::Ordinary).await
    }

    /// Answers a photo request (manual 5.1). The controller does not reply: `Ok` says that the answer has left.
    ///
    /// # Errors
    /// [`RequestError::NotSent`], or [`RequestError::OutcomeUnknown`] if the connection ended within the frame.
    pub async fn answer_photo(&self, answer: PhotoAnswer) -> Result<(), RequestError> {
        self.ask(Work::PhotoAnswer(answer), Lane::Ordinary).await.map(|_left| ())
    }

    /// What happens on the connection without being asked for, from now on.
    ///
    /// A receiver that lags more than 64 behind misses the oldest and is told how many. It ends when the handle is closed, whatever clones of it live.
    #[must_use]
    pub fn pushed(&self) -> broadcast::Receiver<Pushed> {
        self.lanes.hub.subscribe_to_pushed()
    }

    /// What the replies so far tell about the firmware's dialect.
    #[must_use]
    pub fn learned(&self) -> LearnedDialect {
        self.lanes.hub.known().learned
    }

    /// The firmware's version (`version`), asked for once per connection; `None` where the controller has none to tell.
    ///
    /// # Errors
    /// [`RequestError`] of the query.
    pub async fn firmware(&self) -> Result<Option<String>, RequestError> {
        let known = self.lanes.hub.known().firmware.clone();
        match known {
            Some(firmware) => Ok(firmware),
            None => {
                let result = self.query(&[Address::Version]).await?;
                Ok(result.text(Address::Version).map(str::to_owned))
            }
        }
    }

    /// The same robot behind a guard: what [`Self::run`], [`Self::follow`] and [`Self::add_rcc`] of this handle and its clones
    /// send is held against the envelope first, and not sent if it goes beyond.
    ///
    /// A guard that this handle has already goes on: both have to be passed ([`Envelope::and`]), so a wider one loosens
    /// nothing. A handle without it is the one that it was made from.
    ///
    /// Limits of the tool's place are told for the tool and the workbench that are in use when the guard is made. Once this connection
    /// has told another one (action 800, a move with a tool or a work frame, `switchTool`, `modifyTool`, `switchCoordinate`), nobody
    /// knows whether they still are: lists that they concern go beyond then ([`crate::Checked::FrameUnknown`]). Make a guard anew for the
    /// frame that is in use, from a handle without one.
    ///
    /// Where the arm is, the check and the sending are one: meanwhile no other list of this connection leaves.
    ///
    /// Commands are not checked: a start button, a register or an output can start a taught program that no envelope knows.
    #[must_use]
    pub fn with_guard(&self, envelope: Envelope) -> Self {
        let envelope = match self.guard() {
            Some(before) => before.clone().and(envelope),
            None => envelope,
        };
        let guarded_at = match self.guard {
            Some(_) => self.guarded_at,
            None => self.lanes.tell.so_far().frames,
        };
        Self { lanes: Arc::clone(&self.lanes), guard: Some(Arc::new(envelope)), guarded_at }
    }

    /// The envelope that this handle checks against.
    #[must_use]
    pub fn guard(&self) -> Option<&Envelope> {
        self.guard.as_deref()
    }

    /// Somebody wants the arm to stop: nothing more of a path is to be sent.
    pub(crate) fn announce_stop(&self) {
        self.hub().stops_asked.fetch_add(1, Ordering::SeqCst);
        self.lanes.stops.send_modify(|stops| *stops = stops.wrapping_add(1));
    }

    /// Tells when somebody wants the arm to stop, from now on.
    pub(crate) fn stops(&self) -> watch::Receiver<u64> {
        self.lanes.stops.subscribe()
    }

    /// The stops over this connection.
    pub(crate) fn stopping(&self) -> &watch::Sender<Stopping> {
        &self.lanes.stopping
    }

    /// The right to stream a path over this connection, if nobody has it.
    pub(crate) fn streaming(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.lanes.streaming).try_acquire_owned().ok()
    }

    /// The right to look where the arm is, check a list against that and send it. It is kept until the list is answered.
    pub(crate) async fn lists(&self) -> OwnedMutexGuard<()> {
        Arc::clone(&self.lanes.lists).lock_owned().await
    }

    /// What a list of this handle has to reckon with, besides where the arm is.
    pub(crate) fn reckoning(&self) -> Reckoning {
        let told = self.lanes.tell.so_far();
        Reckoning { frame_is_unknown: told.frames != self.guarded_at, may_be_cut: told.watching }
    }

    /// The right to serve the photos of this connection, if nobody has it.
    pub(crate) fn photos(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.lanes.photos).try_acquire_owned().ok()
    }

    /// Ends once the handle is closed, for this clone or another.
    pub(crate) async fn closed(&self) {
        self.lanes.ordinary.closed().await;
    }

    /// Waits until no path is streamed any more, and none is being stopped.
    pub(crate) async fn nothing_streams(&self) {
        // It is never closed.
        drop(self.lanes.streaming.acquire().await);
    }

    /// The number of the present connection, or, while there is none, of the next one.
    pub(crate) fn connection(&self) -> u64 {
        self.lanes.hub.known().connection
    }

    pub(crate) fn hub(&self) -> &Hub {
        &self.lanes.hub
    }

    pub(crate) fn runtime(&self) -> &Handle {
        &self.lanes.runtime
    }

    pub(crate) fn around_query(&self) -> usize {
        self.lanes.around_query
    }

    pub(crate) fn settings(&self) -> &RobotSettings {
        &self.lanes.settings
    }

    /// Sends a request that the controller answers with yes or no.
    pub(crate) async fn accepted(&self, work: Work, lane: Lane) -> Result<Accepted, RequestError> {
        self.accepted_on(Terms::default(), work, lane).await
    }

    /// The same; it leaves on these terms only, or is refused: later as [`NotSent::Busy`], on another connection as
    /// [`NotSent::Disconnected`].
    pub(crate) async fn accepted_on(
        &self,
        terms: Terms,
        work: Work,
        lane: Lane,
    ) -> Result<Accepted, RequestError> {
        let request = work.sent();
        let is_list = matches!(work, Work::AddRcc { .. });
        let leaving = self.lanes.tell.leaving(&work);
        let answer = self.ask_on(terms, work, lane).await;
        leaving.answered(&answer);
        match answer? {
            Answer::Accepted { accepted, on } => {
                if request.effect == Effect::Moves {
                    let robot = self.hub().identity_on(on.connection);
                    self.motions().accepted(About { connection: on.connection, robot }, is_list);
                }
                Ok(accepted)
            }
            Answer::Values { .. } | Answer::Mismatch { .. } | Answer::Left => {
                Err(OutcomeUnknown::Unclear { request, answer: "a reply to a query".to_owned() }.into())
            }
        }
    }

    /// Gives a request to the driver and waits for its answer.
    pub(crate) async fn ask(&self, work: Work, lane: Lane) -> Result<Answer, RequestError> {
        self.ask_on(Terms::default(), work, lane).await
    }

    async fn ask_on(&self, terms: Terms, work: Work, lane: Lane) -> Result<Answer, RequestError> {
        self.give(terms, work, lane).await?.answer().await
    }

    /// Gives a request to the driver: what is given later over the same lane leaves later.
    pub(crate) async fn give(&self, terms: Terms, work: Work, lane: Lane) -> Result<Given, RequestError> {
        let request = work.sent();
        let (reply, answer) = oneshot::channel();
        let mut job = Job::new(work, reply);
        (job.leave_by, job.only_on) = (terms.leave_by, terms.only_on);
        job.stops_before = terms.stops_before.unwrap_or_else(|| self.hub().stops_asked());
        job.background = lane == Lane::Background;
        let given = match lane {
            Lane::Urgent => self.lanes.urgent.send(Urgent::Job(job)).await.is_ok(),
            Lane::Ordinary | Lane::Background => match self.lanes.ordinary.try_send(job) {
                Ok(()) => true,
                // Whoever came first gets room first: nobody overtakes those who wait.
                Err(TrySendError::Full(job)) => self.lanes.ordinary.send(job).await.is_ok(),
                Err(TrySendError::Closed(_)) => false,
            },
        };
        if given { Ok(Given { request, answer }) } else { Err(NotSent::Closed.into()) }
    }
}

/// A request that the driver has.
#[derive(Debug)]
pub(crate) struct Given {
    request: Sent,
    answer: oneshot::Receiver<Result<Answer, RequestError>>,
}

impl Given {
    /// Waits for its answer.
    pub async fn answer(self) -> Result<Answer, RequestError> {
        // The driver answers every job; only a runtime that was shut down leaves one without an answer.
        let reason = LostReason::ClosedHere;
        let ended = OutcomeUnknown::ConnectionLost { request: self.request, reason };
        self.answer.await.unwrap_or(Err(ended.into()))
    }
}

/// How a handle was closed ([`Robot::close`]).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Closed {
    /// The motion that was being streamed and did not come to its end by that.
    pub cut_short: Option<Box<MotionError>>,
}

fn seed_from_clock() -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    since.as_secs() ^ u64::from(since.subsec_nanos()) << 32
}

/// What the driver tells the handles besides answers.
#[derive(Debug)]
pub(crate) struct Hub {
    /// The clock of the handle: what its driver measures with.
    pub clock: Clock,
    /// `None` once the handle is closed. That ends every receiver.
    pushed: Mutex<Option<broadcast::Sender<Pushed>>>,
    known: Mutex<Known>,
    meter: Mutex<Meter>,
    pub board: Board,
    /// Frames that can move the arm and whose outcome is open.
    pub doubts: Doubts,
    /// How many stops and pauses were asked for.
    stops_asked: AtomicU64,
}

/// What is known of the controller behind the present connection.
#[derive(Debug, Default)]
pub(crate) struct Known {
    pub learned: LearnedDialect,
    /// Once it was asked for: the version, if there is one.
    pub firmware: Option<Option<String>>,
    /// Addresses that it does not support.
    pub unsupported: BTreeSet<Address>,
    /// Addresses that some controllers lack, and that had a value here.
    pub supported: BTreeSet<Address>,
    /// Whether the last query had a reply with a number of values that nothing explains.
    pub doubts_lists: bool,
    /// How often lists were doubted, over all connections.
    pub doubts: u64,
    /// How often in a row an address had no value when it was asked for alone, of those that it should have.
    pub empty: BTreeMap<Address, u8>,
    /// Counts the connections, so that no answer of one is kept for the next.
    pub connection: u64,
    /// Who is there, once that was read.
    pub present: Option<Identity>,
    /// Who is meant: the one that was there first, or that was accepted since.
    pub expected: Option<Identity>,
    /// Whether values were handed out over the present connection.
    pub handed_out: bool,
    /// Whether values were handed out over a connection that ended before its robot was identified, and no caller has read mode and
    /// alarm since. Then it is not known whether the robot that answers now is the one that those values came from.
    pub read_of_nobody: bool,
    /// The other robot that answered on the connection before this one, if another one did.
    pub stranger_before: Option<Identity>,
}

impl Known {
    /// A reply on this connection had a number of values that nothing explains.
    pub fn doubt_lists(&mut self, connection: u64) {
        if self.connection == connection {
            self.doubts_lists = true;
            self.doubts += 1;
        }
    }
}

impl Default for Hub {
    fn default() -> Self {
        let clock = Clock::start();
        Self {
            clock,
            pushed: Mutex::new(Some(broadcast::Sender::new(KEPT_FOR_SUBSCRIBERS))),
            known: Mutex::default(),
            meter: Mutex::default(),
            board: Board::new(clock),
            doubts: Doubts::default(),
            stops_asked: AtomicU64::new(0),
        }
    }
}

impl Hub {
    /// What is known; nobody holds this across an await, and nothing that holds it can panic halfway.
    pub fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The counts of the link, under the same rules as [`Self::known`].
    pub fn meter(&self) -> MutexGuard<'_, Meter> {
        self.meter.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in the answer to the identity query.
    ///
    /// `certain`: every part of it could be read. If some parts could not be read and the others are those of the expected robot, the
    /// controller stays unknown: another robot of the same model may differ in those parts alone.
    pub fn introduced(&self, mut found: Found, certain: bool, first: bool) {
        {
            let mut known = self.known();
            let unproved = match &known.expected {
                Some(expected) => !certain && found.identity.is_part_of(expected),
                None => false,
            };
            if certain {
                known.expected.get_or_insert_with(|| found.identity.clone());
            }
            let differs = known.expected.as_ref().is_some_and(|expected| *expected != found.identity);
            found.another = differs && !unproved;
            known.present = (!unproved).then(|| found.identity.clone());
        }
        if found.another {
            tracing::warn!(found = %found.identity, "another robot answers at this address");
        }
        if !first {
            self.push(Pushed::Reconnected(found));
        }
    }

    /// Whether it is known who is meant, and not who is there.
    pub fn is_unidentified(&self) -> bool {
        let known = self.known();
        known.expected.is_some() && known.present.is_none()
    }

    /// The next connection may lead to another robot. If it is not known which one is meant, nothing that is seen there confirms a stop
    /// until a caller has read mode and alarm.
    pub fn doubt_who_answers(&self) {
        let mut known = self.known();
        known.read_of_nobody |= known.expected.is_none();
    }

    /// Who answers on this connection; `None` if it is not the present one, or nobody has read that.
    pub fn identity_on(&self, connection: u64) -> Option<Identity> {
        let known = self.known();
        if known.connection == connection { known.present.clone() } else { None }
    }

    /// Who is meant, and who is there instead on this connection, or was on the one before.
    pub fn stranger_on(&self, connection: u64) -> Option<(Identity, Identity)> {
        let known = self.known();
        let expected = known.expected.as_ref()?;
        let found = match known.connection.checked_sub(connection)? {
            0 => known.present.as_ref()?,
            1 => known.stranger_before.as_ref()?,
            _earlier => return None,
        };
        (expected != found).then(|| (expected.clone(), found.clone()))
    }

    /// Why no command may leave: another robot is there than the one that is meant.
    pub fn stranger(&self) -> Option<NotSent> {
        let connection = self.known().connection;
        let (expected, found) = self.stranger_on(connection)?;
        Some(NotSent::AnotherRobot { expected: Box::new(expected), found: Box::new(found) })
    }

    /// How many stops and pauses were asked for so far.
    pub fn stops_asked(&self) -> u64 {
        self.stops_asked.load(Ordering::SeqCst)
    }

    fn subscribe_to_pushed(&self) -> broadcast::Receiver<Pushed> {
        let pushed = self.pushed.lock().unwrap_or_else(PoisonError::into_inner);
        // The sender of a closed handle is gone, and so is this one at once.
        pushed.as_ref().map_or_else(|| broadcast::Sender::new(1).subscribe(), broadcast::Sender::subscribe)
    }

    /// The handle is closed: ends what [`Robot::pushed`] gave out.
    pub fn end_pushed(&self) {
        self.pushed.lock().unwrap_or_else(PoisonError::into_inner).take();
    }

    /// Tells the subscribers; there may be none.
    pub fn push(&self, pushed: Pushed) {
        tracing::debug!(?pushed);
        if let Some(sender) = &*self.pushed.lock().unwrap_or_else(PoisonError::into_inner) {
            sender.send(pushed).ok();
        }
    }

    pub fn learn(&self, learned: LearnedDialect) {
        self.known().learned = learned;
    }

    /// The next connection may lead to another controller: what was known is forgotten.
    pub fn connection_lost(&self, reason: LostReason) {
        {
            let mut known = self.known();
            let connection = known.connection + 1;
            let (expected, present) = (known.expected.take(), known.present.take());
            let read_of_nobody = known.read_of_nobody || (known.handed_out && expected.is_none());
            let stranger_before = present.filter(|present| expected.as_ref().is_some_and(|it| it != present));
            let doubts = known.doubts;
            *known =
                Known { connection, expected, read_of_nobody, stranger_before, doubts, ..Known::default() };
        }
        self.meter().disconnected(self.clock.now());
        self.board.connection_lost();
        self.push(Pushed::ConnectionLost(reason));
    }
}
