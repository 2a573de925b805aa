//! From an address to a connected socket.

use std::fmt;
use std::future::Future;
use std::io;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::pin::Pin;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::sync::Mutex;
use tokio::time::timeout;

use crate::error::{Invalid, NotSent};

/// The port that controllers listen on unless the pendant says otherwise.
pub const DEFAULT_PORT: u16 = 9760;

/// Opens the connections of a handle ([`crate::Robot::connect_with`]). Messages use its `Display` text as the
/// name of the controller.
///
/// [`crate::Robot::connect`] does this over TCP. Implement `Connect` to simulate the network, or to reach the
/// controller over something else that carries bytes in order.
pub trait Connect: fmt::Display + Send + 'static {
    /// The connection: it carries bytes in order, both ways, until one side ends it.
    type Stream: AsyncRead + AsyncWrite + Unpin + Send + 'static;

    /// Opens one connection. After [`crate::RobotSettings::connect_timeout`] the client gives up and drops
    /// the future.
    fn connect(&mut self) -> impl Future<Output = io::Result<Self::Stream>> + Send;

    /// Whether the controllers dial, as with [`crate::Listen`], so that the next connection may come from
    /// another robot. In that case a stop opens no second connection before the robot is identified. A
    /// `Connect` that wraps another one has to pass this on.
    fn takes_whoever_comes(&self) -> bool {
        false
    }
}

/// A connection of any kind.
pub(crate) trait Carrier: AsyncRead + AsyncWrite + Unpin + Send {}

impl<S: AsyncRead + AsyncWrite + Unpin + Send> Carrier for S {}

/// Opens the connections of one handle, one attempt at a time.
pub(crate) struct Dialer<C> {
    target: Mutex<C>,
    name: String,
    takes_whoever_comes: bool,
}

impl<C> fmt::Debug for Dialer<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Dialer").field(&self.name).finish()
    }
}

/// An attempt to connect that is under way.
pub(crate) type Dialling<'d> = Pin<Box<dyn Future<Output = Result<Box<dyn Carrier>, NotSent>> + Send + 'd>>;

/// A [`Dialer`] of any kind, for a second connection beside the first.
pub(crate) trait Dial: fmt::Debug + Send + Sync {
    /// Makes one attempt to connect, within this time.
    fn dial(&self, within: Duration) -> Dialling<'_>;

    /// The name of the controller in messages.
    fn name(&self) -> &str;

    /// The same as [`Connect::takes_whoever_comes`].
    fn takes_whoever_comes(&self) -> bool;
}

impl<C: Connect> Dialer<C> {
    pub fn new(target: C) -> Self {
        let (name, takes_whoever_comes) = (target.to_string(), target.takes_whoever_comes());
        Self { target: Mutex::new(target), name, takes_whoever_comes }
    }

    /// Makes one attempt to connect, within this time.
    pub async fn connect(&self, within: Duration) -> Result<C::Stream, NotSent> {
        let attempt = timeout(within, async { self.target.lock().await.connect().await }).await;
        let address = self.name.clone();
        match attempt {
            Ok(Ok(stream)) => Ok(stream),
            Ok(Err(error)) => {
                Err(NotSent::Unreachable { address, kind: error.kind(), detail: error.to_string() })
            }
            Err(_elapsed) => Err(NotSent::ConnectTimedOut { address, after: within }),
        }
    }
}

impl<C: Connect> Dial for Dialer<C> {
    fn dial(&self, within: Duration) -> Dialling<'_> {
        Box::pin(async move { Ok(Box::new(self.connect(within).await?) as Box<dyn Carrier>) })
    }

    fn name(&self) -> &str {
        &self.name
    }

    fn takes_whoever_comes(&self) -> bool {
        self.takes_whoever_comes
    }
}

/// A connection that is already open and is never reconnected.
pub(crate) struct Once {
    name: String,
}

impl Once {
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned() }
    }
}

impl Connect for Once {
    type Stream = Box<dyn Carrier>;

    async fn connect(&mut self) -> io::Result<Self::Stream> {
        Err(io::Error::new(io::ErrorKind::NotConnected, "this connection is not made anew"))
    }
}

impl fmt::Display for Once {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

/// Checks that a text is an address that [`crate::Robot::connect`] takes: `host`, `host:port`, `[v6]`,
/// `[v6]:port` or a bare IPv6 address. It looks nothing up and does not connect.
///
/// # Errors
/// [`Invalid::BadAddress`] says what is wrong with it.
pub fn check_address(address: &str) -> Result<(), Invalid> {
    Tcp::parse(address).map(drop)
}

/// An address that [`check_address`] accepts, with its port: [`DEFAULT_PORT`] if it names none. Two texts of
/// one address give the same text.
///
/// # Errors
/// As [`check_address`].
pub fn address_with_port(address: &str) -> Result<String, Invalid> {
    let Tcp { host, port } = Tcp::parse(address)?;
    let host =
        host.parse().map_or_else(|_| host.to_ascii_lowercase(), |ip: IpAddr| ip.to_canonical().to_string());
    Ok(Tcp { host, port }.to_string())
}

/// A controller that is reached over TCP, by host and port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Tcp {
    host: String,
    port: u16,
}

impl Tcp {
    /// Parses `host`, `host:port`, `[v6]`, `[v6]:port` or a bare IPv6 address.
    pub fn parse(address: &str) -> Result<Self, Invalid> {
        let bad = |problem| Invalid::BadAddress { address: address.chars().take(256).collect(), problem };
        let (host, port) = match address.strip_prefix('[') {
            Some(rest) => {
                let (host, rest) = rest.split_once(']').ok_or_else(|| bad("`]` is missing"))?;
                match rest {
                    "" => (host, None),
                    rest => (
                        host,
                        Some(rest.strip_prefix(':').ok_or_else(|| bad("after `]` only :port can follow"))?),
                    ),
                }
            }
            None if address.parse::<Ipv6Addr>().is_ok() => (address, None),
            None => match address.split_once(':') {
                Some((host, port)) => (host, Some(port)),
                None => (address, None),
            },
        };
        if host.is_empty() {
            return Err(bad("the host is missing"));
        }
        if host.contains(|c: char| c.is_whitespace() || c == '/') {
            return Err(bad("a host has no blanks and no slashes"));
        }
        let port = match port {
            None => DEFAULT_PORT,
            Some(port) => port
                .parse()
                .ok()
                .filter(|port| *port != 0)
                .ok_or_else(|| bad("the port is a number from 1 to 65535"))?,
        };
        Ok(Self { host: host.to_owned(), port })
    }

    pub fn host(&self) -> &str {
        &self.host
    }

    pub fn port(&self) -> u16 {
        self.port
    }
}

impl Connect for Tcp {
    type Stream = TcpStream;

    async fn connect(&mut self) -> io::Result<TcpStream> {
        open_socket(&self.host, self.port).await
    }
}

/// Opens a socket to a controller. Small frames leave it at once.
///
/// # Errors
/// What the system says; [`io::ErrorKind::ConnectionRefused`] too if it connected the socket to itself.
pub async fn open_socket(host: &str, port: u16) -> io::Result<TcpStream> {
    let stream = TcpStream::connect((host, port)).await?;
    refuse_itself(stream.local_addr()?, stream.peer_addr()?)?;
    // Otherwise a frame waits for the acknowledgement of the one before, which costs up to 200 ms.
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// Refuses a connection to itself: where nothing listens on a port of this machine, the system may draw the
/// same port for our side. Then the client would read what it writes, and take its own frames for a robot's.
///
/// # Errors
/// Both ends are the same.
pub(crate) fn refuse_itself(here: SocketAddr, there: SocketAddr) -> io::Result<()> {
    if here == there {
        return Err(io::Error::new(io::ErrorKind::ConnectionRefused, "nothing listens there"));
    }
    Ok(())
}

impl fmt::Display for Tcp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.host.contains(':') {
            write!(f, "[{}]:{}", self.host, self.port)
        } else {
            write!(f, "{}:{}", self.host, self.port)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_connection_to_itself_is_refused() {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        socket.bind("127.0.0.1:0".parse().unwrap()).unwrap();
        let itself = socket.local_addr().unwrap();
        // The system does so where nothing listens, here on purpose.
        let stream = socket.connect(itself).await.unwrap();
        let refused = refuse_itself(stream.local_addr().unwrap(), stream.peer_addr().unwrap());
        assert_eq!(refused.unwrap_err().kind(), io::ErrorKind::ConnectionRefused);
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        assert!(refuse_itself(stream.local_addr().unwrap(), stream.peer_addr().unwrap()).is_ok());
    }

    #[test]
    fn addresses_come_with_and_without_port() {
        for (given, meant) in [
            ("192.168.1.10", "192.168.1.10:9760"),
            ("192.168.1.10:9700", "192.168.1.10:9700"),
            ("robot-3", "robot-3:9760"),
            ("::1", "[::1]:9760"),
            ("[::1]", "[::1]:9760"),
            ("[fe80::1%eth0]:502", "[fe80::1%eth0]:502"),
        ] {
            assert_eq!(Tcp::parse(given).map(|target| target.to_string()), Ok(meant.to_owned()), "{given}");
        }
    }

    #[test]
    fn two_texts_of_one_address_give_one_text() {
        for (one, other) in
            [("192.168.1.10", "192.168.1.10:9760"), ("Robot-3", "robot-3"), ("::1", "[0:0:0:0:0:0:0:1]:9760")]
        {
            assert_eq!(address_with_port(one), address_with_port(other));
        }
        assert_ne!(address_with_port("a"), address_with_port("a:9761"));
        assert!(address_with_port("a b").is_err());
    }

    #[test]
    fn what_is_no_address_is_refused() {
        for given in [
            "",
            ":9760",
            "robot:",
            "robot:0",
            "robot:65536",
            "robot:x",
            "[::1",
            "[::1]9760",
            "http://robot",
            "a b",
        ] {
            assert!(matches!(Tcp::parse(given), Err(Invalid::BadAddress { .. })), "{given}");
        }
    }
}
