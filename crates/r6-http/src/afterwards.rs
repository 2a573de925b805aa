//! What goes on over a connection after its last answer.

use std::fmt;

use crate::work::Work;

/// What goes on over a connection after an answer with 101: an extension of that answer.
///
/// The task of the connection runs it. So it counts as a connection, and ends if the server has to make room
/// or ends itself.
#[derive(Clone)]
pub struct Afterwards(Work);

impl Afterwards {
    /// Work that has, or will get, the connection.
    pub fn new(work: impl Future<Output = ()> + Send + 'static) -> Self {
        Self(Work::new(work))
    }

    /// Runs it, unless that was done.
    pub(crate) async fn run(self) {
        if let Some(work) = self.0.take() {
            work.await;
        }
    }
}

impl fmt::Debug for Afterwards {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Afterwards")
    }
}
