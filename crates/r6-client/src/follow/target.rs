//! The source of the targets that are followed. Each target has the time at which it was sent.

use tokio::sync::watch;
use tokio::time::Instant;

use crate::units::AxisPosition;

/// Sends the targets that an arm follows ([`crate::Robot::follow`]). Dropping it ends the following.
///
/// The age of a target counts from when it is sent, not from when the client looks at it:
/// [`crate::FollowOptions::fresh_within`] begins with [`Self::send`].
#[derive(Debug)]
pub struct TargetSender(watch::Sender<Told>);

/// The other end: what [`crate::Robot::follow`] takes.
#[derive(Debug)]
pub struct Targets(watch::Receiver<Told>);

/// A target, and when it was sent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    pub target: AxisPosition,
    /// `None` before the first one.
    pub at: Option<Instant>,
}

impl TargetSender {
    /// A sender that has sent no target yet, and the receiver for [`crate::Robot::follow`].
    #[must_use]
    pub fn new() -> (Self, Targets) {
        let (sender, targets) = watch::channel(Told { target: AxisPosition::none(), at: None });
        (Self(sender), Targets(targets))
    }

    /// Sends a new target. Only the newest one counts.
    pub fn send(&self, target: AxisPosition) {
        self.0.send_replace(Told { target, at: Some(Instant::now()) });
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
    pub(super) fn newest(&mut self) -> (Told, bool) {
        // Checked first, so that a target sent right before the end is still read.
        let ended = self.0.has_changed().is_err();
        (*self.0.borrow_and_update(), ended)
    }
}
