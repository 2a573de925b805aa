//! A listener and its connections.

use std::net::{IpAddr, SocketAddr};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use axum::Router;
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
use crate::slowed::Slowed;
use crate::tls::Tls;

/// How many connections are open at once. A person and a few scripts need one each.
const MAX_CONNECTIONS: usize = 64;

/// How many of them one address may have, so that others have room beside a machine that opens connections
/// without end.
const MAX_OF_ONE_PEER: usize = 32;

/// How long the head of a request may take, from the opening of the connection or the answer to the request
/// before. Clients send it in one piece.
const HEAD_TIME: Duration = Duration::from_secs(2);

/// The longest head of a request, and the most that is read at once.
pub(crate) const MAX_HEAD_BYTES: usize = 16 * 1024;

/// How much of an answer or a stream waits in the system for a peer that reads slowly. A longer queue would
/// hold more memory for each such peer, and values that are old when they are read.
const SEND_BUFFER: usize = 64 * 1024;

/// The address that a request came from: an extension of each request.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub SocketAddr);

/// Accepts and serves connections for as long as it is polled, with TLS if there is a certificate.
pub async fn serve(listener: TcpListener, router: Router, tls: Option<Tls>) {
    let mut guests = Guests::default();
    loop {
        match listener.accept().await {
            Ok((stream, peer)) => {
                // Small messages of a stream must not wait for the acknowledgement of those before. If the
                // socket is dead already, its task will notice.
                let _ = stream.set_nodelay(true);
                let _ = SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER);
                guests.admit(peer, stream, router.clone(), tls.clone());
            }
            Err(error) => {
                // Most likely too many open files: give the connections a moment to end.
                let server = listener.local_addr().ok();
                warn!(?server, %error, "an HTTP connection could not be accepted");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

/// The open connections, oldest first.
///
/// A new connection never waits, because an emergency stop must not wait behind incomplete requests. If there
/// is no room, one connection is closed. It belongs to the same address if that has too many, else to the
/// address that has most. Of these it is the oldest that is not answering a request, else the oldest.
#[derive(Default)]
struct Guests {
    open: Vec<Guest>,
    tasks: JoinSet<()>,
}

struct Guest {
    peer: IpAddr,
    /// Whether a request has come and its answer has not been sent.
    answers: Arc<AtomicBool>,
    task: AbortHandle,
}

impl Guests {
    fn admit(&mut self, from: SocketAddr, stream: TcpStream, router: Router, tls: Option<Tls>) {
        let peer = from.ip();
        while self.tasks.try_join_next().is_some() {}
        self.open.retain(|guest| !guest.task.is_finished());
        if let Some(at) = self.who_goes(peer) {
            self.open.remove(at).task.abort();
        }
        let answers = Arc::new(AtomicBool::new(false));
        let (peer_of, busy) = (Peer(from), Arc::clone(&answers));
        let task = self.tasks.spawn(async move {
            let Some(tls) = tls else {
                return converse(Slowed::new(stream), peer_of, router, busy).await;
            };
            match tls.accept(stream).await {
                Ok(stream) => converse(stream, peer_of, router, busy).await,
                Err(error) => debug!(peer = %from, %error, "a connection got no TLS"),
            }
        });
        self.open.push(Guest { peer, answers, task });
    }

    /// Which connection is closed to make room for one of this address, if any.
    fn who_goes(&self, peer: IpAddr) -> Option<usize> {
        let of = |peer| self.open.iter().filter(|guest| guest.peer == peer).count();
        let crowd = if of(peer) >= MAX_OF_ONE_PEER {
            peer
        } else if self.open.len() >= MAX_CONNECTIONS {
            // Of addresses with as many, the one of the oldest connection.
            self.open.iter().rev().map(|guest| guest.peer).max_by_key(|peer| of(*peer))?
        } else {
            return None;
        };
        let of_crowd = || self.open.iter().enumerate().filter(|(_, guest)| guest.peer == crowd);
        let idle = of_crowd().find(|(_, guest)| !guest.answers.load(Ordering::Relaxed));
        idle.or_else(|| of_crowd().next()).map(|(at, _)| at)
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
            () = wait => return,
            changed = end.changed() => if changed.is_err() {
                std::future::pending().await
            },
        }
    }
}

async fn converse<S>(stream: S, peer: Peer, router: Router, answers: Arc<AtomicBool>)
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
        answers.store(true, Ordering::Relaxed);
        request.extensions_mut().insert(peer);
        let answer = router.call(request);
        let (answers, left, ends) = (Arc::clone(&answers), Arc::clone(&left), Arc::clone(&ends));
        async move {
            let mut answer = answer.await;
            answers.store(false, Ordering::Relaxed);
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
        .serve_connection(TokioIo::new(InJson::new(stream)), service)
        .with_upgrades();
    tokio::select! {
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
