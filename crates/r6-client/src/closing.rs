//! Closing a handle, and the stops that are under way: a program must not end before they end.

use std::sync::Arc;
use std::time::Duration;

use r6_proto::message::Command;
use tokio::sync::watch;

use crate::drive::{Hand, drive};
use crate::error::{OutcomeUnknown, RequestError};
use crate::job::Work;
use crate::robot::{Closed, Robot};
use crate::stop::report::StopReport;
use crate::stop::stopping::{STOP_WITHIN, Stopping};
use crate::time::Time;

/// The stops over one connection ([`Robot::stops_under_way`]). It does not keep the connection open.
#[derive(Clone, Debug)]
pub struct StopsUnderWay {
    stopping: watch::Receiver<Stopping>,
    time: Arc<Time>,
    hand: Arc<dyn Hand>,
}

impl Robot {
    /// Ends the connection for all clones and waits until it is closed.
    ///
    /// It waits for a stop that is under way, for 15 s at most. A motion that is being streamed ends here:
    /// the arm finishes its list (with [`crate::RunOptions::stop_on_drop`] it is stopped), and
    /// [`Closed::cut_short`] says what was not sent. It waits for that end, too, for 15 s at most. The
    /// orderly end of the connection itself takes half a second at most.
    ///
    /// Dropping the last clone does the same in the background. Use this method if the runtime ends right
    /// after. Later requests of other clones are not sent ([`crate::NotSent::Closed`]).
    pub async fn close(self) -> Closed {
        self.drive(self.close_now()).await
    }

    /// Ends the connection for all clones at once, whatever is under way: requests without a reply have an
    /// unknown outcome. A stop that already waits to be written is still sent. Nothing is sent after it, and
    /// there is no other connection.
    ///
    /// [`Self::close`] ends it in order.
    pub fn disconnect(&self) {
        self.announce_closing();
        self.end_connection();
    }

    pub(crate) async fn close_now(&self) -> Closed {
        self.announce_closing();
        self.no_stop_under_way().await;
        let cut_short = match self.hub().time.timeout(STOP_WITHIN, self.nothing_streams()).await {
            Ok(()) => self.motions().cut_by_close(),
            Err(_elapsed) => None,
        };
        self.end_connection();
        self.closed().await;
        Closed { cut_short }
    }

    /// The stops over this connection, from any source: other clones, guards, motions that failed.
    #[must_use]
    pub fn stops_under_way(&self) -> StopsUnderWay {
        StopsUnderWay {
            stopping: self.stopping().subscribe(),
            time: Arc::clone(&self.hub().time),
            hand: Arc::clone(self.hand()),
        }
    }
}

impl StopsUnderWay {
    /// How long [`Self::over`] waits: 15 s, the longest that a whole stop takes.
    pub const WITHIN: Duration = STOP_WITHIN;

    /// Whether a stop is under way now.
    #[must_use]
    pub fn any(&self) -> bool {
        self.stopping.borrow().under_way > 0
    }

    /// Whether the connection is gone: no stop can be under way over it again.
    #[must_use]
    pub fn are_gone(&self) -> bool {
        self.stopping.has_changed().is_err()
    }

    /// Waits until no stop is under way, for [`Self::WITHIN`] at most, and returns the result of the last
    /// one; `None` if there was no stop. Dropping the future stops nothing.
    ///
    /// # Errors
    /// In the report: as [`Robot::stop`], and [`Self::not_confirmed`] if a stop is still under way.
    pub async fn over(&mut self) -> Option<Result<StopReport, RequestError>> {
        let over = self.stopping.wait_for(|stopping| stopping.under_way == 0);
        match drive(&*self.hand, self.time.timeout(Self::WITHIN, over)).await {
            Ok(Ok(stopping)) => stopping.last.clone(),
            // The last handle is gone, and with it every stop.
            Ok(Err(_gone)) => None,
            Err(_elapsed) => Some(Err(Self::not_confirmed(Self::WITHIN))),
        }
    }

    /// The error to report if a stop is still under way after this time.
    #[must_use]
    pub fn not_confirmed(after: Duration) -> RequestError {
        let request = Work::Command(Command::ActionStop).sent();
        OutcomeUnknown::TimedOut { request, after, heard: None }.into()
    }
}
