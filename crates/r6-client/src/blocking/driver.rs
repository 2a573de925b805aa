//! Waits in time slices, for threads that must do something else from time to time.

use std::future::Future;
use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use crate::RobotSettings;
use crate::drive::Hand as _;
use crate::error::RequestError;
use crate::hands::blocking::StdHand;

/// Drives the connection of a [`crate::Robot`] in the threads that wait for it. All clones drive the same
/// connection.
///
/// Most programs want [`super::Robot`], which does this for each call. A `Driver` is for code that must
/// regain control from time to time, such as an extension of an interpreter that checks for signals. A call
/// that has not ended continues with the next [`Self::block_on_for`].
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
    /// Connects as [`super::Robot::connect`] does. Dropping the last clone of the handle closes the
    /// connection in the background; the driver does not keep it open.
    ///
    /// # Errors
    /// The same errors.
    pub fn connect(address: &str, settings: RobotSettings) -> Result<(Self, crate::Robot), RequestError> {
        let (robot, hand) = StdHand::connect(address, settings)?;
        Ok((Self(hand), robot))
    }

    /// Runs a future on this thread for at most this time, and drives the connection meanwhile. Returns
    /// `None` if the future has not ended by then. The system may round the time up by some milliseconds. A
    /// signal to this thread may end it early.
    ///
    /// The future may continue later: with another call of this method, in another thread, or in any
    /// executor. Dropping the future cancels it. The future should wait for this connection only. It notices
    /// what another connection or executor does only with the next reply or at the end of the time.
    pub fn block_on_for<F: Future + ?Sized>(&self, time: Duration, future: Pin<&mut F>) -> Option<F::Output> {
        self.0.block_on_for(time, future)
    }

    /// Has the connection checked soon. Call this after starting something that no call waits for, such as
    /// [`crate::Robot::pushed`].
    pub fn look_after(&self) {
        self.0.nudge();
    }
}
