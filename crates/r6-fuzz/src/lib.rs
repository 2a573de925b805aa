//! Fuzz targets: each promise of the product is one function over bytes, which panics if the promise is
//! broken.
//!
//! The functions are ordinary Rust. `make test` runs them on the files in `fuzz/corpus` and
//! `fuzz/regressions`, and on random changes of these. `make fuzz` lets libFuzzer search for inputs that
//! reach further (`fuzz/`, `docs/RELIABILITY.md`). `cargo run -p r6-fuzz -- TARGET FILE` runs one file.
//!
//! # An input
//!
//! `make fuzz` (`tools/fuzz`) builds the programs of `fuzz/`, a workspace of its own. Each hands bytes to one
//! of the functions in [`TARGETS`].
//!
//! - [`frames`], [`messages`], [`files`], [`saved_state`] and [`panel`] take the bytes as they are.
//!   [`client_session`], [`server_session`] and [`controller`] read operations from them ([`input`]).
//! - Each compares the product with something plain: a scanner that looks at one byte after the other
//!   (`frames/scanner.rs`), a ledger of requests (`client_session/ledger.rs`), a model of the cell
//!   (`controller/model.rs`: what it may do; `controller/duty.rs`: what it must do), serde_json, and the data
//!   before it was written and read again (`written.rs`).
//! - The checks of messages are in `r6-proto/tests/common`, because proptest uses them too.
//! - [`corpus`] finds the stored inputs, [`seeds`] makes the first ones, and [`mutation`] changes them for
//!   `make test` (`tests/corpus.rs`). [`ledger`] keeps the table of `docs/RELIABILITY.md`.
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
