//! What a simulation gives in the place of the system: the time, random numbers, the ways to the robots. It
//! knows nothing else of the gateway.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::pin::Pin;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use r6_client::{RequestError, Robot, RobotSettings};

/// How long after 1970 each world begins: on 2026-01-01.
const BEGINS: Duration = Duration::from_secs(1_767_225_600);

thread_local! {
    static CLOCK: Cell<Option<fn() -> Duration>> = const { Cell::new(None) };
    static BYTES: RefCell<u64> = const { RefCell::new(0) };
}

/// The thread has the time and the random numbers of a world until this is dropped.
#[derive(Debug)]
pub struct Entered(());

/// Gives this thread the time and the random numbers of a world. Two worlds of one seed draw the same bytes.
#[must_use = "it ends when this is dropped"]
pub fn enter(clock: fn() -> Duration, seed: u64) -> Entered {
    CLOCK.set(Some(clock));
    BYTES.with(|state| *state.borrow_mut() = seed);
    Entered(())
}

impl Drop for Entered {
    fn drop(&mut self) {
        CLOCK.set(None);
    }
}

/// The time of the world; `None` outside one.
pub(crate) fn time() -> Option<Duration> {
    CLOCK.get().map(|clock| clock())
}

/// The time of day of the world; `None` outside one.
pub(crate) fn today() -> Option<SystemTime> {
    time().and_then(|time| SystemTime::UNIX_EPOCH.checked_add(BEGINS + time))
}

/// Fills in random bytes of the world. `false` outside one.
pub(crate) fn fill(bytes: &mut [u8]) -> bool {
    if CLOCK.get().is_none() {
        return false;
    }
    BYTES.with(|state| {
        let mut state = state.borrow_mut();
        for byte in bytes {
            // SplitMix64: each call differs, and that is enough here.
            *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            *byte = (mixed ^ (mixed >> 27)).to_le_bytes()[5];
        }
    });
    true
}

/// A connection that is being made.
pub type Connecting = Pin<Box<dyn Future<Output = Result<Robot, RequestError>> + Send>>;

/// The ways to the robots of a world.
#[derive(Clone)]
pub struct Roads(Arc<Connect>);

/// Connects to the robot at an address.
type Connect = dyn Fn(&str, RobotSettings) -> Connecting + Send + Sync;

impl Roads {
    /// This function connects to the robot at an address.
    #[must_use]
    pub fn new(connect: impl Fn(&str, RobotSettings) -> Connecting + Send + Sync + 'static) -> Self {
        Self(Arc::new(connect))
    }

    pub(crate) async fn connect(
        &self,
        address: &str,
        settings: RobotSettings,
    ) -> Result<Robot, RequestError> {
        (self.0)(address, settings).await
    }
}

impl fmt::Debug for Roads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Roads")
    }
}
