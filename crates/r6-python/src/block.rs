//! The `with` block of a running motion and of a followed target. It is native code, so that no signal
//! handler runs between its lines.

use pyo3::exceptions::PyBaseException;
use pyo3::prelude::*;

use crate::following::FollowCore;
use crate::handle::MotionCore;
use crate::operation::{Operation, Waited};
use crate::outcome;

/// The owner of the block.
#[derive(FromPyObject)]
enum Owner {
    Motion(Py<MotionCore>),
    Follow(Py<FollowCore>),
}

/// The end of a running motion and of a followed target, as a ``with`` block. It is native code, so that
/// no signal handler runs between its lines.
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

    /// Stops the arm through all signals, and adds the result to the exception.
    fn stop_for(&self, error: &Bound<'_, PyBaseException>) -> PyResult<()> {
        let py = error.py();
        let core = self.core(py);
        let core = Some(core.bind(py));
        let insisted = self.stop()?.insist(py)?;
        if let Some(raised) = insisted.raised {
            // An exception raised during the stop replaces the first one, which becomes its context. Both
            // carry the result of the stop.
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
