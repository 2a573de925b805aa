//! The common part of `Robot` and `AsyncRobot`. Each method makes an operation; the caller decides how to
//! wait for it.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyString};
use r6_client::{CameraSet, OperationMode, RequestError, Robot, WaitOptions};
use r6_proto::Address;
use r6_proto::message::{Effect, PhotoAnswer};

use crate::closing::{Connection, stopping};
use crate::command::Command;
use crate::convert::{self, seconds};
use crate::driver::Driver;
use crate::envelope::Envelope;
use crate::following::FollowCore;
use crate::line::Line;
use crate::listening::Target;
use crate::motion::Motion;
use crate::operation::{Operation, STOP_GOES_ON};
use crate::photos::{self, PhotosCore};
use crate::process::{OfThisProcess, Process};
use crate::raising::{Raise, raise};
use crate::registers;
use crate::settings::{FollowOptions, RobotSettings, RunOptions};
use crate::starting::Starting;
use crate::subscription::{PushedCore, SubscriptionCore};

/// The common part of ``Robot`` and ``AsyncRobot``.
#[pyclass(frozen, module = "r6._r6")]
pub struct RobotCore {
    handle: OfThisProcess<Handle>,
    #[pyo3(get)]
    address: String,
}

struct Handle {
    /// `None` once it was closed.
    robot: Mutex<Option<Robot>>,
    /// Shared with the handles that `with_guard` makes.
    connection: Arc<Connection>,
    /// The driver, also shared with the handles that `with_guard` makes.
    driver: Driver,
}

impl RobotCore {
    fn new(robot: Robot, connection: Arc<Connection>, driver: Driver) -> Self {
        let address = robot.address().to_owned();
        Self {
            handle: OfThisProcess::new(Handle { robot: Mutex::new(Some(robot)), connection, driver }),
            address,
        }
    }

    fn robot(&self, py: Python<'_>) -> PyResult<Robot> {
        let robot = self.handle.here()?.robot.lock().unwrap_or_else(PoisonError::into_inner).clone();
        robot.ok_or_else(|| RequestError::from(r6_client::NotSent::Closed).exception(py))
    }

    /// An operation that waits for this connection alone. It needs no runtime around it.
    fn here<T, F, C>(&self, future: F, convert: C) -> PyResult<Operation>
    where
        T: Send + 'static,
        F: Future<Output = T> + Send + 'static,
        C: for<'py> FnOnce(Python<'py>, T) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
    {
        Ok(Operation::new(future, convert).over(&self.handle.here()?.driver))
    }

    /// A request that the controller accepts or refuses.
    fn accepted(
        &self,
        future: impl Future<Output = Result<r6_client::Accepted, RequestError>> + Send + 'static,
    ) -> PyResult<Operation> {
        self.here(future, |py, accepted| convert::accepted(py, raise(py, accepted)?))
    }
}

#[pymethods]
impl RobotCore {
    /// Connects. The result is a `RobotCore`.
    #[staticmethod]
    #[pyo3(signature = (address, settings=None))]
    fn connect(address: &Bound<'_, PyAny>, settings: Option<&RobotSettings>) -> PyResult<Operation> {
        let settings = settings.map(|settings| settings.0.clone()).unwrap_or_default();
        let connecting = Target::of(address)?.connect(settings);
        Ok(Operation::new(connecting, |py, made| {
            let (driver, robot): (Driver, Robot) = raise(py, made)?;
            Process::current(py)?.connected(robot.stops_under_way());
            Self::new(robot, Arc::default(), driver).into_bound_py_any(py)
        }))
    }

    /// The same for asyncio.
    #[staticmethod]
    #[pyo3(signature = (address, settings=None))]
    fn connect_async(
        py: Python<'_>,
        address: &Bound<'_, PyAny>,
        settings: Option<&RobotSettings>,
    ) -> PyResult<Operation> {
        let Ok(to) = address.extract::<String>() else { return Self::connect(address, settings) };
        let settings = settings.map(|settings| settings.0.clone()).unwrap_or_default();
        let connecting = Line::open(Process::current(py)?, to, settings);
        Ok(Operation::new(connecting, |py, made| {
            let (line, robot): (Arc<Line>, Robot) = raise(py, made)?;
            Process::current(py)?.connected(robot.stops_under_way());
            Self::new(robot, Arc::default(), Driver::EventLoop(line)).into_bound_py_any(py)
        }))
    }

    /// Closes the connection for all its handles, ends the motion that is streamed over it, and waits for a
    /// stop that is under way. The result is a text about the motion that was cut short, or `None`. Closing
    /// again does nothing.
    fn close(&self) -> PyResult<Operation> {
        let handle = self.handle.here()?;
        let robot = handle.robot.lock().unwrap_or_else(PoisonError::into_inner).take();
        let connection = Arc::clone(&handle.connection);
        let goes_on = match &robot {
            Some(robot) if robot.stops_under_way().any() => STOP_GOES_ON,
            Some(_) | None => "closing goes on",
        };
        let closing = async move {
            let closed = connection.close(robot?).await;
            closed.cut_short.map(|motion| motion.to_string())
        };
        Ok(Operation::new(closing, |py, cut_short| cut_short.into_bound_py_any(py)).going_on(goes_on))
    }

    #[pyo3(signature = (*addresses))]
    fn query(&self, py: Python<'_>, addresses: Vec<Bound<'_, PyString>>) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let (names, addresses) = named(py, addresses)?;
        let reading = async move { robot.query(&addresses).await };
        self.here(reading, |py, result| convert::query_result(py, names, &raise(py, result)?))
    }

    fn status(&self, py: Python<'_>) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let address = robot.address().to_owned();
        let reading = async move { robot.status().await };
        self.here(reading, move |py, status| convert::status(py, &address, &raise(py, status)?))
    }

    fn firmware(&self, py: Python<'_>) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let reading = async move { robot.firmware().await };
        self.here(reading, |py, firmware| raise(py, firmware)?.into_bound_py_any(py))
    }

    fn command(&self, py: Python<'_>, command: &Command) -> PyResult<Operation> {
        let (robot, command) = (self.robot(py)?, command.0.clone());
        let stops = command.name().effect() == Effect::Stops;
        let sending = self.accepted(async move { robot.command(command).await })?;
        let goes_on = "whether it was accepted was not told before this: it is sent all the same";
        Ok(if stops { sending.going_on(goes_on) } else { sending })
    }

    fn clear_list(&self, py: Python<'_>) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        self.accepted(async move { robot.clear_list().await })
    }

    fn add_rcc(&self, py: Python<'_>, motion: PyRef<'_, Motion>, replace: bool) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let motion = motion.0.clone();
        raise(py, motion.instructions())?;
        self.accepted(async move { robot.add_motion(replace, &motion).await })
    }

    fn wait_until_done(
        &self,
        py: Python<'_>,
        timeout: f64,
        interval: f64,
        settle: f64,
        start_within: f64,
        idle_mode: i64,
    ) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let options = WaitOptions {
            interval: seconds("interval", interval)?,
            timeout: seconds("timeout", timeout)?,
            settle: seconds("settle", settle)?,
            start_within: seconds("start_within", start_within)?,
            idle_mode: OperationMode::of_number(idle_mode),
        };
        let waiting = async move { robot.wait_until_done(options).await };
        self.here(waiting, |py, done| convert::done(py, &raise(py, done)?))
    }

    fn stop(&self, py: Python<'_>) -> PyResult<Operation> {
        Ok(stopping(self.robot(py)?))
    }

    /// Prepares a motion. Nothing begins before its operation does.
    #[pyo3(signature = (motion, options=None))]
    fn run(
        &self,
        py: Python<'_>,
        motion: PyRef<'_, Motion>,
        options: Option<&RunOptions>,
    ) -> PyResult<Starting> {
        let options = options.map(|options| options.0).unwrap_or_default();
        let handle = self.handle.here()?;
        let connection = Arc::clone(&handle.connection);
        Starting::new(py, self.robot(py)?, motion.0.clone(), options, connection, &handle.driver)
    }

    /// Follows a target. It begins at once, and there is nothing to wait for.
    #[pyo3(signature = (options=None))]
    fn follow(&self, py: Python<'_>, options: Option<&FollowOptions>) -> PyResult<FollowCore> {
        FollowCore::new(py, self.robot(py)?, options.map(|options| options.0).unwrap_or_default())
    }

    /// The frames that `run` would send.
    #[pyo3(signature = (motion, options=None))]
    fn dry_run<'py>(
        &self,
        py: Python<'py>,
        motion: PyRef<'_, Motion>,
        options: Option<&RunOptions>,
    ) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let options = options.map(|options| options.0).unwrap_or_default();
        let frames = raise(py, self.robot(py)?.dry_run(&motion.0, options))?;
        Ok(frames.iter().map(|frame| PyBytes::new(py, frame)).collect())
    }

    fn read_registers(&self, py: Python<'_>, first: u16, count: usize) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let first = registers::first(first, count)?;
        let reading = async move { robot.read_registers(first, count).await };
        self.here(reading, |py, values| registers::to_array(py, raise(py, values)?))
    }

    #[pyo3(signature = (first, values, *, savable, verify))]
    fn write_registers(
        &self,
        py: Python<'_>,
        first: u16,
        values: Vec<i64>,
        savable: bool,
        verify: bool,
    ) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let write = registers::Write::new(first, values, savable, verify)?;
        let writing = async move {
            let written = write.send(&robot).await;
            (write, written)
        };
        self.here(writing, |py, (write, written)| match written {
            Ok(()) => py.None().into_bound_py_any(py),
            Err(error) => Err(write.exception(py, &error)),
        })
    }

    /// Subscribes to values. There is nothing to wait for.
    fn subscribe(
        &self,
        py: Python<'_>,
        addresses: Vec<Bound<'_, PyString>>,
        every: f64,
    ) -> PyResult<SubscriptionCore> {
        let (names, addresses) = named(py, addresses)?;
        let subscription = self.robot(py)?.subscribe(&addresses, seconds("every", every)?);
        let subscription = raise(py, subscription)?;
        self.handle.here()?.driver.look_after();
        Ok(SubscriptionCore::new(names, subscription))
    }

    fn pushed(&self, py: Python<'_>) -> PyResult<PushedCore> {
        let handle = self.handle.here()?;
        let pushed = self.robot(py)?.pushed();
        handle.driver.look_after();
        Ok(PushedCore::new(pushed, handle.connection.closed()))
    }

    fn answer_photo(&self, py: Python<'_>, cam_id: i64, taken: bool) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let answer = PhotoAnswer { cam_id, ret: i64::from(taken) };
        let sending = async move { robot.answer_photo(answer).await };
        self.here(sending, |py, left| raise(py, left)?.into_bound_py_any(py))
    }

    fn add_points(&self, py: Python<'_>, cam_id: i64, points: Vec<Bound<'_, PyAny>>) -> PyResult<Operation> {
        let robot = self.robot(py)?;
        let points = photos::points(points)?;
        self.accepted(async move { robot.add_points(vec![CameraSet { cam_id, points }]).await })
    }

    /// Serves as the camera of this controller from now on.
    fn serve_photos(&self, py: Python<'_>) -> PyResult<PhotosCore> {
        PhotosCore::new(py, self.robot(py)?)
    }

    fn link_quality<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::link_quality(py, &self.robot(py)?.link_quality())
    }

    fn identity<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.robot(py)?.identity().map(|identity| convert::identity(py, &identity)).transpose()
    }

    fn accept_identity(&self, py: Python<'_>, found: &Bound<'_, PyAny>) -> PyResult<()> {
        self.robot(py)?.accept_identity(convert::identity_from(found)?);
        Ok(())
    }

    fn guard(&self, py: Python<'_>) -> PyResult<Option<Envelope>> {
        Ok(self.robot(py)?.guard().cloned().map(Envelope))
    }

    fn with_guard(&self, py: Python<'_>, envelope: &Envelope) -> PyResult<Self> {
        let handle = self.handle.here()?;
        let guarded = self.robot(py)?.with_guard(envelope.0.clone());
        Ok(Self::new(guarded, Arc::clone(&handle.connection), handle.driver.clone()))
    }
}

/// The addresses, with the names that the caller used.
fn named(py: Python<'_>, names: Vec<Bound<'_, PyString>>) -> PyResult<(Vec<Py<PyString>>, Vec<Address>)> {
    let mut addresses = Vec::with_capacity(names.len());
    for name in &names {
        addresses.push(raise(py, Address::parse(&name.to_cow()?))?);
    }
    Ok((names.into_iter().map(Bound::unbind).collect(), addresses))
}
