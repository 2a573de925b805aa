//! The native half of the Python package `r6`: an adapter between Python and the crates of this workspace,
//! without logic of its own.
//!
//! Work that takes time is an `Operation` (`operation.rs`), which `robot.rs`, `handle.rs` and
//! `subscription.rs` make. The Python half (`python/r6`) waits for it: `Robot` in the calling thread,
//! `AsyncRobot` through asyncio.

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
