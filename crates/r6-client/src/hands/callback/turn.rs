//! Whose turn it is to carry, where a loop calls: what happens while somebody carries is looked at before that one ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::task::Wake;

use crate::hands::callback::EventLoop;

/// Nobody carries, and nothing happened.
const IDLE: u8 = 0;
/// Nobody carries, and the loop was asked to call.
const ASKED: u8 = 1;
/// Somebody carries.
const CARRYING: u8 = 2;
/// Somebody carries, and something happened meanwhile.
const AGAIN: u8 = 3;

/// Whose turn it is to carry.
pub(super) struct Turn {
    state: AtomicU8,
    loop_is_gone: AtomicBool,
    event_loop: Arc<dyn EventLoop>,
}

impl Turn {
    pub fn of(event_loop: Arc<dyn EventLoop>) -> Self {
        Self { state: AtomicU8::new(IDLE), loop_is_gone: AtomicBool::new(false), event_loop }
    }

    /// The loop does not call any more.
    pub fn loop_left(&self) {
        self.loop_is_gone.store(true, Ordering::Release);
    }

    pub fn loop_is_gone(&self) -> bool {
        self.loop_is_gone.load(Ordering::Acquire)
    }

    pub fn is_idle(&self) -> bool {
        matches!(self.state.load(Ordering::Acquire), IDLE | ASKED)
    }

    /// Goes to another state; the one before.
    fn go(&self, next: impl FnMut(u8) -> u8) -> u8 {
        self.state.update(Ordering::AcqRel, Ordering::Acquire, next)
    }

    /// Begins to carry. `false`: somebody carries already, and looks again before ending.
    pub fn begin(&self) -> bool {
        self.go(|state| if state < CARRYING { CARRYING } else { AGAIN }) < CARRYING
    }

    /// Ends carrying; `false` if something happened meanwhile, which has to be looked at first.
    pub fn end(&self) -> bool {
        self.go(|state| if state == AGAIN { CARRYING } else { IDLE }) != AGAIN
    }

    /// Ends carrying, whatever happened meanwhile: the loop is asked to call.
    pub fn interrupt(&self) {
        self.state.store(IDLE, Ordering::Release);
        self.happened();
    }

    /// Something happened.
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
