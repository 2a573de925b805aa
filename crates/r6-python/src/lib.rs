//! The native half of the Python package `r6`: an adapter between Python and the crates of this workspace,
//! without logic of its own.
//!
//! Work that takes time is an `Operation` (`operation.rs`), which `robot.rs`, `handle.rs` and
//! `subscription.rs` make. The Python half (`python/r6`) waits for it: `Robot` in the calling thread,
//! `AsyncRobot` through asyncio.
//!
//! # A call from Python
//!
//! `robot.status()`:
//!
//! 1. `python/r6/_robot.py` (`Robot`) or `_async_robot.py` (`AsyncRobot`) is called. Running motions are in
//!    `_motion.py`, and values that are read repeatedly in `_subscription.py`. `_async_motion.py` and
//!    `_async_subscription.py` are the same for asyncio.
//! 2. It asks the one native core, `robot.rs`, for an operation (`operation.rs`): a future of `r6-client`,
//!    and how its result becomes a Python object (`convert.rs`, `errors.rs`, `raising.rs`). The classes are
//!    in `python/r6/_types.py` and `_errors.py`.
//! 3. `driver.rs` says who drives the connection meanwhile:
//!    - With `Robot`, the calling thread writes and reads the socket itself. It has released the interpreter,
//!      and looks for signals every 50 ms (`r6_client::blocking::Driver`). Between the calls the keeper of
//!      the connection drives.
//!    - With `AsyncRobot`, the thread of the event loop begins the request (`line.rs`) and reads the reply
//!      from the socket itself. If the event loop leaves bytes unread, the engine serves the same socket
//!      (`wire.rs`, over `r6_client::callback`).
//!    - Work that waits for more than the replies of one connection runs on the engine: stops, running
//!      motions, the next values of a subscription. A separate thread reports its end to the event loop
//!      (`process.rs`). A task that is cancelled drops its operation.
//!
//! # Who owns what
//!
//! - One `r6_client::blocking::Engine` serves the whole process. Neither its thread nor a keeper ever waits
//!   for the interpreter.
//! - `starting.rs` has a motion on its way from `run` to its handle. If an exception interrupts that, either
//!   the handle or a stop owns the motion.
//! - The end of a motion's `with` block is native (`block.rs`), because signals arrive between lines of
//!   Python. `outcome.rs` adds what became of the arm to the exception.
//! - `process.rs` counts the operations that must not end with the program, and `interpreter.rs` waits for
//!   them.
//! - `OfThisProcess` (`process.rs`) holds what belongs to one process. In the child of a fork it is neither
//!   locked nor dropped, and its use is an error that says so.
//! - `photos.rs` hands photo requests to a Python function in the caller's own thread or task. `simulator.rs`
//!   starts a virtual controller.

mod block;
mod closing;
mod command;
mod convert;
mod driver;
mod envelope;
mod errors;
mod following;
mod handle;
mod interpreter;
mod line;
mod listening;
mod motion;
mod numbers;
mod operation;
mod outcome;
mod photos;
mod pickling;
mod plot;
mod points;
mod process;
mod program;
mod raising;
mod record;
mod registers;
mod robot;
mod settings;
mod simulator;
mod starting;
mod subscription;
mod tables;
mod units;
mod wire;

use pyo3::prelude::*;

/// Native half of r6; import `r6`.
#[pymodule]
mod _r6 {
    use super::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let py = module.py();
        crate::record::load(py)?;
        crate::raising::load(py)?;
        crate::interpreter::watch(py)
    }

    #[pymodule_export]
    use crate::block::Block;
    #[pymodule_export]
    use crate::command::Command;
    #[pymodule_export]
    use crate::envelope::Envelope;
    #[pymodule_export]
    use crate::following::FollowCore;
    #[pymodule_export]
    use crate::handle::{MotionCore, Progress};
    #[pymodule_export]
    use crate::listening::{Listen, discovering};
    #[pymodule_export]
    use crate::motion::Motion;
    #[pymodule_export]
    use crate::operation::{Operation, Started};
    #[pymodule_export]
    use crate::outcome::{ended_as_asked, told};
    #[pymodule_export]
    use crate::photos::PhotosCore;
    #[pymodule_export]
    use crate::pickling::remade;
    #[pymodule_export]
    use crate::plot::Plot;
    #[pymodule_export]
    use crate::points::word_of;
    #[pymodule_export]
    use crate::process::tasks;
    #[pymodule_export]
    use crate::program::Program;
    #[pymodule_export]
    use crate::registers::{from_thousandths, to_thousandths};
    #[pymodule_export]
    use crate::robot::RobotCore;
    #[pymodule_export]
    use crate::settings::{FollowOptions, RobotSettings, RunOptions};
    #[pymodule_export]
    use crate::simulator::Simulator;
    #[pymodule_export]
    use crate::starting::Starting;
    #[pymodule_export]
    use crate::subscription::{PushedCore, SubscriptionCore};
    #[pymodule_export]
    use crate::tables::{addresses, alarm, models, profiles};
    #[pymodule_export]
    use crate::units::{AxisMask, AxisPosition, Degrees, Millimetres, MillimetresPerSecond, Percent, Pose};
}
