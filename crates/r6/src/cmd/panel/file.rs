//! A program that a person loads out of a file.

use std::path::PathBuf;

use r6_controller::program::MAX_TEXT_BYTES;

use super::Wish;
use crate::exit::Failure;
use crate::text_file;

/// The program of a file; whether it is one, the controller says.
pub(super) fn load(file: PathBuf, name: Option<String>) -> Result<Wish, Failure> {
    let text = text_file::read(&file, "a program", MAX_TEXT_BYTES)
        .map_err(|problem| Failure::usage(problem).while_doing(file.display()))?;
    let stem = || file.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let name = name.or_else(stem).unwrap_or_default();
    if name.is_empty() {
        return Err(Failure::usage("--name: a program's name has 1 to 64 bytes"));
    }
    Ok(Wish::Load { file, name, text })
}
