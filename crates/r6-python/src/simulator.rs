//! `Simulator`: a virtual controller inside this process, on its own thread.

use std::io::Read;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::{PyOSError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;
use r6_controller::{
    Button, ControllerSnapshot, Event, Key, Level, Library, LogEntry, PanelAction, Profile, Program,
    RobotModel, Scenario, StartState,
};
use r6_proto::alarm::AlarmCode;
use r6_proto::io_point::{IoPoint, PointKind};
use r6_sim::{Camera, Clock, ControllerHandle, SimError, VirtualController};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::TryRecvError;

use crate::convert::word;
use crate::errors::wrong_file;
use crate::interpreter;
use crate::points::named;
use crate::process::OfThisProcess;
use crate::raising::{Exception, raise};
use crate::record::{Record, array};
use crate::units::axis;

/// A virtual controller on a free port of 127.0.0.1, inside this process, on its own thread.
///
/// It listens from the start. ``close``, the end of a ``with`` block, or dropping it ends it and its
/// connections.
///
/// - ``profile``: ``"hc1"``, ``"r6-host"``, ``"r6-pendant"``, ``"legacy"``, or a file.
/// - ``model``: a name of ``r6.models()``, or a file.
/// - ``clock``: ``"real"``, ``"max"`` (moves take no time), ``"10x"``, or the factor as a number. At
///   ``"max"`` time passes only as the program needs it: use ``"100x"`` if a time limit has to run out.
/// - ``seed``: the seed of random values.
/// - ``start``: ``"waiting"`` (ready for instructions), ``"auto"``, ``"manual"`` or ``"stopped"``.
/// - ``program``: a program that every controller has (``"pick-and-place"``), a file, or the text of one. A
///   file's program has the name of the file without its extension.
/// - ``scenario``: a file, or the text of one.
/// - ``cameras``: cameras that it connects to, ``"127.0.0.1:9000"`` or ``"1=127.0.0.1:9000"``.
/// - ``state``: the folder that keeps what survives a power cut.
///
/// A file is a ``pathlib.Path``, or a ``str`` that ends with ``.toml`` or ``.json``.
///
/// Errors: ``SimulatorError`` says what is wrong. Nothing is left running then.
#[pyclass(frozen, module = "r6._r6")]
pub struct Simulator {
    /// `None` once it was closed. This is the only handle, and it holds the folder of the state.
    controller: OfThisProcess<Mutex<Option<VirtualController>>>,
    address: SocketAddr,
    log: OfThisProcess<Mutex<Receiver<Arc<LogEntry>>>>,
}

const BUTTONS: [(&str, Button); 5] = [
    ("start", Button::Start),
    ("stop", Button::Stop),
    ("pause", Button::Pause),
    ("single_cycle", Button::SingleCycle),
    ("single_step", Button::SingleStep),
];

const KEYS: [(&str, Key); 3] = [("manual", Key::Manual), ("stop", Key::Stop), ("auto", Key::Auto)];

const STARTS: [(&str, StartState); 4] = [
    ("waiting", StartState::Waiting),
    ("auto", StartState::Auto),
    ("manual", StartState::Manual),
    ("stopped", StartState::Stopped),
];

/// The longest file for a simulator: that of a scenario. The limit is needed because a path may lead to a
/// device without an end.
const MAX_FILE_BYTES: usize = r6_controller::scenario::MAX_TEXT_BYTES;

/// What errors call a text that is in no file.
const TEXT: &str = "<text>";

/// A name or a text, or the file at a path and its text.
pub enum Source {
    Name(String),
    File { path: String, text: String },
}

impl Source {
    pub fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(name) = given.cast::<PyString>() {
            let name = name.to_cow()?;
            // The same rule as on the command line.
            if name.contains('\n') || !(name.ends_with(".toml") || name.ends_with(".json")) {
                return Ok(Self::Name(name.into_owned()));
            }
        }
        let path: PathBuf = given.extract().map_err(|_| PyTypeError::new_err("wanted: a str or a path"))?;
        let mut text = String::new();
        // Reading one byte more than allowed shows that the file is too long.
        let most = u64::try_from(MAX_FILE_BYTES).unwrap_or(u64::MAX).saturating_add(1);
        // A whole path shows in which folder a relative one was looked for. The number makes it the right
        // class of exception, such as FileNotFoundError.
        let whole = std::path::absolute(&path).unwrap_or_else(|_| path.clone()).display().to_string();
        let unreadable = |error: std::io::Error| match error.raw_os_error() {
            Some(number) => PyOSError::new_err((number, error.to_string(), whole.clone())),
            None => PyOSError::new_err(format!("{whole}: {error}")),
        };
        let mut file = std::fs::File::open(&path).map_err(unreadable)?.take(most);
        file.read_to_string(&mut text).map_err(unreadable)?;
        if text.len() > MAX_FILE_BYTES {
            let what = format!(
                "{} is too long: a file for a simulator has {MAX_FILE_BYTES} bytes at most",
                path.display()
            );
            return Err(PyValueError::new_err(what));
        }
        Ok(Self::File { path: path.display().to_string(), text })
    }

    /// The text, and its name in errors: the path, or `<text>`. Errors: `SimulatorError` if it can only be
    /// the name of a `what`, and none of `known` is meant.
    fn text(self, py: Python<'_>, what: &str, known: &[&str]) -> PyResult<(String, String)> {
        match self {
            Self::Name(name) if !name.contains(['\n', '=', '[']) => {
                let there = match r6_proto::nearest(&name, known.iter().copied()) {
                    Some(near) => format!("; nearest: `{near}`"),
                    None if known.is_empty() => String::new(),
                    None => format!("; there are: {}", known.join(", ")),
                };
                let file = "the name of a file ends with .toml or .json";
                Err(wrong(py, format!("there is no {what} `{name}`{there} ({file})")))
            }
            Self::Name(text) => Ok((TEXT.to_owned(), text)),
            Self::File { path, text } => Ok((path, text)),
        }
    }
}

fn wrong(py: Python<'_>, problem: impl std::fmt::Display) -> PyErr {
    Exception::new(py, "SimulatorError", &problem).build()
}

/// A profile by its name or its file. Errors: `SimulatorError`.
pub fn profile_of(py: Python<'_>, source: Source) -> PyResult<Profile> {
    match source {
        Source::File { path, text } => {
            Profile::from_toml(&text).map_err(|mistakes| wrong_file(py, "SimulatorError", &path, &mistakes))
        }
        Source::Name(name) => Profile::named(&name).ok_or_else(|| {
            wrong(py, format!("there is no profile `{name}`; there are: {}", Profile::names().join(", ")))
        }),
    }
}

/// A robot model by its name or its file. Errors: `SimulatorError`.
pub fn model_of(py: Python<'_>, source: Source) -> PyResult<RobotModel> {
    match source {
        Source::File { path, text } => RobotModel::from_toml(&text)
            .map_err(|mistakes| wrong_file(py, "SimulatorError", &path, &mistakes)),
        Source::Name(name) => RobotModel::named(&name).cloned().ok_or_else(|| {
            let names: Vec<_> = RobotModel::names().collect();
            wrong(py, format!("there is no model `{name}`; there are: {}", names.join(", ")))
        }),
    }
}

/// Reads "real", "max", "10x", or the factor as a number.
fn clock(py: Python<'_>, given: &Bound<'_, PyAny>) -> PyResult<Clock> {
    let text = match given.extract::<f64>() {
        Ok(factor) => format!("{factor}x"),
        Err(_) => given.extract::<String>()?,
    };
    text.parse().map_err(|error| wrong(py, error))
}

#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(signature = (
        *, profile=None, model=None, clock=None, seed=0, start="waiting", program=None, scenario=None,
        cameras=Vec::new(), state=None
    ))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        py: Python<'_>,
        profile: Option<&Bound<'_, PyAny>>,
        model: Option<&Bound<'_, PyAny>>,
        clock: Option<&Bound<'_, PyAny>>,
        seed: u64,
        start: &str,
        program: Option<&Bound<'_, PyAny>>,
        scenario: Option<&Bound<'_, PyAny>>,
        cameras: Vec<String>,
        state: Option<PathBuf>,
    ) -> PyResult<Self> {
        let mut builder = VirtualController::builder().seed(seed).stands(word("start", start, &STARTS)?);
        if let Some(given) = profile {
            builder = builder.profile(profile_of(py, Source::of(given)?)?);
        }
        if let Some(given) = model {
            builder = builder.model(model_of(py, Source::of(given)?)?);
        }
        if let Some(given) = clock {
            builder = builder.clock(self::clock(py, given)?);
        }
        if let Some(given) = program {
            let source = Source::of(given)?;
            let shipped = match &source {
                Source::Name(name) => Library::shipped().find(|(shipped, _)| shipped == name),
                Source::File { .. } => None,
            };
            let (file, name, text) = match shipped {
                Some((name, text)) => (name.to_owned(), name.to_owned(), text.to_owned()),
                None => {
                    let known: Vec<_> = Library::shipped().map(|(name, _)| name).collect();
                    let (file, text) = source.text(py, "program", &known)?;
                    let stem = Path::new(&file).file_stem().filter(|_| file != TEXT);
                    let name = stem.map_or("program".into(), |stem| stem.to_string_lossy());
                    (file.clone(), name.into_owned(), text)
                }
            };
            let program = Program::read(&name, &text)
                .map_err(|mistakes| wrong_file(py, "SimulatorError", &file, &mistakes))?;
            builder = builder.program(program).map_err(|error| wrong(py, error))?;
        }
        if let Some(given) = scenario {
            let (file, text) = Source::of(given)?.text(py, "scenario", &[])?;
            let scenario = Scenario::read(&text)
                .map_err(|mistakes| wrong_file(py, "SimulatorError", &file, &mistakes))?;
            builder = builder.scenario(scenario);
        }
        for camera in cameras {
            builder = builder.camera(camera.parse::<Camera>().map_err(|error| wrong(py, error))?);
        }
        if let Some(folder) = state {
            builder = builder.state(folder);
        }
        let controller = raise(py, interpreter::released(py, || builder.start_blocking()).0)?;
        let address = controller.address();
        let log = OfThisProcess::new(Mutex::new(controller.handle().log_from_start()));
        Ok(Self { controller: OfThisProcess::new(Mutex::new(Some(controller))), address, log })
    }

    /// Where it listens, ``host:port``: for ``Robot.connect``.
    #[getter]
    fn address(&self) -> String {
        self.address.to_string()
    }

    /// The port it listens on.
    #[getter]
    fn port(&self) -> u16 {
        self.address.port()
    }

    /// Ends it and its connections. Raises if its state could not be written. Closing again does
    /// nothing.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let taken = self.controller.here()?.lock().unwrap_or_else(PoisonError::into_inner).take();
        let ended =
            interpreter::released(py, || taken.map_or(Ok(()), VirtualController::shutdown_blocking)).0;
        raise(py, ended.map_err(SimError::State))
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, PyAny>) -> PyResult<()> {
        self.close(py)
    }

    /// Presses the emergency stop, which stays pressed: alarm 7.
    fn emergency_stop(&self, py: Python<'_>) -> PyResult<()> {
        self.operate(py, &PanelAction::EmergencyStop)
    }

    /// Releases the emergency stop; alarm 7 stays until it is cleared.
    fn release_emergency_stop(&self, py: Python<'_>) -> PyResult<()> {
        self.operate(py, &PanelAction::ReleaseEmergencyStop)
    }

    /// Clears the alarm; this starts nothing. Raises ``PanelRefused`` if the machine refuses.
    fn clear_alarm(&self, py: Python<'_>) -> PyResult<()> {
        self.operate(py, &PanelAction::ClearAlarm)
    }

    /// Raises an alarm, 1 to 10 000.
    fn raise_alarm(&self, py: Python<'_>, alarm: u32) -> PyResult<()> {
        self.operate(py, &PanelAction::RaiseAlarm(AlarmCode(alarm)))
    }

    /// Presses a button of the pendant: ``start``, ``stop``, ``pause``, ``single_cycle``, ``single_step``.
    fn press(&self, py: Python<'_>, button: &str) -> PyResult<()> {
        self.operate(py, &PanelAction::Press(word("button", button, &BUTTONS)?))
    }

    /// Turns the mode key: ``manual``, ``stop``, ``auto``.
    fn turn_key(&self, py: Python<'_>, key: &str) -> PyResult<()> {
        self.operate(py, &PanelAction::TurnKey(word("key", key, &KEYS)?))
    }

    /// In manual: moves all axes to 0. The machine is homed once they are there.
    fn home(&self, py: Python<'_>) -> PyResult<()> {
        self.operate(py, &PanelAction::Home)
    }

    /// In manual: moves one axis, 0 for J1, by this many degrees, or mm for a linear axis.
    #[pyo3(signature = (axis, by, *, percent=10.0))]
    fn jog(&self, py: Python<'_>, axis: u8, by: f64, percent: f64) -> PyResult<()> {
        self.operate(py, &PanelAction::Jog { axis: self::axis(axis)?, by, percent })
    }

    /// Chooses another program.
    fn switch_program(&self, py: Python<'_>, name: String) -> PyResult<()> {
        self.operate(py, &PanelAction::SwitchProgram(name))
    }

    /// Loads a program. It replaces a program with the same name.
    fn load_program(&self, py: Python<'_>, name: String, text: String) -> PyResult<()> {
        self.operate(py, &PanelAction::LoadProgram { name, text })
    }

    /// Sets an input, ``"X010"`` or ``"EUX010"``, from now on.
    fn set_input(&self, py: Python<'_>, point: &str, on: bool) -> PyResult<()> {
        let IoPoint { kind, board, point: number } = named(point)?;
        let action = match kind {
            PointKind::X => PanelAction::SetInput { board, point: number, on },
            PointKind::Eux => PanelAction::SetEuInput { point: number, on },
            PointKind::Y | PointKind::M | PointKind::Euy => {
                return Err(PyValueError::new_err(format!("{point} is no input: inputs are X and EUX")));
            }
        };
        self.operate(py, &action)
    }

    /// Whether an input, output or M point is on, by its name on the pendant.
    fn is_on(&self, py: Python<'_>, point: &str) -> PyResult<bool> {
        let IoPoint { kind, board, point: number } = named(point)?;
        let io = self.look(py)?.io;
        let word = |words: &[u32]| words.get(usize::from(board)).copied().unwrap_or(0);
        let word = match kind {
            PointKind::X => word(&io.inputs),
            PointKind::Y => word(&io.outputs),
            PointKind::M => word(&io.m),
            PointKind::Eux => io.eu_inputs,
            PointKind::Euy => io.eu_outputs,
        };
        Ok(word >> number & 1 == 1)
    }

    /// Asks a camera for a photo, as a program does.
    fn request_photo(&self, py: Python<'_>, cam_id: i64) -> PyResult<()> {
        let handle = self.handle()?;
        interpreter::released(py, || handle.request_photo(cam_id));
        Ok(())
    }

    /// The present state, as an operator sees it at the machine.
    fn snapshot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let state = self.look(py)?;
        let axes = state.axis_limits.len();
        Record::new(py, "MachineState")?
            .with("firmware", state.version)?
            .with("machine_name", state.machine_name)?
            .with("profile", state.profile)?
            .with("model", state.model)?
            .with("mode", state.mode.number())?
            .with("alarm", state.alarm.0)?
            .with("emergency_stop", state.emergency_stop)?
            .with("homed", state.homed)?
            .with("moving", state.moving)?
            .with("program", state.program)?
            .with("programs", state.programs)?
            .with("list_length", state.list_length)?
            .with("axes", array(py, state.axes.into_iter().take(axes).map(Some))?)?
            .with("pose", array(py, state.world.map(Some))?)?
            .with("axis_limits", state.axis_limits)?
            .with("global_speed", state.global_speed_percent)?
            .with("connections", state.connections)?
            .build()
    }

    /// The events since the last call; 256 lines are kept.
    fn log<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        let mut log = self.log.here()?.lock().unwrap_or_else(PoisonError::into_inner);
        let mut lines = Vec::new();
        loop {
            let (at, connection, warning, text, event) = match log.try_recv() {
                Ok(entry) => (
                    Some(entry.at.as_secs_f64()),
                    entry.connection.map(|connection| connection.number()),
                    entry.level() == Level::Warning,
                    entry.event.to_string(),
                    entry.event.clone(),
                ),
                Err(TryRecvError::Lagged(count)) => (
                    None,
                    None,
                    true,
                    format!("{count} lines were lost: read the log more often"),
                    Event::EventsDropped { count },
                ),
                Err(TryRecvError::Empty | TryRecvError::Closed) => return Ok(lines),
            };
            let line = Record::new(py, "LogLine")?
                .with("at", at)?
                .with("connection", connection)?
                .with("warning", warning)?
                .with("text", text)?
                .with("event", as_data(py, &event)?)?
                .build()?;
            lines.push(line);
        }
    }

    fn __repr__(&self) -> String {
        format!("<Simulator at {}>", self.address)
    }
}

/// An event as Python data: its name and its fields.
fn as_data<'py>(py: Python<'py>, event: &Event) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(event).map_err(|error| PyValueError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

impl Simulator {
    fn operate(&self, py: Python<'_>, action: &PanelAction) -> PyResult<()> {
        let handle = self.handle()?;
        raise(py, interpreter::released(py, || handle.operate(action)).0)
    }

    fn look(&self, py: Python<'_>) -> PyResult<ControllerSnapshot> {
        let handle = self.handle()?;
        Ok(interpreter::released(py, || handle.snapshot()).0)
    }

    fn handle(&self) -> PyResult<ControllerHandle> {
        let controller = self.controller.here()?.lock().unwrap_or_else(PoisonError::into_inner);
        let handle = controller.as_ref().map(|controller| controller.handle().clone());
        handle.ok_or_else(|| PyRuntimeError::new_err("this simulator was closed"))
    }
}
