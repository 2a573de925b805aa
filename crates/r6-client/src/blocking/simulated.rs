//! For tests of this client: a blocking connection whose clock, threads and sockets a test makes itself.
//!
//! This is no part of the public interface; it changes as the tests need it.

use std::future::{Future, poll_fn};
use std::pin::pin;
use std::sync::Arc;

use crate::drive::Hand as _;
use crate::error::RequestError;
use crate::hands::blocking::StdHand;
use crate::hands::blocking::system::Std;
pub use crate::hands::blocking::system::{Parked, Stream, System};
use crate::settings::RobotSettings;

/// Drives one connection, as [`super::Robot`] does, and keeps no handle: the last handle closes the connection whether this lives or not.
#[derive(Clone, Debug)]
pub struct Driver(Arc<StdHand>);

impl Driver {
    /// As [`super::Robot::connect`], in this system; without one, in that of this program.
    ///
    /// # Errors
    /// As there.
    pub fn connect(
        system: Option<Arc<dyn System>>,
        address: &str,
        settings: RobotSettings,
    ) -> Result<(crate::Robot, Self), RequestError> {
        let system = system.unwrap_or_else(|| Arc::new(Std::start()));
        let (robot, hand) = StdHand::connect_in(system, address, settings)?;
        Ok((robot, Self(hand)))
    }

    /// As [`super::Robot::block_on`].
    pub fn block_on<F: Future>(&self, future: F) -> F::Output {
        let mut future = pin!(future);
        self.0.block_on(poll_fn(|cx| {
            self.0.tell_time();
            future.as_mut().poll(cx)
        }))
    }
}
