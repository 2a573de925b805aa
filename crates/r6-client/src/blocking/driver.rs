//! Waiting in slices, for threads that have something else to look after meanwhile.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use crate::RobotSettings;
use crate::drive::Hand as _;
use crate::error::RequestError;
use crate::hands::blocking::StdHand;

/// Drives the connection of a [`crate::Robot`] in the threads that wait for it. Clones drive the same connection.
///
/// Most programs want [`super::Robot`], which does this for each call. A `Driver` is for code that must come back from time to time, such as
/// an extension of an interpreter that looks for signals: a call that is not over waits on with the next [`Self::block_on_for`].
///
/// ```
/// # let controller = r6_sim::VirtualController::start_blocking()?;
/// # let address = controller.address().to_string();
/// use std::pin::pin;
/// use std::time::Duration;
///
/// use r6_client::blocking::Driver;
/// use r6_client::RobotSettings;
/// use r6_client::Address;
///
/// let (driver, robot) = Driver::connect(&address, RobotSettings::default())?;
/// let mut query = pin!(robot.query(&[Address::CurAlarm]));
/// let values = loop {
///     if let Some(values) = driver.block_on_for(Duration::from_millis(50), query.as_mut()) {
///         break values?;
///     }
///     // Not yet: look after something else.
/// };
/// assert_eq!(values.integer(Address::CurAlarm), Some(0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Driver(Arc<StdHand>);

impl Driver {
    /// Connects as [`super::Robot::connect`] does. Dropping the last clone of the handle closes the connection in the background; the
    /// driver does not keep it open.
    ///
    /// # Errors
    /// As there.
    pub fn connect(address: &str, settings: RobotSettings) -> Result<(Self, crate::Robot), RequestError> {
        let (robot, hand) = StdHand::connect(address, settings)?;
        Ok((Self(hand), robot))
    }

    /// Runs a future on this thread for so long, and drives the connection meanwhile; `None` if the future has not ended by then. The
    /// system may round the time up by some milliseconds; a signal to this thread may end it early.
    ///
    /// The future may be run on later, by this, by another thread or by any executor; dropping it gives it up. It should wait for this
    /// connection alone: what another connection or executor makes happen is seen with the next reply, or when the time is over.
    pub fn block_on_for<F: Future + ?Sized>(&self, time: Duration, future: Pin<&mut F>) -> Option<F::Output> {
        self.0.block_on_for(time, future)
    }

    /// Has the connection looked after soon, because something was begun that no call waits for, such as [`crate::Robot::pushed`].
    pub fn look_after(&self) {
        self.0.nudge();
    }
}
