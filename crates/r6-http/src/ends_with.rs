//! When a connection ends although its answer goes on.

use std::fmt;

use crate::work::Work;

/// Ends the connection with this future: an extension of an answer that goes on, such as a stream.
///
/// An answer notices nothing while its peer does not read, so it cannot end itself.
#[derive(Clone)]
pub struct EndsWith(Work);

impl EndsWith {
    /// The connection is closed when this is done. What waits to be sent is lost.
    pub fn new(end: impl Future<Output = ()> + Send + 'static) -> Self {
        Self(Work::new(end))
    }

    /// Waits for the end.
    pub(crate) async fn wait(self) {
        match self.0.take() {
            Some(end) => end.await,
            None => std::future::pending().await,
        }
    }
}

impl fmt::Debug for EndsWith {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("EndsWith")
    }
}
