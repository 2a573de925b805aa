//! What a robot knows of its cameras: the photos that the controller waits for, and how much they send.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use r6_proto::time::Instant;
use tokio::sync::{Semaphore, broadcast};

use crate::core::camera::Camera;
use crate::core::rate::{Limit, Rate};

/// Requests of all cameras of one robot: 10 a second in the long run. They share its one connection with the
/// polls and commands, of which a controller takes some 20 ms each, and each is two entries of the audit log.
/// A belt that needs more parts a second sends several in one request.
const REQUESTS: Limit = Limit { interval: Duration::from_millis(100), burst: 20 };

/// A controller waits for a photo no longer than its program says, which the wire does not tell. After this
/// time the gateway takes it that it does not wait any more.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// How many photos may wait for a raw client to be told of them. A cell has a few cameras. A client that
/// misses some is told of all that the controller still waits for.
const UNTOLD: usize = 16;

/// How many requests of cameras are under way at once: half of the places of all commands, so that cameras
/// of a robot that does not answer them leave places for the holder of the lease.
const PLACES: usize = 8;

/// What is known of the cameras of a robot.
#[derive(Debug)]
pub struct Cameras {
    /// The photos as they are asked for.
    pub asked: broadcast::Sender<Camera>,
    /// Requests of cameras that are under way: [`PLACES`].
    pub places: Semaphore,
    /// The photos that the controller waits for, by camera: 1000 at most.
    photos: Mutex<BTreeMap<Camera, Photo>>,
    rate: Mutex<Rate>,
}

/// A photo that the controller asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Photo {
    /// The connection that it asked over: the answer is for no other.
    pub connection: u64,
    /// When it asked.
    pub at: Instant,
    /// How many stops had begun: an answer after a stop could set the arm in motion again.
    pub stops: u64,
    /// Whether callers were told. Before the robot has said who it is, it may be another one.
    pub is_told: bool,
}

impl Default for Cameras {
    fn default() -> Self {
        let asked = broadcast::Sender::new(UNTOLD);
        Self { asked, places: Semaphore::new(PLACES), photos: Mutex::default(), rate: Mutex::default() }
    }
}

impl Cameras {
    /// The photos that the controller waits for.
    pub fn photos(&self) -> MutexGuard<'_, BTreeMap<Camera, Photo>> {
        self.photos.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the controller may wait for a photo: a request for one was not answered, and is not old.
    pub fn may_wait(&self, now: Instant) -> bool {
        self.photos().values().any(|photo| now.since(photo.at) < LONGEST_WAIT)
    }

    /// Counts a request of a camera.
    ///
    /// # Errors
    /// It comes too early, and is not counted: how long to wait.
    pub fn count(&self, now: Instant) -> Result<(), Duration> {
        let mut rate = self.rate.lock().unwrap_or_else(PoisonError::into_inner);
        let wait = rate.wait(now, REQUESTS);
        if !wait.is_zero() {
            return Err(wait);
        }
        rate.count(now, REQUESTS);
        Ok(())
    }
}
