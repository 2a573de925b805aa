//! Serves as a camera: passes each photo request to Python, and sends the result.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::IntoPyObjectExt;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;
use r6_client::{PhotosEnded, Robot, Shot};
use r6_proto::message::Point;
use tokio::sync::{mpsc, oneshot, watch};

use crate::handle::Streaming;
use crate::operation::Operation;
use crate::process::{OfThisProcess, Process};
use crate::raising::Raise;
use crate::record::{Record, class};

/// A message from the serving task.
enum Came {
    /// The controller asks for a photo.
    Asked { cam_id: i64, tell: oneshot::Sender<Shot> },
    /// No other request will come.
    Ended(PhotosEnded),
}

struct Parts {
    /// Locked while a caller waits.
    coming: Arc<tokio::sync::Mutex<mpsc::Receiver<Came>>>,
    /// Where to send the result of the last request.
    waits: Arc<Mutex<Option<oneshot::Sender<Shot>>>>,
    serving: Streaming,
    /// Its sender is dropped when the task has ended.
    ended: watch::Receiver<()>,
}

/// The common part of ``serve_photos`` in ``Robot`` and ``AsyncRobot``.
#[pyclass(frozen, module = "r6._r6")]
pub struct PhotosCore {
    parts: OfThisProcess<Parts>,
}

impl PhotosCore {
    /// Begins to serve. A task waits for the pictures, not a thread, so a slow picture delays nothing else.
    pub fn new(py: Python<'_>, robot: Robot) -> PyResult<Self> {
        let (ask, coming) = mpsc::channel(1);
        let (alive, ended) = watch::channel(());
        let task = Process::current(py)?.engine().handle().spawn(async move {
            // Dropped last, after the service has ended.
            let _alive = alive;
            let look = |cam_id| {
                let ask = ask.clone();
                async move {
                    let (tell, told) = oneshot::channel();
                    // The receiver is gone only if this task is about to end too.
                    ask.send(Came::Asked { cam_id, tell }).await.ok();
                    told.await.unwrap_or(Shot::NotMine)
                }
            };
            let ended = robot.serve_photos(look).await;
            ask.send(Came::Ended(ended)).await.ok();
        });
        let coming = Arc::new(tokio::sync::Mutex::new(coming));
        let serving = Streaming(task.abort_handle());
        Ok(Self { parts: OfThisProcess::new(Parts { coming, waits: Arc::default(), serving, ended }) })
    }
}

#[pymethods]
impl PhotosCore {
    /// The camera of the next request, or why no other request comes.
    fn next(&self) -> PyResult<Operation> {
        let parts = self.parts.here()?;
        let (coming, waits) = (Arc::clone(&parts.coming), Arc::clone(&parts.waits));
        let waiting = async move {
            let mut coming = coming.lock().await;
            loop {
                match coming.recv().await {
                    // The request was withdrawn before the caller saw it.
                    Some(Came::Asked { tell, .. }) if tell.is_closed() => {}
                    Some(Came::Asked { cam_id, tell }) => {
                        *waits.lock().unwrap_or_else(PoisonError::into_inner) = Some(tell);
                        return Ok(cam_id);
                    }
                    Some(Came::Ended(ended)) => return Err(ended),
                    None => return Err(PhotosEnded::Closed),
                }
            }
        };
        Ok(Operation::new(waiting, |py, asked| match asked {
            Ok(cam_id) => cam_id.into_bound_py_any(py),
            Err(ended) => self::ended(py, &ended),
        }))
    }

    /// Answers the last request. Nothing is sent if the program was stopped or the connection was lost in the
    /// meantime.
    fn answer(&self, shot: &Bound<'_, PyAny>) -> PyResult<()> {
        let parts = self.parts.here()?;
        let shot = self::shot(shot)?;
        if let Some(tell) = parts.waits.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // An error says that the request was withdrawn.
            drop(tell.send(shot));
        }
        Ok(())
    }

    /// Ends it at once, and waits until it has ended, so that another camera may begin. A waiting request
    /// gets no answer.
    fn close(&self) -> PyResult<Operation> {
        let parts = self.parts.here()?;
        parts.serving.end();
        let mut ended = parts.ended.clone();
        let ending = async move { while ended.changed().await.is_ok() {} };
        Ok(Operation::new(ending, |py, ()| Ok(py.None().into_bound(py))))
    }
}

fn ended<'py>(py: Python<'py>, ended: &PhotosEnded) -> PyResult<Bound<'py, PyAny>> {
    let (reason, cam_id, error, missed) = match ended {
        PhotosEnded::ConnectionLost(_) => ("connection_lost", None, None, None),
        PhotosEnded::Stopped => ("stopped", None, None, None),
        PhotosEnded::Closed => ("closed", None, None, None),
        PhotosEnded::ServedAlready => ("served_already", None, None, None),
        PhotosEnded::Request { cam_id, error } => ("request", Some(*cam_id), Some(error.exception(py)), None),
        PhotosEnded::FellBehind { missed } => ("fell_behind", None, None, Some(*missed)),
    };
    Record::new(py, "PhotosEnded")?
        .with("reason", reason)?
        .with("cam_id", cam_id)?
        .with("error", error)?
        .with("missed", missed)?
        .with("text", ended.to_string())?
        .build()
}

/// Converts a list of points, or a word.
fn shot(object: &Bound<'_, PyAny>) -> PyResult<Shot> {
    if let Ok(word) = object.cast::<PyString>() {
        return match word.to_cow()?.as_ref() {
            "failed" => Ok(Shot::Failed),
            "not_mine" => Ok(Shot::NotMine),
            other => Err(PyValueError::new_err(format!(
                "a photo gives points, `failed` or `not_mine`, not `{other}`"
            ))),
        };
    }
    let points: Vec<Bound<'_, PyAny>> = object.extract().map_err(|_| {
        PyTypeError::new_err(format!(
            "a photo gives a list of r6.Point, perhaps empty, or \"failed\", or \"not_mine\": not {}",
            object.get_type()
        ))
    })?;
    Ok(Shot::Points(self::points(points)?))
}

/// Converts objects of `r6._types.Point`.
pub fn points(objects: Vec<Bound<'_, PyAny>>) -> PyResult<Vec<Point>> {
    objects.iter().map(point).collect()
}

fn point(object: &Bound<'_, PyAny>) -> PyResult<Point> {
    if !object.is_instance(&class(object.py(), "Point")?)? {
        return Err(PyTypeError::new_err("points have to be r6.Point"));
    }
    Ok(Point {
        model_id: object.getattr("model_id")?.extract()?,
        x: object.getattr("x")?.extract()?,
        y: object.getattr("y")?.extract()?,
        z: object.getattr("z")?.extract()?,
        u: object.getattr("u")?.extract()?,
        v: object.getattr("v")?.extract()?,
        angle: object.getattr("angle")?.extract()?,
        similarity: object.getattr("similarity")?.extract()?,
        color: object.getattr("color")?.extract()?,
        relative: object.getattr("relative")?.extract()?,
    })
}
