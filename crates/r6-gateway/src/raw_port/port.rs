//! Accepts the clients of one raw port, and looks after the implicit lease.

use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use socket2::{SockRef, TcpKeepalive};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::task::JoinSet;

use super::conversation::{self, End};
use super::{Client, RawPort, SharedPolicy};
use crate::clock;
use crate::core::rate::Rate;
use crate::core::raw::lease::{Due, ImplicitLease, Rest};
use crate::core::raw::session::Cause;
use crate::core::refusals::Refusals;
use crate::core::seat::USUAL_LEASE;
use crate::fleet::Fleet;
use crate::fleet::station::Station;

/// How many clients a robot has. They share one connection, and a controller answers about 50 requests a
/// second.
const MAX_CLIENTS: usize = 16;

/// How many of them come from one address, so that a computer that only reads leaves places for those that
/// stop and command.
const MAX_OF_ONE_ADDRESS: usize = 8;

/// How many connections the system queues until they are accepted.
const BACKLOG: u32 = 64;

/// How many bytes the system takes for a client that does not read, besides those of the session.
const SEND_BUFFER: u32 = 64 * 1024;

/// A client from which nothing came for so long is asked by the system whether it is still there: a cable
/// that was cut must not keep its place for ever.
const KEEPALIVE: Duration = Duration::from_secs(30);

/// How often to look at the implicit lease, and at the usual time of a reply. After a stop, the lease of a
/// script is free this long after a poll has seen that the arm stands.
const LOOK: Duration = Duration::from_millis(100);

/// The longest time that a reply is held back, whatever the robot's usual time is.
const MAX_PACE: Duration = Duration::from_millis(20);

/// A raw port that is open, and what its clients share.
#[derive(Debug)]
pub struct Door {
    /// The name of its robot.
    pub robot: String,
    /// The robots.
    pub fleet: Arc<Fleet>,
    /// Who may do what.
    pub policy: SharedPolicy,
    lease: Mutex<ImplicitLease>,
    refusals: Mutex<Refusals>,
    /// What stands in the log of the process. Apart from the audit log: strangers stand in this one alone.
    logged: Mutex<Refusals>,
    /// The rate of commands and lists: each takes the disk twice. That of a token is the model.
    rate: Mutex<Rate>,
    pace: Mutex<Duration>,
    /// Locked while the implicit lease is acquired.
    pub acquiring: tokio::sync::Mutex<()>,
}

impl Door {
    /// Opens a raw port.
    ///
    /// # Errors
    /// The system does not allow listening there.
    pub fn open(
        port: &RawPort,
        fleet: Arc<Fleet>,
        policy: SharedPolicy,
    ) -> std::io::Result<(Self, TcpListener)> {
        let socket = if port.listen.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
        // As tokio does for its listeners: a port can be used again at once.
        #[cfg(unix)]
        socket.set_reuseaddr(true)?;
        // Connections take this over.
        socket.set_send_buffer_size(SEND_BUFFER)?;
        socket.bind(port.listen)?;
        let listener = socket.listen(BACKLOG)?;
        let door = Self {
            robot: port.robot.to_string(),
            fleet,
            policy,
            lease: Mutex::default(),
            refusals: Mutex::default(),
            logged: Mutex::default(),
            rate: Mutex::default(),
            pace: Mutex::default(),
            acquiring: tokio::sync::Mutex::default(),
        };
        Ok((door, listener))
    }

    /// The implicit lease.
    pub fn lease(&self) -> MutexGuard<'_, ImplicitLease> {
        self.lease.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The refusals that stand in the audit log.
    pub fn refusals(&self) -> MutexGuard<'_, Refusals> {
        self.refusals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether the log of the process tells of this now: once a minute for each source and event.
    pub fn is_logged(&self, source: SocketAddr, event: &str) -> bool {
        let mut logged = self.logged.lock().unwrap_or_else(PoisonError::into_inner);
        logged.is_written(clock::now(), source.ip(), event)
    }

    /// The rate of commands and lists.
    pub fn rate(&self) -> MutexGuard<'_, Rate> {
        self.rate.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How long a reply takes at least: half of the robot's usual time. Otherwise a loop without a sleep,
    /// which the robot slows down, would spin.
    pub fn pace(&self) -> Duration {
        *self.pace.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Renews the implicit lease or gives it back, and takes the usual time of a reply.
    fn look(&self) {
        let Some(station) = self.fleet.station(&self.robot) else { return };
        let (stands, list_is_empty) = station.is_at_rest();
        station.seat(|seat, now| {
            let (stopped, under_way) = seat.stops();
            let mut lease = self.lease();
            let rest = Rest { stands: stands && under_way == 0, list_is_empty, stopped };
            match lease.due(now, rest) {
                Due::Nothing => {}
                Due::Renew(key) => {
                    if seat.renew(now, key, USUAL_LEASE).is_err() {
                        lease.lost(key);
                    }
                }
                Due::Release(key) => {
                    // If it has ended by itself, it is gone all the same.
                    let _ = seat.release(now, key);
                    lease.lost(key);
                }
            }
        });
        let robot = station.robot().and_then(|robot| robot.link_quality().latency);
        let usual = robot.map_or(Duration::ZERO, |latency| latency.p50);
        *self.pace.lock().unwrap_or_else(PoisonError::into_inner) = (usual / 2).min(MAX_PACE);
    }
}

/// Accepts clients for ever. They end with this task.
pub async fn attend(door: Door, listener: TcpListener) {
    let door = Arc::new(door);
    let mut clients: JoinSet<()> = JoinSet::new();
    let present = Present::default();
    let mut looks = tokio::time::interval(LOOK);
    looks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            Some(_) = clients.join_next() => {}
            _ = looks.tick() => door.look(),
            accepted = listener.accept() => match accepted {
                Ok((stream, source)) => {
                    // With `join_next` above, ended clients may still be counted: take them out first.
                    while clients.try_join_next().is_some() {}
                    let client = door.policy.client(canonical(source));
                    let address = client.source.ip();
                    if let Some(station) = admit(&door, client, (clients.len(), present.of(address))) {
                        let (door, place) = (Arc::clone(&door), present.enter(address));
                        clients.spawn(async move {
                            converse(door, station, stream, client).await;
                            drop(place);
                        });
                    }
                }
                Err(error) => {
                    // Most likely too many open files: give the connections a moment to end.
                    tracing::warn!(robot = door.robot, %error, "a raw port cannot accept a connection");
                    tokio::time::sleep(Duration::from_millis(100)).await;
                }
            },
        }
    }
}

/// An IPv4 address that comes as an IPv6 address is an IPv4 address.
fn canonical(source: SocketAddr) -> SocketAddr {
    SocketAddr::new(source.ip().to_canonical(), source.port())
}

/// The addresses of the clients that are there.
#[derive(Clone, Debug, Default)]
struct Present(Arc<Mutex<Vec<IpAddr>>>);

impl Present {
    fn all(&self) -> MutexGuard<'_, Vec<IpAddr>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How many have this address.
    fn of(&self, address: IpAddr) -> usize {
        self.all().iter().filter(|other| **other == address).count()
    }

    /// One more is there, until this is dropped.
    fn enter(&self, address: IpAddr) -> Place {
        self.all().push(address);
        Place { present: self.clone(), address }
    }
}

/// The place of a client.
struct Place {
    present: Present,
    address: IpAddr,
}

impl Drop for Place {
    fn drop(&mut self) {
        let mut all = self.present.all();
        if let Some(at) = all.iter().position(|other| *other == self.address) {
            all.swap_remove(at);
        }
    }
}

/// The robot, if the client may come in beside this number of clients, and this number of its own address.
fn admit(door: &Door, client: Client, (clients, of_address): (usize, usize)) -> Option<Arc<Station>> {
    let Client { source, .. } = client;
    let station = door.fleet.station(&door.robot)?;
    let cause = if door.policy.rule(client, &door.robot).is_none() {
        Cause::Denied
    } else if clients >= MAX_CLIENTS || of_address >= MAX_OF_ONE_ADDRESS {
        Cause::TooManyClients
    } else if station.link.borrow().is_none() {
        Cause::RobotDown
    } else {
        return Some(station);
    };
    station.counts.raw.closed(cause);
    // Strangers must not fill the log.
    if door.is_logged(source, cause.word()) {
        tracing::info!(robot = door.robot, %source, %cause, "a raw client was not let in");
    }
    None
}

async fn converse(door: Arc<Door>, station: Arc<Station>, stream: TcpStream, client: Client) {
    let Client { source, .. } = client;
    let keepalive = TcpKeepalive::new().with_time(KEEPALIVE).with_interval(KEEPALIVE);
    // Frames leave at once and separately: old clients read with one call.
    let ready = stream.set_nodelay(true);
    if ready.and_then(|()| SockRef::from(&stream).set_tcp_keepalive(&keepalive)).is_err() {
        return;
    }
    let _present = station.counts.raw.client();
    tracing::debug!(robot = door.robot, %source, "a raw client came");
    match conversation::run(&door, &station, stream, client).await {
        End::Left => tracing::debug!(robot = door.robot, %source, "a raw client left"),
        End::Closed(cause) => {
            tracing::info!(robot = door.robot, %source, %cause, "a raw client was closed");
            station.counts.raw.closed(cause);
        }
    }
}
