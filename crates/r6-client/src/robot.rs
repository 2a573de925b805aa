//! The handle: the state that its clones share, which operations exclude each other, and how one drives the
//! connection.

pub(crate) mod requests;

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use futures_util::future::AbortHandle;
use r6_proto::client::LearnedDialect;
use r6_proto::time::Instant;
use tokio::sync::{
    Mutex as AsyncMutex, OwnedMutexGuard, OwnedSemaphorePermit, Semaphore, broadcast, oneshot, watch,
};

use crate::drive::{Driven, Hand, SharedConnection, drive};
use crate::event::Event;
use crate::guard::{Envelope, Reckoning};
use crate::hub::Hub;
use crate::identity::Identity;
pub use crate::job::Accepted;
use crate::link_quality::LinkQuality;
use crate::motions::Motions;
use crate::pushed::Pushed;
use crate::query::frames::QueryFrames;
use crate::sent_settings::SharedSentSettings;
use crate::settings::{Heartbeat, RobotSettings};
use crate::stop::report::SecondConnection;
use crate::stop::stopping::Stopping;
use crate::stream::error::MotionError;
use crate::stream::turn::Turns;
use crate::time::Elapsed;

/// A handle on one controller. Clones share one connection; dropping the last one closes it.
///
/// All methods may be called at the same time from many tasks: the requests share the connection, and each
/// caller gets its own reply. Dropping the future of a request that has not been sent yet withdraws the
/// request, except for a stop.
///
/// An executor's waker may only schedule its task, as all usual ones do. A waker that polls or calls the
/// robot itself waits for ever, because the client calls wakers while it holds its locks.
#[derive(Clone)]
pub struct Robot {
    common: Arc<Common>,
    /// The envelope that every list is checked against before it is sent.
    guard: Option<Arc<Envelope>>,
    /// How often a tool or a workbench had been set when the guard was made: its limits apply to the one in
    /// use then.
    guarded_at: u64,
}

struct Common {
    address: String,
    settings: RobotSettings,
    query_frames: QueryFrames,
    hub: Arc<Hub>,
    shared: Arc<SharedConnection>,
    /// Drives the connection.
    hand: Arc<dyn Hand>,
    takes_whoever_comes: bool,
    /// Counts the stops and pauses that handles asked for: the next one ends a path that is being streamed.
    stops: watch::Sender<u64>,
    /// The stops that are under way: a motion that a stop ended waits for that stop.
    stopping: watch::Sender<Stopping>,
    /// The motion that is being streamed has the turn: two motions would mix in one list.
    turns: Turns,
    /// The motions of this handle and its clones.
    motions: Motions,
    /// Set when the handle is being closed: this ends a motion that is being streamed.
    closing: watch::Sender<bool>,
    /// Locked while the client reads where the arm is, checks a list against that place, and waits for the
    /// reply to the list. Another list in between would move the arm, and the check would be for the wrong
    /// place.
    lists: Arc<AsyncMutex<()>>,
    tell: SharedSentSettings,
    /// Held by the task that serves photos: two tasks would both answer each request.
    photos: Arc<Semaphore>,
}

impl fmt::Debug for Robot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Robot").field("address", &self.common.address).finish_non_exhaustive()
    }
}

impl Robot {
    /// Opens a second handle to the same robot, with its own connection, for a stop when the first connection
    /// does not answer. No command is sent on it until the controller has identified itself as the expected
    /// robot.
    pub(crate) async fn second_connection(&self) -> Result<Self, SecondConnection> {
        let unidentified = self.hub().known().expected.is_none();
        if unidentified && self.common.takes_whoever_comes {
            return Err(SecondConnection::Unidentified);
        }
        let settings = RobotSettings { heartbeat: Heartbeat::Off, ..self.settings().clone() };
        let (expected, of_nobody) = {
            let known = self.hub().known();
            let of_nobody = known.read_of_nobody || (known.handed_out && known.expected.is_none());
            (known.expected.clone(), of_nobody)
        };
        let made = self.common.hand.second(settings.clone(), expected).await;
        let second = Self::on(made.map_err(SecondConnection::NotMade)?, settings);
        second.hub().known().read_of_nobody = of_nobody;
        Ok(second)
    }

    /// A handle on an existing connection.
    pub(crate) fn on(driven: Driven, settings: RobotSettings) -> Self {
        let Driven { shared, hand } = driven;
        let (address, takes_whoever_comes) = {
            let connection = shared.connection();
            (connection.name().to_owned(), connection.takes_whoever_comes())
        };
        let common = Common {
            address,
            query_frames: QueryFrames::of(&settings),
            settings,
            hub: Arc::clone(&shared.hub),
            shared,
            hand,
            takes_whoever_comes,
            stops: watch::Sender::new(0),
            stopping: watch::Sender::default(),
            turns: Turns::default(),
            motions: Motions::default(),
            closing: watch::Sender::new(false),
            photos: Arc::new(Semaphore::new(1)),
            lists: Arc::default(),
            tell: SharedSentSettings::default(),
        };
        Self { common: Arc::new(common), guard: None, guarded_at: 0 }
    }

    /// Drives the connection while this operation waits.
    pub(crate) async fn drive<F: Future>(&self, operation: F) -> F::Output {
        drive(&*self.common.hand, operation).await
    }

    /// Waits for the future, at most this long.
    pub(crate) async fn within<F: Future>(&self, time: Duration, what: F) -> Result<F::Output, Elapsed> {
        self.drive(self.hub().time.timeout_at(self.now() + time, what)).await
    }

    /// Starts work that continues even if the caller is dropped.
    pub(crate) fn errand<F>(&self, errand: F) -> oneshot::Receiver<F::Output>
    where
        F: Future<Output: Send> + Send + 'static,
    {
        let told = self.common.shared.errands.give(errand);
        self.common.hand.nudge();
        told
    }

    /// Like [`Self::errand`], but the returned handle can abort it.
    pub(crate) fn abortable_errand(&self, errand: impl Future<Output = ()> + Send + 'static) -> AbortHandle {
        let abort = self.unbegun_errand(errand);
        self.nudge();
        abort
    }

    /// Like [`Self::abortable_errand`], but it begins with the next [`Self::nudge`]. `nudge` wakes other
    /// tasks, so do not call it under a lock.
    pub(crate) fn unbegun_errand(&self, errand: impl Future<Output = ()> + Send + 'static) -> AbortHandle {
        self.common.shared.errands.give_abortable(errand)
    }

    /// Wakes the hand for work that no call waits for.
    pub(crate) fn nudge(&self) {
        self.common.hand.nudge();
    }

    /// The time now.
    pub(crate) fn now(&self) -> Instant {
        self.common.hand.tell_time();
        self.hub().time.now()
    }

    /// Announces that the handle is being closed: this ends a motion that is being streamed.
    pub(crate) fn announce_closing(&self) {
        self.common.closing.send_replace(true);
    }

    /// Ends the connection for all clones.
    pub(crate) fn end_connection(&self) {
        self.common.end_connection();
    }

    /// Ends when the handle is being closed.
    pub(crate) async fn is_closing(&self) {
        let mut closing = self.common.closing.subscribe();
        // This handle keeps the sender alive.
        closing.wait_for(|closing| *closing).await.ok();
    }

    pub(crate) fn motions(&self) -> &Motions {
        &self.common.motions
    }

    /// Host and port of the controller.
    #[must_use]
    pub fn address(&self) -> &str {
        &self.common.address
    }

    /// Receives unsolicited events of the connection, from now on.
    ///
    /// A receiver that lags more than 64 behind misses the oldest and learns how many it missed. It ends when
    /// the handle is closed, even if clones of the handle still exist.
    #[must_use]
    pub fn pushed(&self) -> broadcast::Receiver<Pushed> {
        let pushed = self.common.hub.subscribe_to_pushed();
        // From now on incoming frames are wanted, whether or not a call waits.
        self.nudge();
        pushed
    }

    /// Receives the client's own events, from now on: see [`Event`]. `Event::Connected` happens before any
    /// handle exists.
    ///
    /// A receiver that lags more than 64 behind misses the oldest and learns how many it missed. It ends when
    /// the handle is closed, even if clones of the handle still exist.
    #[must_use]
    pub fn events(&self) -> broadcast::Receiver<Event> {
        self.common.hub.subscribe_to_events()
    }

    /// What the replies so far show about the firmware's dialect.
    #[must_use]
    pub fn learned(&self) -> LearnedDialect {
        self.common.hub.known().learned
    }

    /// How good the connection is: latencies of the last minute, losses, and whether the controller lives.
    /// Sends nothing.
    ///
    /// ```no_run
    /// # fn show(robot: &r6_client::Robot) {
    /// let link = robot.link_quality();
    /// if link.state > r6_client::LinkState::Alive {
    ///     eprintln!("{link}");
    /// }
    /// # }
    /// ```
    #[must_use]
    pub fn link_quality(&self) -> LinkQuality {
        self.hub().meter().quality(self.now(), self.settings().liveness)
    }

    /// The robot at the other end of the present connection; `None` until its identity has been read.
    ///
    /// The client asks for the identity before the first query or command. It does not if that query is
    /// [`Robot::status`], which reads the identity too. After a reconnect it asks for the identity before
    /// anything else. A first query waits at most half a second for the answer. If the controller does not
    /// answer within two timeouts, the client does not ask again on that connection until the first command.
    #[must_use]
    pub fn identity(&self) -> Option<Identity> {
        self.hub().known().present.clone()
    }

    /// Accepts this controller as the expected one from now on, after
    /// [`NotSent::AnotherRobot`](crate::NotSent::AnotherRobot) has refused a command: a cabinet was
    /// exchanged, its firmware updated, or its machine renamed.
    ///
    /// Commands are then sent only to a robot with this identity. As after every reconnect, mode and alarm
    /// have to be read before the first command. This call sends nothing.
    ///
    /// ```no_run
    /// # async fn run(robot: r6_client::Robot) -> Result<(), r6_client::RequestError> {
    /// use r6_client::{NotSent, RequestError};
    ///
    /// if let Err(RequestError::NotSent(NotSent::AnotherRobot { found, .. })) = robot.clear_list().await
    ///     && found.machine_name.as_deref() == Some("spare of cell 4")
    /// {
    ///     robot.accept_identity(*found);
    ///     robot.status().await?;
    ///     robot.clear_list().await?;
    /// }
    /// # Ok(())
    /// # }
    /// ```
    pub fn accept_identity(&self, found: Identity) {
        let mut known = self.hub().known();
        known.expected = Some(found);
        known.read_of_nobody = false;
    }

    /// The same robot behind a guard. The client checks what [`Self::run`], [`Self::follow`] and
    /// [`Self::add_rcc`] of this handle and its clones would send against the envelope, and does not send it
    /// if it exceeds the envelope.
    ///
    /// If this handle already has a guard, that guard stays: both have to be passed ([`Envelope::and`]), so a
    /// wider one loosens nothing. The original handle stays as it was.
    ///
    /// Limits of the tool's place apply to the tool and the workbench that are in use when the guard is made.
    /// After this connection has set another one (action 800, a move with a tool or a work frame,
    /// `switchTool`, `modifyTool`, `switchCoordinate`), it is unknown whether they still are. Lists that
    /// these limits concern are then refused ([`crate::Checked::FrameUnknown`]). Make a new guard for the
    /// frame in use, from a handle without one.
    ///
    /// Reading where the arm is, checking and sending are one step: no other list of this connection is sent
    /// meanwhile.
    ///
    /// Commands are not checked: a start button, a register or an output can start a taught program, which no
    /// envelope can check.
    #[must_use]
    pub fn with_guard(&self, envelope: Envelope) -> Self {
        let envelope = match self.guard() {
            Some(before) => before.clone().and(envelope),
            None => envelope,
        };
        let guarded_at = match self.guard {
            Some(_) => self.guarded_at,
            None => self.common.tell.so_far().frames,
        };
        Self { common: Arc::clone(&self.common), guard: Some(Arc::new(envelope)), guarded_at }
    }

    /// The envelope that this handle checks against.
    #[must_use]
    pub fn guard(&self) -> Option<&Envelope> {
        self.guard.as_deref()
    }

    /// Announces a stop request: no more of a path may be sent.
    pub(crate) fn announce_stop(&self) {
        self.hub().stop_asked();
        self.common.stops.send_modify(|stops| *stops = stops.wrapping_add(1));
    }

    /// Reports stop requests, from now on.
    pub(crate) fn stops(&self) -> watch::Receiver<u64> {
        self.common.stops.subscribe()
    }

    /// The stops over this connection.
    pub(crate) fn stopping(&self) -> &watch::Sender<Stopping> {
        &self.common.stopping
    }

    /// The right to stream a path over this connection.
    pub(crate) fn turns(&self) -> &Turns {
        &self.common.turns
    }

    /// The right to read where the arm is, check a list against that and send it. Keep it until the list is
    /// answered.
    pub(crate) async fn lists(&self) -> OwnedMutexGuard<()> {
        Arc::clone(&self.common.lists).lock_owned().await
    }

    /// What the check of a list of this handle has to consider, besides where the arm is.
    pub(crate) fn reckoning(&self) -> Reckoning {
        let told = self.common.tell.so_far();
        Reckoning { frame_is_unknown: told.frames != self.guarded_at, may_be_cut: told.watching }
    }

    /// The right to serve the photos of this connection; `None` if another task has it.
    pub(crate) fn photos(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.common.photos).try_acquire_owned().ok()
    }

    /// Ends once the handle is closed, through this clone or another.
    pub(crate) async fn closed(&self) {
        let mut closed = self.hub().closed.subscribe();
        // This handle keeps the sender alive.
        closed.wait_for(|closed| *closed).await.ok();
    }

    /// Waits until no path is being streamed or stopped.
    pub(crate) async fn nothing_streams(&self) {
        self.common.turns.free().await;
    }

    /// The number of the present connection or, between connections, of the next one.
    #[must_use]
    pub fn connection(&self) -> u64 {
        self.common.hub.known().connection
    }

    pub(crate) fn hub(&self) -> &Hub {
        &self.common.hub
    }

    pub(crate) fn hand(&self) -> &Arc<dyn Hand> {
        &self.common.hand
    }

    pub(crate) fn query_frames(&self) -> QueryFrames {
        self.common.query_frames
    }

    pub(crate) fn settings(&self) -> &RobotSettings {
        &self.common.settings
    }
}

impl Common {
    fn end_connection(&self) {
        self.shared.connection().close();
        self.hand.nudge();
    }
}

impl Drop for Common {
    fn drop(&mut self) {
        self.end_connection();
    }
}

/// Result of closing a handle ([`Robot::close`]).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Closed {
    /// The motion that was being streamed and that the closing cut short.
    pub cut_short: Option<Box<MotionError>>,
}
