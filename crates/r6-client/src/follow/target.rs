//! The targets that the arm follows, each with its age.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use r6_proto::time::Instant;
use tokio::sync::watch;

use crate::units::AxisPosition;

/// Sends the targets that an arm follows ([`crate::Robot::follow`]). Dropping it ends the following.
///
/// The age of a target counts from when it is sent, not from when the client looks at it:
/// [`crate::FollowOptions::fresh_within`] begins with [`Self::send`].
#[derive(Debug)]
pub struct TargetSender(watch::Sender<Sent>);

/// The other end: what [`crate::Robot::follow`] takes.
#[derive(Debug)]
pub struct Targets(watch::Receiver<Sent>);

/// A target, and a function that returns its present age; `None` before the first target.
#[derive(Clone)]
struct Sent {
    target: AxisPosition,
    age: Option<Arc<dyn Fn() -> Duration + Send + Sync>>,
}

impl fmt::Debug for Sent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Sent").field(&self.target).finish()
    }
}

/// A target, and when it was sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastTarget {
    pub target: AxisPosition,
    /// `None` before the first target.
    pub at: Option<Instant>,
}

impl TargetSender {
    /// Creates a sender that has sent no target yet, and the receiver for [`crate::Robot::follow`].
    #[must_use]
    pub fn new() -> (Self, Targets) {
        let (sender, targets) = watch::channel(Sent { target: AxisPosition::none(), age: None });
        (Self(sender), Targets(targets))
    }

    /// Sends a target together with a function that returns its age.
    pub(crate) fn send_aged(&self, target: AxisPosition, age: impl Fn() -> Duration + Send + Sync + 'static) {
        self.0.send_replace(Sent { target, age: Some(Arc::new(age)) });
    }

    /// Whether the following has ended.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.0.is_closed()
    }

    /// Waits until the following has ended.
    pub async fn closed(&self) {
        self.0.closed().await;
    }
}

impl Targets {
    /// The newest target, and whether the sender is gone.
    pub(super) fn newest(&mut self, now: Instant) -> (LastTarget, bool) {
        // Checked first, so that a target sent right before the end is still read.
        let ended = self.0.has_changed().is_err();
        let Sent { target, age } = &*self.0.borrow_and_update();
        (LastTarget { target: *target, at: age.as_ref().map(|age| now - age()) }, ended)
    }
}
