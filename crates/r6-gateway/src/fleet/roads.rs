//! How connections to robots are made: over TCP, or in a simulation over its own network.

use std::fmt;
use std::io;

use r6_client::{Connect, Listen, RequestError, Robot, RobotSettings};
use tokio::net::TcpStream;

use super::address::RobotAddress;

/// How long the machine of a robot may leave something unacknowledged, of a gateway that can lose its robots.
/// Otherwise the system would send a command again when a cable is plugged in after minutes, though the
/// gateway has closed the connection or was killed: another gateway has the robot by then. The last command
/// is permitted 1 s after the last good beat, and another gateway takes the robot 3 s after it.
#[cfg(target_os = "linux")]
const UNACKNOWLEDGED: std::time::Duration = std::time::Duration::from_millis(1_500);

/// The ways to the robots.
#[derive(Clone, Debug, Default)]
pub enum Roads {
    /// TCP.
    #[default]
    Tcp,
    /// TCP, of a gateway that shares its store: what it wrote ends with its connection.
    TcpOfTerm,
    /// The network of a simulation.
    #[cfg(feature = "simulation")]
    Simulated(crate::simulated::Roads),
}

/// The way to one robot, which outlives an attempt to connect.
#[derive(Debug)]
pub enum Road<'r> {
    /// The gateway connects.
    Dial(&'r Roads, &'r str),
    /// It listens for the robot.
    DialsIn(Listen),
}

impl Roads {
    /// The way to the robot at this address. A port for a robot that connects is open from now on, until the
    /// way and the robot's handle are dropped.
    ///
    /// # Errors
    /// The gateway cannot listen there.
    pub async fn to<'r>(&'r self, address: &'r str) -> io::Result<Road<'r>> {
        #[cfg(feature = "simulation")]
        if let Self::Simulated(_) = self {
            return Ok(Road::Dial(self, address));
        }
        match RobotAddress::read(address) {
            Ok(RobotAddress::DialsIn { listen, from }) => {
                Ok(Road::DialsIn(Listen::on(&listen.to_string()).await?.only_from(from)))
            }
            // What is wrong with an address is told by the attempt to connect.
            Ok(RobotAddress::Dial(_)) | Err(_) => Ok(Road::Dial(self, address)),
        }
    }
}

impl Road<'_> {
    /// Connects, as [`Robot::connect`]; or waits for the robot to connect.
    ///
    /// # Errors
    /// There is no connection yet.
    pub async fn connect(&self, settings: RobotSettings) -> Result<Robot, RequestError> {
        match self {
            Self::DialsIn(listen) => Robot::connect_with(listen.clone(), settings).await,
            Self::Dial(Roads::Tcp, address) => Robot::connect(address, settings).await,
            Self::Dial(Roads::TcpOfTerm, address) => {
                Robot::connect_with(OfTerm::new(address)?, settings).await
            }
            #[cfg(feature = "simulation")]
            Self::Dial(Roads::Simulated(roads), address) => roads.connect(address, settings).await,
        }
    }
}

/// An address with its port.
#[derive(Clone, Debug)]
struct OfTerm(String);

impl OfTerm {
    fn new(address: &str) -> Result<Self, RequestError> {
        Ok(Self(r6_client::address_with_port(address)?))
    }
}

impl Connect for OfTerm {
    type Stream = TcpStream;

    async fn connect(&mut self) -> io::Result<TcpStream> {
        let stream = TcpStream::connect(&self.0).await?;
        // Otherwise a frame waits for the acknowledgement of the one before.
        stream.set_nodelay(true)?;
        #[cfg(target_os = "linux")]
        socket2::SockRef::from(&stream).set_tcp_user_timeout(Some(UNACKNOWLEDGED))?;
        Ok(stream)
    }
}

impl fmt::Display for OfTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[tokio::test]
    async fn what_is_not_acknowledged_ends_before_another_gateway_has_the_robot() {
        use crate::core::owner::{EXPIRES, NO_MOVES};

        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let stream = OfTerm::new(&address).unwrap().connect().await.unwrap();
        let timeout = socket2::SockRef::from(&stream).tcp_user_timeout().unwrap().unwrap();
        assert!(timeout + NO_MOVES < EXPIRES, "{timeout:?}");
        assert!(stream.nodelay().unwrap());
    }
}
