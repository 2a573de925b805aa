//! Where a followed target comes from: each with the time at which it was told.

use tokio::sync::watch;
use tokio::time::Instant;

use crate::units::AxisPosition;

/// Tells where a followed target is ([`crate::Robot::follow`]). Dropping it ends the following.
///
/// A target counts from when it is told here, not from when it is looked at:
/// [`crate::FollowOptions::fresh_within`] begins with [`Self::send`].
#[derive(Debug)]
pub struct TargetSender(watch::Sender<Told>);

/// The other end: what [`crate::Robot::follow`] takes.
#[derive(Debug)]
pub struct Targets(watch::Receiver<Told>);

/// A target, and when it was told.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    pub target: AxisPosition,
    /// `None` before the first one.
    pub at: Option<Instant>,
}

impl TargetSender {
    /// A sender that has told no target yet, and what is to be followed.
    #[must_use]
    pub fn new() -> (Self, Targets) {
        let (sender, targets) = watch::channel(Told { target: AxisPosition::none(), at: None });
        (Self(sender), Targets(targets))
    }

    /// The target is here now. Only the newest one counts.
    pub fn send(&self, target: AxisPosition) {
        self.0.send_replace(Told { target, at: Some(Instant::now()) });
    }

    /// Whether nobody follows any more.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.0.is_closed()
    }

    /// Ends when nobody follows any more.
    pub async fn closed(&self) {
        self.0.closed().await;
    }
}

impl Targets {
    /// The newest target, and whether there is nobody left to tell another.
    pub(super) fn newest(&mut self) -> (Told, bool) {
        // Asked first: what is told right before the end is the newest all the same.
        let ended = self.0.has_changed().is_err();
        (*self.0.borrow_and_update(), ended)
    }
}
