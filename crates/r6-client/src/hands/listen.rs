//! The other TCP role: the controller is set to client mode on its pendant, and dials this program.
//!
//! [`Listen`] is a [`Connect`](crate::hands::connect::Connect) that waits where others dial.

use std::fmt;
use std::future::poll_fn;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Poll;
use std::time::Duration;

use tokio::net::{TcpListener, TcpStream};
use tokio::time::Instant;

use crate::hands::connect::Connect;

/// How many connections that wait are looked at for the newest: the system queues no more.
const MAX_WAITING: usize = 1024;

/// How often the log tells of a connection that is not the controller's.
const TOLD_EVERY: Duration = Duration::from_secs(60);

/// Waits for a controller that dials. For [`Robot::connect_with`](crate::Robot::connect_with).
///
/// The pendant assigns each port of a controller to one use (monitor, camera, instructions), in server or in
/// client mode. In client mode the controller connects to the address that is set there. If no program
/// listens, it tries again and again. After a lost connection the client waits for the next one,
/// [`crate::RobotSettings::connect_timeout`] at a time. Set this longer than the time that the controller
/// takes to dial again. If several connections wait, the newest counts: the others are left over from a
/// controller that lost its power.
///
/// There is no login: any peer that reaches the port is taken for the controller. So set the address that is
/// allowed ([`Self::only_from`]). While a controller is connected, no other connection is accepted: the
/// system queues those that come.
///
/// ```
/// # #[tokio::main(flavor = "current_thread")]
/// # async fn main() -> Result<(), Box<dyn std::error::Error>> {
/// use r6_client::{Listen, Robot, RobotSettings};
///
/// let listen = Listen::on("127.0.0.1:0").await?.only_from("127.0.0.1".parse()?);
/// # let camera = r6_sim::Camera { cam_id: None, address: listen.address()? };
/// # let controller = r6_sim::VirtualController::builder().camera(camera).start().await?;
/// let robot = Robot::connect_with(listen, RobotSettings::default()).await?;
/// assert!(robot.status().await?.is_ready());
/// # drop(controller); Ok(()) }
/// ```
///
/// A clone listens on the same port, which is free once all of them are dropped. If the first attempt to
/// connect fails, another one can be made with a clone, and no controller is refused in between. The clones
/// are for one controller: handles on two of them would take each other's connections.
#[derive(Clone, Debug)]
pub struct Listen {
    listener: Arc<TcpListener>,
    only_from: Option<IpAddr>,
    /// When the log last told of a stranger.
    told: Arc<Mutex<Option<Instant>>>,
}

impl Listen {
    /// Listens on this address and port, such as `0.0.0.0:9760`.
    ///
    /// # Errors
    /// The error of the system: the port is in use, or the address does not belong to this machine.
    pub async fn on(address: &str) -> io::Result<Self> {
        Ok(Self {
            listener: Arc::new(TcpListener::bind(address).await?),
            only_from: None,
            told: Arc::default(),
        })
    }

    /// Accepts connections from this machine only; others are closed once they are accepted.
    #[must_use]
    pub fn only_from(mut self, controller: IpAddr) -> Self {
        self.only_from = Some(controller.to_canonical());
        self
    }

    /// The address it listens on. With port 0, it contains the free port that the system chose.
    ///
    /// # Errors
    /// The error of the system.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    fn is_meant(&self, peer: SocketAddr) -> bool {
        // A socket for both kinds of addresses shows those of IPv4 as IPv6.
        let meant = self.only_from.is_none_or(|only| only == peer.ip().to_canonical());
        if !meant && self.is_told_now() {
            crate::Event::StrangerClosed { peer }.log(&self.to_string());
        }
        meant
    }

    /// Whether the log tells of a stranger now. Those who connect again and again must not fill it.
    fn is_told_now(&self) -> bool {
        let now = Instant::now();
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let is_due = told.is_none_or(|told| now.duration_since(told) >= TOLD_EVERY);
        if is_due {
            *told = Some(now);
        }
        is_due
    }

    /// Accepts a connection that already waits.
    async fn waiting(&self) -> Option<(TcpStream, SocketAddr)> {
        let look = poll_fn(|context| match self.listener.poll_accept(context) {
            Poll::Ready(Ok(accepted)) => Poll::Ready(Some(accepted)),
            Poll::Ready(Err(_)) | Poll::Pending => Poll::Ready(None),
        });
        // Otherwise the runtime says that none waits once this task has had its share of the time.
        tokio::task::unconstrained(look).await
    }
}

impl Connect for Listen {
    type Stream = TcpStream;

    async fn connect(&mut self) -> io::Result<TcpStream> {
        let mut stream = loop {
            let (stream, peer) = self.listener.accept().await?;
            if self.is_meant(peer) {
                break stream;
            }
        };
        for _ in 0..MAX_WAITING {
            let Some((newer, peer)) = self.waiting().await else { break };
            if self.is_meant(peer) {
                stream = newer;
            }
        }
        stream.set_nodelay(true)?;
        Ok(stream)
    }

    fn takes_whoever_comes(&self) -> bool {
        true
    }
}

impl fmt::Display for Listen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.address() {
            Ok(address) => write!(f, "the controller that dials {address}"),
            Err(_) => f.write_str("the controller that dials"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn an_address_of_ipv4_is_the_same_as_a_socket_for_both_kinds_shows_it() {
        let listen = Listen::on("127.0.0.1:0").await.unwrap();
        for meant in ["10.0.0.1", "::ffff:10.0.0.1"] {
            let listen = listen.clone().only_from(meant.parse().unwrap());
            for (peer, is_meant) in [
                ("10.0.0.1:5", true),
                ("[::ffff:10.0.0.1]:5", true),
                ("10.0.0.2:5", false),
                ("[::1]:5", false),
            ] {
                assert_eq!(listen.is_meant(peer.parse().unwrap()), is_meant, "{meant} {peer}");
            }
        }
    }
}
