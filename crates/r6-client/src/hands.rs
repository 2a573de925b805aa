//! What drives a client. Besides `blocking`, which wraps it for threads, these files alone know clocks, sockets, tasks and threads.

pub(crate) mod blocking;
pub mod callback;
pub(crate) mod clock;
pub(crate) mod connect;
pub(crate) mod discover;
pub(crate) mod listen;
mod targets;
pub(crate) mod tokio;
