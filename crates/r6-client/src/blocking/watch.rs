//! Values and events that the client delivers without a request of the caller, without `async`.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::address::Address;
use tokio::sync::broadcast::{self, error::RecvError};

use super::Connection;
use crate::event::Event;
use crate::{Pushed, Snapshot};

/// The blocking form of [`crate::Subscription`]. As an iterator it waits for the next values, and ends when
/// the handle is closed.
pub struct Subscription {
    subscription: crate::Subscription,
    connection: Arc<Connection>,
}

impl fmt::Debug for Subscription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("blocking::Subscription").field(&self.addresses()).finish()
    }
}

impl Subscription {
    pub(super) fn new(subscription: crate::Subscription, connection: Arc<Connection>) -> Self {
        Self { subscription, connection }
    }

    /// The blocking form of [`crate::Subscription::addresses`].
    #[must_use]
    pub fn addresses(&self) -> &[Address] {
        self.subscription.addresses()
    }

    /// The blocking form of [`crate::Subscription::latest`].
    #[must_use]
    pub fn latest(&self) -> Snapshot {
        self.subscription.latest()
    }

    /// The blocking form of [`crate::Subscription::next`] with a time limit. At the limit it returns the
    /// values known so far, with their ages.
    pub fn next_within(&mut self, time: Duration) -> Option<Snapshot> {
        let Self { subscription, connection } = self;
        match connection.runner.block_on(connection.robot.within(time, subscription.next())) {
            Ok(next) => next,
            Err(_elapsed) => Some(subscription.latest()),
        }
    }
}

impl Iterator for Subscription {
    type Item = Snapshot;

    fn next(&mut self) -> Option<Snapshot> {
        self.connection.runner.block_on(self.subscription.next())
    }
}

/// The receiver that [`crate::blocking::Robot::pushed`] returns.
pub type PushedReceiver = Receiver<Pushed>;

/// The receiver that [`crate::blocking::Robot::events`] returns.
pub type EventReceiver = Receiver<Event>;

/// Receives events and messages. As an iterator it waits for the next one, skips what was missed, and ends
/// when the handle is closed.
pub struct Receiver<T> {
    receiver: broadcast::Receiver<T>,
    connection: Arc<Connection>,
}

impl<T> fmt::Debug for Receiver<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Receiver").finish_non_exhaustive()
    }
}

impl<T: Clone> Receiver<T> {
    pub(super) fn new(receiver: broadcast::Receiver<T>, connection: Arc<Connection>) -> Self {
        Self { receiver, connection }
    }

    /// Waits for the next one.
    ///
    /// # Errors
    /// `Lagged(n)`: the receiver missed this many; the next call continues after them. `Closed`: the handle
    /// is closed.
    pub fn recv(&mut self) -> Result<T, RecvError> {
        let Self { receiver, connection } = self;
        connection.runner.block_on(next(receiver, connection))
    }

    /// Waits for the next one, at most this long. Returns `None` at the time limit.
    ///
    /// # Errors
    /// The same errors as [`Self::recv`].
    pub fn recv_within(&mut self, time: Duration) -> Result<Option<T>, RecvError> {
        let Self { receiver, connection } = self;
        match connection.runner.block_on(connection.robot.within(time, next(receiver, connection))) {
            Ok(pushed) => pushed.map(Some),
            Err(_elapsed) => Ok(None),
        }
    }
}

/// Waits for the next one, or for the end of the handle. The sender may outlive the handle, because a
/// subscription keeps it.
async fn next<T: Clone>(
    receiver: &mut broadcast::Receiver<T>,
    connection: &Connection,
) -> Result<T, RecvError> {
    tokio::select! {
        biased;
        pushed = receiver.recv() => pushed,
        () = connection.robot.closed() => Err(RecvError::Closed),
    }
}

impl<T: Clone> Iterator for Receiver<T> {
    type Item = T;

    fn next(&mut self) -> Option<T> {
        loop {
            match self.recv() {
                Ok(pushed) => return Some(pushed),
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return None,
            }
        }
    }
}
