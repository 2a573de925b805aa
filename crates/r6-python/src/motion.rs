//! `Motion`: moves, outputs and waits in order.

use std::collections::HashMap;

use pyo3::exceptions::{PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PySlice;
use r6_client::{StepError, WaitCondition};

use crate::convert::{seconds, word};
use crate::numbers::rows;
use crate::pickling::not_pickled;
use crate::plot::{Keywords, Plot, plotted};
use crate::points::{awaited, output, outputs, pulsed, stopping};
use crate::raising::{Raise, raise};
use crate::units::{AxisPosition, Given, MillimetresPerSecond, Percent, Pose, of_degrees, of_mm_deg};

/// Moves, outputs and waits in order. Every step runs once, unless the motion repeats.
///
/// Each method adds a step, or changes the last one, and returns the motion itself, so that a motion can
/// be written as one chain. A wrong step raises ``StepError`` at once and makes the motion unusable: no
/// part of it is ever sent. At most 100 000 steps.
#[pyclass(module = "r6._r6")]
#[derive(Clone, Default)]
pub struct Motion(pub r6_client::Motion);

type Chain<'py> = PyResult<PyRefMut<'py, Motion>>;

impl Motion {
    /// Adds to the motion. A wrong step raises at once and makes the motion unusable: no part of it is ever
    /// sent.
    fn add<'py>(
        mut slf: PyRefMut<'py, Self>,
        add: impl FnOnce(r6_client::Motion) -> r6_client::Motion,
    ) -> Chain<'py> {
        let motion = std::mem::take(&mut slf.0);
        slf.0 = add(motion);
        let wrong: Option<StepError> = slf.0.instructions().err();
        match wrong {
            Some(error) => Err(error.exception(slf.py())),
            None => Ok(slf),
        }
    }
}

#[pymethods]
impl Motion {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Moves the axes to an ``AxisPosition``, all arriving together (action 4); ``speed`` is a ``Percent``.
    fn axis_move<'py>(
        slf: PyRefMut<'py, Self>,
        to: Given<AxisPosition>,
        speed: Given<Percent>,
    ) -> Chain<'py> {
        Self::add(slf, |motion| motion.axis_move(to.0, speed.0))
    }

    /// Moves the tool straight to a ``Pose`` (action 10); ``speed`` is a ``Percent``, 100 % is 2000 mm/s
    /// (reported).
    fn linear_move<'py>(slf: PyRefMut<'py, Self>, to: Given<Pose>, speed: Given<Percent>) -> Chain<'py> {
        Self::add(slf, |motion| motion.linear_move(to.0, speed.0))
    }

    /// The same at the speed that ``path_speed`` set.
    fn linear_move_at_path_speed<'py>(slf: PyRefMut<'py, Self>, to: Given<Pose>) -> Chain<'py> {
        Self::add(slf, |motion| motion.linear_move_at_path_speed(to.0))
    }

    /// Moves the tool through a middle pose to an end pose (action 17). Begin with a linear move: a
    /// controller accepted a curve without one and did not make it (reported).
    fn curve_move<'py>(
        slf: PyRefMut<'py, Self>,
        through: Given<Pose>,
        to: Given<Pose>,
        speed: Given<Percent>,
    ) -> Chain<'py> {
        Self::add(slf, |motion| motion.curve_move(through.0, to.0, speed.0))
    }

    /// Adds an axis move for each row: shape (n, k), k from 1 to 8 axes, degrees. ``blend``: as in
    /// ``blend``, for each move.
    #[pyo3(signature = (positions, speed, blend=None))]
    fn axis_path<'py>(
        slf: PyRefMut<'py, Self>,
        positions: &Bound<'py, PyAny>,
        speed: Given<Percent>,
        blend: Option<u8>,
    ) -> Chain<'py> {
        let targets = rows(positions)?.iter().map(|row| of_degrees(row)).collect::<PyResult<Vec<_>>>()?;
        Self::add(slf, |motion| {
            targets.into_iter().fold(motion, |motion, to| blended(motion.axis_move(to, speed.0), blend))
        })
    }

    /// Adds a linear move for each row: shape (n, 3), mm, or (n, 6), mm and degrees. ``blend``: as in
    /// ``blend``.
    #[pyo3(signature = (poses, speed, blend=None))]
    fn linear_path<'py>(
        slf: PyRefMut<'py, Self>,
        poses: &Bound<'py, PyAny>,
        speed: Given<Percent>,
        blend: Option<u8>,
    ) -> Chain<'py> {
        let targets = rows(poses)?.iter().map(|row| of_mm_deg(row)).collect::<PyResult<Vec<_>>>()?;
        Self::add(slf, |motion| {
            targets.into_iter().fold(motion, |motion, to| blended(motion.linear_move(to, speed.0), blend))
        })
    }

    /// Rounds the corner after the last step, a move: 0 stops there, 9 rounds most.
    fn blend(slf: PyRefMut<'_, Self>, level: u8) -> Chain<'_> {
        Self::add(slf, |motion| motion.blend(level))
    }

    /// Waits before the last step, a move: seconds, at most a day, in steps of 0.1 s.
    fn delay(slf: PyRefMut<'_, Self>, time: f64) -> Chain<'_> {
        let time = seconds("time", time)?;
        Self::add(slf, |motion| motion.delay(time))
    }

    /// Makes the last step, a move, with this tool frame.
    fn tool(slf: PyRefMut<'_, Self>, number: u32) -> Chain<'_> {
        Self::add(slf, |motion| motion.tool(number))
    }

    /// Makes the last step, a move, in this work frame.
    fn work_frame(slf: PyRefMut<'_, Self>, number: u32) -> Chain<'_> {
        Self::add(slf, |motion| motion.work_frame(number))
    }

    /// Sets the speed of later linear moves without their own speed (action 51).
    fn path_speed<'py>(slf: PyRefMut<'py, Self>, speed: Given<MillimetresPerSecond>) -> Chain<'py> {
        Self::add(slf, |motion| motion.path_speed(speed.0))
    }

    /// Sets an output of the first board, by its name on the pendant: ``"Y010"`` to ``"Y047"``, M, EUY
    /// (action 200).
    fn set_output<'py>(slf: PyRefMut<'py, Self>, point: &str, on: bool) -> Chain<'py> {
        let point = output(point)?;
        Self::add(slf, |motion| motion.set_output(point, on))
    }

    /// Sets an output Y for a time, seconds, then sets it back (action 200, timed).
    fn pulse_output<'py>(slf: PyRefMut<'py, Self>, point: &str, on: bool, time: f64) -> Chain<'py> {
        let (point, time) = (pulsed(point)?, seconds("time", time)?);
        Self::add(slf, |motion| motion.pulse_output(point, on, time))
    }

    /// Sets several outputs of one board at once, by their names on the pendant: ``{"Y010": True, "Y017":
    /// False}``. The board is one of the first two of Y or M: ``"Y1.010"``, ``"M010"`` (action 204). Other
    /// points do not change.
    fn set_board(slf: PyRefMut<'_, Self>, points: HashMap<String, bool>) -> Chain<'_> {
        let outputs = outputs(points)?;
        Self::add(slf, |motion| motion.set_board(outputs))
    }

    /// Waits for a time, seconds, while the arm stands (action 100).
    fn wait(slf: PyRefMut<'_, Self>, time: f64) -> Chain<'_> {
        let time = seconds("time", time)?;
        Self::add(slf, |motion| motion.wait(time))
    }

    /// Waits for ``"X010"``, M or EUX, while the arm stands: at most ``limit`` seconds, without it for
    /// ever (action 100).
    #[pyo3(signature = (point, condition="on", *, limit=None))]
    fn wait_for<'py>(
        slf: PyRefMut<'py, Self>,
        point: &str,
        condition: &str,
        limit: Option<f64>,
    ) -> Chain<'py> {
        const CONDITIONS: [(&str, WaitCondition); 4] = [
            ("on", WaitCondition::On),
            ("off", WaitCondition::Off),
            ("rising", WaitCondition::RisingEdge),
            ("falling", WaitCondition::FallingEdge),
        ];
        let point = awaited(point)?;
        let condition = word("condition", condition, &CONDITIONS)?;
        let limit = limit.map(|limit| seconds("limit", limit)).transpose()?;
        Self::add(slf, |motion| motion.wait_for(point, condition, limit))
    }

    /// Lets an input of the first board, ``"X010"`` to ``"X047"``, stop the motion from here on when it
    /// changes to this state (action 52).
    fn stop_on_input<'py>(slf: PyRefMut<'py, Self>, point: &str, on: bool) -> Chain<'py> {
        let point = stopping(point)?;
        Self::add(slf, |motion| motion.stop_on_input(point, on))
    }

    /// Changes the workbench (action 800).
    fn workbench(slf: PyRefMut<'_, Self>, number: u32) -> Chain<'_> {
        Self::add(slf, |motion| motion.workbench(number))
    }

    /// Keeps every step so far in the controller's list, so that the list starts over after its end until
    /// the arm is stopped. Such a motion has to fit into the list as a whole (``RunOptions.room``).
    /// ``MotionHandle.finished`` then ends only with an error: call ``MotionHandle.stop`` before the end
    /// of a ``with`` block. The motion also continues if this program dies.
    fn repeat(slf: PyRefMut<'_, Self>) -> Chain<'_> {
        Self::add(slf, r6_client::Motion::repeat)
    }

    /// Whether a step stays in the controller's list, so that the motion has no end of its own.
    #[getter]
    fn repeats(&self) -> bool {
        self.0.repeats()
    }

    /// Adds the steps of another motion.
    fn extend<'py>(slf: PyRefMut<'py, Self>, other: &Bound<'py, PyAny>) -> Chain<'py> {
        let other = if other.as_ptr() == slf.as_ptr() {
            slf.0.clone()
        } else {
            let other =
                other.cast::<Self>().map_err(|_| PyTypeError::new_err("only a Motion can be appended"))?;
            other.borrow().0.clone()
        };
        raise(slf.py(), other.instructions())?;
        Self::add(slf, |motion| motion.extend(&other))
    }

    /// Plays the motion on a virtual controller and draws it. No robot is asked, and no time passes. A
    /// motion that repeats is played once. Inputs are off.
    ///
    /// - ``model`` (``"BRTIRUS0707A"``), ``profile`` (``"hc1"``): a name or a path, as for ``Simulator``.
    /// - ``global_speed`` (100 %): at least 0.1 %.
    /// - ``start``: where the axes stand before it; 0 for those that are not named.
    ///
    /// An alarm, or a wait for a signal that never comes, ends the picture: ``Plot.trouble`` says which.
    ///
    /// Errors: ``SimulatorError`` if the model or the profile is wrong; ``ValueError`` if the motion cannot
    /// be played: more than 10 000 steps, a start out of reach, a step that this firmware does not know.
    #[pyo3(signature = (*, model=None, profile=None, global_speed=None, start=None))]
    fn plot(
        &self,
        py: Python<'_>,
        model: Option<&Bound<'_, PyAny>>,
        profile: Option<&Bound<'_, PyAny>>,
        global_speed: Option<Given<Percent>>,
        start: Option<Given<AxisPosition>>,
    ) -> PyResult<Plot> {
        plotted(py, &self.0, false, "motion", &Keywords { model, profile, global_speed, start })
    }

    fn __copy__(&self) -> Self {
        self.clone()
    }

    fn __deepcopy__(&self, _memo: &Bound<'_, PyAny>) -> Self {
        self.clone()
    }

    fn __reduce__(&self) -> PyResult<()> {
        Err(not_pickled("Motion"))
    }

    /// One step, or a slice of steps, as a motion of its own. A slice has a step of 1. A path speed that was
    /// set before the slice is not in it; a move that needs one is a ``StepError`` then.
    fn __getitem__(&self, wanted: &Bound<'_, PyAny>) -> PyResult<Self> {
        let length = self.0.len();
        if let Ok(slice) = wanted.cast::<PySlice>() {
            let indices = slice.indices(isize::try_from(length)?)?;
            if indices.step != 1 {
                return Err(PyTypeError::new_err("a motion is cut without leaving steps out: motion[2:5]"));
            }
            let (start, stop) = (usize::try_from(indices.start)?, usize::try_from(indices.stop)?);
            return Ok(Self(self.0.part(start..stop)));
        }
        let index: isize =
            wanted.extract().map_err(|_| PyTypeError::new_err("write motion[2] or motion[2:5]"))?;
        let counted = if index < 0 { length.checked_add_signed(index) } else { usize::try_from(index).ok() };
        match counted.filter(|index| *index < length) {
            Some(index) => Ok(Self(self.0.part(index..=index))),
            None => Err(PyIndexError::new_err(format!("the motion has {length} steps"))),
        }
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        let count = self.0.len();
        format!("<Motion of {count} step{}>", if count == 1 { "" } else { "s" })
    }
}

fn blended(motion: r6_client::Motion, blend: Option<u8>) -> r6_client::Motion {
    match blend {
        Some(level) => motion.blend(level),
        None => motion,
    }
}
