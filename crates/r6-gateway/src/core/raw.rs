//! The decisions of the raw port: which source may do what, which readings may answer a query, who holds the
//! implicit lease, and what one client sends and gets.
//!
//! - [`asked`]: what a client asks for.
//! - [`policy`]: rules by source address.
//! - [`fresh`]: which readings are fresh enough after a command.
//! - [`lease`]: the lease of scripts that know no leases.
//! - [`meaning`]: whether a list or the points of a camera mean the same in our own encoding.
//! - [`session`]: the frames and limits of one client.

pub mod asked;
pub mod fresh;
pub mod lease;
pub mod meaning;
pub mod policy;
pub mod session;
