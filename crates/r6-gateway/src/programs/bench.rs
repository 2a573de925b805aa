//! Threads for work that computes for long.

use std::sync::Arc;

use r6_api::Code;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::problem::Problem;

/// How many checks and plans compute at once. One takes milliseconds, a long one a second. The connections to
/// the robots need the other processors.
const AT_ONCE: usize = 2;

/// A place for work that computes.
#[derive(Clone, Debug)]
pub struct Bench {
    places: Arc<Semaphore>,
    /// A place of its own for programs that are to be stored: viewers that plan in a loop must not keep
    /// engineers from that.
    to_store: Arc<Semaphore>,
    /// The same for programs that are to run.
    to_run: Arc<Semaphore>,
}

impl Bench {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        let one = || Arc::new(Semaphore::new(1));
        Self { places: Arc::new(Semaphore::new(AT_ONCE)), to_store: one(), to_run: one() }
    }

    /// Computes something on a thread of its own. It goes on to its end if the caller goes away, and takes
    /// its place until then.
    ///
    /// # Errors
    /// `overloaded` if the place is taken, or if the process ends.
    pub async fn compute<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Problem> {
        on(place(&self.places)?, work).await
    }

    /// The same for a program that is to be stored, which has a place more.
    ///
    /// # Errors
    /// `overloaded` if that is taken too, or if the process ends.
    pub async fn compute_to_store<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Problem> {
        on(place(&self.to_store).or_else(|_| place(&self.places))?, work).await
    }

    /// The same for a program that is to run, which has a place more.
    ///
    /// # Errors
    /// `overloaded` if that is taken too, or if the process ends.
    pub async fn compute_to_run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Problem> {
        on(place(&self.to_run).or_else(|_| place(&self.places))?, work).await
    }
}

fn place(of: &Arc<Semaphore>) -> Result<OwnedSemaphorePermit, Problem> {
    Arc::clone(of)
        .try_acquire_owned()
        .map_err(|_| Problem::new(Code::Overloaded, "other programs are being checked or planned: ask again"))
}

async fn on<T: Send + 'static>(
    place: OwnedSemaphorePermit,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Problem> {
    let done = tokio::task::spawn_blocking(move || {
        let done = work();
        drop(place);
        done
    });
    done.await.map_err(|_| Problem::new(Code::Overloaded, "it was not computed: the gateway ends"))
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[tokio::test]
    async fn what_finds_no_place_is_refused_and_a_place_comes_back() {
        let bench = Bench::new();
        let mut running = Vec::new();
        for _ in 0..AT_ONCE {
            let (release, wait) = channel::<()>();
            let (began, begun) = tokio::sync::oneshot::channel();
            let bench = bench.clone();
            let task = tokio::spawn(async move {
                let work = move || {
                    began.send(()).unwrap();
                    wait.recv().is_err()
                };
                bench.compute(work).await
            });
            begun.await.unwrap();
            running.push((task, release));
        }
        assert_eq!(bench.compute(|| 1).await.unwrap_err().code, Code::Overloaded);
        assert_eq!(bench.compute_to_store(|| 1).await.unwrap(), 1, "this has a place of its own");
        assert_eq!(bench.compute_to_run(|| 1).await.unwrap(), 1, "and this");
        // A caller that goes away leaves its place to the work that goes on.
        running[0].0.abort();
        assert_eq!(bench.compute(|| 1).await.unwrap_err().code, Code::Overloaded);
        for (task, release) in running {
            drop(release);
            let _ = task.await;
        }
        while bench.compute(|| 1).await.is_err() {
            tokio::task::yield_now().await;
        }
    }
}
