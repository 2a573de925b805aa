//! `Command`: a command with its arguments, in everyday units.

use std::borrow::Cow;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use r6_proto::message::Command as Sent;
use r6_proto::{CommandName, RegisterIndex};

use crate::pickling::Reduced;
use crate::points::for_command;
use crate::units::{Given, Percent};

/// A command with its arguments, in everyday units: for ``Robot.command`` (manual 4.2).
#[pyclass(frozen, module = "r6._r6", eq)]
#[derive(Clone, PartialEq)]
pub struct Command(pub Sent<'static>);

#[pymethods]
impl Command {
    /// Any command by its word and arguments, as in ``r6 command``: ``Command.typed("modifyGSPD", 20)``.
    /// ``ValueError`` says which word or argument is wrong, and what it has to be.
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

    /// Stops the motion at once. ``Robot.stop`` does more: it checks that the arm stands and clears its
    /// list.
    #[staticmethod]
    fn action_stop() -> Self {
        Self(Sent::ActionStop)
    }

    /// Pauses the motion; start continues at the present step.
    #[staticmethod]
    fn action_pause() -> Self {
        Self(Sent::ActionPause)
    }

    /// Enters single cycle. It can set the arm in motion.
    #[staticmethod]
    fn action_single_cycle() -> Self {
        Self(Sent::ActionSingleCycle)
    }

    /// The start button. It can set the arm in motion, with the rest of the list.
    #[staticmethod]
    fn start_button() -> Self {
        Self(Sent::StartButton)
    }

    /// The stop button: the first press ends the program with the cycle, the second at once.
    #[staticmethod]
    fn stop_button() -> Self {
        Self(Sent::StopButton)
    }

    /// Switches to another program.
    #[staticmethod]
    fn switch_mold(mold: String) -> Self {
        Self(Sent::SwitchMold { mold: Cow::Owned(mold) })
    }

    /// Changes a counter; ``None`` keeps the value.
    #[staticmethod]
    #[pyo3(signature = (id, *, current=None, target=None))]
    fn modify_counter(id: u32, current: Option<u32>, target: Option<u32>) -> Self {
        Self(Sent::ModifyCounter { id, current, target })
    }

    /// Sets one output by its name: Y on boards 0 to 3, M on boards 0 to 2, EUY. A cell may start a motion
    /// by it.
    #[staticmethod]
    fn modify_output(point: &str, on: bool) -> PyResult<Self> {
        let (board, point) = for_command(point)?;
        Ok(Self(Sent::ModifyOutput { board, point, on }))
    }

    /// Clears the alarm and runs the next step.
    #[staticmethod]
    fn clear_alarm_run_next() -> Self {
        Self(Sent::ClearAlarmRunNext)
    }

    /// Clears the alarm and continues automatically.
    #[staticmethod]
    fn clear_alarm_continue() -> Self {
        Self(Sent::ClearAlarmContinue)
    }

    /// Changes a stack: spacing in X, Y, Z, mm, and count in X, Y, Z.
    #[staticmethod]
    fn modify_stack(stack: u32, spacing: [f64; 3], count: [u32; 3]) -> Self {
        Self(Sent::ModifyStackData { stack, spacing, count })
    }

    /// Changes the global speed.
    #[staticmethod]
    fn modify_gspd(speed: Given<Percent>) -> Self {
        Self(Sent::ModifyGspd { percent: speed.0.value() })
    }

    /// Writes one register, 800 to 900; ``savable`` keeps it over a power cut.
    #[staticmethod]
    #[pyo3(signature = (register, value, *, savable=false))]
    fn rewrite_data(register: u16, value: i64, savable: bool) -> PyResult<Self> {
        Ok(Self(Sent::RewriteData { register: self::register(register)?, value, savable }))
    }

    /// Writes consecutive registers.
    #[staticmethod]
    #[pyo3(signature = (first, values, *, savable=false))]
    fn rewrite_data_list(first: u16, values: Vec<i64>, savable: bool) -> PyResult<Self> {
        Ok(Self(Sent::RewriteDataList { first: register(first)?, savable, values }))
    }

    /// Changes the acceleration and deceleration time of the path, seconds.
    #[staticmethod]
    fn modify_acc_dec(acceleration: f64, deceleration: f64) -> Self {
        Self(Sent::ModifyAccDec { acceleration, deceleration })
    }

    /// Switches to another tool; 0 means no tool.
    #[staticmethod]
    fn switch_tool(tool: u32) -> Self {
        Self(Sent::SwitchTool { tool })
    }

    /// Changes a tool: X, Y, Z in mm and RX, RY, RZ in degrees, from the flange.
    #[staticmethod]
    fn modify_tool(tool: u32, offset: [f64; 6]) -> Self {
        Self(Sent::ModifyTool { tool, offset })
    }

    /// Switches to another workbench; 0 is the world.
    #[staticmethod]
    fn switch_coordinate(workbench: u32) -> Self {
        Self(Sent::SwitchCoordinate { workbench })
    }

    /// Resets and clears the alarm (207beta57).
    #[staticmethod]
    fn clear_alarm() -> Self {
        Self(Sent::ClearAlarm)
    }

    /// Clears the alarm as in the newest manual: whether the program goes to its first line, and whether
    /// only the alarm is cleared.
    #[staticmethod]
    #[pyo3(signature = (*, first_line, only_alarm))]
    fn clear_alarm_with(first_line: bool, only_alarm: bool) -> Self {
        Self(Sent::ClearAlarmWith { first_line, only_alarm })
    }

    /// The word on the wire.
    #[getter]
    fn word(&self) -> &'static str {
        self.name().word()
    }

    /// What it does.
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
