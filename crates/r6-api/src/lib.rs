//! The contract: the types that r6 writes as JSON. So far these are the status, positions, problems and the
//! panel. `r6 status --json`, the panel over HTTP and Python's `to_dict` use the same types. The other output
//! of `r6 --json` is still defined in the crate `r6`.
//!
//! Each type works with serde; with the feature `openapi` it is also an OpenAPI schema. This crate has no I/O
//! and no type of a client or of a controller: the caller that reads a robot passes its values by address.
//!
//! - [`gateway`]: robots, leases, commands, events and the audit log of the gateway.
//! - [`panel`]: what an operator sees and does at a virtual machine.
//! - [`status`]: the state of a robot, and whether it takes instructions.
//! - [`position`]: axes and poses, each value with its unit.
//! - [`problem`]: why a request failed, with codes for programs.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod gateway;
pub mod panel;
pub mod position;
pub mod problem;
pub mod status;

pub use position::{AxisPosition, Pose, Unit};
pub use problem::{Code, CommandProblem, Problem};
pub use status::{Condition, Status, Unmet, Unproved};
