//! The common parts of every HTTP server of r6: the panel of virtual controllers, the gateway.
//!
//! - [`serve`] accepts connections, and keeps room for new ones ([`server`]).
//! - [`Afterwards`] is what goes on over a connection that is not HTTP any more.
//! - [`access`] lets programs of this machine through, but no web pages from elsewhere.
//! - [`Refusal`] is a problem of the contract with its status; [`body`] reads bodies within limits of length
//!   and time.
#![cfg_attr(
    not(test),
    warn(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used, clippy::panic)
)]

pub mod access;
mod afterwards;
pub mod body;
mod in_json;
mod refusal;
pub mod server;

pub use afterwards::Afterwards;
pub use refusal::Refusal;
pub use server::{Peer, serve};
