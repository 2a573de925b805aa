//! What comes by itself: values that are read again and again, and what happens on the connection.

use std::sync::Arc;
use std::time::Duration;

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyString;
use r6_client::{Pushed, Subscription};
use tokio::sync::Mutex;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::time::timeout;

use crate::convert::{self, seconds};
use crate::errors::timed_out;
use crate::operation::Operation;
use crate::process::Kept;
use crate::record::Record;

/// Values that are read again and again.
#[pyclass(frozen, module = "r6._r6")]
pub struct SubscriptionCore {
    names: Arc<[Py<PyString>]>,
    /// Locked while somebody waits for the next values. `None` once it was ended.
    subscription: Kept<Arc<Mutex<Option<Subscription>>>>,
}

impl SubscriptionCore {
    /// The values under these names.
    pub fn new(names: Vec<Py<PyString>>, subscription: Subscription) -> Self {
        let subscription = Kept::new(Arc::new(Mutex::new(Some(subscription))));
        Self { names: names.into(), subscription }
    }
}

/// Waits no longer than that, if there is a limit.
async fn within<F: Future>(limit: Option<Duration>, future: F) -> Result<F::Output, Duration> {
    match limit {
        Some(limit) => timeout(limit, future).await.map_err(|_elapsed| limit),
        None => Ok(future.await),
    }
}

fn limit(timeout: Option<f64>) -> PyResult<Option<Duration>> {
    timeout.map(|time| seconds("timeout", time)).transpose()
}

#[pymethods]
impl SubscriptionCore {
    /// The values as they are known now.
    fn latest(&self) -> PyResult<Operation> {
        let (names, subscription) = (Arc::clone(&self.names), Arc::clone(self.subscription.here()?));
        let looking = async move { subscription.lock().await.as_ref().map(Subscription::latest) };
        Ok(Operation::new(looking, move |py, snapshot| match snapshot {
            Some(snapshot) => convert::snapshot(py, &names, &snapshot),
            None => py.None().into_bound_py_any(py),
        }))
    }

    /// The values once any was read again; `None` once the robot was closed.
    fn next(&self, timeout: Option<f64>) -> PyResult<Operation> {
        let (names, subscription) = (Arc::clone(&self.names), Arc::clone(self.subscription.here()?));
        let limit = limit(timeout)?;
        let waiting = within(limit, async move {
            match subscription.lock().await.as_mut() {
                Some(subscription) => subscription.next().await,
                None => None,
            }
        });
        Ok(Operation::new(waiting, move |py, snapshot| match snapshot.map_err(timed_out)? {
            Some(snapshot) => convert::snapshot(py, &names, &snapshot),
            None => py.None().into_bound_py_any(py),
        }))
    }

    /// Ends it.
    fn close(&self) -> PyResult<()> {
        // Whoever waits for the next values holds it, and drops it with the operation.
        if let Ok(mut subscription) = self.subscription.here()?.try_lock() {
            subscription.take();
        }
        Ok(())
    }
}

/// What happens on the connection.
#[pyclass(frozen, module = "r6._r6")]
pub struct PushedCore {
    receiver: Kept<Arc<Mutex<Receiver<Pushed>>>>,
}

impl PushedCore {
    /// From now on.
    pub fn new(receiver: Receiver<Pushed>) -> Self {
        Self { receiver: Kept::new(Arc::new(Mutex::new(receiver))) }
    }
}

#[pymethods]
impl PushedCore {
    /// The next event; `None` once the robot was closed.
    fn next(&self, timeout: Option<f64>) -> PyResult<Operation> {
        let receiver = Arc::clone(self.receiver.here()?);
        let limit = limit(timeout)?;
        let waiting = within(limit, async move { receiver.lock().await.recv().await });
        Ok(Operation::new(waiting, |py, event| match event.map_err(timed_out)? {
            Ok(event) => convert::pushed(py, event),
            Err(RecvError::Lagged(count)) => Record::new(py, "Missed")?.with("count", count)?.build(),
            Err(RecvError::Closed) => py.None().into_bound_py_any(py),
        }))
    }
}
