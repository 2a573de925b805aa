//! The network of a day, in memory: connections to robots, which are cut now and then, and to the gateway.

use std::fmt;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use r6_client::{Connect, Robot};
use r6_gateway::simulation::Roads;
use r6_sim::{ControllerHandle, MemoryStream};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::mpsc;

/// How many connections to the gateway wait to be accepted.
const WAITING: usize = 64;

/// The ways to the robots.
#[derive(Clone)]
pub struct Network {
    robots: Arc<[ControllerHandle]>,
    /// The gateway's present end at each robot.
    ends: Arc<Mutex<Vec<Arc<End>>>>,
}

/// What is known of a connection at the gateway's end.
#[derive(Debug, Default)]
struct End(Mutex<(bool, Option<Waker>)>);

impl End {
    fn cut(&self) {
        let mut end = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        end.0 = true;
        end.1.take().into_iter().for_each(Waker::wake);
    }

    /// Whether it was cut. If not, this task is woken when that happens.
    fn is_cut(&self, cx: &Context<'_>) -> bool {
        let mut end = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        end.1 = Some(cx.waker().clone());
        end.0
    }
}

impl Network {
    /// To these robots.
    pub fn new(robots: Vec<ControllerHandle>) -> Self {
        let ends = robots.iter().map(|_| Arc::default()).collect();
        Self { robots: robots.into(), ends: Arc::new(Mutex::new(ends)) }
    }

    /// For the gateway.
    pub fn roads(&self) -> Roads {
        let network = self.clone();
        Roads::new(move |address, settings| {
            let way = Way { network: network.clone(), address: address.to_owned() };
            Box::pin(Robot::connect_with(way, settings))
        })
    }

    /// Cuts the connection to a robot: the gateway finds it reset.
    pub fn cut(&self, robot: u16) {
        let ends = self.ends.lock().unwrap_or_else(PoisonError::into_inner);
        ends.get(usize::from(robot)).into_iter().for_each(|end| end.cut());
    }
}

/// The way to one robot.
struct Way {
    network: Network,
    address: String,
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.address)
    }
}

impl Connect for Way {
    type Stream = Line;

    async fn connect(&mut self) -> io::Result<Line> {
        let host = self.address.split(':').next().unwrap_or_default();
        let number = host.strip_prefix("robot-").and_then(|number| number.parse::<usize>().ok());
        let number = number.ok_or(io::ErrorKind::NotFound)?;
        let robot = self.network.robots.get(number).ok_or(io::ErrorKind::NotFound)?.clone();
        let (near, far) = MemoryStream::pair();
        tokio::spawn(async move { robot.serve(far).await });
        let end = Arc::<End>::default();
        let mut ends = self.network.ends.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(place) = ends.get_mut(number) {
            *place = Arc::clone(&end);
        }
        Ok(Line { stream: near, end })
    }
}

/// The gateway's end of a connection to a robot.
pub struct Line {
    stream: MemoryStream,
    end: Arc<End>,
}

impl AsyncRead for Line {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.end.is_cut(cx) {
            return Poll::Ready(Err(io::ErrorKind::ConnectionReset.into()));
        }
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl AsyncWrite for Line {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(cx, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}

/// The listener of the gateway.
pub struct Listener(mpsc::Receiver<MemoryStream>);

/// Where callers come in.
#[derive(Clone, Debug)]
pub struct Door(mpsc::Sender<MemoryStream>);

/// A listener, and the door to it.
pub fn listener() -> (Listener, Door) {
    let (door, arrivals) = mpsc::channel(WAITING);
    (Listener(arrivals), Door(door))
}

impl Door {
    /// A new connection to the gateway.
    pub async fn connect(&self) -> io::Result<MemoryStream> {
        let (near, far) = MemoryStream::pair();
        self.0.send(far).await.map_err(|_| io::ErrorKind::ConnectionRefused)?;
        Ok(near)
    }
}

impl r6_http::Listener for Listener {
    type Stream = MemoryStream;

    async fn accept(&mut self) -> io::Result<(MemoryStream, SocketAddr)> {
        match self.0.recv().await {
            Some(stream) => Ok((stream, SocketAddr::from((Ipv4Addr::LOCALHOST, 40_000)))),
            // All callers have gone.
            None => std::future::pending().await,
        }
    }

    fn address(&self) -> Option<SocketAddr> {
        None
    }
}
