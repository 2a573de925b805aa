//! Cameras that listen: each controller dials them, and dials again after a connection is lost.
//!
//! `r6-controller/src/controller/cameras.rs` knows which connection belongs to which camera.

use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;
use std::time::Duration;

use r6_controller::event::{Detail, ShellEvent};
use r6_traffic::random::Random;
use socket2::{SockRef, TcpKeepalive};
use tokio::net::TcpStream;
use tokio::time::Instant;
use tracing::debug;

use crate::connection;
use crate::handle::ControllerHandle;

/// The most cameras that one controller dials. Each takes a task and an open file; a cell has a few.
pub const MAX_CAMERAS: usize = 16;

/// How long an attempt to connect may take. A camera in the cell answers within milliseconds, a camera that
/// is off never.
const CONNECT_TIME: Duration = Duration::from_secs(3);

/// The wait after the first failure or loss: a restarted camera program listens at once.
const FIRST_WAIT: Duration = Duration::from_millis(100);

/// The factor between one wait and the next.
const GROWTH: u32 = 2;

/// The longest wait. A camera that is switched on again is found within this time, and a camera that is gone
/// costs one small packet in this time.
const LONGEST_WAIT: Duration = Duration::from_secs(5);

/// How long a connection may be silent before the system checks whether the camera is still there, and how
/// often it checks. A camera that has lost its power says nothing. The system gives up after some checks
/// (nine on Linux).
const ASK_AFTER: Duration = Duration::from_secs(10);
const ASK_AGAIN: Duration = Duration::from_secs(2);

/// How long sent data may stay unacknowledged: as long as those checks take. Without this limit a photo
/// request to a camera without power would keep the connection for a quarter of an hour.
#[cfg(target_os = "linux")]
const UNACKNOWLEDGED: Duration = Duration::from_secs(28);

/// A camera that listens, and that each controller dials: `ADDR:PORT`, or `ID=ADDR:PORT` for one of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Camera {
    /// Its `camID`; `None` if it stands for every camera without an address of its own.
    pub cam_id: Option<i64>,
    /// The address that it listens on.
    pub address: SocketAddr,
}

/// The error of a text that is not a [`Camera`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadCamera(&'static str);

impl fmt::Display for BadCamera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }
}

impl std::error::Error for BadCamera {}

impl FromStr for Camera {
    type Err = BadCamera;

    fn from_str(text: &str) -> Result<Self, BadCamera> {
        const BAD_ID: BadCamera = BadCamera("the camID is a whole number: 1=127.0.0.1:9000");
        const BAD_ADDRESS: BadCamera = BadCamera(
            "write an address and a port other than 0, as 127.0.0.1:9000, or 1=127.0.0.1:9000 for camera 1",
        );
        let (cam_id, address) = match text.split_once('=') {
            Some((cam_id, address)) => (Some(cam_id.parse().map_err(|_| BAD_ID)?), address),
            None => (None, text),
        };
        let address: SocketAddr = address.parse().map_err(|_| BAD_ADDRESS)?;
        if address.port() == 0 { Err(BAD_ADDRESS) } else { Ok(Self { cam_id, address }) }
    }
}

impl fmt::Display for Camera {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.cam_id {
            Some(cam_id) => write!(f, "camera {cam_id} at {}", self.address),
            None => write!(f, "the camera at {}", self.address),
        }
    }
}

/// Keeps a connection to a camera while this runs, with one attempt at a time. Waits are in real time,
/// whatever the controller's clock, because the camera is not simulated.
pub(crate) async fn dial(controller: ControllerHandle, camera: Camera, seed: u64) {
    let mut waits = Waits::new(seed);
    let mut failing = false;
    loop {
        match connect(camera.address).await {
            Ok(stream) => {
                failing = false;
                let begun = Instant::now();
                connection::serve_camera(&controller, stream, camera).await;
                // A camera that accepts and hangs up at once is dialled less and less often.
                if begun.elapsed() > LONGEST_WAIT {
                    waits.begin_anew();
                }
            }
            Err(why) if failing => debug!(%camera, why, "still not reached"),
            Err(why) => {
                failing = true;
                let (camera, why) = (Detail::of(camera), Detail::of(why));
                controller.tell(None, ShellEvent::CameraUnreachable { camera, why });
            }
        }
        tokio::time::sleep(waits.next()).await;
    }
}

async fn connect(address: SocketAddr) -> Result<TcpStream, String> {
    let stream = match tokio::time::timeout(CONNECT_TIME, TcpStream::connect(address)).await {
        Ok(connected) => connected.map_err(|error| error.to_string())?,
        Err(_) => return Err(format!("no answer within {CONNECT_TIME:?}")),
    };
    if let Err(error) = stream.set_nodelay(true) {
        debug!(%error, "frames to a camera may be late");
    }
    if let Err(error) = watch(&SockRef::from(&stream)) {
        debug!(%error, "a camera that loses its power will not be noticed soon");
    }
    Ok(stream)
}

/// Makes the system notice that the camera has lost its power, whether data is on its way to it or not.
fn watch(socket: &SockRef<'_>) -> std::io::Result<()> {
    #[cfg(target_os = "linux")]
    socket.set_tcp_user_timeout(Some(UNACKNOWLEDGED))?;
    socket.set_tcp_keepalive(&TcpKeepalive::new().with_time(ASK_AFTER).with_interval(ASK_AGAIN))
}

/// The waits between attempts. Each is longer than the one before, up to a limit, and is drawn from its upper
/// half, so that many controllers do not dial at the same time.
#[derive(Debug)]
struct Waits {
    next: Duration,
    random: Random,
}

impl Waits {
    fn new(seed: u64) -> Self {
        Self { next: FIRST_WAIT, random: Random::new(seed) }
    }

    fn begin_anew(&mut self) {
        self.next = FIRST_WAIT;
    }

    fn next(&mut self) -> Duration {
        let wait = self.next;
        self.next = wait.saturating_mul(GROWTH).min(LONGEST_WAIT);
        wait / 2 + self.random.up_to(wait / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_is_read_with_and_without_its_number() {
        let address = "127.0.0.1:9000".parse().unwrap();
        assert_eq!("127.0.0.1:9000".parse(), Ok(Camera { cam_id: None, address }));
        assert_eq!("7=127.0.0.1:9000".parse(), Ok(Camera { cam_id: Some(7), address }));
        assert_eq!("0=[::1]:1".parse::<Camera>().unwrap().to_string(), "camera 0 at [::1]:1");
        for wrong in ["", "9000", "127.0.0.1", "127.0.0.1:0", "x=127.0.0.1:9000", "=127.0.0.1:9000", "1="] {
            assert!(wrong.parse::<Camera>().is_err(), "{wrong}");
        }
    }

    #[cfg(target_os = "linux")]
    #[tokio::test]
    async fn a_camera_that_loses_its_power_is_noticed() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let stream = connect(listener.local_addr().unwrap()).await.unwrap();
        let socket = SockRef::from(&stream);
        assert_eq!(socket.tcp_user_timeout().unwrap(), Some(UNACKNOWLEDGED));
        assert!(socket.keepalive().unwrap());
        assert_eq!(socket.tcp_keepalive_time().unwrap(), ASK_AFTER);
        assert_eq!(socket.tcp_keepalive_interval().unwrap(), ASK_AGAIN);
    }

    #[test]
    fn waits_grow_to_the_longest_within_their_upper_half() {
        let mut waits = Waits::new(3);
        let mut full = FIRST_WAIT;
        for _ in 0..20 {
            let wait = waits.next();
            assert!(wait >= full / 2 && wait <= full, "{wait:?} of {full:?}");
            full = (full * GROWTH).min(LONGEST_WAIT);
        }
        assert_eq!(full, LONGEST_WAIT);
        waits.begin_anew();
        assert!(waits.next() <= FIRST_WAIT);
    }

    #[test]
    fn the_seed_says_the_waits() {
        let waits = |seed| {
            let mut waits = Waits::new(seed);
            std::array::from_fn::<_, 8, _>(|_| waits.next())
        };
        assert_eq!(waits(5), waits(5));
        assert_ne!(waits(5), waits(6));
        assert_ne!(waits(0), waits(1));
    }
}
