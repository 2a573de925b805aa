//! The place where a request's answer is stored for its caller. The next request reuses the place, so that a
//! request needs no allocation for it.
//!
//! ```text
//!  open ──the answer is stored──▶ answered ──the caller takes it──▶ taken, kept for the next request
//!   │ └───the request is dropped──▶ abandoned
//!   └─────the caller gives up──▶ given up: a later answer is dropped
//! ```

use std::future::Future;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};

use crate::error::RequestError;
use crate::job::Answer;

/// How many free places are kept: as many as a connection has requests under way.
const MOST_KEPT: usize = 16;

/// The result of a request.
type AnswerOrError = Result<Answer, RequestError>;

/// The free places.
#[derive(Debug, Default)]
pub(crate) struct Places(Mutex<Vec<Arc<Place>>>);

/// The caller's end.
#[derive(Debug)]
pub(crate) struct Reply(Option<Arc<Place>>);

/// The answering end. Dropping it tells the caller that no answer will come.
#[derive(Debug)]
pub(crate) struct ReplyTo(Option<Arc<Place>>);

#[derive(Debug, Default)]
struct Place {
    state: Mutex<State>,
    given_up: AtomicBool,
}

#[derive(Debug)]
enum State {
    /// With the waker of the caller, if it waits.
    Open(Option<Waker>),
    Answered(AnswerOrError),
    Abandoned,
}

impl Default for State {
    fn default() -> Self {
        Self::Open(None)
    }
}

impl Places {
    fn free(&self) -> MutexGuard<'_, Vec<Arc<Place>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The two ends of a place.
    pub fn open(&self) -> (ReplyTo, Reply) {
        let place = self.free().pop().unwrap_or_default();
        (ReplyTo(Some(Arc::clone(&place))), Reply(Some(place)))
    }

    /// Frees the place for the next request: its answer was taken, or will not come.
    pub fn put_back(&self, mut reply: Reply) {
        let Some(mut place) = reply.0.take() else { return };
        // Unless the other end has not dropped it yet.
        if let Some(own) = Arc::get_mut(&mut place) {
            *own = Place::default();
            let mut free = self.free();
            if free.len() < MOST_KEPT {
                free.push(place);
            }
        }
    }
}

impl Place {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl ReplyTo {
    /// Whether the caller no longer waits for it.
    pub fn is_given_up(&self) -> bool {
        self.0.as_ref().is_none_or(|place| place.given_up.load(Ordering::Acquire))
    }

    /// Stores the answer, if the caller still waits.
    pub fn put(mut self, answer: AnswerOrError) {
        self.end(State::Answered(answer));
    }

    fn end(&mut self, end: State) {
        let Some(place) = self.0.take() else { return };
        if place.given_up.load(Ordering::Acquire) {
            return;
        }
        let before = std::mem::replace(&mut *place.state(), end);
        // Before the caller is woken, it has to own the place alone.
        drop(place);
        if let State::Open(Some(waker)) = before {
            waker.wake();
        }
    }
}

impl Drop for ReplyTo {
    fn drop(&mut self) {
        self.end(State::Abandoned);
    }
}

impl Future for Reply {
    /// `None`: no answer will ever come.
    type Output = Option<AnswerOrError>;

    fn poll(self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Self::Output> {
        let Some(place) = &self.0 else { return Poll::Ready(None) };
        let mut state = place.state();
        let (ready, before) = match &mut *state {
            State::Open(Some(known)) if known.will_wake(cx.waker()) => return Poll::Pending,
            State::Open(known) => (None, known.replace(cx.waker().clone())),
            State::Answered(_) | State::Abandoned => {
                (Some(std::mem::replace(&mut *state, State::Abandoned)), None)
            }
        };
        drop(state);
        // Not under the lock, because dropping a waker may run any code.
        drop(before);
        match ready {
            None => Poll::Pending,
            Some(State::Answered(told)) => Poll::Ready(Some(told)),
            Some(State::Open(_) | State::Abandoned) => Poll::Ready(None),
        }
    }
}

impl Drop for Reply {
    fn drop(&mut self) {
        if let Some(place) = &self.0 {
            place.given_up.store(true, Ordering::Release);
            let left = std::mem::replace(&mut *place.state(), State::Abandoned);
            drop(left);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::pin::pin;
    use std::sync::atomic::AtomicUsize;
    use std::task::Wake;

    use proptest::prelude::*;

    use super::*;

    #[derive(Default)]
    struct Bell(AtomicUsize);

    impl Wake for Bell {
        fn wake(self: Arc<Self>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn poll(reply: &mut Reply, bell: &Arc<Bell>) -> Poll<Option<AnswerOrError>> {
        pin!(reply).poll(&mut Context::from_waker(&Waker::from(Arc::clone(bell))))
    }

    fn rung(bell: &Bell) -> usize {
        bell.0.load(Ordering::Relaxed)
    }

    #[test]
    fn a_place_is_used_again_and_forgets_what_was_in_it() {
        let places = Places::default();
        let mut same = None;
        for _ in 0..3 {
            let bell = Arc::<Bell>::default();
            let (to, mut reply) = places.open();
            let at = Arc::as_ptr(to.0.as_ref().unwrap());
            assert_eq!(*same.get_or_insert(at), at);
            assert!(poll(&mut reply, &bell).is_pending());
            to.put(Ok(Answer::Left));
            assert_eq!(rung(&bell), 1);
            assert!(matches!(poll(&mut reply, &bell), Poll::Ready(Some(Ok(Answer::Left)))));
            places.put_back(reply);
        }
        assert_eq!(places.free().len(), 1);
    }

    #[test]
    fn a_place_that_the_other_end_holds_is_not_used_again() {
        let places = Places::default();
        let (to, reply) = places.open();
        places.put_back(reply);
        assert!(places.free().is_empty());
        let (_other, mut waits) = places.open();
        to.put(Ok(Answer::Left));
        assert!(poll(&mut waits, &Arc::default()).is_pending(), "that answer was for somebody else");
    }

    #[test]
    fn no_more_are_kept_than_are_of_use() {
        let places = Places::default();
        let open: Vec<_> = (0..100).map(|_| places.open()).collect();
        for (to, reply) in open {
            drop(to);
            places.put_back(reply);
        }
        assert_eq!(places.free().len(), MOST_KEPT);
    }

    /// What can happen to a request.
    #[derive(Clone, Copy, Debug)]
    enum Step {
        Polled,
        PolledByAnother,
        Answered,
        Dropped,
        GivenUp,
    }

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        use Step::{Answered, Dropped, GivenUp, Polled, PolledByAnother};
        let step = prop::sample::select(vec![Polled, PolledByAnother, Answered, Dropped, GivenUp]);
        prop::collection::vec(step, 0..8)
    }

    proptest! {
        /// Whatever ends the request wakes the last poller once, and it finds that end. After giving up,
        /// nothing is woken.
        #[test]
        fn the_last_to_poll_is_woken_once(steps in steps()) {
            let places = Places::default();
            let (to, reply) = places.open();
            let (mut to, mut reply) = (Some(to), Some(reply));
            let bells = [Arc::<Bell>::default(), Arc::default()];
            let (mut waits, mut answered) = (None, None);
            for step in steps {
                let before = bells.each_ref().map(|bell| rung(bell));
                let rings = |on: Option<usize>| {
                    bells.iter().enumerate().all(|(at, bell)| {
                        rung(bell) == before[at] + usize::from(on == Some(at))
                    })
                };
                match step {
                    Step::Polled | Step::PolledByAnother => {
                        let by = usize::from(matches!(step, Step::PolledByAnother));
                        let Some(reply) = &mut reply else { continue };
                        match (poll(reply, &bells[by]), answered.take()) {
                            (Poll::Pending, None) => {
                                prop_assert!(to.is_some());
                                waits = Some(by);
                            }
                            (Poll::Ready(Some(_)), Some(true)) | (Poll::Ready(None), Some(false)) => {
                                answered = Some(false);
                            }
                            other => prop_assert!(false, "{other:?}"),
                        }
                        prop_assert!(rings(None));
                    }
                    Step::Answered | Step::Dropped => {
                        let Some(to) = to.take() else { continue };
                        prop_assert_eq!(to.is_given_up(), reply.is_none());
                        answered = Some(matches!(step, Step::Answered));
                        if answered == Some(true) { to.put(Ok(Answer::Left)) } else { drop(to) }
                        prop_assert!(rings(waits.take()));
                    }
                    Step::GivenUp => {
                        reply = None;
                        waits = None;
                        prop_assert!(rings(None));
                        prop_assert!(bells.iter().all(|bell| Arc::strong_count(bell) == 1), "a waker is kept");
                    }
                }
            }
        }
    }
}
