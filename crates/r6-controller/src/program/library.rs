//! The programs of one controller (`moldList`).

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

use r6_program::Mistakes;

use super::Program;

/// The most programs of one controller. Pendants list some dozen.
pub const MAX_PROGRAMS: usize = 200;

/// The most text of programs that an operator loads at the machine: bytes of all programs together. As JSON,
/// with two bytes for each quote and line end, that is a file that is written in a moment.
pub const MAX_LOADED_BYTES: usize = 2 << 20;

/// The programs that come with every virtual controller: name, text.
const SHIPPED: [(&str, &str); 6] = [
    ("default", include_str!("../../programs/default.toml")),
    ("palletise", include_str!("../../programs/palletise.toml")),
    ("pick-and-place", include_str!("../../programs/pick-and-place.toml")),
    ("register-follow", include_str!("../../programs/register-follow.toml")),
    ("register-move", include_str!("../../programs/register-move.toml")),
    ("remote", include_str!("../../programs/remote.toml")),
];

/// Programs by name.
#[derive(Clone, Debug, PartialEq)]
pub struct Library {
    programs: BTreeMap<String, Arc<Program>>,
}

impl Default for Library {
    /// The programs that come with every virtual controller.
    fn default() -> Self {
        let mut library = Self::empty();
        for (name, text) in SHIPPED {
            // A test makes sure that no file is dropped here.
            if let Ok(program) = Program::read(name, text) {
                library.programs.insert(name.to_owned(), Arc::new(program));
            }
        }
        library
    }
}

impl Library {
    /// A library without programs.
    #[must_use]
    pub const fn empty() -> Self {
        Self { programs: BTreeMap::new() }
    }

    /// The names and texts of the programs that come with every virtual controller.
    pub fn shipped() -> impl Iterator<Item = (&'static str, &'static str)> {
        SHIPPED.into_iter()
    }

    /// Adds a program, and replaces one with the same name.
    ///
    /// # Errors
    /// [`LibraryError::Full`].
    pub fn insert(&mut self, program: Program) -> Result<(), LibraryError> {
        let known = self.programs.contains_key(program.name());
        if !known && self.programs.len() >= MAX_PROGRAMS {
            return Err(LibraryError::Full);
        }
        self.programs.insert(program.name().to_owned(), Arc::new(program));
        Ok(())
    }

    /// Reads a program and adds it.
    ///
    /// # Errors
    /// [`LibraryError`] says what is wrong with the text, or that the library is full.
    pub fn load(&mut self, name: &str, text: &str) -> Result<(), LibraryError> {
        let program = Program::read(name, text)
            .map_err(|mistakes| LibraryError::Program { name: name.to_owned(), mistakes: mistakes.into() })?;
        self.insert(program)
    }

    /// The program with this name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<&Arc<Program>> {
        self.programs.get(name)
    }

    /// The names, in alphabetical order: `moldList`.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.programs.keys().map(String::as_str)
    }

    /// The programs, in the order of their names.
    pub fn programs(&self) -> impl Iterator<Item = &Program> {
        self.programs.values().map(|program| &**program)
    }

    /// Whether this is an unchanged program that comes with every virtual controller.
    #[must_use]
    pub fn is_shipped(program: &Program) -> bool {
        SHIPPED.contains(&(program.name(), program.text()))
    }

    /// Whether two names are the same program, or the first may call the second, directly or through others.
    #[must_use]
    pub fn reaches(&self, from: &str, name: &str) -> bool {
        let mut seen = BTreeSet::new();
        let mut next = vec![from];
        while let Some(at) = next.pop() {
            if at == name {
                return true;
            }
            if seen.insert(at) {
                next.extend(self.named(at).into_iter().flat_map(|program| program.calls()));
            }
        }
        false
    }

    /// The first call of a program to a missing program, with the nearest existing name.
    #[must_use]
    pub fn missing_call(&self, program: &Program) -> Option<String> {
        let missing = program.calls().find(|name| !self.programs.contains_key(*name))?;
        let near = r6_proto::nearest(missing, self.names());
        let hint = near.map(|near| format!("; nearest: `{near}`")).unwrap_or_default();
        Some(format!("it calls `{missing}`, which is not there{hint}"))
    }
}

/// Why a program was not added.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LibraryError {
    /// Its text is wrong.
    Program {
        /// The name of the program.
        name: String,
        /// The mistakes, with their places.
        mistakes: Box<Mistakes>,
    },
    /// The library is full.
    Full,
}

impl fmt::Display for LibraryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Program { name, mistakes } => write!(f, "program `{name}`: {mistakes}"),
            Self::Full => write!(f, "there are {MAX_PROGRAMS} programs already"),
        }
    }
}

impl std::error::Error for LibraryError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Program { mistakes, .. } => Some(&**mistakes),
            Self::Full => None,
        }
    }
}
