//! `Command`: a command with its arguments, in everyday units.

use std::borrow::Cow;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_proto::message::Command as Sent;
use r6_proto::{CommandName, RegisterIndex};

use crate::pickling::Reduced;
use crate::points::for_command;
use crate::units::{Given, Percent};

/// A command with its arguments.
#[pyclass(frozen, module = "r6._r6", eq)]
#[derive(Clone, PartialEq)]
pub struct Command(pub Sent<'static>);

#[pymethods]
impl Command {
    #[staticmethod]
    #[pyo3(signature = (word, *arguments))]
    fn typed(word: &str, arguments: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        let name = CommandName::exact(word.as_bytes()).ok_or_else(|| {
            let near = CommandName::nearest(word).map(|near| format!("; nearest: `{near}`"));
            PyValueError::new_err(format!("there is no command `{word}`{}", near.unwrap_or_default()))
        })?;
        let words = arguments.iter().map(typed_word).collect::<PyResult<Vec<_>>>()?;
        Sent::typed(name, &words).map(Self).map_err(|error| PyValueError::new_err(format!("{name}: {error}")))
    }

    #[staticmethod]
    fn action_stop() -> Self {
        Self(Sent::ActionStop)
    }

    #[staticmethod]
    fn action_pause() -> Self {
        Self(Sent::ActionPause)
    }

    #[staticmethod]
    fn action_single_cycle() -> Self {
        Self(Sent::ActionSingleCycle)
    }

    #[staticmethod]
    fn start_button() -> Self {
        Self(Sent::StartButton)
    }

    #[staticmethod]
    fn stop_button() -> Self {
        Self(Sent::StopButton)
    }

    #[staticmethod]
    fn switch_mold(mold: String) -> Self {
        Self(Sent::SwitchMold { mold: Cow::Owned(mold) })
    }

    #[staticmethod]
    #[pyo3(signature = (id, *, current=None, target=None))]
    fn modify_counter(id: u32, current: Option<u32>, target: Option<u32>) -> Self {
        Self(Sent::ModifyCounter { id, current, target })
    }

    #[staticmethod]
    fn modify_output(point: &str, on: bool) -> PyResult<Self> {
        let (board, point) = for_command(point)?;
        Ok(Self(Sent::ModifyOutput { board, point, on }))
    }

    #[staticmethod]
    fn clear_alarm_run_next() -> Self {
        Self(Sent::ClearAlarmRunNext)
    }

    #[staticmethod]
    fn clear_alarm_continue() -> Self {
        Self(Sent::ClearAlarmContinue)
    }

    #[staticmethod]
    fn modify_stack(stack: u32, spacing: [f64; 3], count: [u32; 3]) -> Self {
        Self(Sent::ModifyStackData { stack, spacing, count })
    }

    #[staticmethod]
    fn modify_gspd(speed: Given<Percent>) -> Self {
        Self(Sent::ModifyGspd { percent: speed.0.value() })
    }

    #[staticmethod]
    #[pyo3(signature = (register, value, *, savable=false))]
    fn rewrite_data(register: u16, value: i64, savable: bool) -> PyResult<Self> {
        Ok(Self(Sent::RewriteData { register: self::register(register)?, value, savable }))
    }

    #[staticmethod]
    #[pyo3(signature = (first, values, *, savable=false))]
    fn rewrite_data_list(first: u16, values: Vec<i64>, savable: bool) -> PyResult<Self> {
        Ok(Self(Sent::RewriteDataList { first: register(first)?, savable, values }))
    }

    #[staticmethod]
    fn modify_acc_dec(acceleration: f64, deceleration: f64) -> Self {
        Self(Sent::ModifyAccDec { acceleration, deceleration })
    }

    #[staticmethod]
    fn switch_tool(tool: u32) -> Self {
        Self(Sent::SwitchTool { tool })
    }

    #[staticmethod]
    fn modify_tool(tool: u32, offset: [f64; 6]) -> Self {
        Self(Sent::ModifyTool { tool, offset })
    }

    #[staticmethod]
    fn switch_coordinate(workbench: u32) -> Self {
        Self(Sent::SwitchCoordinate { workbench })
    }

    #[staticmethod]
    fn clear_alarm() -> Self {
        Self(Sent::ClearAlarm)
    }

    #[staticmethod]
    #[pyo3(signature = (*, first_line, only_alarm))]
    fn clear_alarm_with(first_line: bool, only_alarm: bool) -> Self {
        Self(Sent::ClearAlarmWith { first_line, only_alarm })
    }

    #[getter]
    fn word(&self) -> &'static str {
        self.name().word()
    }

    #[getter]
    fn meaning(&self) -> &'static str {
        self.name().info().meaning
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> Reduced<'py> {
        self.reduced(py)
    }

    fn __repr__(&self) -> String {
        format!("<Command {}>", self.0)
    }
}

impl Command {
    fn name(&self) -> CommandName {
        self.0.name()
    }
}

/// An argument as typed on the command line; `True` and `False` are `1` and `0` there.
fn typed_word(argument: &Bound<'_, PyAny>) -> PyResult<String> {
    match argument.extract::<bool>() {
        Ok(flag) => Ok(u8::from(flag).to_string()),
        Err(_) => Ok(argument.str()?.to_string()),
    }
}

/// A register by its number.
pub fn register(number: u16) -> PyResult<RegisterIndex> {
    RegisterIndex::new(number)
        .ok_or_else(|| PyValueError::new_err(format!("a register is a number from 800 to 900, not {number}")))
}
