//! What `r6 run` reads: the instructions of a file, in TOML or as the AddRCC frames of the manual.

mod json;
pub mod lines;
mod toml;

use r6_proto::message::Instruction;
use r6_proto::message::instruction::Coordinates;
use r6_proto::{AXES, AxisIndex, AxisMask};

/// The largest program file that is read, bytes: far more than any list of instructions, and little enough for memory.
pub const MAX_FILE_BYTES: usize = 16 * 1024 * 1024;

/// Instructions that go out together.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// Whether they replace the list; else they are appended.
    pub replace: bool,
    /// The instructions.
    pub instructions: Vec<Instruction>,
}

/// What a file says.
#[derive(Debug, PartialEq)]
pub struct ProgramFile {
    /// Its frames.
    pub batches: Vec<Batch>,
    /// What the reader of the file should know: odd spellings, unknown keys.
    pub remarks: Vec<String>,
}

/// What is wrong with a file, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    /// Line and column, counted from 1; `None` where the whole file is meant.
    pub at: Option<(usize, usize)>,
    /// What is wrong there.
    pub what: String,
    /// What to do about it.
    pub advice: Option<String>,
}

impl std::fmt::Display for FileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.at {
            Some((line, column)) => write!(f, "{line}:{column}: {}", self.what),
            None => write!(f, " {}", self.what),
        }
    }
}

impl std::error::Error for FileError {}

impl ProgramFile {
    /// Reads AddRCC frames, one behind the other, with `//` comments.
    ///
    /// # Errors
    /// [`FileError`] says where the text is wrong and what is due there.
    pub fn from_json(text: &str) -> Result<Self, FileError> {
        json::read(text)
    }

    /// Reads a list of `[[instruction]]` tables.
    ///
    /// # Errors
    /// [`FileError`] says where the text is wrong and what is due there.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        toml::read(text)
    }

    /// Lets a list that repeats run only once.
    pub fn run_once(&mut self) {
        let steps = self.batches.iter_mut().flat_map(|batch| &mut batch.instructions);
        steps.for_each(|step| step.oneshot = true);
    }
}

/// The mask of the first so many axes.
#[must_use]
pub fn first_axes(count: usize) -> AxisMask {
    AxisIndex::ALL.into_iter().take(count).fold(AxisMask::NONE, AxisMask::with)
}

/// All eight coordinates, 0 for those that are not given: a controller that wants all of them was reported (unit A),
/// and the mask keeps the others where they are.
#[must_use]
pub fn eight(given: &[f64]) -> Coordinates {
    let mut values = [0.0; AXES];
    for (slot, value) in values.iter_mut().zip(given) {
        *slot = *value;
    }
    Coordinates::from_slice(&values)
}
