//! The raw port: the robots' own protocol, for scripts that know nothing of the gateway.
//!
//! # A request over the raw port
//!
//! 1. [`port`] accepts the connection, if the policy allows its source (`core/raw/policy.rs`).
//! 2. [`conversation`] moves bytes; `core/raw/session.rs` finds the frames, and brings the replies into their
//!    order; `core/raw/asked.rs` reads what a frame asks for.
//! 3. [`serve`] carries a request out: a query from fresh readings or by asking the robot, a stop at once, a
//!    command with the implicit lease (`core/raw/lease.rs`), on the way of all commands
//!    (`fleet/command.rs`), and what a camera sends under the grant of its rule (`fleet/camera.rs`).
//!
//! The photos that the controller asks for go the other way: `fleet/camera.rs` tells [`conversation`], which
//! sends them to the clients whose rule names the camera.

mod conversation;
mod port;
mod serve;

use std::net::SocketAddr;
use std::sync::{Arc, PoisonError, RwLock};

use crate::core::name::RobotName;
use crate::core::raw::policy::{RawPolicy, RawRule};

pub use port::{Door, attend};

/// One raw port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawPort {
    /// The robot.
    pub robot: RobotName,
    /// Where to listen; port 0 takes any free port.
    pub listen: SocketAddr,
}

/// The policy that all raw ports share. It can be exchanged: the new one holds from the next frame on.
#[derive(Clone, Debug, Default)]
pub struct SharedPolicy(Arc<RwLock<RawPolicy>>);

impl SharedPolicy {
    /// A policy.
    #[must_use]
    pub fn new(policy: RawPolicy) -> Self {
        Self(Arc::new(RwLock::new(policy)))
    }

    /// Exchanges it. Returns the new one if it differs.
    pub fn set(&self, policy: RawPolicy) -> Option<RawPolicy> {
        let mut held = self.0.write().unwrap_or_else(PoisonError::into_inner);
        let is_new = *held != policy;
        held.clone_from(&policy);
        is_new.then_some(policy)
    }

    /// The present policy.
    #[must_use]
    pub fn now(&self) -> RawPolicy {
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The rule for this source and robot; `None` if the source may do nothing.
    fn rule(&self, source: SocketAddr, robot: &str) -> Option<RawRule> {
        let policy = self.0.read().unwrap_or_else(PoisonError::into_inner);
        policy.rule(source.ip(), robot).cloned()
    }
}
