//! A future that travels with an answer to the task of its connection.

use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};

/// A future that is taken once. Extensions of an answer have to be `Clone` and `Sync`, which a future is not:
/// so it lies behind a lock, and all clones share it.
#[derive(Clone)]
pub(crate) struct Work(Arc<Mutex<Option<Boxed>>>);

type Boxed = Pin<Box<dyn Future<Output = ()> + Send>>;

impl Work {
    /// This future.
    pub fn new(work: impl Future<Output = ()> + Send + 'static) -> Self {
        Self(Arc::new(Mutex::new(Some(Box::pin(work)))))
    }

    /// The future, unless it was taken.
    pub fn take(self) -> Option<Boxed> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}
