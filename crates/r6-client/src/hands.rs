//! The drivers of a client. Only these files, and `blocking`, which wraps it for threads, know clocks,
//! sockets, tasks and threads.

pub(crate) mod blocking;
pub mod callback;
pub(crate) mod clock;
pub(crate) mod connect;
pub(crate) mod discover;
pub(crate) mod listen;
mod targets;
pub(crate) mod tokio;
