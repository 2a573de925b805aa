//! A listener and its connections.

use std::io;
use std::net::{IpAddr, Ipv6Addr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Router;
use axum::response::Response;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use socket2::SockRef;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::{AbortHandle, JoinSet};
use tracing::{debug, warn};

use crate::afterwards::Afterwards;
use crate::ends_with::EndsWith;
use crate::in_json::InJson;
use crate::shown::{self, Shown};
use crate::slowed::Slowed;
use crate::stalled::Stalled;
use crate::tls::Tls;

/// How many connections are open at once. A script needs one, a window of a browser up to seven: six for its
/// requests and one for its stream. So this is room for some thirty windows; each connection may hold 100 KB.
const MAX_CONNECTIONS: usize = 256;

/// How many of them one address may have, so that others have room beside a machine that opens connections
/// without end. A proxy is one address, and so are all windows of one office behind a router.
const MAX_OF_ONE_PEER: usize = 128;

/// How long the head of a request may take, from the opening of the connection, with TLS from the end of the
/// handshake, or from the answer to the request before. Clients send it in one piece.
const HEAD_TIME: Duration = Duration::from_secs(2);

/// The longest head of a request, and the most that is read at once.
pub(crate) const MAX_HEAD_BYTES: usize = 16 * 1024;

/// How much of an answer or a stream waits in the system for a peer that reads slowly. A longer queue would
/// hold more memory for each such peer, and values that are old when they are read.
const SEND_BUFFER: usize = 64 * 1024;

/// The address that a request came from: an extension of each request.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub SocketAddr);

/// The connection of a request: an extension of each request.
#[derive(Clone, Debug)]
pub struct Guest(Arc<GuestState>);

impl Guest {
    /// From now on the request counts as being answered: its connection is the last to be closed if there is
    /// no room. To be called once the caller is known; on a server without callers, once the body was read.
    /// Without this call, strangers could hold all places with requests whose bodies never end.
    pub fn keep(&self) {
        self.0.is_kept.store(true, Ordering::Relaxed);
    }
}

/// Where connections come from.
pub trait Listener: Send {
    /// A connection.
    type Stream: AsyncRead + AsyncWrite + Send + Unpin + 'static;

    /// The next connection, and the address of its peer.
    ///
    /// # Errors
    /// There is no room for another connection at present.
    fn accept(&mut self) -> impl Future<Output = io::Result<(Self::Stream, SocketAddr)>> + Send;

    /// The address that it listens on, for the log.
    fn address(&self) -> Option<SocketAddr>;
}

impl Listener for TcpListener {
    type Stream = TcpStream;

    async fn accept(&mut self) -> io::Result<(TcpStream, SocketAddr)> {
        let (stream, peer) = Self::accept(self).await?;
        // Small messages of a stream must not wait for the acknowledgement of those before. If the socket is
        // dead already, its task will notice.
        let _ = stream.set_nodelay(true);
        let _ = SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
        Ok((stream, peer))
    }

    fn address(&self) -> Option<SocketAddr> {
        self.local_addr().ok()
    }
}

/// Accepts and serves connections over TCP for as long as it is polled, with TLS if there is a certificate.
pub async fn serve(listener: TcpListener, router: Router, tls: Option<Tls>) {
    serve_until(listener, router, tls, std::future::pending(), Duration::ZERO).await;
}

/// The same until it is over: then no connection is accepted any more, and those that are open have this time
/// to come to their end.
pub async fn serve_until(
    listener: TcpListener,
    router: Router,
    tls: Option<Tls>,
    over: impl Future<Output = ()>,
    grace: Duration,
) {
    let greet = |stream, peer: SocketAddr, state| {
        let (tls, router) = (tls.clone(), router.clone());
        async move {
            let Some(tls) = tls else {
                return converse(Slowed::new(stream), (Peer(peer), None), router, state).await;
            };
            match tls.accept(stream).await {
                Ok(stream) => {
                    let shown = shown::of(stream.get_ref().1);
                    converse(stream, (Peer(peer), shown), router, state).await;
                }
                Err(error) => debug!(%peer, %error, "a connection got no TLS"),
            }
        }
    };
    attend(listener, greet, over, grace).await;
}

/// Accepts and serves connections without TLS for as long as it is polled.
pub async fn serve_plain(listener: impl Listener, router: Router) {
    let greet =
        |stream, peer, state| converse(Slowed::new(stream), (Peer(peer), None), router.clone(), state);
    attend(listener, greet, std::future::pending(), Duration::ZERO).await;
}

/// Accepts connections, and lets `greet` serve each, until it is over. Then it waits for those that are open,
/// for the time of `grace`.
async fn attend<L, F>(
    mut listener: L,
    greet: impl Fn(L::Stream, SocketAddr, Arc<GuestState>) -> F,
    over: impl Future<Output = ()>,
    grace: Duration,
) where
    L: Listener,
    F: Future<Output = ()> + Send + 'static,
{
    let mut guests = Guests::default();
    let mut over = std::pin::pin!(over);
    loop {
        let accepted = tokio::select! {
            biased;
            () = &mut over => break,
            accepted = listener.accept() => accepted,
        };
        match accepted {
            Ok((stream, peer)) => {
                guests.admit(peer, |state| greet(stream, peer, state));
                // A request that has arrived is read before the next connection can push this one out.
                tokio::task::yield_now().await;
            }
            Err(error) => {
                // Most likely too many open files: give the connections a moment to end.
                let server = listener.address();
                warn!(?server, %error, "an HTTP connection could not be accepted");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
    drop(listener);
    let ended = async { while guests.tasks.join_next().await.is_some() {} };
    if tokio::time::timeout(grace, ended).await.is_err() {
        debug!("connections of an HTTP server that ends are cut");
    }
}

/// The open connections, oldest first.
///
/// A new connection never waits, because an emergency stop must not wait behind incomplete requests. If there
/// is no room, one connection is closed: first of the strangers, which never had a request that was kept (see
/// [`Guest::keep`]) and got a good answer, then of those that wait for their next request or follow a stream,
/// and only then of those whose request is being answered and is kept. Of the first sort that there is, it is
/// the oldest of the peer that has the most of them. A peer that has too many connections makes room itself.
#[derive(Default)]
struct Guests {
    open: Vec<Open>,
    tasks: JoinSet<()>,
}

/// An open connection.
struct Open {
    peer: IpAddr,
    state: Arc<GuestState>,
    task: AbortHandle,
}

/// What a connection does now.
#[derive(Debug, Default)]
struct GuestState {
    /// Whether a request is kept and its answer has not been sent.
    is_kept: AtomicBool,
    /// Whether a request that was kept got what it asked for.
    was_served: AtomicBool,
}

impl GuestState {
    /// The lowest goes first if there is no room.
    fn rank(&self) -> u8 {
        match (self.is_kept.load(Ordering::Relaxed), self.was_served.load(Ordering::Relaxed)) {
            (false, false) => 0,
            (false, true) => 1,
            (true, _) => 2,
        }
    }
}

/// Who counts as one peer: an address, or a network of IPv6, of which one machine has all addresses.
fn network(peer: IpAddr) -> IpAddr {
    match peer.to_canonical() {
        IpAddr::V6(peer) => IpAddr::V6(Ipv6Addr::from_bits(peer.to_bits() & !u128::from(u64::MAX))),
        peer @ IpAddr::V4(_) => peer,
    }
}

impl Guests {
    fn admit<F: Future<Output = ()> + Send + 'static>(
        &mut self,
        from: SocketAddr,
        serve: impl FnOnce(Arc<GuestState>) -> F,
    ) {
        let peer = network(from.ip());
        while self.tasks.try_join_next().is_some() {}
        self.open.retain(|guest| !guest.task.is_finished());
        if let Some(at) = self.who_goes(peer) {
            self.open.remove(at).task.abort();
        }
        let state = Arc::new(GuestState::default());
        let task = self.tasks.spawn(serve(Arc::clone(&state)));
        self.open.push(Open { peer, state, task });
    }

    /// Which connection is closed to make room for one of this peer, if any.
    fn who_goes(&self, peer: IpAddr) -> Option<usize> {
        let of_peer = self.open.iter().filter(|guest| guest.peer == peer).count();
        let is_crowd = of_peer >= MAX_OF_ONE_PEER;
        if !is_crowd && self.open.len() < MAX_CONNECTIONS {
            return None;
        }
        let ranks: Vec<_> = self.open.iter().map(|guest| (guest.peer, guest.state.rank())).collect();
        let may_go = || ranks.iter().enumerate().filter(|(_, (of, _))| !is_crowd || *of == peer);
        let lowest = may_go().map(|(_, (_, rank))| *rank).min()?;
        let lowest = || may_go().filter(|(_, (_, rank))| *rank == lowest);
        let count = |peer: IpAddr| lowest().filter(|(_, (of, _))| *of == peer).count();
        // Of peers with as many, the one of the oldest connection.
        let most = lowest().map(|(_, (of, _))| *of).rev().max_by_key(|of| count(*of))?;
        lowest().find(|(_, (of, _))| *of == most).map(|(at, _)| at)
    }
}

/// Waits for the end that the last answer has asked for.
async fn ended(end: &mut watch::Receiver<Option<EndsWith>>) {
    loop {
        let now = end.borrow_and_update().clone();
        let wait = async {
            match now {
                Some(now) => now.wait().await,
                None => std::future::pending().await,
            }
        };
        tokio::select! {
            biased;
            () = wait => return,
            changed = end.changed() => if changed.is_err() {
                std::future::pending().await
            },
        }
    }
}

async fn converse<S>(stream: S, (peer, shown): (Peer, Option<Shown>), router: Router, state: Arc<GuestState>)
where
    S: AsyncRead + AsyncWrite + Send + Unpin + 'static,
{
    let router = TowerToHyperService::new(router);
    // What an answer with 101 leaves to do.
    let afterwards = Arc::new(Mutex::new(None));
    let left = Arc::clone(&afterwards);
    let (ends, mut end) = watch::channel(None::<EndsWith>);
    let ends = Arc::new(ends);
    let service = service_fn(move |mut request: hyper::Request<hyper::body::Incoming>| {
        state.is_kept.store(false, Ordering::Relaxed);
        request.extensions_mut().insert(peer);
        if let Some(shown) = shown.clone() {
            request.extensions_mut().insert(shown);
        }
        request.extensions_mut().insert(Guest(Arc::clone(&state)));
        let answer = router.call(request);
        let (state, left, ends) = (Arc::clone(&state), Arc::clone(&left), Arc::clone(&ends));
        async move {
            let mut answer = answer.await;
            let is_good = |answer: &Response| !answer.status().is_client_error();
            let was_kept = state.is_kept.swap(false, Ordering::Relaxed);
            if was_kept && answer.as_ref().is_ok_and(is_good) {
                state.was_served.store(true, Ordering::Relaxed);
            }
            let with = answer.as_mut().ok().and_then(|answer| answer.extensions_mut().remove::<EndsWith>());
            ends.send_replace(with);
            let work = answer.as_mut().ok().and_then(|answer| answer.extensions_mut().remove::<Afterwards>());
            if work.is_some() {
                *left.lock().unwrap_or_else(PoisonError::into_inner) = work;
            }
            answer
        }
    });
    let serving = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(MAX_HEAD_BYTES)
        .serve_connection(TokioIo::new(InJson::new(Stalled::new(stream))), service)
        .with_upgrades();
    tokio::select! {
        biased;
        served = serving => {
            if let Err(error) = served {
                debug!(%error, "an HTTP connection was lost");
            }
        }
        () = ended(&mut end) => debug!("an HTTP connection ends with its answer"),
    }
    let work = afterwards.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(work) = work {
        work.run().await;
    }
}

#[cfg(test)]
mod tests {
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};
    use tokio::net::TcpStream;
    use tokio::sync::{Notify, oneshot};
    use tokio::task::JoinHandle;

    use super::*;

    /// A server with a route that says that it was asked, and answers when it may. What ends it, too.
    async fn ending(grace: Duration) -> (SocketAddr, [Arc<Notify>; 2], oneshot::Sender<()>, JoinHandle<()>) {
        let [asked, may] = [Arc::new(Notify::new()), Arc::new(Notify::new())];
        let route = {
            let [asked, may] = [Arc::clone(&asked), Arc::clone(&may)];
            get(async move || {
                asked.notify_one();
                may.notified().await;
                "done"
            })
        };
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let (end, ends) = oneshot::channel::<()>();
        let over = async { drop(ends.await) };
        let server = serve_until(listener, Router::new().route("/", route), None, over, grace);
        (address, [asked, may], end, tokio::spawn(server))
    }

    async fn ask(address: SocketAddr) -> TcpStream {
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream.write_all(b"GET / HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n").await.unwrap();
        stream
    }

    #[tokio::test]
    async fn a_request_that_is_under_way_at_the_end_gets_its_answer_and_no_other_is_accepted() {
        let (address, [asked, may], end, server) = ending(Duration::from_secs(10)).await;
        let mut stream = ask(address).await;
        asked.notified().await;
        end.send(()).unwrap();
        while TcpStream::connect(address).await.is_ok() {
            tokio::task::yield_now().await;
        }
        may.notify_one();
        let mut reply = String::new();
        stream.read_to_string(&mut reply).await.unwrap();
        assert!(reply.starts_with("HTTP/1.1 200") && reply.ends_with("done"), "{reply}");
        server.await.unwrap();
    }

    #[tokio::test]
    async fn a_request_that_does_not_come_to_its_end_in_time_is_cut() {
        let (address, [asked, _may], end, server) = ending(Duration::from_millis(20)).await;
        let mut stream = ask(address).await;
        asked.notified().await;
        end.send(()).unwrap();
        server.await.unwrap();
        let mut reply = Vec::new();
        assert!(stream.read_to_end(&mut reply).await.is_err() || reply.is_empty(), "{reply:?}");
    }

    /// A machine without a connection so far.
    const LAST: u16 = u16::MAX;

    /// Connections, oldest first: the number of the machine, whether a request is kept, whether one was
    /// served.
    async fn guests(open: &[(u16, bool, bool)]) -> Guests {
        let mut guests = Guests::default();
        for (peer, is_kept, was_served) in open {
            let state = GuestState { is_kept: (*is_kept).into(), was_served: (*was_served).into() };
            let task = guests.tasks.spawn(std::future::pending());
            guests.open.push(Open { peer: new(*peer), state: Arc::new(state), task });
        }
        guests
    }

    fn new(peer: u16) -> IpAddr {
        let [high, low] = peer.to_be_bytes();
        IpAddr::from([10, 0, high, low])
    }

    #[tokio::test]
    async fn a_request_that_is_being_answered_goes_last() {
        // A stop of one machine, and silent connections of all others.
        let others = MAX_CONNECTIONS - 1;
        let mut open = vec![(1, true, false)];
        open.extend((2..).take(others).map(|peer| (peer, false, false)));
        assert_eq!(guests(&open).await.who_goes(new(LAST)), Some(1));
        // Two streams of one machine, and silent connections of all others.
        let mut open = vec![(1, false, true), (1, false, true)];
        open.extend((2..).take(others - 1).map(|peer| (peer, false, false)));
        assert_eq!(guests(&open).await.who_goes(new(LAST)), Some(2));
        // Only streams and answers: the machine with the most streams makes room.
        let mut open: Vec<_> = (0..40).map(|peer| (peer, true, true)).collect();
        open.extend([(50, false, true), (51, false, true), (51, false, true)]);
        open.extend((60..).take(MAX_CONNECTIONS - open.len()).map(|peer| (peer, true, false)));
        assert_eq!(guests(&open).await.who_goes(new(LAST)), Some(41));
        // Only answers.
        let open: Vec<_> = (0..).take(MAX_CONNECTIONS).map(|peer| (peer, true, true)).collect();
        assert_eq!(guests(&open).await.who_goes(new(LAST)), Some(0));
        assert_eq!(guests(&open[1..]).await.who_goes(new(LAST)), None);
    }

    #[tokio::test]
    async fn a_peer_with_too_many_makes_room_itself() {
        let mut open = vec![(2, false, false)];
        open.extend([(1, false, true); MAX_OF_ONE_PEER]);
        assert_eq!(guests(&open).await.who_goes(new(1)), Some(1));
        assert_eq!(guests(&open).await.who_goes(new(2)), None);
        open[5] = (1, false, false);
        assert_eq!(guests(&open).await.who_goes(new(1)), Some(5));
    }

    #[test]
    fn a_network_of_ipv6_is_one_peer() {
        let of = |text: &str| network(text.parse().unwrap());
        assert_eq!(of("2001:db8::1"), of("2001:db8::ffff:1"));
        assert_ne!(of("2001:db8::1"), of("2001:db8:0:1::1"));
        assert_ne!(of("10.0.0.1"), of("10.0.0.2"));
        assert_eq!(of("::ffff:10.0.0.1"), of("10.0.0.1"));
    }
}
