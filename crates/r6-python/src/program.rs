//! `Program`: a motion from a file of `r6 run`.

use std::io::Read;
use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_program::{MAX_FILE_BYTES, MotionList, MotionProgram};

use crate::errors::wrong_file;
use crate::motion::Motion;
use crate::pickling::not_pickled;
use crate::plot::{Keywords, Plot, plotted};
use crate::units::{AxisPosition, Given, Percent};

/// The name of a text without a file, in errors.
const NO_FILE: &str = "<text>";

/// A motion from a file of ``r6 run``: TOML (``[[instruction]]`` tables), or AddRCC frames in JSON.
///
/// ::
///
///     program = r6.Program.load("square.toml")
///     robot.run(program.motion, r6.RunOptions(append=program.append)).finished()
#[pyclass(frozen, module = "r6._r6")]
pub struct Program {
    /// What a picture calls it.
    name: String,
    motion: r6_client::Motion,
    append: bool,
    remarks: Vec<String>,
}

impl Program {
    fn of(py: Python<'_>, file: &str, name: String, text: &str) -> PyResult<Self> {
        let program =
            MotionProgram::read(text).map_err(|mistakes| wrong_file(py, "FileError", file, &mistakes))?;
        let append = program.lists.first().is_some_and(|list| !list.replace);
        Ok(Self { name, append, motion: in_frames(program.lists), remarks: program.remarks })
    }
}

/// The steps; each list begins a new frame.
fn in_frames(lists: Vec<MotionList>) -> r6_client::Motion {
    lists.into_iter().fold(r6_client::Motion::new(), |motion, list| {
        motion.begin_frame().extend(&r6_client::Motion::of_list(list.instructions))
    })
}

#[pymethods]
impl Program {
    /// Reads a file of at most 16 MiB.
    ///
    /// Errors: ``FileError`` with every mistake, its line and its column; ``OSError`` and ``ValueError``
    /// if it cannot be read.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let mut text = String::new();
        // Reading one byte more than allowed shows that the file is too long. A path may lead to a device
        // without an end.
        let most = u64::try_from(MAX_FILE_BYTES).unwrap_or(u64::MAX).saturating_add(1);
        std::fs::File::open(&path)?.take(most).read_to_string(&mut text)?;
        let name = path.display().to_string();
        if text.len() > MAX_FILE_BYTES {
            let what = format!("{name} is too long: a program has {MAX_FILE_BYTES} bytes at most");
            return Err(PyValueError::new_err(what));
        }
        let title = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        Self::of(py, &name, title, &text)
    }

    /// Reads a text. Errors: ``FileError``.
    #[staticmethod]
    fn read(py: Python<'_>, text: &str) -> PyResult<Self> {
        Self::of(py, NO_FILE, "program".to_owned(), text)
    }

    /// Its steps, as a copy: changing it does not change the program. It repeats if the file says so.
    #[getter]
    fn motion(&self) -> Motion {
        Motion(self.motion.clone())
    }

    /// Whether the file says to append to the list: for ``RunOptions.append``.
    #[getter]
    fn append(&self) -> bool {
        self.append
    }

    /// Remarks for the author of the file: older spellings, keys without a meaning.
    #[getter]
    fn remarks(&self) -> Vec<String> {
        self.remarks.clone()
    }

    /// Plays it on a virtual controller and draws it, as ``Motion.plot`` does.
    #[pyo3(signature = (*, model=None, profile=None, global_speed=None, start=None))]
    fn plot(
        &self,
        py: Python<'_>,
        model: Option<&Bound<'_, PyAny>>,
        profile: Option<&Bound<'_, PyAny>>,
        global_speed: Option<Given<Percent>>,
        start: Option<Given<AxisPosition>>,
    ) -> PyResult<Plot> {
        let keywords = Keywords { model, profile, global_speed, start };
        plotted(py, &self.motion, self.append, &self.name, &keywords)
    }

    fn __len__(&self) -> usize {
        self.motion.len()
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(not_pickled("Program"))
    }

    fn __repr__(&self) -> String {
        let count = self.motion.len();
        format!("<Program of {count} step{}>", if count == 1 { "" } else { "s" })
    }
}
