//! Test equipment of the workspace, only for dev-dependencies.
//!
//! It uses no other crate of the workspace, so that every crate, including `r6-proto`, can test with it.
//! Every function panics with a message that names the file and the fault: a broken test file is a failed
//! test.
//!
//! Tests that hold the repository together: `tests/layers.rs` (which crate and which file may import which),
//! `tests/book.rs` (every link of the pages leads somewhere), `tests/pains.rs` (each test named in
//! `docs/PAINS.md` exists), `tests/chinese.rs` (the Chinese pages say what the English ones say),
//! `tests/plain.rs` (plain words, short comment lines).

pub mod alloc;
pub mod book;
pub mod coverage;
pub mod hostile;
pub mod imports;
pub mod layers;
#[cfg(unix)]
pub mod postgres;
pub mod transcript;
pub mod vector;
mod workspace;
