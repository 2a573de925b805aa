//! Where connections come in, over TCP or in memory: they are accepted, refused, or left without an answer.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

use r6_controller::event::{Detail, ShellEvent};
use r6_traffic::link::Door;
use socket2::{Domain, Protocol, SockRef, Socket, Type};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;
use tracing::debug;

use crate::connection;
use crate::handle::ControllerHandle;
use crate::memory::MemoryStream;

/// How many connections the system queues until they are accepted, the same as in tokio.
const BACKLOG: i32 = 1024;

/// After how long a connecting system retries if it gets no answer. Each further wait is twice as long.
const FIRST_ASKED_AGAIN: Duration = Duration::from_secs(1);

/// The waits before a port is tried again that another program took while it was closed: the first, and the
/// longest.
const FIRST_WAIT: Duration = Duration::from_millis(10);
const LONGEST_WAIT: Duration = Duration::from_secs(1);

/// How many of our own connections fill the queue of a port that is to give no answer. Even with a queue of
/// length 0, Linux accepts one.
const MAX_FILLERS: usize = 4;

/// How long a connection of our own may take to be made. On this machine it takes microseconds. A longer time
/// shows that the queue is full; if the connection was only late, it fills the queue.
const FILL_TIME: Duration = Duration::from_millis(50);

/// How many queued connections are closed at the end of the fault: our own, and some that came at that
/// moment.
const MAX_QUEUED: usize = 64;

/// Accepts the connections of a controller. They end with this task.
pub(crate) async fn attend(listener: TcpListener, controller: ControllerHandle) {
    let mut entrance = Entrance { door: controller.door(), controller, connections: JoinSet::new() };
    let mut listener = listener;
    loop {
        let door = *entrance.door.borrow_and_update();
        match door {
            Door::Open => entrance.accept(&listener).await,
            Door::Refuses => listener = entrance.refuse(listener).await,
            Door::BlackHole => entrance.give_no_answer(&listener).await,
        }
    }
}

/// Serves the in-memory connections of a controller. They end with this task. [`knock`] decides whether they
/// are made.
pub(crate) async fn attend_in_memory(
    mut arrivals: mpsc::Receiver<MemoryStream>,
    controller: ControllerHandle,
) {
    let mut entrance = Entrance { door: controller.door(), controller, connections: JoinSet::new() };
    let mut before = *entrance.door.borrow_and_update();
    loop {
        tokio::select! {
            biased;
            () = changed(&mut entrance.door) => {
                let door = *entrance.door.borrow_and_update();
                match std::mem::replace(&mut before, door) {
                    same if same == door => {}
                    _ if door == Door::Refuses => entrance.tell(ShellEvent::Refuses),
                    _ if door == Door::BlackHole => entrance.tell(ShellEvent::GivesNoAnswer),
                    _ => entrance.tell(ShellEvent::TakesAgain),
                }
            }
            Some(_) = entrance.connections.join_next() => {}
            Some(stream) = arrivals.recv() => {
                entrance.connections.spawn(connection::serve(entrance.controller.clone(), stream));
            }
            else => return,
        }
    }
}

/// Tries to connect in memory. Like a real system it retries if it gets no answer.
pub(crate) async fn knock(
    door: &watch::Receiver<Door>,
    entrance: &mpsc::Sender<MemoryStream>,
) -> io::Result<MemoryStream> {
    let mut wait = FIRST_ASKED_AGAIN;
    loop {
        // Copied before any wait, so that the borrow is not held.
        let door = *door.borrow();
        match door {
            Door::Open => {
                let (near, far) = MemoryStream::pair();
                let accepted = entrance.try_send(far);
                return accepted.map(|()| near).map_err(|_| io::ErrorKind::ConnectionRefused.into());
            }
            Door::Refuses => return Err(io::ErrorKind::ConnectionRefused.into()),
            Door::BlackHole => {
                tokio::time::sleep(wait).await;
                wait *= 2;
            }
        }
    }
}

/// The entrance of a controller, with the connections that came through it.
struct Entrance {
    controller: ControllerHandle,
    door: watch::Receiver<Door>,
    connections: JoinSet<()>,
}

impl Entrance {
    /// Accepts connections until the door changes.
    async fn accept(&mut self, listener: &TcpListener) {
        let mut failing = false;
        loop {
            tokio::select! {
                biased;
                () = changed(&mut self.door) => return,
                Some(_) = self.connections.join_next() => {}
                accepted = listener.accept() => match accepted {
                    // Each frame is sent at once and separately, because clients read with one call and small
                    // buffers.
                    Ok((stream, _)) => match stream.set_nodelay(true) {
                        Ok(()) => {
                            if std::mem::take(&mut failing) {
                                self.tell(ShellEvent::AcceptsAgain);
                            }
                            self.connections.spawn(connection::serve(self.controller.clone(), stream));
                        }
                        Err(error) => debug!(%error, "a connection was gone before it was served"),
                    },
                    Err(error) => {
                        // Most likely too many open files: give the connections a moment to end.
                        if !std::mem::replace(&mut failing, true) {
                            self.tell(ShellEvent::CannotAccept { why: Detail::of(error) });
                        }
                        tokio::time::sleep(Duration::from_millis(100)).await;
                    }
                },
            }
        }
    }

    /// Waits until the door changes.
    async fn wait(&mut self) {
        loop {
            tokio::select! {
                biased;
                () = changed(&mut self.door) => return,
                Some(_) = self.connections.join_next() => {}
            }
        }
    }

    /// T1: closes the port until the door changes, and then opens it again.
    async fn refuse(&mut self, listener: TcpListener) -> TcpListener {
        let address = self.controller.address();
        drop(listener);
        let mut socket = bind(address);
        self.tell(ShellEvent::Refuses);
        self.wait().await;
        let mut wait = FIRST_WAIT;
        let mut told = false;
        loop {
            match socket.and_then(listen) {
                Ok(listener) => {
                    self.tell(ShellEvent::TakesAgain);
                    return listener;
                }
                Err(error) => {
                    if !told {
                        told = true;
                        let (address, why) = (Detail::of(address), Detail::of(&error));
                        self.controller.tell(None, ShellEvent::CannotListen { address, why });
                    }
                    debug!(controller = %address, %error, "still not listening");
                }
            }
            tokio::time::sleep(wait).await;
            wait = (wait * 2).min(LONGEST_WAIT);
            socket = bind(address);
        }
    }

    /// T2: attempts to connect get no answer until the door changes. Linux drops connection requests if its
    /// queue has no room. So the queue is made as short as possible, and filled. Other systems still answer,
    /// but no connection is served.
    async fn give_no_answer(&mut self, listener: &TcpListener) {
        let fillers = if cfg!(target_os = "linux") {
            fill(listener, self.controller.address()).await
        } else {
            Ok(Vec::new())
        };
        match &fillers {
            Ok(_) => self.tell(ShellEvent::GivesNoAnswer),
            Err(error) => {
                self.controller.tell(None, ShellEvent::DoesNotServe { why: Detail::of(error) });
            }
        }
        self.wait().await;
        drop(fillers);
        close_queued(listener);
        if let Err(error) = SockRef::from(listener).listen(BACKLOG) {
            self.tell(ShellEvent::ShortQueue { why: Detail::of(error) });
        }
        self.tell(ShellEvent::TakesAgain);
    }

    fn tell(&self, event: ShellEvent) {
        self.controller.tell(None, event);
    }
}

/// Waits until the door changes.
async fn changed(door: &mut watch::Receiver<Door>) {
    if door.changed().await.is_err() {
        // The sender still exists: the caller holds the controller, which holds the sender.
        std::future::pending::<()>().await;
    }
}

/// A socket that is bound and does not listen: attempts to connect are refused, and no other program gets the
/// port meanwhile.
fn bind(address: SocketAddr) -> io::Result<Socket> {
    let socket = Socket::new(Domain::for_address(address), Type::STREAM, Some(Protocol::TCP))?;
    // Accepted connections on the port may still exist. On Windows the option has another meaning.
    #[cfg(not(windows))]
    socket.set_reuse_address(true)?;
    socket.set_nonblocking(true)?;
    socket.bind(&address.into())?;
    Ok(socket)
}

fn listen(socket: Socket) -> io::Result<TcpListener> {
    socket.listen(BACKLOG)?;
    TcpListener::from_std(socket.into())
}

/// Fills the queue of a listener. While the result is alive, no other connection is made.
async fn fill(listener: &TcpListener, address: SocketAddr) -> io::Result<Vec<Filler>> {
    SockRef::from(listener).listen(0)?;
    let mut fillers = Vec::with_capacity(MAX_FILLERS);
    while fillers.len() < MAX_FILLERS {
        let mut filler = Box::pin(TcpStream::connect(reachable(address)));
        match tokio::time::timeout(FILL_TIME, &mut filler).await {
            Ok(made) => fillers.push(Filler::Made(made?)),
            Err(_) => {
                fillers.push(Filler::Waiting(filler));
                return Ok(fillers);
            }
        }
    }
    Err(io::Error::other(format!("the system takes more than {MAX_FILLERS} without accepting one")))
}

/// A connection that takes the room of others while it is alive.
enum Filler {
    Made(#[expect(dead_code, reason = "it only has to be there")] TcpStream),
    Waiting(#[expect(dead_code, reason = "it only has to be there")] Connecting),
}

type Connecting = std::pin::Pin<Box<dyn Future<Output = io::Result<TcpStream>> + Send>>;

/// The address of a listener for this machine.
pub(crate) fn reachable(address: SocketAddr) -> SocketAddr {
    let mut reachable = address;
    match address.ip() {
        IpAddr::V4(host) if host.is_unspecified() => reachable.set_ip(Ipv4Addr::LOCALHOST.into()),
        IpAddr::V6(host) if host.is_unspecified() => reachable.set_ip(Ipv6Addr::LOCALHOST.into()),
        IpAddr::V4(_) | IpAddr::V6(_) => {}
    }
    reachable
}

/// Closes the connections that wait to be accepted.
fn close_queued(listener: &TcpListener) {
    let socket = SockRef::from(listener);
    for _ in 0..MAX_QUEUED {
        // None are left, or accepting them is not possible.
        if socket.accept().is_err() {
            return;
        }
    }
}
