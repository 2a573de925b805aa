//! The contract: types of what leaves r6 as JSON, so far the status, positions, problems and the panel. `r6 status --json`, the panel over
//! HTTP and Python's `to_dict` use the same ones. The other output of `r6 --json` is still made in the crate `r6`.
//!
//! Each type is serde's; with the feature `openapi` it is an OpenAPI schema, too. There is no I/O here, and no type of a client or
//! of a controller: whoever reads a robot hands over its values by address.
//!
//! - [`panel`]: what a person sees and does at a virtual machine.
//! - [`status`]: the state of a robot, and whether it takes instructions.
//! - [`position`]: axes and poses, each value with its unit.
//! - [`problem`]: why something was not done, with the words that programs decide by.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod panel;
pub mod position;
pub mod problem;
pub mod status;

pub use position::{AxisPosition, Pose, Unit};
pub use problem::{Code, CommandProblem, Problem};
pub use status::{Condition, Status, Unmet, Unproved};
