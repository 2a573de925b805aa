//! The common parts of every HTTP server of r6: the panel of virtual controllers, the gateway.
//!
//! - [`serve`] accepts connections, and keeps room for new ones ([`server`]). [`serve_plain`] does so where
//!   they come from somewhere else than TCP of this machine.
//! - [`Afterwards`] is what goes on over a connection that is not HTTP any more. [`EndsWith`] ends a
//!   connection whose answer goes on.
//! - [`Tls`] is a certificate, with which [`serve`] speaks TLS. [`connect_to`] speaks it with another server,
//!   which finds the certificate of this one in [`Shown`].
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
mod connect;
mod ends_with;
mod in_json;
mod refusal;
pub mod server;
mod shown;
mod slowed;
mod stalled;
mod tls;
mod work;

pub use afterwards::Afterwards;
pub use connect::connect_to;
pub use ends_with::EndsWith;
pub use refusal::{Refusal, read_json};
pub use server::{Guest, Listener, Peer, serve, serve_plain, serve_until};
pub use shown::Shown;
pub use tls::{BadCertificate, Tls, first_der, is_for};
