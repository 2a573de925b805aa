//! What happens to traffic of the remote protocol on its way: the faults of a link, drawn from a seed.
//!
//! There is no I/O, no clock and no task in this crate: bytes, points in time and seeds come in; bytes and endings go out.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod fault;
pub mod link;
pub mod random;
