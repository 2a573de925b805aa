//! The same robot without `async`: every call blocks its thread.
//!
//! ```
//! # let controller = r6_sim::VirtualController::start_blocking()?;
//! # let address = controller.address().to_string();
//! use r6_client::blocking::Robot;
//! use r6_client::RobotSettings;
//! use r6_client::Address;
//!
//! let robot = Robot::connect(&address, RobotSettings::default())?;
//! let values = robot.query(&[Address::CurMode, Address::CurAlarm])?;
//! assert_eq!(values.integer(Address::CurAlarm), Some(0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! There is one implementation: these methods call those of [`crate::Robot`], and its documentation says what
//! they do. A handle may be used from many threads at once, and a stop overtakes requests that other threads
//! wait for.
//!
//! It needs no runtime: the calling thread itself writes and reads, and a thread of the connection does what
//! is due between the calls. All of it blocks the thread, so use [`crate::Robot`] in async code. Robots on an
//! [`Engine`] use a tokio runtime inside, and panic on a thread that runs another one.

mod cell;
mod driver;
mod engine;
mod motion;
mod runner;
#[doc(hidden)]
pub mod simulated;
mod stops;
mod watch;

use std::fmt;
use std::future::{Future, poll_fn};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::address::Address;
use r6_proto::client::LearnedDialect;
use r6_proto::io_point::IoPoint;
use r6_proto::message::{Command, Instruction, PhotoAnswer};
use tokio::runtime::Handle;

pub use self::driver::Driver;
pub use self::engine::Engine;
pub use self::motion::{MotionHandle, ProgressWatch, StepHandle};
use self::runner::Runner;
pub use self::stops::StopsUnderWay;
pub use self::watch::{EventReceiver, PushedReceiver, Receiver, Subscription};
use crate::error::RequestError;
use crate::hands::blocking::StdHand;
use crate::hands::connect::Connect;
use crate::units::Pose;
use crate::{
    Accepted, CameraSet, Cause, Closed, Done, Envelope, Identity, LinkQuality, Motion, MotionError,
    NotSubscribed, QueryResult, RobotSettings, RunOptions, Status, StopReport, WaitError, WaitOptions,
};

/// A handle on one controller. Clones share one connection.
///
/// Dropping the last clone, and everything made with it, closes the connection. The drop blocks this thread
/// for half a second at most, or longer in these cases:
///
/// - While a motion is being streamed or stopped, the drop waits for its end, for 16 s at most. A motion that
///   takes longer runs to its end in the background, while the program lives, and then the connection is
///   closed.
/// - While a stop is under way besides, the drop waits for that, too, for 15 s at most.
///
/// On a thread that runs a tokio runtime the drop does not block: the connection is closed in the background.
#[derive(Clone)]
pub struct Robot {
    robot: crate::Robot,
    connection: Arc<Connection>,
}

/// How long a connection waits for the stop of its last motion: the longest time of a stop, and 1 s for what
/// follows it.
const LAST_STOP: Duration = crate::StopsUnderWay::WITHIN.saturating_add(Duration::from_secs(1));

/// What all handles of a connection share.
struct Connection {
    robot: crate::Robot,
    runner: Runner,
}

impl Drop for Connection {
    fn drop(&mut self) {
        // Do not block inside a runtime; the same then happens in the background.
        if Handle::try_current().is_ok() {
            return;
        }
        // If a dropped handle asked for a stop on drop, its motion is being stopped now.
        let over = self.robot.within(LAST_STOP, self.robot.nothing_streams());
        if self.runner.block_on(over).is_ok() {
            self.runner.block_on(self.robot.clone().close());
        } else {
            // A motion whose handle was dropped continues to its end, while this program lives.
            self.runner.close_later(&self.robot);
        }
    }
}

impl fmt::Debug for Robot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("blocking::Robot").field(&self.address()).finish()
    }
}

impl Robot {
    /// As [`crate::Robot::connect`], over a socket that the calling threads drive, without a runtime.
    ///
    /// # Errors
    /// As there, and [`NotSent::NoEngine`](crate::NotSent::NoEngine) if the operating system cannot start a
    /// thread for it.
    pub fn connect(address: &str, settings: RobotSettings) -> Result<Self, RequestError> {
        let (robot, hand) = StdHand::connect(address, settings)?;
        Ok(Self::of(Runner::Own(hand), robot))
    }

    /// As [`crate::Robot::connect`], on an engine that other robots may share.
    ///
    /// # Errors
    /// As there.
    pub fn connect_on(engine: &Engine, address: &str, settings: RobotSettings) -> Result<Self, RequestError> {
        let robot = engine.block_on(crate::Robot::connect(address, settings))?;
        Ok(Self::of(Runner::Engine(engine.clone()), robot))
    }

    /// As [`crate::Robot::connect_with`].
    ///
    /// # Errors
    /// As there.
    pub fn connect_with<C: Connect>(
        engine: &Engine,
        target: C,
        settings: RobotSettings,
    ) -> Result<Self, RequestError> {
        let robot = engine.block_on(crate::Robot::connect_with(target, settings))?;
        Ok(Self::of(Runner::Engine(engine.clone()), robot))
    }

    fn of(runner: Runner, robot: crate::Robot) -> Self {
        let connection = Connection { robot: robot.clone(), runner };
        Self { robot, connection: Arc::new(connection) }
    }

    fn runner(&self) -> &Runner {
        &self.connection.runner
    }

    /// Runs a future to its end on this thread and drives this robot's connection meanwhile. Use it for
    /// methods that only [`Self::as_async`] has.
    ///
    /// # Panics
    /// On an engine, where a tokio runtime runs on this thread.
    pub fn block_on<F: Future>(&self, future: F) -> F::Output {
        let mut future = pin!(future);
        self.runner().block_on(poll_fn(|cx| {
            // Update the time: the future may have done other work since.
            self.robot.now();
            future.as_mut().poll(cx)
        }))
    }

    /// The engine that this robot's calls run on; `None` if they need none ([`Self::connect`]).
    #[must_use]
    pub fn engine(&self) -> Option<&Engine> {
        self.runner().engine()
    }

    /// The async handle on the same connection, for any executor; with [`Self::block_on`], for this thread.
    #[must_use]
    pub fn as_async(&self) -> &crate::Robot {
        &self.robot
    }

    /// As [`crate::Robot::close`], even if other clones are in use. It waits for a stop that is under way,
    /// and until a motion that is being streamed has ended, for 15 s at most each.
    pub fn close(self) -> Closed {
        self.runner().block_on(self.robot.clone().close())
    }

    /// As [`crate::Robot::address`].
    #[must_use]
    pub fn address(&self) -> &str {
        self.robot.address()
    }

    /// As [`crate::Robot::query`].
    ///
    /// # Errors
    /// As there.
    pub fn query(&self, addresses: &[Address]) -> Result<QueryResult, RequestError> {
        self.runner().block_on(self.robot.query(addresses))
    }

    /// As [`crate::Robot::query_again`].
    ///
    /// # Errors
    /// As there.
    pub fn query_again(&self, result: &mut QueryResult) -> Result<(), RequestError> {
        self.runner().block_on(self.robot.query_again(result))
    }

    /// As [`crate::Robot::status`].
    ///
    /// # Errors
    /// As there.
    pub fn status(&self) -> Result<Status, RequestError> {
        self.runner().block_on(self.robot.status())
    }

    /// As [`crate::Robot::firmware`].
    ///
    /// # Errors
    /// As there.
    pub fn firmware(&self) -> Result<Option<String>, RequestError> {
        self.runner().block_on(self.robot.firmware())
    }

    /// As [`crate::Robot::command`].
    ///
    /// # Errors
    /// As there.
    pub fn command(&self, command: Command<'static>) -> Result<Accepted, RequestError> {
        self.runner().block_on(self.robot.command(command))
    }

    /// As [`crate::Robot::start`].
    ///
    /// # Errors
    /// As there.
    pub fn start(&self) -> Result<Accepted, RequestError> {
        self.runner().block_on(self.robot.start())
    }

    /// As [`crate::Robot::set_output`].
    ///
    /// # Errors
    /// As there.
    pub fn set_output(&self, point: IoPoint, on: bool) -> Result<Accepted, RequestError> {
        self.runner().block_on(self.robot.set_output(point, on))
    }

    /// As [`crate::Robot::is_on`].
    ///
    /// # Errors
    /// As there.
    pub fn is_on(&self, point: IoPoint) -> Result<Option<bool>, RequestError> {
        self.runner().block_on(self.robot.is_on(point))
    }

    /// As [`crate::Robot::pose`].
    ///
    /// # Errors
    /// As there.
    pub fn pose(&self) -> Result<Option<Pose>, RequestError> {
        self.runner().block_on(self.robot.pose())
    }

    /// As [`crate::Robot::stop`].
    ///
    /// # Errors
    /// As there.
    pub fn stop(&self) -> Result<StopReport, RequestError> {
        self.runner().block_on(self.robot.stop())
    }

    /// As [`crate::Robot::add_rcc`].
    ///
    /// # Errors
    /// As there.
    pub fn add_rcc(&self, replace: bool, instructions: Vec<Instruction>) -> Result<Accepted, RequestError> {
        self.runner().block_on(self.robot.add_rcc(replace, instructions))
    }

    /// As [`crate::Robot::add_motion`].
    ///
    /// # Errors
    /// As there.
    pub fn add_motion(&self, replace: bool, motion: &Motion) -> Result<Accepted, RequestError> {
        self.runner().block_on(self.robot.add_motion(replace, motion))
    }

    /// As [`crate::Robot::clear_list`].
    ///
    /// # Errors
    /// As there.
    pub fn clear_list(&self) -> Result<Accepted, RequestError> {
        self.runner().block_on(self.robot.clear_list())
    }

    /// As [`crate::Robot::wait_until_done`].
    ///
    /// # Errors
    /// As there.
    pub fn wait_until_done(&self, options: WaitOptions) -> Result<Done, WaitError> {
        self.runner().block_on(self.robot.wait_until_done(options))
    }

    /// As [`crate::Robot::run`]: it returns once everything is checked, and the motion is streamed in the
    /// background.
    ///
    /// # Errors
    /// As there.
    #[expect(clippy::result_large_err, reason = "made once a motion")]
    pub fn run(&self, motion: &Motion, options: RunOptions) -> Result<MotionHandle, MotionError> {
        let handle = self.runner().block_on(self.robot.run(motion, options))?;
        Ok(MotionHandle::new(handle, Arc::clone(&self.connection)))
    }

    /// As [`crate::Robot::dry_run`].
    ///
    /// # Errors
    /// As there.
    pub fn dry_run(&self, motion: &Motion, options: RunOptions) -> Result<Vec<Vec<u8>>, Cause> {
        self.robot.dry_run(motion, options)
    }

    /// As [`crate::Robot::add_points`].
    ///
    /// # Errors
    /// As there.
    pub fn add_points(&self, cameras: Vec<CameraSet>) -> Result<Accepted, RequestError> {
        self.runner().block_on(self.robot.add_points(cameras))
    }

    /// As [`crate::Robot::answer_photo`].
    ///
    /// # Errors
    /// As there.
    pub fn answer_photo(&self, answer: PhotoAnswer) -> Result<(), RequestError> {
        self.runner().block_on(self.robot.answer_photo(answer))
    }

    /// As [`crate::Robot::pushed`].
    #[must_use]
    pub fn pushed(&self) -> PushedReceiver {
        let pushed = self.robot.pushed();
        self.runner().look_after();
        PushedReceiver::new(pushed, Arc::clone(&self.connection))
    }

    /// As [`crate::Robot::events`].
    #[must_use]
    pub fn events(&self) -> EventReceiver {
        EventReceiver::new(self.robot.events(), Arc::clone(&self.connection))
    }

    /// As [`crate::Robot::subscribe`]: the values are read between calls, too.
    ///
    /// # Errors
    /// As there.
    pub fn subscribe(&self, addresses: &[Address], every: Duration) -> Result<Subscription, NotSubscribed> {
        let subscription = self.robot.subscribe(addresses, every)?;
        self.runner().look_after();
        Ok(Subscription::new(subscription, Arc::clone(&self.connection)))
    }

    /// As [`crate::Robot::learned`].
    #[must_use]
    pub fn learned(&self) -> LearnedDialect {
        self.robot.learned()
    }

    /// As [`crate::Robot::link_quality`].
    #[must_use]
    pub fn link_quality(&self) -> LinkQuality {
        self.robot.link_quality()
    }

    /// As [`crate::Robot::identity`].
    #[must_use]
    pub fn identity(&self) -> Option<Identity> {
        self.robot.identity()
    }

    /// As [`crate::Robot::accept_identity`].
    pub fn accept_identity(&self, found: Identity) {
        self.robot.accept_identity(found);
    }

    /// As [`crate::Robot::with_guard`].
    #[must_use]
    pub fn with_guard(&self, envelope: Envelope) -> Self {
        Self { robot: self.robot.with_guard(envelope), connection: Arc::clone(&self.connection) }
    }

    /// As [`crate::Robot::guard`].
    #[must_use]
    pub fn guard(&self) -> Option<&Envelope> {
        self.robot.guard()
    }
}
