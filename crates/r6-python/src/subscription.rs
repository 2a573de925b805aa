//! What arrives without a request of the caller: values that are read repeatedly, and events on the
//! connection.

use std::future;
use std::sync::Arc;
use std::time::Duration;

use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyString;
use r6_client::{Pushed, Snapshot, Subscription};
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{Mutex, watch};
use tokio::time::timeout;

use crate::convert::{self, seconds};
use crate::errors::timed_out;
use crate::operation::Operation;
use crate::process::OfThisProcess;
use crate::record::Record;

/// The common part of ``Subscription`` and ``AsyncSubscription``.
#[pyclass(frozen, module = "r6._r6")]
pub struct SubscriptionCore {
    names: Arc<[Py<PyString>]>,
    shared: OfThisProcess<Arc<Shared>>,
}

struct Shared {
    /// Locked while a caller waits for the next values. `None` once it was ended.
    subscription: Mutex<Option<Subscription>>,
    closed: watch::Sender<bool>,
}

impl Shared {
    /// The next values; `None` once it was ended, or the robot was closed.
    async fn next(&self) -> Option<Snapshot> {
        let next = async { self.subscription.lock().await.as_mut()?.next().await };
        tokio::select! {
            biased;
            () = is_true(self.closed.subscribe()) => {}
            snapshot = next => return snapshot,
        }
        // This lock succeeds once the last waiting caller has released it.
        self.subscription.lock().await.take();
        None
    }
}

/// Waits until the value is true. Never returns if the sender is gone.
async fn is_true(mut told: watch::Receiver<bool>) {
    if told.wait_for(|told| *told).await.is_err() {
        future::pending().await
    }
}

impl SubscriptionCore {
    /// A subscription with the names that the caller used.
    pub fn new(names: Vec<Py<PyString>>, subscription: Subscription) -> Self {
        let subscription = Mutex::new(Some(subscription));
        let shared = Shared { subscription, closed: watch::Sender::new(false) };
        Self { names: names.into(), shared: OfThisProcess::new(Arc::new(shared)) }
    }
}

/// Waits at most for the limit, if there is one.
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
    /// The last known values.
    fn latest(&self) -> PyResult<Operation> {
        let (names, shared) = (Arc::clone(&self.names), Arc::clone(self.shared.here()?));
        let looking = async move { shared.subscription.lock().await.as_ref().map(Subscription::latest) };
        Ok(Operation::new(looking, move |py, snapshot| match snapshot {
            Some(snapshot) => convert::snapshot(py, &names, &snapshot),
            None => py.None().into_bound_py_any(py),
        }))
    }

    /// The values after at least one was read again; `None` once it was ended, or the robot was closed.
    fn next(&self, timeout: Option<f64>) -> PyResult<Operation> {
        let (names, shared) = (Arc::clone(&self.names), Arc::clone(self.shared.here()?));
        let waiting = within(limit(timeout)?, async move { shared.next().await });
        Ok(Operation::new(waiting, move |py, snapshot| match snapshot.map_err(timed_out)? {
            Some(snapshot) => convert::snapshot(py, &names, &snapshot),
            None => py.None().into_bound_py_any(py),
        }))
    }

    /// Ends the subscription, and every wait for its next values.
    fn close(&self) -> PyResult<()> {
        let shared = self.shared.here()?;
        shared.closed.send_replace(true);
        // A caller that waits for the next values holds the lock. It takes the subscription when it sees that
        // this is closed.
        if let Ok(mut subscription) = shared.subscription.try_lock() {
            subscription.take();
        }
        Ok(())
    }
}

/// The common part of ``PushedEvents`` and ``AsyncPushedEvents``.
#[pyclass(frozen, module = "r6._r6")]
pub struct PushedCore {
    receiver: OfThisProcess<Arc<Mutex<Receiver<Pushed>>>>,
    /// Whether the robot was closed. The sender of the events lives longer, because a subscription keeps it.
    closed: OfThisProcess<watch::Receiver<bool>>,
}

impl PushedCore {
    /// Events from now on, until it is closed.
    pub fn new(receiver: Receiver<Pushed>, closed: watch::Receiver<bool>) -> Self {
        Self {
            receiver: OfThisProcess::new(Arc::new(Mutex::new(receiver))),
            closed: OfThisProcess::new(closed),
        }
    }
}

#[pymethods]
impl PushedCore {
    /// The next event; `None` once the robot was closed.
    fn next(&self, timeout: Option<f64>) -> PyResult<Operation> {
        let (receiver, closed) = (Arc::clone(self.receiver.here()?), self.closed.here()?.clone());
        let waiting = within(limit(timeout)?, async move {
            let mut receiver = receiver.lock().await;
            tokio::select! {
                biased;
                event = receiver.recv() => event,
                () = is_true(closed) => Err(RecvError::Closed),
            }
        });
        Ok(Operation::new(waiting, |py, event| match event.map_err(timed_out)? {
            Ok(event) => convert::pushed(py, event),
            Err(RecvError::Lagged(count)) => Record::new(py, "Missed")?.with("count", count)?.build(),
            Err(RecvError::Closed) => py.None().into_bound_py_any(py),
        }))
    }
}
