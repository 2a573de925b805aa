//! Runs async code where nothing is async: a waiting caller drives it, and a thread drives it while no caller
//! waits.
//!
//! ```text
//! a call:   the caller's thread drives the runtime with its sockets and timers; no other thread wakes up
//! no call:  the keeper's thread drives it: it reads subscriptions, sends heartbeats, and streams motions
//! ```
//!
//! The keeper takes over when no call was made for a moment. The first call after that takes the runtime
//! back, which wakes each of the two threads once.

use std::future::{Future, poll_fn};
use std::io;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::thread::{self, Thread};
use std::time::Duration;

use tokio::runtime::{Builder, Handle, Runtime};
use tokio::sync::Notify;
use tokio::time::{Instant, sleep};

use crate::StopsUnderWay;

/// The keeper takes over when no call was made for this long. Its work has to be done within 20 ms, the
/// shortest period of a subscription. Calls that follow each other faster than this never wake the keeper.
const FIRST_PAUSE: Duration = Duration::from_millis(1);

/// The keeper checks at least this often whether a long call has ended.
const LONGEST_PAUSE: Duration = Duration::from_millis(10);

/// The time allowed for remaining work at the end: confirming a stop, and then closing a connection, which
/// takes half a second.
const FAREWELL: Duration = StopsUnderWay::WITHIN.saturating_add(Duration::from_secs(1));

/// Runs the async client for threads that are not async. All clones are the same engine; it ends when the
/// last one is dropped.
///
/// Each [`super::Robot`] has its own engine, unless the caller gives it one to share. Sharing saves one
/// thread per robot. The calls to robots that share an engine are driven by one thread at a time.
#[derive(Clone, Debug)]
pub struct Engine(Arc<Owner>);

/// Ends the keeper when the last engine is gone.
#[derive(Debug)]
struct Owner {
    shared: Arc<Shared>,
    keeper: Thread,
}

#[derive(Debug)]
struct Shared {
    runtime: Runtime,
    /// The number of calls that wait now.
    waiting: AtomicUsize,
    /// The number of calls that have begun so far.
    calls: AtomicU64,
    /// Whether the keeper drives the runtime, or is about to.
    kept: AtomicBool,
    /// Tells the keeper to let go.
    let_go: Notify,
    ended: AtomicBool,
}

impl Engine {
    /// Starts an engine and its thread.
    ///
    /// # Errors
    /// An error of the system, if it has no thread or no file for the engine.
    pub fn start() -> io::Result<Self> {
        let shared = Arc::new(Shared {
            runtime: Builder::new_current_thread().enable_all().build()?,
            waiting: AtomicUsize::new(0),
            calls: AtomicU64::new(0),
            kept: AtomicBool::new(false),
            let_go: Notify::new(),
            ended: AtomicBool::new(false),
        });
        let kept = Arc::clone(&shared);
        let keeper = thread::Builder::new().name("r6-engine".to_owned()).spawn(move || kept.keep())?;
        Ok(Self(Arc::new(Owner { shared, keeper: keeper.thread().clone() })))
    }

    /// Runs a future to its end on this thread.
    ///
    /// # Panics
    /// If a tokio runtime runs on this thread: nothing may block there.
    pub fn block_on<F: Future>(&self, future: F) -> F::Output {
        let shared = &self.0.shared;
        let mut future = pin!(future);
        let mut call = None;
        shared.runtime.block_on(poll_fn(|cx| {
            let polled = future.as_mut().poll(cx);
            // A future that is ready at once drives nothing. So a loop of such calls must not keep the keeper
            // away.
            if polled.is_pending() {
                call.get_or_insert_with(|| Call::begin(shared));
            }
            polled
        }))
    }

    /// Runs a function inside the runtime. The function must not wait.
    pub fn enter<T>(&self, what: impl FnOnce() -> T) -> T {
        let _inside = self.0.shared.runtime.enter();
        what()
    }

    /// The handle for spawning tasks that continue between the calls.
    #[must_use]
    pub fn handle(&self) -> &Handle {
        self.0.shared.runtime.handle()
    }
}

/// A call that waits.
struct Call<'s>(&'s Shared);

impl<'s> Call<'s> {
    fn begin(shared: &'s Shared) -> Self {
        shared.waiting.fetch_add(1, Ordering::SeqCst);
        shared.calls.fetch_add(1, Ordering::SeqCst);
        if shared.kept.load(Ordering::SeqCst) {
            shared.let_go.notify_one();
        }
        Self(shared)
    }
}

impl Drop for Call<'_> {
    fn drop(&mut self) {
        self.0.waiting.fetch_sub(1, Ordering::SeqCst);
    }
}

impl Shared {
    /// The main function of the keeper's thread.
    fn keep(mut self: Arc<Self>) {
        while self.wait_for_silence() {
            self.kept.store(true, Ordering::SeqCst);
            // A call that came between these two steps did not see the flag, so it did not ask the keeper to
            // let go. But the keeper sees the call here.
            if self.waiting.load(Ordering::SeqCst) == 0 {
                self.runtime.block_on(self.let_go.notified());
            }
            self.kept.store(false, Ordering::SeqCst);
        }
        self.runtime.block_on(self.farewell());
        // The runtime must end on this thread, because the last engine may be dropped inside another runtime.
        while let Err(shared) = Arc::try_unwrap(self) {
            self = shared;
            thread::park_timeout(FIRST_PAUSE);
        }
    }

    /// Waits until no call was made for a moment. Returns `false` when the engine ends.
    fn wait_for_silence(&self) -> bool {
        let mut pause = FIRST_PAUSE;
        loop {
            let calls = self.calls.load(Ordering::SeqCst);
            if self.ended.load(Ordering::SeqCst) {
                return false;
            }
            thread::park_timeout(pause);
            if self.waiting.load(Ordering::SeqCst) == 0 && self.calls.load(Ordering::SeqCst) == calls {
                return true;
            }
            pause = LONGEST_PAUSE.min(pause * 2);
        }
    }

    /// Waits until the tasks have ended, at most for [`FAREWELL`].
    async fn farewell(&self) {
        let until = Instant::now() + FAREWELL;
        while self.runtime.metrics().num_alive_tasks() > 0 && Instant::now() < until {
            sleep(FIRST_PAUSE).await;
        }
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::SeqCst);
        self.shared.let_go.notify_one();
        self.keeper.unpark();
    }
}
