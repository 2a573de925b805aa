//! Every example does what it says, on a virtual controller. The tests judge by what the arm did.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]
#![allow(clippy::duplicate_mod, reason = "each example has its own way to wait for Ctrl-C, in one file")]

mod cell;
mod motion;
mod readme;
mod shared;

// The examples themselves. Their `main` does not run, because it reads arguments and waits for Ctrl-C.
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/camera_pick.rs"]
mod camera_pick;
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/follow_target.rs"]
mod follow_target;
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/move_axes.rs"]
mod move_axes;
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/read_state.rs"]
mod read_state;
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/registers.rs"]
mod registers;
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/stream_path.rs"]
mod stream_path;
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/ten_lines.rs"]
mod ten_lines;
#[allow(dead_code, reason = "main and what only main uses")]
#[path = "../../examples/two_robots.rs"]
mod two_robots;
