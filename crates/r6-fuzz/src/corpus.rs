//! The stored inputs: `fuzz/corpus/<target>` to begin with, and `fuzz/regressions/<target>` with those that
//! once broke a promise.

use std::fs;
use std::path::{Path, PathBuf};

/// The folder `fuzz` of this repository.
#[must_use]
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz")
}

/// The files of `corpus` or `regressions` for a target, in the order of their names; empty if the folder does
/// not exist.
#[must_use]
pub fn files(kind: &str, target: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder().join(kind).join(target)) else { return Vec::new() };
    let mut files: Vec<_> =
        entries.flatten().map(|entry| entry.path()).filter(|path| path.is_file()).collect();
    files.sort();
    files
}

/// The bytes of a file.
#[must_use]
pub fn read(path: &Path) -> Vec<u8> {
    fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}
