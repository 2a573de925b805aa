//! Decides which call works on the connection when an event loop calls. What happens during that work is
//! handled before the call at work ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::task::Wake;

use crate::hands::callback::EventLoop;

/// No call is at work, and nothing has happened.
const IDLE: u8 = 0;
/// No call is at work, and the loop was asked to call.
const ASKED: u8 = 1;
/// A call is at work.
const CARRYING: u8 = 2;
/// A call is at work, and something has happened meanwhile.
const AGAIN: u8 = 3;

/// The right to work on the connection.
pub(super) struct Turn {
    state: AtomicU8,
    loop_is_gone: AtomicBool,
    event_loop: Arc<dyn EventLoop>,
}

impl Turn {
    pub fn of(event_loop: Arc<dyn EventLoop>) -> Self {
        Self { state: AtomicU8::new(IDLE), loop_is_gone: AtomicBool::new(false), event_loop }
    }

    /// Notes that the loop does not call any more.
    pub fn loop_left(&self) {
        self.loop_is_gone.store(true, Ordering::Release);
    }

    pub fn loop_is_gone(&self) -> bool {
        self.loop_is_gone.load(Ordering::Acquire)
    }

    pub fn is_idle(&self) -> bool {
        matches!(self.state.load(Ordering::Acquire), IDLE | ASKED)
    }

    /// Changes the state. Returns the state before.
    fn go(&self, next: impl FnMut(u8) -> u8) -> u8 {
        self.state.update(Ordering::AcqRel, Ordering::Acquire, next)
    }

    /// Takes the right to work. Returns `false` if another call has it; that call looks again before it ends.
    pub fn begin(&self) -> bool {
        self.go(|state| if state < CARRYING { CARRYING } else { AGAIN }) < CARRYING
    }

    /// Gives the right back. Returns `false` if something happened meanwhile, which has to be handled first.
    pub fn end(&self) -> bool {
        self.go(|state| if state == AGAIN { CARRYING } else { IDLE }) != AGAIN
    }

    /// Gives the right back even if something happened meanwhile, and asks the loop to call.
    pub fn interrupt(&self) {
        self.state.store(IDLE, Ordering::Release);
        self.happened();
    }

    /// Notes that something happened.
    pub fn happened(&self) {
        let before = self.go(|state| if state < CARRYING { ASKED } else { AGAIN });
        if before == IDLE && !self.loop_is_gone() {
            self.event_loop.soon();
        }
    }
}

impl Wake for Turn {
    fn wake(self: Arc<Self>) {
        self.happened();
    }

    fn wake_by_ref(self: &Arc<Self>) {
        self.happened();
    }
}
