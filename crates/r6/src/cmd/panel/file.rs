//! A program that a person loads out of a file.

use std::path::PathBuf;

use super::Wish;
use crate::cmd::sim::given;
use crate::exit::Failure;

/// The program of a file. It is read here first: mistakes are told with their lines.
pub(super) fn load(file: PathBuf, name: Option<String>) -> Result<Wish, Failure> {
    if name.as_deref() == Some("") {
        return Err(Failure::usage("--name: a program's name has 1 to 64 bytes"));
    }
    let program = given::program(&file, name.as_deref())?;
    Ok(Wish::Load { file, name: program.name().to_owned(), text: program.text().to_owned() })
}
