//! Work that continues whether or not a caller waits: a motion that is streamed, a stop, the poller of the
//! subscriptions.
//!
//! An errand is a future that waits only for this client's replies and times, so that any hand can drive it.

use std::fmt;
use std::future::Future;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::Pin;
use std::sync::{Mutex, PoisonError};
use std::task::{Context, Poll};

use futures_util::future::{AbortHandle, Abortable};
use futures_util::stream::{FuturesUnordered, Stream};
use tokio::sync::oneshot;

/// An errand without a result.
pub(crate) type Boxed = Pin<Box<dyn Future<Output = ()> + Send>>;

/// Errands that were given and that no hand has begun.
#[derive(Default)]
pub(crate) struct Given(Mutex<Vec<Boxed>>);

impl fmt::Debug for Given {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Given")
    }
}

impl Given {
    /// Gives an errand. The receiver gets its result, or learns that it was given up.
    pub fn give<F>(&self, errand: F) -> oneshot::Receiver<F::Output>
    where
        F: Future<Output: Send> + Send + 'static,
    {
        let (tell, told) = oneshot::channel();
        self.push(Box::pin(async move {
            tell.send(errand.await).ok();
        }));
        told
    }

    /// Gives an errand that can be aborted.
    pub fn give_abortable(&self, errand: impl Future<Output = ()> + Send + 'static) -> AbortHandle {
        let (abort, registration) = AbortHandle::new_pair();
        let errand = Abortable::new(errand, registration);
        self.push(Box::pin(async move {
            errand.await.ok();
        }));
        abort
    }

    fn push(&self, errand: Boxed) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(errand);
    }

    /// Takes the errands that no hand has begun.
    pub fn take(&self) -> Vec<Boxed> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The errands that are under way.
#[derive(Default)]
pub(crate) struct Errands(FuturesUnordered<Boxed>);

impl fmt::Debug for Errands {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Errands").field(&self.0.len()).finish()
    }
}

impl Errands {
    /// Whether any is under way.
    pub fn any(&self) -> bool {
        !self.0.is_empty()
    }

    /// Begins the given errands, and drives those that can continue.
    pub fn drive(&mut self, given: &Given, cx: &mut Context<'_>) {
        self.0.extend(given.take());
        while !self.0.is_empty() {
            // A panic ends only this errand. Its receiver learns that there will be no result.
            match catch_unwind(AssertUnwindSafe(|| Pin::new(&mut self.0).poll_next(cx))) {
                Ok(Poll::Ready(Some(()))) => {}
                Err(_panicked) => crate::Event::WorkPanicked.log(""),
                Ok(Poll::Ready(None) | Poll::Pending) => break,
            }
        }
    }
}
