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

/// A client of a raw port.
#[derive(Clone, Copy, Debug)]
pub struct Client {
    /// Where it comes from.
    pub source: SocketAddr,
    /// How often all raw ports had been closed when it came: what it asks for does not leave after another
    /// closing, also if they are open again.
    closings: u64,
}

/// The policy that all raw ports share, and whether they are open. Clients hear of each change.
#[derive(Clone, Debug)]
pub struct SharedPolicy(Arc<watch::Sender<Held>>);

#[derive(Debug)]
struct Held {
    policy: RawPolicy,
    /// Who closed all raw ports, and when.
    closed: Option<ActedBy>,
    /// Whether the disk has it: a restart leaves the ports so.
    is_kept: bool,
    /// How often they were closed.
    closings: u64,
}

impl SharedPolicy {
    /// A policy, and who has closed all raw ports.
    #[must_use]
    pub fn new(policy: RawPolicy, closed: Option<ActedBy>) -> Self {
        Self(Arc::new(watch::Sender::new(Held { policy, closed, is_kept: true, closings: 0 })))
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

    /// Closes all raw ports, which the disk does not know yet. Returns whether they were open.
    fn close(&self, by: ActedBy) -> bool {
        let mut was_open = false;
        self.0.send_modify(|held| {
            held.closings += 1;
            held.is_kept = false;
            was_open = held.closed.is_none();
            held.closed.get_or_insert(by);
        });
        was_open
    }

    /// Opens all raw ports, as the disk has it, unless they were closed once more than `closings` times.
    /// Returns whether they are open.
    fn open(&self, closings: u64) -> bool {
        self.0.send_if_modified(|held| {
            let is_last = held.closings == closings;
            if is_last {
                (held.closed, held.is_kept) = (None, true);
            }
            is_last
        })
    }

    /// The state of the ports after this many closings is on the disk.
    fn kept(&self, closings: u64) {
        // No client has to hear of it.
        self.0.send_if_modified(|held| {
            held.is_kept |= held.closings == closings;
            false
        });
    }

    /// It is not known what the disk has.
    fn doubt(&self) {
        self.0.send_if_modified(|held| {
            held.is_kept = false;
            false
        });
    }

    /// Who has closed all raw ports, and when.
    #[must_use]
    pub fn closed(&self) -> Option<ActedBy> {
        self.0.borrow().closed.clone()
    }

    /// How often all raw ports were closed.
    fn closings(&self) -> u64 {
        self.0.borrow().closings
    }

    /// Whether a restart leaves the ports as they are.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.0.borrow().is_kept
    }

    /// Changes of the policy.
    fn changes(&self) -> watch::Receiver<Held> {
        self.0.subscribe()
    }

    /// A client that comes from there now.
    fn client(&self, source: SocketAddr) -> Client {
        Client { source, closings: self.closings() }
    }

    /// The rule for this client and robot; `None` if the client may do nothing.
    fn rule(&self, client: Client, robot: &str) -> Option<RawRule> {
        let held = self.0.borrow();
        let is_open = held.closed.is_none() && held.closings == client.closings;
        is_open.then(|| held.policy.rule(client.source.ip(), robot).cloned()).flatten()
    }
}
