//! What `r6 run` sends: the lists of a motion program, ready to be cut into frames.

mod batch;

pub use batch::{BadStep, Batch, MAX_FRAME_BYTES, cut};
pub use r6_program::{MAX_FILE_BYTES, Mistake, Mistakes, eight, first_axes};

use r6_program::{MotionList, MotionProgram};

/// What a file says.
#[derive(Debug, PartialEq)]
pub struct ProgramFile {
    /// Its frames.
    pub batches: Vec<Batch>,
    /// What the reader of the file should know: odd spellings, unknown keys.
    pub remarks: Vec<String>,
}

impl From<MotionProgram> for ProgramFile {
    fn from(program: MotionProgram) -> Self {
        let batch = |MotionList { replace, instructions }| Batch { replace, instructions };
        Self { batches: program.lists.into_iter().map(batch).collect(), remarks: program.remarks }
    }
}

impl ProgramFile {
    /// Reads AddRCC frames, one behind the other, with `//` comments.
    ///
    /// # Errors
    /// [`Mistakes`] say where the text is wrong and what is due there.
    pub fn from_json(text: &str) -> Result<Self, Mistakes> {
        MotionProgram::from_json(text).map(Self::from)
    }

    /// Reads a list of `[[instruction]]` tables.
    ///
    /// # Errors
    /// [`Mistakes`] say where the text is wrong and what is due there.
    pub fn from_toml(text: &str) -> Result<Self, Mistakes> {
        MotionProgram::from_toml(text).map(Self::from)
    }

    /// Lets a list that repeats run only once.
    pub fn run_once(&mut self) {
        let steps = self.batches.iter_mut().flat_map(|batch| &mut batch.instructions);
        steps.for_each(|step| step.oneshot = true);
    }
}
