//! Calls that drive their connection badly: some are dropped while they wait, some are slow. Other calls must
//! not suffer.

use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use r6_client::{Address, AxisIndex, Command, RegisterIndex, WaitOptions};
use tokio::time::{Sleep, sleep};

use super::{Work, ms};
use crate::fault::Class;
use crate::line::Line;
use crate::shared::Shared;

/// A call is dropped before this many polls. A query needs two or three; starting a motion needs a few more.
const MOST_POLLS: usize = 8;

/// How often one call can be slow, so that it stays within the time limit for calls.
const MOST_NAPS: u32 = 2;

/// The longest time without a poll of a slow call, and the usual time, in ms.
const LONGEST_NAP: u64 = 5000;
const SHORT_NAP: u64 = 400;

/// A call that is kept this long outlives its world.
const KEPT_FOR: Duration = Duration::from_secs(3600);

/// The registers that interleaved calls write.
const BETWEEN: u16 = 840;

impl Work {
    /// The call with the drivers of this world, to its end.
    pub(super) fn driven<F: Future>(&self, call: F) -> Driven<F> {
        let naps = if self.shared.plan.drivers.are_slow() { MOST_NAPS } else { 0 };
        let (shared, first_nap) = (self.shared.clone(), None);
        Driven { call: Box::pin(call), shared, index: self.index, naps, first_nap, state: State::New }
    }

    /// The call; if calls are dropped, only some polls of it.
    pub(super) fn perhaps_dropped<F: Future>(&self, call: F) -> Dropped<F> {
        let is_dropped = self.shared.plan.drivers.drop_calls();
        let draws = &mut self.shared.state().lines[self.index].draws;
        let left = (is_dropped && draws.strikes(0.2)).then(|| draws.below(MOST_POLLS));
        Dropped {
            call: Some(Box::pin(call)),
            shared: self.shared.clone(),
            index: self.index,
            left,
            was_polled: false,
        }
    }

    /// Makes interleaved calls on the same handle, again and again. Their results are not used.
    pub(super) async fn come_between(mut self) {
        while !self.is_over() {
            sleep(self.random.up_to(ms(250))).await;
            let robot = self.robot.clone();
            let axes: Vec<_> = AxisIndex::ALL.into_iter().take(4).map(Address::Axis).collect();
            match self.random.below(8) {
                0..3 => drop(self.perhaps("a query between", robot.query(&axes)).await),
                3 => drop(self.perhaps("a status between", robot.status()).await),
                4 | 5 => {
                    let number = BETWEEN + u16::try_from(self.index).unwrap_or(0);
                    let Some(register) = RegisterIndex::new(number) else { continue };
                    let write = Command::RewriteData { register, savable: false, value: self.next_value() };
                    drop(self.perhaps("a command between", robot.command(write)).await);
                }
                6 => {
                    let soon = WaitOptions { timeout: ms(900), ..WaitOptions::default() };
                    drop(self.perhaps("a wait between", robot.wait_until_done(soon)).await);
                }
                _ => {
                    let Ok(mut news) = robot.subscribe(&axes, ms(200)) else { continue };
                    drop(self.perhaps("a subscription between", news.next()).await);
                }
            }
        }
        if self.shared.plan.drivers.are_slow() {
            // The slowest possible call: it is polled once, and kept while the other calls show that
            // everything works again.
            let robot = self.robot.clone();
            let mut kept = self.driven(async move { drop(robot.query(&[Address::CurMode]).await) });
            kept.first_nap = Some(KEPT_FOR);
            kept.await;
        }
    }
}

/// The current state of a call.
enum State {
    /// It was never polled.
    New,
    /// It is polled whenever it is woken.
    Awake,
    /// It was polled and keeps its place. It is not polled before this time is over.
    Asleep(Pin<Box<Sleep>>),
    Over,
}

/// A call that may be slow.
pub(super) struct Driven<F> {
    call: Pin<Box<F>>,
    shared: Shared,
    index: usize,
    /// How often it can still be slow.
    naps: u32,
    /// How long it sleeps after its first poll, if this is fixed and not drawn.
    first_nap: Option<Duration>,
    state: State,
}

impl<F> Driven<F> {
    /// Counts the calls that are awake and asleep.
    fn becomes(&mut self, next: State) {
        let line = &mut self.shared.state().lines[self.index];
        count(line, &self.state, |count| count - 1);
        count(line, &next, |count| count + 1);
        self.state = next;
    }

    /// How long it sleeps now, if at all.
    fn nap(&mut self) -> Option<Duration> {
        if self.naps == 0 {
            return None;
        }
        if let Some(nap) = self.first_nap.take() {
            return Some(nap);
        }
        let draws = &mut self.shared.state().lines[self.index].draws;
        if !draws.strikes(0.1) {
            return None;
        }
        self.naps -= 1;
        let longest = if draws.strikes(0.2) { LONGEST_NAP } else { SHORT_NAP };
        Some(ms(1) + draws.up_to(ms(longest)))
    }
}

fn count(line: &mut Line, state: &State, change: impl Fn(usize) -> usize) {
    match state {
        State::New | State::Over => {}
        State::Awake => line.awake = change(line.awake),
        State::Asleep(_) => line.asleep = change(line.asleep),
    }
}

impl<F: Future> Future for Driven<F> {
    type Output = F::Output;

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<F::Output> {
        let this = &mut *self;
        if let State::Asleep(nap) = &mut this.state {
            ready!(nap.as_mut().poll(cx));
        }
        if !matches!(this.state, State::Awake) {
            this.becomes(State::Awake);
        }
        if let Poll::Ready(done) = this.call.as_mut().poll(cx) {
            this.becomes(State::Over);
            return Poll::Ready(done);
        }
        if let Some(nap) = this.nap() {
            let mut nap = Box::pin(sleep(nap));
            // The poll registers the waker. The time cannot be over yet.
            let _ = nap.as_mut().poll(cx);
            this.becomes(State::Asleep(nap));
            this.shared.state().record.strikes(Class::K4);
        }
        Poll::Pending
    }
}

impl<F> Drop for Driven<F> {
    fn drop(&mut self) {
        self.becomes(State::Over);
    }
}

/// A call that may be dropped when it is woken the next time.
pub(super) struct Dropped<F> {
    call: Option<Pin<Box<F>>>,
    shared: Shared,
    index: usize,
    /// How often it is still polled; `None`: to its end.
    left: Option<usize>,
    was_polled: bool,
}

impl<F: Future> Future for Dropped<F> {
    /// `None` means that it was dropped.
    type Output = Option<F::Output>;

    fn poll(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Option<F::Output>> {
        let this = &mut *self;
        let Some(call) = &mut this.call else { return Poll::Ready(None) };
        if this.left == Some(0) {
            this.call = None;
            let mut state = this.shared.state();
            state.record.tally.dropped += 1;
            if this.was_polled {
                state.record.strikes(Class::K3);
            }
            state.record.tell(crate::shared::now(), format_args!("client-{}: a call is dropped", this.index));
            return Poll::Ready(None);
        }
        this.left = this.left.map(|left| left - 1);
        this.was_polled = true;
        call.as_mut().poll(cx).map(Some)
    }
}
