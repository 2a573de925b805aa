//! A program that a person loads out of a file.

use std::io::Read;
use std::path::{Path, PathBuf};

use r6_controller::program::MAX_TEXT_BYTES;

use super::Wish;
use crate::exit::Failure;

/// The program of a file; whether it is one, the controller says.
pub(super) fn load(file: PathBuf, name: Option<String>) -> Result<Wish, Failure> {
    let text = read_program(&file).map_err(|problem| Failure::usage(problem).while_doing(file.display()))?;
    let stem = || file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = name.or_else(stem).unwrap_or_default();
    if name.is_empty() {
        return Err(Failure::usage("--name: a program's name has 1 to 64 bytes"));
    }
    Ok(Wish::Load { file, name, text })
}

fn read_program(file: &Path) -> Result<String, String> {
    let unread = |error: std::io::Error| format!("the file cannot be read: {error}");
    // One byte more than is possible tells that it is too long.
    let most = u64::try_from(MAX_TEXT_BYTES).unwrap_or(u64::MAX);
    let mut text = String::new();
    std::fs::File::open(file).map_err(unread)?.take(most + 1).read_to_string(&mut text).map_err(unread)?;
    if text.len() > MAX_TEXT_BYTES {
        return Err(format!("the file is too long: a program has {MAX_TEXT_BYTES} bytes at most"));
    }
    Ok(text)
}
