//! Commands as a person types them: the arguments are words in the units of people.

use std::fmt;

use super::argument::{self, Argument, Source};
use super::{Command, CommandName};
use crate::grid::Nearest;
use crate::printable::printable;

/// Why words are not valid arguments of a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TypedError {
    /// There are too few or too many words.
    Count {
        /// How many arguments the command takes.
        wanted: usize,
        /// How many of those are optional. They can only be left out together.
        optional: usize,
        /// How many words were given.
        given: usize,
    },
    /// An argument is wrong.
    Argument {
        /// Its name.
        name: &'static str,
        /// What was typed.
        found: String,
        /// What a valid value is.
        wanted: &'static str,
        /// The nearest values that can be sent, if the value lies between two of them.
        nearest: Option<Nearest>,
    },
}

impl fmt::Display for TypedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count { wanted, optional, given } => {
                match wanted {
                    0 => f.write_str("it takes no argument")?,
                    1 => f.write_str("it takes 1 argument")?,
                    _ => write!(f, "it takes {wanted} arguments")?,
                }
                if *optional > 0 {
                    write!(f, ", or {} without the optional ones;", wanted - optional)?;
                } else {
                    f.write_str(",")?;
                }
                write!(f, " {given} given")
            }
            Self::Argument { name, found, wanted, nearest } => {
                write!(f, "{name} is `{}`, but has to be {wanted}", printable(found))?;
                match nearest {
                    Some(nearest) => write!(f, "; nearest: {nearest}"),
                    None => Ok(()),
                }
            }
        }
    }
}

impl std::error::Error for TypedError {}

impl Command<'static> {
    /// Creates the command with these arguments, in the units of the table of commands: `modifyGSPD 5` is 5
    /// %.
    ///
    /// # Errors
    /// [`TypedError`] with the wrong argument, what was typed and what is valid; or with the right number of
    /// arguments.
    pub fn typed(name: CommandName, words: &[impl AsRef<str>]) -> Result<Self, TypedError> {
        let arguments = name.info().arguments;
        let (wanted, given) = (arguments.len(), words.len());
        let optional = arguments.iter().filter(|argument| argument.optional).count();
        // The last argument of a list of registers repeats for each value.
        let more = name == CommandName::RewriteDataList && given > wanted;
        if given != wanted && given + optional != wanted && !more {
            return Err(TypedError::Count { wanted, optional, given });
        }
        Self::take(name, &mut Typed { name, words, number: 0 })
    }
}

struct Typed<'w, W> {
    name: CommandName,
    words: &'w [W],
    number: usize,
}

impl<W: AsRef<str>> Typed<'_, W> {
    fn not_so(&self, number: usize, nearest: Option<(Nearest, &'static str)>) -> TypedError {
        let info = argument::info(self.name.info().arguments, number);
        let (name, wanted) = info.map_or(("?", "?"), |info| (info.name, info.kind.wanted().english()));
        TypedError::Argument {
            name,
            found: self.words.get(number).map_or_else(String::new, |word| word.as_ref().to_owned()),
            wanted: nearest.map_or(wanted, |(_, steps)| steps),
            nearest: nearest.map(|(nearest, _)| nearest),
        }
    }
}

impl<W: AsRef<str>> Source<'static> for Typed<'_, W> {
    type Error = TypedError;

    const FORGIVES: bool = false;

    fn number(&self) -> usize {
        self.number
    }

    fn left(&self) -> usize {
        self.words.len().saturating_sub(self.number)
    }

    fn next(&mut self) -> Result<Argument<'static>, TypedError> {
        let number = self.number;
        self.number += 1;
        let info = argument::info(self.name.info().arguments, number);
        let (Some(info), Some(word)) = (info, self.words.get(number)) else { return Err(self.wrong(number)) };
        info.kind.read_word(word.as_ref()).map_err(|between| self.not_so(number, between))
    }

    fn wrong(&self, number: usize) -> TypedError {
        self.not_so(number, None)
    }
}
