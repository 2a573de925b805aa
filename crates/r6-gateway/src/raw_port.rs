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
//!
//! [`switch`] closes and opens all raw ports at once.

mod conversation;
mod port;
mod serve;
mod switch;

use std::net::SocketAddr;
use std::sync::Arc;

use r6_api::gateway::ActedBy;
use tokio::sync::watch;

use crate::core::name::RobotName;
use crate::core::raw::policy::{RawPolicy, RawRule};

pub use port::{Door, attend};
pub use switch::Switch;

/// One raw port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawPort {
    /// The robot.
    pub robot: RobotName,
    /// Where to listen; port 0 takes any free port.
    pub listen: SocketAddr,
}

/// The policy that all raw ports share, and whether they are open. Clients hear of each change.
#[derive(Clone, Debug)]
pub struct SharedPolicy(Arc<watch::Sender<Held>>);

#[derive(Debug)]
struct Held {
    policy: RawPolicy,
    /// Who closed all raw ports, and when.
    closed: Option<ActedBy>,
    /// How often they were closed. What was asked for before does not leave after, also if they are open
    /// again.
    closings: u64,
}

impl SharedPolicy {
    /// A policy, and who has closed all raw ports.
    #[must_use]
    pub fn new(policy: RawPolicy, closed: Option<ActedBy>) -> Self {
        Self(Arc::new(watch::Sender::new(Held { policy, closed, closings: 0 })))
    }

    /// Exchanges it. Returns the new one if it differs.
    pub fn set(&self, policy: RawPolicy) -> Option<RawPolicy> {
        let is_new = self.0.send_if_modified(|held| {
            let is_new = held.policy != policy;
            held.policy.clone_from(&policy);
            is_new
        });
        is_new.then_some(policy)
    }

    /// The present policy.
    #[must_use]
    pub fn now(&self) -> RawPolicy {
        self.0.borrow().policy.clone()
    }

    /// Closes all raw ports. Whether they were open.
    pub fn close(&self, by: ActedBy) -> bool {
        let mut was_open = false;
        self.0.send_modify(|held| {
            held.closings += 1;
            was_open = held.closed.is_none();
            held.closed.get_or_insert(by);
        });
        was_open
    }

    /// Opens all raw ports, unless they were closed since there were so many closings. Whether they are open.
    pub fn open(&self, closings: u64) -> bool {
        self.0.send_if_modified(|held| {
            let is_good = held.closings == closings;
            if is_good {
                held.closed = None;
            }
            is_good
        })
    }

    /// Who has closed all raw ports, and when.
    #[must_use]
    pub fn closed(&self) -> Option<ActedBy> {
        self.0.borrow().closed.clone()
    }

    /// How often all raw ports were closed.
    #[must_use]
    pub fn closings(&self) -> u64 {
        self.0.borrow().closings
    }

    /// The rule for this source and robot, unless the raw ports were closed since there were so many
    /// closings.
    fn rule_since(&self, closings: u64, source: SocketAddr, robot: &str) -> Option<RawRule> {
        let held = self.0.borrow();
        let is_open = held.closed.is_none() && held.closings == closings;
        is_open.then(|| held.policy.rule(source.ip(), robot).cloned()).flatten()
    }

    /// Changes of the policy.
    fn changes(&self) -> watch::Receiver<Held> {
        self.0.subscribe()
    }

    /// The rule for this source and robot; `None` if the source may do nothing.
    fn rule(&self, source: SocketAddr, robot: &str) -> Option<RawRule> {
        let held = self.0.borrow();
        let is_open = held.closed.is_none();
        is_open.then(|| held.policy.rule(source.ip(), robot).cloned()).flatten()
    }
}
