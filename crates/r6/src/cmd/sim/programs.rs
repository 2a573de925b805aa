//! The taught programs that a virtual controller is given.

use std::path::Path;

use r6_controller::program::MAX_TEXT_BYTES;
use r6_controller::settings::REMOTE_MOLD;
use r6_controller::{Library, LibraryError, Program};

use crate::text_file;

/// A program that a user names: one that every controller has, or one out of a file.
#[derive(Clone, Debug)]
pub enum Given {
    /// It is there already.
    Shipped(String),
    /// It has to be loaded.
    File(Program),
}

impl Given {
    fn name(&self) -> &str {
        match self {
            Self::Shipped(name) => name,
            Self::File(program) => program.name(),
        }
    }
}

/// The program of this name, or of this file; a file's program is called as the file is, without its ending.
pub fn read(text: &str) -> Result<Given, String> {
    let library = Library::default();
    if library.named(text).is_some() {
        return Ok(Given::Shipped(text.to_owned()));
    }
    let path = Path::new(text);
    if !path.extension().is_some_and(|extension| extension == "toml" || extension == "json") {
        return Err(match r6_proto::nearest(text, library.names()) {
            Some(near) => format!("there is no such program; nearest: `{near}`"),
            None => {
                let names: Vec<_> = library.names().collect();
                format!("there is no such program; there are: {}, or a .toml or .json file", names.join(", "))
            }
        });
    }
    let content = text_file::read(path, "a program", MAX_TEXT_BYTES)?;
    let name = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    Program::read(name, &content).map(Given::File).map_err(|error| error.to_string())
}

/// A library with these programs besides those that every controller has, and the one that runs.
pub fn library(given: Vec<Given>) -> Result<(Library, String), String> {
    let mut library = Library::default();
    let mold = given.first().map_or(REMOTE_MOLD, Given::name).to_owned();
    for program in given {
        if let Given::File(program) = program {
            library.insert(program).map_err(|error: LibraryError| error.to_string())?;
        }
    }
    if let Some((name, missing)) =
        library.programs().find_map(|program| Some((program.name(), library.missing_call(program)?)))
    {
        return Err(format!("program `{name}`: {missing}; give its file with another --program"));
    }
    Ok((library, mold))
}
