//! Fuzz targets: each promise of the product is one function over bytes, which panics if the promise is
//! broken.
//!
//! The functions are ordinary Rust. `make test` runs them on the files in `fuzz/corpus` and
//! `fuzz/regressions`, and on random changes of these. `make fuzz` lets libFuzzer search for inputs that
//! reach further (`fuzz/`, `docs/RELIABILITY.md`). `cargo run -p r6-fuzz -- TARGET FILE` runs one file.
#![allow(clippy::missing_panics_doc, reason = "to panic is what every function here is for")]

pub mod client_session;
pub mod controller;
pub mod corpus;
pub mod files;
pub mod frames;
pub mod input;
pub mod ledger;
pub mod messages;
pub mod mutation;
pub mod panel;
pub mod saved_state;
pub mod seeds;
pub mod server_session;
pub mod words;
mod written;

/// A target: its name, and the function that runs one input.
pub type Target = (&'static str, fn(&[u8]));

/// All targets, in the order of `docs/RELIABILITY.md`.
pub const TARGETS: [Target; 8] = [
    ("frames", frames::run),
    ("messages", messages::run),
    ("client_session", client_session::run),
    ("server_session", server_session::run),
    ("controller", controller::run),
    ("files", files::run),
    ("saved_state", saved_state::run),
    ("panel", panel::run),
];

/// The target with this name.
#[must_use]
pub fn target(name: &str) -> Option<Target> {
    TARGETS.into_iter().find(|(known, _)| *known == name)
}
