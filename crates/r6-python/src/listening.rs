//! Controllers that connect to this program, and the search for controllers at some addresses.

use std::net::IpAddr;
use std::sync::{Mutex, PoisonError};

use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyList;
use r6_client::{NotSent, RequestError, Robot, RobotSettings, blocking};
use tokio::task::spawn_blocking;

use crate::convert;
use crate::driver::Driver;
use crate::interpreter;
use crate::operation::Operation;
use crate::process::{OfThisProcess, Process};
use crate::raising::Raise;
use crate::record::Record;
use crate::settings;

/// Waits for a controller that connects to this program: for ``Robot.connect``.
///
/// The pendant sets each port of a controller to server mode or client mode. In client mode the controller
/// connects to the address that is set there. It tries again until a program listens there.
///
/// - ``address``: where to listen, such as ``"0.0.0.0:9760"``. Port 0 takes a free port.
/// - ``only_from``: the IP address of the controller. Connections from other machines are closed at once.
///   Set it, because there is no login: any machine that reaches the port is taken for the controller.
///
/// It serves one ``connect``, which waits for ``RobotSettings.connect_timeout`` seconds, as the robot does
/// after a lost connection. Set a longer time than the controller takes to connect again. If several
/// connections wait, the newest is used. The port is closed with the robot, or when connecting fails.
///
/// Errors: ``OSError`` if the port is in use or this machine does not have the address; ``ValueError``.
#[pyclass(frozen, module = "r6._r6")]
pub struct Listen {
    /// `None` once a robot has used it.
    listen: OfThisProcess<Mutex<Option<r6_client::Listen>>>,
    /// Where it listens, ``host:port``, with the port that port 0 took.
    #[pyo3(get)]
    address: String,
}

#[pymethods]
impl Listen {
    #[new]
    #[pyo3(signature = (address, *, only_from=None))]
    fn new(py: Python<'_>, address: &str, only_from: Option<&str>) -> PyResult<Self> {
        let only_from: Option<IpAddr> = only_from
            .map(|from| from.parse().map_err(|_| PyValueError::new_err(format!("{from} is no IP address"))))
            .transpose()?;
        let engine = Process::current(py)?.engine();
        // Resolving a name may take time.
        let binding = || engine.block_on(r6_client::Listen::on(address));
        let mut listen = interpreter::released(py, binding).0?;
        if let Some(controller) = only_from {
            listen = listen.only_from(controller);
        }
        let address = listen.address()?.to_string();
        Ok(Self { listen: OfThisProcess::new(Mutex::new(Some(listen))), address })
    }

    fn __repr__(&self) -> String {
        format!("<Listen on {}>", self.address)
    }
}

/// How a robot is reached.
pub enum Target {
    /// At this address.
    Address(String),
    /// The controller connects to this program.
    Dials(r6_client::Listen),
}

impl Target {
    /// An address, or an unused `Listen`.
    pub fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(listen) = given.cast::<Listen>() {
            let listen = listen.get().listen.here()?.lock().unwrap_or_else(PoisonError::into_inner).take();
            let used = || PyRuntimeError::new_err("this Listen was used: make another for another attempt");
            return listen.map(Self::Dials).ok_or_else(used);
        }
        let wanted = |_| PyTypeError::new_err("an address is a str or an r6.Listen");
        given.extract().map(Self::Address).map_err(wanted)
    }

    /// Connects, for calls that wait in their threads.
    pub async fn connect(self, settings: RobotSettings) -> Result<(Driver, Robot), RequestError> {
        match self {
            Self::Address(address) => {
                // A caller that gives up does not wait for this thread. If the thread still connects, the
                // connection is closed.
                let connecting = spawn_blocking(move || blocking::Driver::connect(&address, settings));
                let made =
                    connecting.await.map_err(|error| NotSent::NoEngine { detail: error.to_string() })?;
                made.map(|(driver, robot)| (Driver::Threads(driver), robot))
            }
            Self::Dials(listen) => Ok((Driver::Engine, Robot::connect_with(listen, settings).await?)),
        }
    }
}

/// For ``discover`` and ``async_discover``.
#[pyfunction]
#[pyo3(signature = (addresses, settings=None))]
pub fn discovering(addresses: Vec<String>, settings: Option<&settings::RobotSettings>) -> Operation {
    let settings = settings.map(|settings| settings.0.clone()).unwrap_or_default();
    let asking = async move {
        let addresses: Vec<&str> = addresses.iter().map(String::as_str).collect();
        r6_client::discover(&addresses, &settings).await
    };
    Operation::new(asking, |py, found| {
        let list = PyList::empty(py);
        for discovered in found {
            let record = Record::new(py, "Discovered")?.with("address", discovered.address)?;
            let record = match discovered.who {
                Ok(identity) => record.with("who", convert::identity(py, &identity)?)?,
                Err(error) => record.with("who", error.exception(py))?,
            };
            list.append(record.build()?)?;
        }
        Ok(list.into_any())
    })
}
