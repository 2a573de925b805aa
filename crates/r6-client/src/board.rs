//! State that the subscriptions of one connection share: which address is wanted how often, and its last
//! value.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use futures_util::future::AbortHandle;
use r6_proto::Reading;
use r6_proto::address::{Address, AddressMap, Walk};
use r6_proto::time::Instant;
use tokio::sync::{Notify, watch};

use crate::error::{NotSent, OutcomeUnknown, RequestError};
use crate::poll_plan::{Next, PollPlan, next_due, slack};
use crate::query::result::{AskedAt, NoReading, QueryResult};
use crate::subscription::limits::{MAX_ADDRESSES, MAX_POLLED, MAX_SUBSCRIPTIONS, NotSubscribed};
use crate::tap::{MAX_RECORDINGS, Tap};
use crate::time::Time;

/// The last value of an address.
#[derive(Clone, Debug)]
pub(crate) struct Last {
    pub value: Result<Reading, NoReading>,
    /// When it was asked for: the value is no older.
    pub at: Instant,
    /// The number of the connection that it was read over.
    pub connection: u64,
}

/// Subscriptions, plan and values.
#[derive(Debug)]
pub(crate) struct Board {
    time: Arc<Time>,
    shared: Mutex<Shared>,
    /// Wakes the poller after a change.
    changed: Notify,
}

#[derive(Debug, Default)]
struct Shared {
    plan: PollPlan,
    wishes: BTreeMap<u64, Wish>,
    next_id: u64,
    values: AddressMap<Last>,
    /// What was asked for last: in general it is asked for again.
    asked: Arc<[Address]>,
    failure: Option<RequestError>,
    poller: Option<AbortHandle>,
    taps: Vec<Tap>,
    /// How many connections were lost.
    losses: u64,
    closed: bool,
}

/// A query that is due.
#[derive(Debug)]
pub(crate) struct Poll {
    /// In the order of [`Address`].
    pub addresses: Arc<[Address]>,
    begun: Instant,
    /// How many connections were lost before it.
    losses: u64,
}

/// The wishes of one subscription.
#[derive(Debug)]
struct Wish {
    /// In the order of [`Address`].
    addresses: Vec<Address>,
    every: Duration,
    /// When it is to be notified again.
    due: Instant,
    news: watch::Sender<()>,
}

impl Shared {
    /// Plans each address at the shortest period of its subscriptions, and forgets values that no
    /// subscription wants.
    fn plan_anew(&mut self, now: Instant) {
        let mut wanted = AddressMap::<Duration>::default();
        for wish in self.wishes.values() {
            let mut walk = Walk::default();
            for address in &wish.addresses {
                let every = wanted.walk_to_or_insert(&mut walk, *address, || wish.every);
                *every = wish.every.min(*every);
            }
        }
        self.values.retain(|address, _| wanted.contains(address));
        self.plan.replace(&wanted, now);
    }

    /// Notifies the subscriptions concerned, each no faster than its own period, counted between the times at
    /// which polls were asked for, such as `begun`. If the times of replies counted, a fast reply after a
    /// slow one would not be told.
    fn tell(&mut self, asked: &[Address], begun: Instant) {
        for wish in self.wishes.values_mut() {
            if begun + slack(wish.every) >= wish.due && share(asked, &wish.addresses) {
                wish.due = next_due(begun, wish.every);
                wish.news.send_replace(());
            }
        }
    }

    /// Notifies all subscriptions at once, and again as soon as there is news.
    fn tell_all(&mut self) {
        self.wishes.values_mut().for_each(|wish| {
            wish.due = Instant::ORIGIN;
            wish.news.send_replace(());
        });
    }
}

impl Board {
    /// A board without subscriptions.
    pub fn new(time: Arc<Time>) -> Self {
        Self { time, shared: Mutex::default(), changed: Notify::new() }
    }

    fn shared(&self) -> MutexGuard<'_, Shared> {
        // Nothing can panic while holding this guard, and no caller holds it across an await.
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a subscription. `poll` provides the poller if none runs; it does not start it yet.
    pub fn add(
        &self,
        addresses: &[Address],
        every: Duration,
        poll: impl FnOnce() -> AbortHandle,
    ) -> Result<(u64, watch::Receiver<()>), NotSubscribed> {
        let mut addresses = addresses.to_vec();
        addresses.sort_unstable();
        addresses.dedup();
        let mut shared = self.shared();
        if shared.closed {
            return Err(NotSubscribed::Closed);
        }
        if addresses.is_empty() || addresses.len() > MAX_ADDRESSES {
            return Err(NotSubscribed::Addresses { asked: addresses.len() });
        }
        if shared.wishes.len() >= MAX_SUBSCRIPTIONS {
            return Err(NotSubscribed::Subscriptions);
        }
        let new = addresses.iter().filter(|address| shared.plan.every(**address).is_none()).count();
        if shared.plan.len() + new > MAX_POLLED {
            return Err(NotSubscribed::Polled { polled: shared.plan.len(), new });
        }
        let id = shared.next_id;
        shared.next_id += 1;
        let (news, seen) = watch::channel(());
        let wish = Wish { addresses, every, due: Instant::ORIGIN, news };
        shared.wishes.insert(id, wish);
        shared.plan_anew(self.time.now());
        if shared.poller.is_none() {
            shared.poller = Some(poll());
        }
        drop(shared);
        self.changed.notify_one();
        Ok((id, seen))
    }

    /// Ends a subscription. The last one also ends the poller, even while it waits.
    pub fn remove(&self, id: u64) {
        let mut shared = self.shared();
        shared.wishes.remove(&id);
        shared.plan_anew(self.time.now());
        let mut ended = None;
        if shared.wishes.is_empty() {
            shared.failure = None;
            ended = shared.poller.take();
        }
        drop(shared);
        // Not under the lock, because it wakes the driver.
        if let Some(poller) = ended {
            poller.abort();
        }
    }

    /// The shortest period of all subscriptions; `None` without one.
    pub fn pace(&self) -> Option<Duration> {
        self.shared().wishes.values().map(|wish| wish.every).min()
    }

    /// What one subscription sees. `row` makes a row of an address, its last value and its period. Also
    /// returns why the last poll failed.
    pub fn seen<T>(
        &self,
        addresses: &[Address],
        mut row: impl FnMut(Address, Option<&Last>, Duration) -> T,
    ) -> (Vec<T>, Option<RequestError>) {
        let shared = self.shared();
        let (mut planned, mut kept) = (Walk::default(), Walk::default());
        let rows = addresses.iter().map(|address| {
            let every = shared.plan.every_of_next(&mut planned, *address).unwrap_or_default();
            row(*address, shared.values.walk_to(&mut kept, *address), every)
        });
        (rows.collect(), shared.failure.clone())
    }

    /// Adds a recording. `false` if the handle is closed, or if there are too many.
    pub fn tap(&self, tap: Tap) -> bool {
        let mut shared = self.shared();
        let takes = !shared.closed && shared.taps.len() < MAX_RECORDINGS;
        if takes {
            shared.taps.push(tap);
        }
        takes
    }

    /// The connection is lost: notifies all subscriptions; everything is read again on the next connection.
    pub fn connection_lost(&self) {
        let mut shared = self.shared();
        shared.losses += 1;
        shared.plan.all_due(self.time.now());
        shared.tell_all();
        drop(shared);
        self.changed.notify_one();
    }

    /// The handle is closed: ends all subscriptions.
    pub fn close(&self) {
        let mut shared = self.shared();
        shared.closed = true;
        shared.wishes.clear();
        shared.taps.clear();
        shared.plan.replace(&AddressMap::default(), self.time.now());
        drop(shared);
        self.changed.notify_one();
    }

    /// Waits for the next query of the poller; `None` when no subscription is left.
    pub async fn due(&self) -> Option<Poll> {
        loop {
            let until = {
                let mut shared = self.shared();
                match shared.plan.next(self.time.now()) {
                    Next::Ask(addresses) => {
                        if *shared.asked != *addresses {
                            shared.asked = addresses.into();
                        }
                        let (addresses, losses) = (Arc::clone(&shared.asked), shared.losses);
                        return Some(Poll { addresses, begun: self.time.now(), losses });
                    }
                    Next::Idle => return None,
                    Next::Wait(until) => until,
                }
            };
            tokio::select! {
                biased;
                () = self.time.sleep_until(until) => {}
                () = self.changed.notified() => {}
            }
        }
    }

    /// A poll was answered; each value comes with the time at which it was asked for.
    pub fn answered(&self, poll: &Poll, result: &QueryResult, asked_at: &AskedAt) {
        let now = self.time.now();
        let mut shared = self.shared();
        shared.taps.retain(|tap| tap.take(result, asked_at));
        let (mut planned, mut kept) = (Walk::default(), Walk::default());
        for (position, (address, value)) in result.rows().iter().enumerate() {
            if let Some(at) = asked_at.of(position)
                && shared.plan.every_of_next(&mut planned, *address).is_some()
            {
                let last = Last { value: value.clone(), at, connection: result.connection() };
                match shared.values.walk_to_mut(&mut kept, *address) {
                    Some(kept) => *kept = last,
                    None => drop(shared.values.insert(*address, last)),
                }
            }
        }
        shared.failure = None;
        // Values from before a loss of the connection have to be read again on the next one.
        if shared.losses == poll.losses {
            shared.plan.answered(&poll.addresses, poll.begun, now);
        }
        shared.tell(&poll.addresses, poll.begun);
    }

    /// A poll failed; the old values stay, and age.
    pub fn failed(&self, poll: &Poll, error: RequestError) {
        let now = self.time.now();
        let mut shared = self.shared();
        if took_its_time(&error) {
            shared.plan.lost(&poll.addresses, now);
        } else {
            shared.plan.failed(&poll.addresses, now);
        }
        shared.failure = Some(error);
        shared.tell_all();
    }
}

/// Whether an address is in both lists, which are in the order of the addresses.
fn share(mut one: &[Address], mut other: &[Address]) -> bool {
    while let ([first, one_left @ ..], [second, other_left @ ..]) = (one, other) {
        match first.cmp(second) {
            Ordering::Equal => return true,
            Ordering::Less => one = one_left,
            Ordering::Greater => other = other_left,
        }
    }
    false
}

/// Whether the failure came after a timeout or an attempt to connect, which has its own wait. Another pause
/// before the next poll is then useless.
fn took_its_time(error: &RequestError) -> bool {
    matches!(
        error,
        RequestError::NotSent(
            NotSent::Unreachable { .. } | NotSent::ConnectTimedOut { .. } | NotSent::Unidentified { .. }
        ) | RequestError::OutcomeUnknown(
            OutcomeUnknown::TimedOut { .. } | OutcomeUnknown::ConnectionLost { .. }
        )
    )
}

#[cfg(test)]
mod tests {
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};
    use std::time::Duration;

    use super::Poll as Poll_;
    use super::*;

    const SLOW: Duration = Duration::from_secs(1000);

    struct Watched {
        board: Board,
        id: u64,
        news: watch::Receiver<()>,
    }

    fn watched() -> Watched {
        let board = Board::new(Arc::default());
        let poller = || AbortHandle::new_pair().0;
        let (id, news) = board.add(&[Address::CurMode], SLOW, poller).unwrap();
        Watched { board, id, news }
    }

    fn mode(number: i64) -> QueryResult {
        QueryResult::for_tests(vec![(Address::CurMode, Ok(Reading::Integer(number)))])
    }

    impl Watched {
        /// The query that is due now, or how long until the next.
        fn due(&self) -> Result<Option<Poll_>, Duration> {
            let mut due = pin!(self.board.due());
            match due.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
                Poll::Ready(due) => Ok(due),
                Poll::Pending => Err(self.board.time.deadline().unwrap() - self.board.time.now()),
            }
        }

        fn answer(&self, poll: &Poll_) {
            self.board.answered(poll, &mode(7), &AskedAt::Once(self.board.time.now()));
        }
    }

    #[test]
    fn a_poll_waits_for_its_time_and_for_a_lost_connection() {
        let mut watched = watched();
        let poll = watched.due().unwrap().unwrap();
        watched.answer(&poll);
        assert!(watched.news.has_changed().unwrap());
        watched.news.mark_unchanged();
        let wait = watched.due().unwrap_err();
        assert!(wait > SLOW / 2, "{wait:?}");
        watched.board.time.pass(watched.board.time.now() + wait);
        let next = watched.due().unwrap().unwrap();
        watched.answer(&next);
        watched.news.mark_unchanged();
        let mut due = pin!(watched.board.due());
        let mut cx = Context::from_waker(Waker::noop());
        assert!(due.as_mut().poll(&mut cx).is_pending());
        watched.board.connection_lost();
        let Poll::Ready(Some(poll)) = due.as_mut().poll(&mut cx) else { panic!("it is due at once") };
        assert_eq!(*poll.addresses, [Address::CurMode]);
        assert!(watched.news.has_changed().unwrap());
    }

    #[test]
    fn an_answer_from_before_the_loss_does_not_save_reading_again() {
        let watched = watched();
        let poll = watched.due().unwrap().unwrap();
        watched.board.connection_lost();
        watched.answer(&poll);
        assert!(watched.due().is_ok());
    }

    #[test]
    fn nobody_is_told_more_often_than_he_asked_for() {
        let mut watched = watched();
        let fast = Duration::from_millis(20);
        let poller = || unreachable!("there is one");
        let (_fast, mut quick) = watched.board.add(&[Address::CurMode], fast, poller).unwrap();
        let (mut told_slow, mut told_quick) = (0, 0);
        for _ in 0..100 {
            let poll = match watched.due() {
                Ok(poll) => poll.unwrap(),
                Err(wait) => {
                    watched.board.time.pass(watched.board.time.now() + wait);
                    watched.due().unwrap().unwrap()
                }
            };
            watched.answer(&poll);
            told_slow += u32::from(watched.news.has_changed().unwrap());
            told_quick += u32::from(quick.has_changed().unwrap());
            watched.news.mark_unchanged();
            quick.mark_unchanged();
        }
        assert_eq!((told_slow, told_quick), (1, 100));
    }

    #[test]
    fn each_poll_is_told_also_if_replies_are_slow_and_fast_in_turns() {
        let board = Board::new(Arc::default());
        let every = Duration::from_millis(100);
        let poller = || AbortHandle::new_pair().0;
        let (id, news) = board.add(&[Address::CurMode], every, poller).unwrap();
        let mut watched = Watched { board, id, news };
        for turn in 0..20_u64 {
            if let Err(wait) = watched.due() {
                watched.board.time.pass(watched.board.time.now() + wait);
            }
            let poll = watched.due().unwrap().unwrap();
            let takes = Duration::from_millis(if turn % 2 == 0 { 90 } else { 4 });
            watched.board.time.pass(watched.board.time.now() + takes);
            watched.answer(&poll);
            assert!(watched.news.has_changed().unwrap(), "poll {turn}");
            watched.news.mark_unchanged();
        }
    }

    #[test]
    fn a_recording_has_every_poll_and_a_late_reader_is_told_what_it_lost() {
        let watched = watched();
        let (tap, mut polls) = Tap::new();
        assert!(watched.board.tap(tap));
        let poll = watched.due().unwrap().unwrap();
        for _ in 0..1030 {
            watched.answer(&poll);
        }
        let got: Vec<_> = std::iter::from_fn(|| polls.try_recv().ok()).collect();
        assert_eq!(
            (got.len(), got.iter().map(|poll| poll.lost).max()),
            (1024, Some(0)),
            "nothing before these"
        );
        watched.answer(&poll);
        assert_eq!(polls.try_recv().unwrap().lost, 6, "the values that were lost came before this poll");
        drop(polls);
        watched.answer(&poll);
        assert!(watched.board.shared().taps.is_empty(), "its recording was dropped");
        watched.board.close();
        assert!(!watched.board.tap(Tap::new().0));
    }

    #[test]
    fn what_nobody_wants_any_more_is_neither_asked_for_nor_kept() {
        let watched = watched();
        let poll = watched.due().unwrap().unwrap();
        watched.board.remove(watched.id);
        watched.answer(&poll);
        assert!(watched.due().unwrap().is_none());
        assert!(watched.board.shared().values.is_empty());
    }
}
