//! Closing a connection without losing a stop that was asked for (`stop_on_drop`), or one that is under way: what is closed can stop
//! nobody.

use std::future::{Future, poll_fn};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Poll;

use r6_client::{Progress, RequestError, Robot, StopReport, StopsUnderWay};
use tokio::sync::watch;
use tokio::time::timeout;

use crate::convert;
use crate::errors::raise;
use crate::operation::{Operation, STOP_GOES_ON};

/// What all handles of a connection share.
#[derive(Default)]
pub struct Connection {
    /// Motions that are to be stopped when nobody holds them any more. The sender goes once a motion, and the stop that may follow
    /// it, is over. One runs at a time: there are few.
    living: Mutex<Vec<watch::Receiver<Progress>>>,
    closed: watch::Sender<bool>,
    /// Motions whose handles came to nobody and that are being stopped.
    unowned: watch::Sender<usize>,
}

/// A motion whose handle came to nobody, until it has been stopped: nobody closes its connection before.
pub struct Unowned(Arc<Connection>);

impl Unowned {
    /// Over this connection.
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
    /// Keeps a motion in mind until it is over.
    pub fn add(&self, motion: watch::Receiver<Progress>) {
        let mut living = self.living.lock().unwrap_or_else(PoisonError::into_inner);
        living.retain(lives);
        living.push(motion);
    }

    /// Stops the arm if one of them lives, waits for a stop that is under way, and closes the connection.
    pub async fn close(&self, robot: Robot) {
        let mut living = std::mem::take(&mut *self.living.lock().unwrap_or_else(PoisonError::into_inner));
        living.retain(lives);
        // Out of time, or a stop that failed: the connection ends all the same, as who closes it wants.
        let _ = timeout(StopsUnderWay::WITHIN, async {
            // The sender is here.
            let _ = self.unowned.subscribe().wait_for(|count| *count == 0).await;
            // One that has ended and still lives is being stopped.
            if living.iter().any(|motion| !motion.borrow().ended) {
                let _ = robot.stop().await;
            }
            for mut motion in living {
                while motion.changed().await.is_ok() {}
            }
        })
        .await;
        robot.close().await;
        self.closed.send_replace(true);
    }

    /// Tells when it is closed.
    pub fn closed(&self) -> watch::Receiver<bool> {
        self.closed.subscribe()
    }
}

fn lives(motion: &watch::Receiver<Progress>) -> bool {
    motion.has_changed().is_ok()
}

/// Waits for a stop as long as one takes; it goes on by itself. One that is still under way is told as not confirmed.
pub async fn stopped<F>(stopping: F) -> Option<Result<StopReport, RequestError>>
where
    F: Future<Output = Option<Result<StopReport, RequestError>>>,
{
    let within = StopsUnderWay::WITHIN;
    timeout(within, stopping).await.unwrap_or_else(|_elapsed| Some(Err(StopsUnderWay::not_confirmed(within))))
}

/// Stops the arm: goes on to its end, whoever gives up waiting for it.
pub fn stopping(robot: Robot) -> Operation {
    Operation::new(stop(robot), |py, report| convert::stop_report(py, &raise(py, report)?))
        .going_on(STOP_GOES_ON)
}

/// Stops the arm. The stop is a task of its own: whoever gives up waiting for it ends nothing.
async fn stop(robot: Robot) -> Result<StopReport, RequestError> {
    let mut stopping = Box::pin(async move { robot.stop().await });
    // Once here, so that it is under way for whoever closes the connection next.
    if let Poll::Ready(report) = poll_fn(|context| Poll::Ready(stopping.as_mut().poll(context))).await {
        return report;
    }
    let stopping = tokio::spawn(stopping);
    // The task does not panic, and the engine outlives it.
    let report = stopped(async { stopping.await.ok() }).await;
    report.unwrap_or_else(|| Err(StopsUnderWay::not_confirmed(StopsUnderWay::WITHIN)))
}
