//! Test equipment of the workspace, a dev-dependency only.
//!
//! It knows no other crate of the workspace, so that every one of them, `r6-proto` included, can test with
//! it. Everything here panics with a message that names the file and the fault: a broken test file is a
//! failed test.

pub mod alloc;
pub mod book;
pub mod coverage;
pub mod hostile;
pub mod imports;
pub mod layers;
pub mod transcript;
pub mod vector;
mod workspace;
