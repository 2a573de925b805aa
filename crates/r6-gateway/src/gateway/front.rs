//! Threads of their own for what callers ask, over HTTP and over the raw ports.
//!
//! The polls of the robots are on the other threads of the process: a thousand of them in 0.1 s. A request
//! would wait behind them until it is read, and again after each write to the disk. What the robot replies is
//! heard on those other threads.

use std::fmt;
use std::io;

use tokio::net::TcpListener;
use tokio::runtime::{Builder, Handle, Runtime};

/// How many threads there are at least: one can be in a long answer while the other takes a stop.
const LEAST: usize = 2;

/// The threads. They end with this value, and what runs there with them.
pub(super) struct Front {
    handle: Handle,
    /// Taken when this value is dropped.
    runtime: Option<Runtime>,
}

impl fmt::Debug for Front {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Front")
    }
}

impl Front {
    /// Starts the threads.
    ///
    /// # Errors
    /// The system gives no threads.
    pub(super) fn start() -> io::Result<Self> {
        // Half of the processors are left to the robots.
        let threads = std::thread::available_parallelism().map_or(LEAST, |all| LEAST.max(all.get() / 2));
        let mut builder = Builder::new_multi_thread();
        let runtime = builder.worker_threads(threads).thread_name("front").enable_all().build()?;
        Ok(Self { handle: runtime.handle().clone(), runtime: Some(runtime) })
    }

    /// Where to spawn.
    pub(super) fn handle(&self) -> &Handle {
        &self.handle
    }

    /// Lets these threads hear of the connections of a listener.
    ///
    /// # Errors
    /// The system does not allow that.
    pub(super) fn hear(&self, listener: TcpListener) -> io::Result<TcpListener> {
        let listener = listener.into_std()?;
        let _entered = self.handle.enter();
        TcpListener::from_std(listener)
    }
}

impl Drop for Front {
    fn drop(&mut self) {
        // Not by waiting: this may be in a task.
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}
