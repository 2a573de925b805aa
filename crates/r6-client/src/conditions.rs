//! The conditions under which a command may be sent, for programs that hand commands on for others.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use r6_proto::message::Instruction;

/// When a command may be sent: [`crate::Robot::command_under`]. The default: as [`crate::Robot::command`].
///
/// The client checks them in the call that writes the first byte. An earlier check is not enough, because a
/// command may wait behind other requests.
#[derive(Clone, Debug, Default)]
pub struct Conditions {
    /// Not later than this after the call; otherwise [`crate::NotSent::Busy`].
    pub leave_within: Option<Duration>,
    /// Only on the connection with this number ([`crate::Robot::connection`]); otherwise
    /// [`crate::NotSent::Disconnected`].
    pub only_on: Option<u64>,
    /// Only while this permission stands; otherwise [`crate::NotSent::Withdrawn`].
    pub permission: Option<Permission>,
}

/// A permission that can be withdrawn while a command waits. Clones share it.
#[derive(Clone, Default)]
pub struct Permission {
    withdrawn: Arc<AtomicBool>,
    stands: Option<Arc<dyn Fn() -> bool + Send + Sync>>,
}

impl Permission {
    /// A permission that stands.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The same permission, for commands that may leave only while `stands` returns `true`. It replaces an
    /// earlier function.
    ///
    /// The client calls it before it writes, so it has to return at once. An example is a time by a clock
    /// that the client does not know.
    #[must_use]
    pub fn only_while(self, stands: impl Fn() -> bool + Send + Sync + 'static) -> Self {
        Self { stands: Some(Arc::new(stands)), ..self }
    }

    /// Withdraws the permission for good. Commands that have not begun to leave are not sent.
    pub fn withdraw(&self) {
        self.withdrawn.store(true, Ordering::SeqCst);
    }

    /// Whether it does not stand: it was withdrawn, or the function of [`Self::only_while`] says so.
    #[must_use]
    pub fn is_withdrawn(&self) -> bool {
        self.withdrawn.load(Ordering::SeqCst) || self.stands.as_ref().is_some_and(|stands| !stands())
    }
}

impl fmt::Debug for Permission {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Permission").field("withdrawn", &self.is_withdrawn()).finish_non_exhaustive()
    }
}

/// Decides about each list of a motion: [`crate::Robot::run_under`]. Clones share the function.
#[derive(Clone)]
pub struct ListGate(Arc<Decide>);

/// Whether the list replaces the list of the controller, and its instructions.
type Decide = dyn Fn(bool, &[Instruction]) -> Option<Conditions> + Send + Sync;

impl ListGate {
    /// A gate that asks `decide` right before each list is given to the connection: whether it replaces the
    /// list of the controller, and its instructions. `None` refuses the list.
    ///
    /// The conditions hold for this list alone. The client calls the function while it streams, so it has to
    /// return at once.
    #[must_use]
    pub fn new(decide: impl Fn(bool, &[Instruction]) -> Option<Conditions> + Send + Sync + 'static) -> Self {
        Self(Arc::new(decide))
    }

    pub(crate) fn decide(&self, replace: bool, instructions: &[Instruction]) -> Option<Conditions> {
        (self.0)(replace, instructions)
    }
}

impl fmt::Debug for ListGate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ListGate").finish_non_exhaustive()
    }
}
