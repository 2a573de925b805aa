//! The time, as set by the hand that drives the client, and the tasks that wait for a time.
//!
//! ```text
//!  the hand:  pass(now) ──▶ now() is later, and wakes the tasks that waited for a time up to now
//!  a waiter:  sleep_until(at) ──▶ deadline(), by which the hand has to come back
//! ```

use std::collections::BTreeMap;
use std::fmt;
use std::future::Future;
use std::pin::{Pin, pin};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use r6_proto::time::Instant;

/// No task waits for a time.
const NEVER: u64 = u64::MAX;

/// The clock of one client. It advances only when its hand says so.
#[derive(Debug)]
pub(crate) struct Time {
    now: AtomicU64,
    /// The earliest time that a task waits for.
    earliest: AtomicU64,
    waiting: Mutex<Waiting>,
}

#[derive(Debug, Default)]
struct Waiting {
    by_time: BTreeMap<(Instant, u64), Waker>,
    next_id: u64,
}

/// The time limit passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Elapsed;

impl Default for Time {
    fn default() -> Self {
        Self { now: AtomicU64::new(0), earliest: AtomicU64::new(NEVER), waiting: Mutex::default() }
    }
}

impl Time {
    /// The time now.
    pub fn now(&self) -> Instant {
        Instant::from_nanos(self.now.load(Ordering::Acquire))
    }

    /// Sets the time and wakes the tasks whose time has come. Time never goes back.
    pub fn pass(&self, now: Instant) {
        self.now.fetch_max(now.as_nanos(), Ordering::AcqRel);
        if now.as_nanos() < self.earliest.load(Ordering::Acquire) {
            return;
        }
        let mut due = Vec::new();
        {
            let mut waiting = self.waiting();
            while let Some(first) = waiting.by_time.first_entry()
                && first.key().0 <= now
            {
                due.push(first.remove());
            }
            self.note_earliest(&waiting);
        }
        due.into_iter().for_each(Waker::wake);
    }

    /// The next time at which a task has to be woken.
    pub fn deadline(&self) -> Option<Instant> {
        match self.earliest.load(Ordering::Acquire) {
            NEVER => None,
            nanos => Some(Instant::from_nanos(nanos)),
        }
    }

    /// Ends at that time.
    pub fn sleep_until(self: &Arc<Self>, at: Instant) -> Sleep {
        Sleep { time: Arc::clone(self), at, id: None }
    }

    /// Ends after this time.
    pub fn sleep(self: &Arc<Self>, time: Duration) -> Sleep {
        self.sleep_until(self.now() + time)
    }

    /// Waits for the future until that time at most.
    pub async fn timeout_at<F: Future>(self: &Arc<Self>, at: Instant, what: F) -> Result<F::Output, Elapsed> {
        let (mut what, mut over) = (pin!(what), pin!(self.sleep_until(at)));
        std::future::poll_fn(|cx| match what.as_mut().poll(cx) {
            Poll::Ready(output) => Poll::Ready(Ok(output)),
            Poll::Pending => over.as_mut().poll(cx).map(|()| Err(Elapsed)),
        })
        .await
    }

    /// Waits for the future for this long at most.
    pub async fn timeout<F: Future>(self: &Arc<Self>, time: Duration, what: F) -> Result<F::Output, Elapsed> {
        self.timeout_at(self.now() + time, what).await
    }

    /// No caller holds this guard across an await, and nothing can panic while holding it.
    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn note_earliest(&self, waiting: &Waiting) {
        let first = waiting.by_time.first_key_value().map_or(NEVER, |((at, _), _)| at.as_nanos());
        self.earliest.store(first, Ordering::Release);
    }
}

/// Ends at its time.
#[must_use]
pub(crate) struct Sleep {
    time: Arc<Time>,
    at: Instant,
    /// Its number, while it waits.
    id: Option<u64>,
}

impl fmt::Debug for Sleep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Sleep").field(&self.at).finish()
    }
}

impl Future for Sleep {
    type Output = ();

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<()> {
        // Checked under the lock, so that the time cannot come between this check and the wait.
        let this = &mut *self;
        let mut waiting = this.time.waiting();
        if this.time.now() >= this.at {
            return Poll::Ready(());
        }
        let id = *this.id.get_or_insert_with(|| {
            waiting.next_id += 1;
            waiting.next_id
        });
        let earlier = waiting.by_time.insert((this.at, id), cx.waker().clone());
        this.time.note_earliest(&waiting);
        drop(waiting);
        // Not under the lock: the last of a task's wakers may own a `Sleep` of this clock too.
        drop(earlier);
        Poll::Pending
    }
}

impl Drop for Sleep {
    fn drop(&mut self) {
        if let Some(id) = self.id {
            let waker = {
                let mut waiting = self.time.waiting();
                let waker = waiting.by_time.remove(&(self.at, id));
                self.time.note_earliest(&waiting);
                waker
            };
            drop(waker);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn at(ms: u64) -> Instant {
        Instant::ORIGIN + Duration::from_millis(ms)
    }

    fn poll<F: Future>(future: Pin<&mut F>) -> Poll<F::Output> {
        future.poll(&mut Context::from_waker(Waker::noop()))
    }

    #[test]
    fn what_is_in_time_counts_and_what_is_late_does_not() {
        let time = Arc::new(Time::default());
        let mut late = pin!(time.timeout_at(at(5), std::future::pending::<()>()));
        assert_eq!(poll(late.as_mut()), Poll::Pending);
        assert_eq!(time.deadline(), Some(at(5)));
        time.pass(at(4));
        assert_eq!(poll(late.as_mut()), Poll::Pending);
        time.pass(at(5));
        assert_eq!(poll(late.as_mut()), Poll::Ready(Err(Elapsed)));
        let mut both = pin!(time.timeout_at(at(5), std::future::ready(7)));
        assert_eq!(poll(both.as_mut()), Poll::Ready(Ok(7)), "what is there counts, however late it is");
    }

    #[test]
    fn a_waker_that_is_replaced_may_own_a_wait_of_its_own() {
        struct Owns(#[expect(dead_code, reason = "it is dropped with its waker")] Sleep);

        impl std::task::Wake for Owns {
            fn wake(self: Arc<Self>) {}
        }

        let (tell, told) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let time = Arc::new(Time::default());
            let mut owned = time.sleep_until(at(5));
            assert_eq!(poll(Pin::new(&mut owned)), Poll::Pending);
            let mut waits = time.sleep_until(at(7));
            let waker = Waker::from(Arc::new(Owns(owned)));
            assert_eq!(Pin::new(&mut waits).poll(&mut Context::from_waker(&waker)), Poll::Pending);
            drop(waker);
            assert_eq!(poll(Pin::new(&mut waits)), Poll::Pending);
            tell.send(time.deadline()).unwrap();
        });
        assert_eq!(told.recv_timeout(Duration::from_secs(10)), Ok(Some(at(7))), "it hangs");
    }

    #[test]
    fn time_never_goes_back() {
        let time = Time::default();
        time.pass(at(5));
        time.pass(at(4));
        assert_eq!(time.now(), at(5));
    }

    proptest! {
        /// The deadline is the earliest time that a task waits for, however tasks come and go.
        #[test]
        fn the_deadline_is_the_earliest(waits in prop::collection::vec((0_u64..100, any::<bool>()), 1..30), now in 0_u64..100) {
            let time = Arc::new(Time::default());
            let mut sleeps: Vec<_> = waits.iter().map(|(ms, _)| Box::pin(time.sleep_until(at(*ms)))).collect();
            for sleep in &mut sleeps {
                let waits = sleep.at > at(0);
                prop_assert_eq!(poll(sleep.as_mut()).is_pending(), waits);
            }
            let mut kept: Vec<u64> = waits.iter().filter(|(_, keep)| *keep).map(|(ms, _)| *ms).collect();
            let mut keep = waits.iter().map(|(_, keep)| *keep);
            sleeps.retain(|_| keep.next().unwrap_or(false));
            kept.retain(|ms| *ms > 0);
            prop_assert_eq!(time.deadline(), kept.iter().min().map(|ms| at(*ms)));
            time.pass(at(now));
            kept.retain(|ms| *ms > now);
            prop_assert_eq!(time.deadline(), kept.iter().min().map(|ms| at(*ms)));
            for sleep in &mut sleeps {
                let waits = sleep.at > at(now);
                prop_assert_eq!(poll(sleep.as_mut()).is_pending(), waits);
            }
        }
    }
}
