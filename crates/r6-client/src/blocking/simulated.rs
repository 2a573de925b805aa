//! For tests of this client: a blocking connection with a clock, threads and sockets that the test provides.
//!
//! This is not part of the public interface. It changes as the tests need it.

use std::future::{Future, poll_fn};
use std::pin::pin;
use std::sync::Arc;

use crate::drive::Hand as _;
use crate::error::RequestError;
use crate::hands::blocking::StdHand;
use crate::hands::blocking::system::Std;
pub use crate::hands::blocking::system::{Parked, Stream, System};
use crate::settings::RobotSettings;

/// Drives one connection, as [`super::Robot`] does, but holds no handle. Dropping the last handle closes the
/// connection even while this exists.
#[derive(Clone, Debug)]
pub struct Driver(Arc<StdHand>);

impl Driver {
    /// Connects as [`super::Robot::connect`] does, in this system; with `None`, in the operating system.
    ///
    /// # Errors
    /// The same errors.
    pub fn connect(
        system: Option<Arc<dyn System>>,
        address: &str,
        settings: RobotSettings,
    ) -> Result<(crate::Robot, Self), RequestError> {
        let system = system.unwrap_or_else(|| Arc::new(Std::start()));
        let (robot, hand) = StdHand::connect_in(system, address, settings)?;
        Ok((robot, Self(hand)))
    }

    /// Runs a future to its end, as [`super::Robot::block_on`] does.
    pub fn block_on<F: Future>(&self, future: F) -> F::Output {
        let mut future = pin!(future);
        self.0.block_on(poll_fn(|cx| {
            self.0.tell_time();
            future.as_mut().poll(cx)
        }))
    }
}
