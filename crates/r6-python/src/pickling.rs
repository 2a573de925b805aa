//! Pickles values, for another process and for copies: what pickle stores of a native object, and how it is
//! made again.
//!
//! A value comes back equal, to the last bit. Objects that belong to a connection cannot be pickled.

use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use r6_client::IoPoint;
use r6_client::units::AxisCoordinate;
use r6_proto::message::Command as Sent;

use crate::command::Command;
use crate::handle::Progress;
use crate::units::{AxisPosition, Degrees, Millimetres, axis, coordinate, of_mm_deg};

/// A callable and its arguments: a class, or `remade`.
pub type Reduced<'py> = PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)>;

/// The error for a class that is built step by step and has no form that another process could read.
pub fn not_pickled(class: &str) -> PyErr {
    PyTypeError::new_err(format!("a {class} cannot be pickled: put it together in the process that uses it"))
}

/// The arguments with which `remade` makes an object of this kind.
fn reduced<'py>(py: Python<'py>, kind: &str, state: impl IntoPyObject<'py>) -> Reduced<'py> {
    let state = state.into_bound_py_any(py)?;
    let arguments = (kind, state).into_pyobject(py)?;
    Ok((py.import("r6._r6")?.getattr("remade")?, arguments))
}

/// Makes an object of this package again from its pickled state.
#[pyfunction]
pub fn remade<'py>(py: Python<'py>, kind: &str, state: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    match kind {
        "Progress" => {
            let (total, left, accepted, done, ended) = state.extract()?;
            Progress(r6_client::Progress { total, left, accepted, done, ended }).into_bound_py_any(py)
        }
        "AxisPosition" => {
            let mut position = r6_client::units::AxisPosition::none();
            for named in state.try_iter()? {
                let (number, to): (u8, Bound<'_, PyAny>) = named?.extract()?;
                position = position.with(axis(number)?, coordinate(&to)?);
            }
            AxisPosition(position).into_bound_py_any(py)
        }
        "Pose" => crate::units::Pose(of_mm_deg(&state.extract::<Vec<f64>>()?)?).into_bound_py_any(py),
        "Command" => {
            let (name, arguments, named): (String, Bound<'_, PyTuple>, Bound<'_, PyDict>) =
                state.extract()?;
            py.get_type::<Command>().call_method(name.as_str(), arguments, Some(&named))
        }
        other => Err(PyValueError::new_err(format!("nothing of r6 is called {other}"))),
    }
}

impl Progress {
    /// For pickle.
    pub fn reduced<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        let r6_client::Progress { total, left, accepted, done, ended } = self.0;
        reduced(py, "Progress", (total, left, accepted, done, ended))
    }
}

impl AxisPosition {
    /// For pickle.
    pub fn reduced<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        let mut named = Vec::new();
        for axis in self.0.mask().axes() {
            let to = match self.0.at(axis) {
                Some(AxisCoordinate::Degrees(angle)) => Degrees(angle).into_bound_py_any(py)?,
                Some(AxisCoordinate::Millimetres(length)) => Millimetres(length).into_bound_py_any(py)?,
                None => continue,
            };
            named.push((axis.index(), to));
        }
        reduced(py, "AxisPosition", named)
    }
}

impl crate::units::Pose {
    /// For pickle.
    pub fn reduced<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        let place = self.0.place().map(|length| length.value());
        let turn = self.0.turn().map(|turn| turn.map(|angle| angle.value()));
        let values: Vec<f64> = place.into_iter().chain(turn.into_iter().flatten()).collect();
        reduced(py, "Pose", values)
    }
}

impl Command {
    /// For pickle: the constructor and its arguments.
    pub fn reduced<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        let named = PyDict::new(py);
        let made =
            |name: &'static str, arguments: PyResult<Bound<'py, PyTuple>>| Ok::<_, PyErr>((name, arguments?));
        let none = || Ok(PyTuple::empty(py));
        let (name, arguments) = match &self.0 {
            Sent::ActionStop => made("action_stop", none()),
            Sent::ActionPause => made("action_pause", none()),
            Sent::ActionSingleCycle => made("action_single_cycle", none()),
            Sent::StartButton => made("start_button", none()),
            Sent::StopButton => made("stop_button", none()),
            Sent::SwitchMold { mold } => made("switch_mold", (mold.as_ref(),).into_pyobject(py)),
            Sent::ModifyCounter { id, current, target } => {
                named.set_item("current", current)?;
                named.set_item("target", target)?;
                made("modify_counter", (*id,).into_pyobject(py))
            }
            Sent::ModifyOutput { board, point, on } => {
                let point = IoPoint::of_command(*board, *point).ok_or_else(|| not_pickled("modifyOutput"))?;
                made("modify_output", (point.to_string(), *on).into_pyobject(py))
            }
            Sent::ClearAlarmRunNext => made("clear_alarm_run_next", none()),
            Sent::ClearAlarmContinue => made("clear_alarm_continue", none()),
            Sent::ModifyStackData { stack, spacing, count } => {
                made("modify_stack", (*stack, *spacing, *count).into_pyobject(py))
            }
            Sent::ModifyGspd { percent } => {
                let speed = crate::units::Percent::made(py, *percent)?;
                made("modify_gspd", (speed,).into_pyobject(py))
            }
            Sent::RewriteData { register, value, savable } => {
                named.set_item("savable", savable)?;
                made("rewrite_data", (register.number(), *value).into_pyobject(py))
            }
            Sent::RewriteDataList { first, savable, values } => {
                named.set_item("savable", savable)?;
                made("rewrite_data_list", (first.number(), values.clone()).into_pyobject(py))
            }
            Sent::ModifyAccDec { acceleration, deceleration } => {
                made("modify_acc_dec", (*acceleration, *deceleration).into_pyobject(py))
            }
            Sent::SwitchTool { tool } => made("switch_tool", (*tool,).into_pyobject(py)),
            Sent::ModifyTool { tool, offset } => made("modify_tool", (*tool, *offset).into_pyobject(py)),
            Sent::SwitchCoordinate { workbench } => {
                made("switch_coordinate", (*workbench,).into_pyobject(py))
            }
            Sent::ClearAlarmWith { first_line, only_alarm } => {
                named.set_item("first_line", first_line)?;
                named.set_item("only_alarm", only_alarm)?;
                made("clear_alarm_with", none())
            }
            Sent::ClearAlarm => made("clear_alarm", none()),
            #[allow(unreachable_patterns, reason = "a command may have its row before it has a method here")]
            other => return Err(not_pickled(other.name().word())),
        }?;
        reduced(py, "Command", (name, arguments, named))
    }
}
