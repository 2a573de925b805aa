//! The contract: the types that r6 writes as JSON. `r6 status --json`, the panel over HTTP and Python's
//! `to_dict` use the same types. The JSON of `r6 plot`, `inspect`, `discover` and `command --list` is still
//! defined in the crate `r6`.
//!
//! Each type works with serde; with the feature `openapi` it is also an OpenAPI schema. This crate has no I/O
//! and no type of a client or of a controller: the caller that reads a robot passes its values by address.
//!
//! - [`alarm`]: what an alarm means.
//! - [`gateway`]: robots, leases, commands, events and the audit log of the gateway.
//! - [`motion`]: what became of commands, motions and stops.
//! - [`panel`]: what an operator sees and does at a virtual machine.
//! - [`status`]: the state of a robot, and whether it takes instructions.
//! - [`position`]: axes and poses, each value with its unit.
//! - [`problem`]: why a request failed, with codes for programs.
//! - [`reading`]: the values of a query.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod alarm;
pub mod gateway;
pub mod motion;
pub mod panel;
pub mod position;
pub mod problem;
pub mod reading;
pub mod status;

pub use alarm::Alarm;
pub use motion::{CommandAccepted, CutShort, MotionEvent, Steps, StopReport};
pub use position::{AxisPosition, Pose, Unit};
pub use problem::{Code, CommandProblem, Mistake, Problem};
pub use reading::{AddressValue, Sample};
pub use status::{Condition, Status, Unmet, Unproved};
