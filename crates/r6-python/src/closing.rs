//! Closes a connection without losing a stop that is under way, because a closed connection cannot stop the
//! arm.

use std::future::{Future, poll_fn};
use std::sync::Arc;
use std::task::Poll;

use r6_client::{Closed, RequestError, Robot, StopReport, StopsUnderWay};
use tokio::sync::watch;
use tokio::time::timeout;

use crate::convert;
use crate::operation::{Operation, STOP_GOES_ON};
use crate::raising::raise;

/// State that all handles of a connection share.
#[derive(Default)]
pub struct Connection {
    closed: watch::Sender<bool>,
    /// The number of motions that are being stopped because no caller got their handle.
    unowned: watch::Sender<usize>,
}

/// A motion whose handle no caller got, until it has been stopped. Closing the connection waits for it.
pub struct Unowned(Arc<Connection>);

impl Unowned {
    /// Counts one over this connection.
    pub fn over(connection: &Arc<Connection>) -> Self {
        connection.unowned.send_modify(|count| *count += 1);
        Self(Arc::clone(connection))
    }
}

impl Drop for Unowned {
    fn drop(&mut self) {
        self.0.unowned.send_modify(|count| *count = count.saturating_sub(1));
    }
}

impl Connection {
    /// Waits for the stops of motions whose handle no caller got, then closes the connection. The client
    /// itself waits for every other stop, and for the motion that it ends.
    pub async fn close(&self, robot: Robot) -> Closed {
        // After the timeout the connection is closed anyway, as the caller wants. The wait cannot fail:
        // `self` has the sender.
        let mut unowned = self.unowned.subscribe();
        let _ = timeout(StopsUnderWay::WITHIN, unowned.wait_for(|count| *count == 0)).await;
        let closed = robot.close().await;
        self.closed.send_replace(true);
        closed
    }

    /// A receiver that says when the connection is closed.
    pub fn closed(&self) -> watch::Receiver<bool> {
        self.closed.subscribe()
    }
}

/// Waits for a stop as long as a stop may take. The stop goes on without this. A stop that is still under way
/// then counts as not confirmed.
pub async fn stopped<F>(stopping: F) -> Option<Result<StopReport, RequestError>>
where
    F: Future<Output = Option<Result<StopReport, RequestError>>>,
{
    let within = StopsUnderWay::WITHIN;
    timeout(within, stopping).await.unwrap_or_else(|_elapsed| Some(Err(StopsUnderWay::not_confirmed(within))))
}

/// An operation that stops the arm. It goes on to its end even if the caller gives up waiting.
pub fn stopping(robot: Robot) -> Operation {
    Operation::new(stop(robot), |py, report| convert::stop_report(py, &raise(py, report)?))
        .going_on(STOP_GOES_ON)
}

/// Stops the arm. The stop is its own task, so it goes on if the caller gives up waiting.
async fn stop(robot: Robot) -> Result<StopReport, RequestError> {
    let mut stopping = Box::pin(async move { robot.stop().await });
    // Polls once here, so that a caller that closes the connection next sees the stop under way.
    if let Poll::Ready(report) = poll_fn(|context| Poll::Ready(stopping.as_mut().poll(context))).await {
        return report;
    }
    let stopping = tokio::spawn(stopping);
    // The task does not panic, and the engine outlives it.
    let report = stopped(async { stopping.await.ok() }).await;
    report.unwrap_or_else(|| Err(StopsUnderWay::not_confirmed(StopsUnderWay::WITHIN)))
}
