//! Wakes a waiting thread: its future can continue, or another thread calls it.

use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Wake, Waker};
use std::time::Duration;

use super::system::{Parked, System};

/// Wakes one thread.
#[derive(Debug)]
pub(super) struct Signal {
    thread: Arc<dyn Parked>,
    /// Whether the thread is parked, or about to be.
    parked: AtomicBool,
    /// Whether its future can continue.
    woken: AtomicBool,
    /// Whether another thread called it to handle the connection.
    called: AtomicBool,
}

thread_local! {
    /// Created once for each thread, so that a call does not allocate one.
    static MINE: Cell<Option<(Arc<Signal>, Waker)>> = const { Cell::new(None) };
}

impl Signal {
    /// Creates a signal for the calling thread.
    pub fn here(system: &dyn System) -> Arc<Self> {
        let signal = Self {
            thread: system.this_thread(),
            parked: AtomicBool::new(false),
            woken: AtomicBool::new(false),
            called: AtomicBool::new(false),
        };
        Arc::new(signal)
    }

    /// Runs a function with the signal of this thread. A nested call gets another signal.
    pub fn with<T>(system: &dyn System, what: impl FnOnce(&Arc<Self>, &Waker) -> T) -> T {
        let mine = MINE.take().unwrap_or_else(|| {
            let signal = Self::here(system);
            let waker = Waker::from(Arc::clone(&signal));
            (signal, waker)
        });
        let done = what(&mine.0, &mine.1);
        MINE.set(Some(mine));
        done
    }

    /// Whether the future can continue.
    pub fn is_woken(&self) -> bool {
        self.woken.load(Ordering::SeqCst)
    }

    /// Prepares to poll the future: from now on, each wake of the future counts.
    pub fn begin_poll(&self) {
        self.woken.store(false, Ordering::SeqCst);
    }

    /// Calls the thread, which then handles the connection.
    pub fn call(&self) {
        self.called.store(true, Ordering::SeqCst);
        self.rouse();
    }

    /// Waits until the future can continue, the thread is called, or the time is over. It may return earlier.
    pub fn park(&self, within: Option<Duration>) {
        self.parked.store(true, Ordering::SeqCst);
        if !self.is_woken() && !self.called.load(Ordering::SeqCst) {
            self.thread.park(within);
        }
        self.parked.store(false, Ordering::SeqCst);
        // A call after this point finds the thread awake. The thread checks for it before it parks again.
        self.called.store(false, Ordering::SeqCst);
    }

    fn rouse(&self) {
        if self.parked.load(Ordering::SeqCst) {
            self.thread.unpark();
        }
    }

    #[cfg(test)]
    pub fn is_called(&self) -> bool {
        self.called.load(Ordering::SeqCst)
    }
}

impl Wake for Signal {
    fn wake(self: Arc<Self>) {
        self.wake_by_ref();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.woken.store(true, Ordering::SeqCst);
        self.rouse();
    }
}
