//! Reads the parts of a virtual controller: built-in parts by name, or files.

use std::path::Path;
use std::sync::Arc;

use r6_controller::program::MAX_TEXT_BYTES;
use r6_controller::settings::REMOTE_MOLD;
use r6_controller::{Library, Program, RobotModel, Scenario};
use r6_controller::{LibraryError, Profile};

use crate::exit::Failure;
use crate::{output, text_file};

/// The longest file of a profile or a robot model. They have some kilobytes.
const MAX_FILE_BYTES: usize = 256 * 1024;

/// Reads a text file that an option names. `what` names its content in the error.
fn text(path: &Path, what: &str, most: usize) -> Result<String, Failure> {
    text_file::read(path, what, most).map_err(|problem| Failure::usage(problem).while_doing(path.display()))
}

/// Whether an option names a file, by its extension.
pub fn is_file(text: &str, endings: &[&str]) -> bool {
    let ending = Path::new(text).extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| endings.contains(&ending))
}

/// The failure for an unknown name.
fn no_such(what: &str, name: &str, known: &[&'static str], files: &str) -> Failure {
    let failure = Failure::usage(format!("there is no {what} `{name}`"));
    match r6_proto::nearest(name, known.iter().copied()) {
        Some(near) => failure.advise(format!("nearest: `{near}`")),
        None => failure.advise(format!("there are: {}, or {files}", known.join(", "))),
    }
}

/// The profile of this name, or of this file.
///
/// # Errors
/// There is no such profile, or the file is wrong. The error names all places, and what is expected there.
pub fn profile(name: &str) -> Result<Profile, Failure> {
    if let Some(profile) = Profile::named(name) {
        return Ok(profile);
    }
    if !is_file(name, &["toml"]) {
        return Err(no_such("profile", name, &Profile::names(), "a .toml file"));
    }
    let file = text(Path::new(name), "a profile", MAX_FILE_BYTES)?;
    Profile::from_toml(&file).map_err(|mistakes| Failure::in_file(name, &mistakes))
}

/// The robot model of this name, or of this file.
///
/// # Errors
/// There is no such model, or the file is wrong. The error names all places, and what is expected there.
pub fn model(name: &str) -> Result<RobotModel, Failure> {
    if let Some(model) = RobotModel::named(name) {
        return Ok(model.clone());
    }
    if !is_file(name, &["toml"]) {
        let names: Vec<_> = RobotModel::names().collect();
        return Err(no_such("robot model", name, &names, "a .toml file"));
    }
    let file = text(Path::new(name), "a robot model", MAX_FILE_BYTES)?;
    RobotModel::from_toml(&file).map_err(|mistakes| Failure::in_file(name, &mistakes))
}

/// The scenario of this file.
///
/// # Errors
/// The file is wrong. The error names all places, and what is expected there.
pub fn scenario(path: &Path) -> Result<Arc<Scenario>, Failure> {
    let file = text(path, "a scenario", r6_controller::scenario::MAX_TEXT_BYTES)?;
    let name = path.display().to_string();
    Scenario::read(&file).map(Arc::new).map_err(|mistakes| Failure::in_file(&name, &mistakes))
}

/// The taught program of this file, with its text. Its name is `name`, or the file's name without its
/// extension.
///
/// # Errors
/// The file is wrong. The error names all places, and what is expected there.
pub fn program(path: &Path, name: Option<&str>) -> Result<Program, Failure> {
    let file = text(path, "a program", MAX_TEXT_BYTES)?;
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    program_of(&file, name.unwrap_or(stem), &path.display().to_string())
}

/// The taught program of this text. Messages name the file as `shown`.
///
/// # Errors
/// The text is wrong. The error names all places, and what is expected there.
pub fn program_of(text: &str, name: &str, shown: &str) -> Result<Program, Failure> {
    let program = Program::read(name, text).map_err(|mistakes| Failure::in_file(shown, &mistakes))?;
    if let Some(hint) = program.hint() {
        output::note(format_args!("r6: {shown}:{hint}"));
    }
    Ok(program)
}

/// A library with the built-in programs and these, and the name of the program that runs: the first of these.
///
/// # Errors
/// There is no such program, a file is wrong, or a program calls a program that does not exist.
pub fn library(given: &[String]) -> Result<(Library, String), Failure> {
    let mut library = Library::default();
    let mut mold = None;
    for name in given {
        let shipped = Library::default();
        let name = if shipped.named(name).is_some() {
            name.clone()
        } else if is_file(name, &["toml", "json"]) {
            let program = program(Path::new(name), None)?;
            let name = program.name().to_owned();
            library.insert(program).map_err(|error: LibraryError| Failure::usage(error))?;
            name
        } else {
            let names: Vec<_> = Library::shipped().map(|(name, _)| name).collect();
            return Err(no_such("program", name, &names, "a .toml or .json file"));
        };
        mold.get_or_insert(name);
    }
    let missing =
        library.programs().find_map(|program| Some((program.name(), library.missing_call(program)?)));
    if let Some((name, missing)) = missing {
        let failure = Failure::usage(format!("program `{name}`: {missing}"));
        return Err(failure.advise("give its file with another --program"));
    }
    Ok((library, mold.unwrap_or_else(|| REMOTE_MOLD.to_owned())))
}
