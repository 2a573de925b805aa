//! Threads for work that computes for long.

use std::sync::Arc;

use r6_api::Code;
use tokio::sync::Semaphore;

use crate::problem::Problem;

/// How many checks and plans compute at once. One takes milliseconds, a long one a second. The connections to
/// the robots need the other processors.
const AT_ONCE: usize = 2;

/// A place for work that computes.
#[derive(Clone, Debug)]
pub struct Bench(Arc<Semaphore>);

impl Bench {
    /// An empty one.
    #[must_use]
    pub fn new() -> Self {
        Self(Arc::new(Semaphore::new(AT_ONCE)))
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
        let place = Arc::clone(&self.0).try_acquire_owned();
        let place = place.map_err(|_| {
            Problem::new(Code::Overloaded, "other programs are being checked or planned: ask again")
        })?;
        let done = tokio::task::spawn_blocking(move || {
            let done = work();
            drop(place);
            done
        });
        done.await.map_err(|_| Problem::new(Code::Overloaded, "it was not computed: the gateway ends"))
    }
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
