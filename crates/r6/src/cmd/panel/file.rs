//! Loads a program from a file.

use std::path::PathBuf;

use super::Wish;
use crate::cmd::sim::given;
use crate::exit::Failure;

/// Reads the program of a file. Reading it here reports mistakes with their lines.
pub(super) fn load(file: PathBuf, name: Option<String>) -> Result<Wish, Failure> {
    if name.as_deref() == Some("") {
        return Err(Failure::usage("--name: a program's name has 1 to 64 bytes"));
    }
    let program = given::program(&file, name.as_deref())?;
    Ok(Wish::Load { file, name: program.name().to_owned(), text: program.text().to_owned() })
}
