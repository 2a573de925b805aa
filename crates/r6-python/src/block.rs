//! The `with` block of a motion and of a target that is followed: native, for no signal comes through between its lines.

use pyo3::exceptions::PyBaseException;
use pyo3::prelude::*;

use crate::following::FollowCore;
use crate::handle::MotionCore;
use crate::operation::{Operation, Waited};
use crate::outcome;

/// What runs.
#[derive(FromPyObject)]
enum Owner {
    Motion(Py<MotionCore>),
    Follow(Py<FollowCore>),
}

/// How a motion that runs and a target that is followed end.
///
/// A signal that came between two lines of Python at the end of a block would leave an arm in motion behind.
#[pyclass(frozen, subclass, generic, module = "r6._r6")]
pub struct Block {
    owner: Owner,
}

impl Block {
    fn finished(&self) -> PyResult<Operation> {
        match &self.owner {
            Owner::Motion(core) => core.get().finished(),
            Owner::Follow(core) => core.get().finished(),
        }
    }

    fn stop(&self) -> PyResult<Operation> {
        match &self.owner {
            Owner::Motion(core) => core.get().stop(),
            Owner::Follow(core) => core.get().stop(),
        }
    }

    fn stop_asked(&self) -> bool {
        match &self.owner {
            Owner::Motion(core) => core.get().stop_asked(),
            Owner::Follow(core) => core.get().stop_asked(),
        }
    }

    /// Stops the arm, however often a signal comes meanwhile, and tells the exception what became of it.
    fn stop_for(&self, error: &Bound<'_, PyBaseException>) -> PyResult<()> {
        let py = error.py();
        let core = self.core(py);
        let core = Some(core.bind(py));
        let insisted = self.stop()?.insist(py)?;
        if let Some(raised) = insisted.raised {
            // What came meanwhile goes on in place of the first, which is its context; both know what became of the arm.
            let report = insisted.outcome.as_ref().map(Bound::clone).map_err(|error| error.clone_ref(py));
            outcome::tell(core, error, report)?;
            outcome::tell(core, raised.value(py), insisted.outcome)?;
            outcome::in_the_course_of(py, &raised, error)?;
            return Err(raised);
        }
        outcome::tell(core, error, insisted.outcome)
    }
}

#[pymethods]
impl Block {
    #[new]
    fn new(core: Owner) -> Self {
        Self { owner: core }
    }

    #[getter(_core)]
    fn core(&self, py: Python<'_>) -> Py<PyAny> {
        match &self.owner {
            Owner::Motion(core) => core.clone_ref(py).into_any(),
            Owner::Follow(core) => core.clone_ref(py).into_any(),
        }
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    fn __exit__(
        &self,
        py: Python<'_>,
        _kind: &Bound<'_, PyAny>,
        error: Option<&Bound<'_, PyBaseException>>,
        _traceback: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        if let Some(error) = error {
            return self.stop_for(error);
        }
        match self.finished()?.waited(py)? {
            Waited::Made(Err(error))
                if self.stop_asked() && outcome::is_end_by_stop(py, error.value(py))? =>
            {
                Ok(())
            }
            Waited::Made(done) => done.map(drop),
            Waited::Raised(interrupt) => {
                self.stop_for(interrupt.value(py))?;
                Err(interrupt)
            }
        }
    }
}
