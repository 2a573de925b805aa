//! Who drives: the calls that wait, and the keeper that drives while no call waits.
//!
//! Sockets, timers and errands know one waker, [`Seats`]. It wakes the call that drove last. It also wakes
//! the keeper, so that other users of the same connection do not depend on a slow call.
//!
//! ```text
//!           sit                      begin                     end, nothing happened meanwhile
//!  (call) ──────▶ seated, it drives ──────▶ carrying ◀──┐ ───────────────────────────────────▶ seated, waits
//!                                               └───────┘ end, something happened meanwhile
//!  an event while a call carries:  that call looks again before it ends
//!  an event while no call carries: wakes the call that drove last; also the keeper, if there is no such call
//!                                  or if others depend on it
//!  an errand is given:             wakes the call that drove last, and the keeper
//!  a call leaves before it looked: wakes the next in its place
//! ```

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Wake, Waker};

/// A call's place among those that wait; empty until it sits.
#[derive(Debug, Default)]
pub(crate) struct Seat(pub(crate) Option<u64>);

/// The seats of one connection.
#[derive(Debug, Default)]
pub(crate) struct Seats(Mutex<Inner>);

#[derive(Clone, Debug, Default)]
struct Inner {
    seated: Vec<(u64, Waker)>,
    next: u64,
    /// The seat of the call that drove last.
    lead: Option<u64>,
    keeper: Option<Waker>,
    /// Whether a call or the keeper is carrying now.
    carrying: bool,
    /// Whether something happened that no call and no keeper has looked at.
    woken: bool,
    /// Whether there is work besides the calls that wait: then the keeper does not rely on them.
    background: bool,
}

/// The wakers to call, outside the lock, because a waker may call back into this.
#[derive(Debug, Default)]
#[must_use]
struct ToWake([Option<Waker>; 2]);

impl ToWake {
    fn wake(self) {
        self.0.into_iter().flatten().for_each(Waker::wake);
    }
}

impl Inner {
    /// Chooses who has to look at what happened.
    fn to_wake(&self) -> ToWake {
        let lead = self.lead.and_then(|lead| self.seated.iter().find(|(seat, _)| *seat == lead));
        let alone = self.seated.len() == 1 && !self.background;
        let keeper = if lead.is_some() && alone { None } else { self.keeper.clone() };
        ToWake([lead.map(|(_, waker)| waker.clone()), keeper])
    }
}

impl Seats {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A call waits: it leads from now on.
    pub fn sit(&self, seat: &mut Seat, waker: &Waker) {
        let mut inner = self.inner();
        let number = *seat.0.get_or_insert_with(|| {
            inner.next += 1;
            inner.next
        });
        inner.lead = Some(number);
        let mut known = None;
        match inner.seated.iter_mut().find(|(seated, _)| *seated == number) {
            Some((_, same)) if same.will_wake(waker) => {}
            Some((_, other)) => known = Some(std::mem::replace(other, waker.clone())),
            None => inner.seated.push((number, waker.clone())),
        }
        drop(inner);
        drop(known);
    }

    /// The keeper is there.
    pub fn keep(&self, waker: &Waker) {
        let known = self.inner().keeper.replace(waker.clone());
        drop(known);
    }

    /// The keeper is gone for good.
    pub fn keeper_left(&self) {
        let keeper = self.inner().keeper.take();
        drop(keeper);
    }

    /// A call is over, or was given up. If it was woken and did not look, the next one looks.
    pub fn leave(&self, seat: &mut Seat) {
        let Some(number) = seat.0.take() else { return };
        let mut inner = self.inner();
        let mut gone = None;
        if let Some(at) = inner.seated.iter().position(|(seated, _)| *seated == number) {
            gone = Some(inner.seated.swap_remove(at));
        }
        if inner.lead == Some(number) {
            inner.lead = inner.seated.last().map(|(seat, _)| *seat);
        }
        let next = if inner.woken && !inner.carrying { inner.to_wake() } else { ToWake::default() };
        drop(inner);
        next.wake();
        drop(gone);
    }

    /// Begins to carry. `false`: another one already carries, and looks again before it ends.
    pub fn begin(&self) -> bool {
        let mut inner = self.inner();
        inner.woken = inner.carrying;
        !std::mem::replace(&mut inner.carrying, true)
    }

    /// Ends carrying. `false`: something happened meanwhile, and the caller has to look at it first.
    /// `background`: whether there is work besides the calls that wait.
    pub fn end(&self, background: bool) -> bool {
        let mut inner = self.inner();
        inner.background = background;
        inner.carrying = std::mem::take(&mut inner.woken);
        !inner.carrying
    }

    /// Ends carrying even if something happened meanwhile, and wakes another one for it.
    pub fn interrupt(&self) {
        let mut inner = self.inner();
        inner.carrying = false;
        inner.woken = true;
        let next = inner.to_wake();
        drop(inner);
        next.wake();
    }

    /// There is work that no call waits for: the keeper does it, however slow the seated calls are.
    pub fn nudge(&self) {
        self.inner().background = true;
        self.happened();
    }

    /// Something happened.
    pub fn happened(&self) {
        let mut inner = self.inner();
        inner.woken = true;
        let next = if inner.carrying { ToWake::default() } else { inner.to_wake() };
        drop(inner);
        next.wake();
    }
}

impl Wake for Seats {
    fn wake(self: Arc<Self>) {
        self.happened();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.happened();
    }
}

#[cfg(test)]
mod tests {
    //! Every order of the steps of two calls, a keeper, a controller and an errand; any call may be given up
    //! or slow.

    use std::cell::RefCell;
    use std::collections::HashSet;

    use super::*;

    const CALLS: usize = 2;
    /// The keeper's number among those that can be woken.
    const KEEPER: usize = CALLS;

    thread_local! {
        /// The calls and the keeper that were woken in the present step.
        static WOKEN: RefCell<Vec<usize>> = const { RefCell::new(Vec::new()) };
    }

    struct Bell(usize);

    impl Wake for Bell {
        fn wake(self: Arc<Self>) {
            WOKEN.with_borrow_mut(|woken| woken.push(self.0));
        }
    }

    /// How far a call or the keeper is in driving.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    enum At {
        /// It waits to be woken.
        Waits,
        /// It is polled, and sits down.
        Sits,
        Begins,
        Carries,
        Ends,
        Leaves,
        Gone,
        /// It is never polled again, and keeps its seat.
        Slow,
    }

    #[derive(Clone, Debug)]
    struct World {
        inner: Inner,
        at: [At; CALLS + 1],
        seat: [Option<u64>; CALLS],
        /// The calls and the keeper that were woken and not polled since.
        woken: [bool; CALLS + 1],
        /// Replies that lie in the socket.
        unread: [bool; CALLS],
        /// Replies that were handed out.
        answered: [bool; CALLS],
        /// Replies that the controller has still to send.
        unsent: [bool; CALLS],
        /// Whether the socket wakes the seats when something arrives.
        registered: bool,
        errand: Errand,
    }

    /// Work besides the calls that wait.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    enum Errand {
        None,
        Given,
        Begun,
    }

    #[derive(Clone, Copy, Debug)]
    enum Step {
        Goes(usize),
        GivesUp(usize),
        TurnsSlow(usize),
        Replies(usize),
        /// An errand is given.
        Gives,
    }

    impl World {
        fn begin() -> Self {
            let mut at = [At::Sits; CALLS + 1];
            at[KEEPER] = At::Sits;
            Self {
                inner: Inner::default(),
                at,
                seat: [None; CALLS],
                woken: [false; CALLS + 1],
                unread: [false; CALLS],
                answered: [false; CALLS],
                unsent: [true; CALLS],
                registered: false,
                errand: Errand::None,
            }
        }

        /// The state that distinguishes two worlds.
        fn key(&self) -> impl Eq + std::hash::Hash + use<> {
            let Inner { seated, lead, keeper, carrying, woken, background, next: _ } = &self.inner;
            let seats: Vec<_> =
                seated.iter().map(|(seat, _)| self.seat.iter().position(|it| *it == Some(*seat))).collect();
            let lead = lead.map(|lead| self.seat.iter().position(|it| *it == Some(lead)));
            let inner = (seats, lead, keeper.is_some(), *carrying, *woken, *background);
            let replies = (self.unread, self.answered, self.unsent, self.registered);
            (inner, self.at, self.woken, replies, self.errand)
        }

        fn steps(&self) -> Vec<Step> {
            let mut steps = Vec::new();
            for who in 0..=KEEPER {
                match self.at[who] {
                    At::Waits if self.woken[who] => steps.push(Step::Goes(who)),
                    At::Sits | At::Begins | At::Carries | At::Ends | At::Leaves => {
                        steps.push(Step::Goes(who))
                    }
                    At::Waits | At::Gone | At::Slow => {}
                }
                if who != KEEPER && self.at[who] == At::Waits {
                    steps.push(Step::GivesUp(who));
                    steps.push(Step::TurnsSlow(who));
                }
            }
            steps.extend((0..CALLS).filter(|call| self.unsent[*call]).map(Step::Replies));
            if self.errand == Errand::None {
                steps.push(Step::Gives);
            }
            steps
        }

        fn after(&self, step: Step) -> Self {
            let mut this = self.clone();
            let seats = Seats(Mutex::new(self.inner.clone()));
            match step {
                Step::GivesUp(call) => this.at[call] = At::Leaves,
                Step::TurnsSlow(call) => this.at[call] = At::Slow,
                Step::Replies(call) => {
                    (this.unsent[call], this.unread[call]) = (false, true);
                    if std::mem::take(&mut this.registered) {
                        seats.happened();
                    }
                }
                Step::Gives => {
                    this.errand = Errand::Given;
                    seats.nudge();
                }
                Step::Goes(who) => this.go(who, &seats),
            }
            this.inner = seats.0.into_inner().unwrap_or_else(PoisonError::into_inner);
            for who in WOKEN.take() {
                this.woken[who] = true;
            }
            this
        }

        fn go(&mut self, who: usize, seats: &Seats) {
            let waker = Waker::from(Arc::new(Bell(who)));
            self.at[who] = match self.at[who] {
                At::Waits => {
                    self.woken[who] = false;
                    if who != KEEPER && self.answered[who] { At::Leaves } else { At::Sits }
                }
                At::Sits if who == KEEPER => {
                    seats.keep(&waker);
                    At::Begins
                }
                At::Sits => {
                    let mut seat = Seat(self.seat[who]);
                    seats.sit(&mut seat, &waker);
                    self.seat[who] = seat.0;
                    At::Begins
                }
                At::Begins if seats.begin() => At::Carries,
                At::Begins => At::Waits,
                At::Carries if self.errand == Errand::Given => {
                    self.errand = Errand::Begun;
                    At::Carries
                }
                At::Carries => {
                    match self.unread.iter().position(|unread| *unread) {
                        Some(reply) => {
                            (self.unread[reply], self.answered[reply]) = (false, true);
                            // The call's own waker, not that of its seat.
                            self.woken[reply] = true;
                            At::Carries
                        }
                        None => {
                            self.registered = true;
                            At::Ends
                        }
                    }
                }
                At::Ends if !seats.end(self.errand != Errand::None) => At::Carries,
                At::Ends if who != KEEPER && self.answered[who] => At::Leaves,
                At::Ends => At::Waits,
                At::Leaves => {
                    let mut seat = Seat(self.seat[who].take());
                    seats.leave(&mut seat);
                    At::Gone
                }
                other @ (At::Gone | At::Slow) => other,
            };
        }

        /// Checks a world where no step is left: no call that is not slow waits for a reply that was sent,
        /// and the errand has begun.
        fn assert_settled(&self) {
            assert_ne!(self.errand, Errand::Given, "no driver begins an errand: {self:?}");
            for call in 0..CALLS {
                let waits_for_the_controller = self.at[call] != At::Waits || self.unsent[call];
                assert!(waits_for_the_controller, "a reply is there, and its call waits: {self:?}");
            }
            let slow_alone = self.at[..CALLS].contains(&At::Slow) && !self.at[..CALLS].contains(&At::Waits);
            assert!(slow_alone || !self.unread.contains(&true), "no driver reads: {self:?}");
        }
    }

    /// Worlds are distinguished by the place of a seat, so two calls on one seat would look the same.
    #[test]
    fn every_call_has_a_seat_of_its_own() {
        let seats = Seats::default();
        let [mut one, mut other] = [Seat::default(), Seat::default()];
        seats.sit(&mut one, &Waker::from(Arc::new(Bell(0))));
        seats.sit(&mut other, &Waker::from(Arc::new(Bell(1))));
        assert_ne!(one.0, other.0);
        seats.leave(&mut other);
        seats.happened();
        assert_eq!(WOKEN.take(), [0]);
    }

    #[test]
    fn no_order_of_steps_loses_a_reply_or_leaves_nobody_to_drive() {
        let (mut seen, mut to_see, mut ends) = (HashSet::new(), vec![World::begin()], 0);
        while let Some(world) = to_see.pop() {
            if !seen.insert(world.key()) {
                continue;
            }
            let steps = world.steps();
            // Giving up and turning slow are optional steps, so nothing may depend on them.
            let goes_on =
                steps.iter().any(|step| matches!(step, Step::Goes(_) | Step::Replies(_) | Step::Gives));
            if !goes_on {
                world.assert_settled();
                ends += 1;
            }
            to_see.extend(steps.into_iter().map(|step| world.after(step)));
        }
        assert!(ends > 10 && seen.len() > 1000, "{ends} ends, {} states", seen.len());
    }
}
