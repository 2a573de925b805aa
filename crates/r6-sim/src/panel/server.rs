//! The panel's listener and its connections.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tracing::{debug, warn};

use super::routes;
use crate::handle::ControllerHandle;

/// How many connections are open at once; more wait until one ends. A person and a few scripts need one each.
const MAX_CONNECTIONS: usize = 64;

/// How long a connection may be silent before its next request is there.
const HEAD_TIME: Duration = Duration::from_secs(10);

/// The longest head of a request, and what is read at once.
const MAX_HEAD_BYTES: usize = 16 * 1024;

/// Serves the panel for as long as it is polled.
pub(crate) async fn serve(listener: TcpListener, controllers: Vec<ControllerHandle>) {
    let address = match listener.local_addr() {
        Ok(address) => address,
        Err(error) => {
            warn!(%error, "the panel has no address");
            return;
        }
    };
    let router = routes::router(controllers.into(), address);
    let room = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let mut connections = JoinSet::new();
    loop {
        // It is never closed.
        let Ok(permit) = Arc::clone(&room).acquire_owned().await else { return };
        while connections.try_join_next().is_some() {}
        match listener.accept().await {
            Ok((stream, _)) => {
                let router = router.clone();
                connections.spawn(async move {
                    converse(stream, router).await;
                    drop(permit);
                });
            }
            Err(error) => {
                // Most likely too many open files: give the connections a moment to end.
                warn!(panel = %address, %error, "a connection could not be accepted");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

async fn converse(stream: TcpStream, router: Router) {
    let served = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(MAX_HEAD_BYTES)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router))
        .await;
    if let Err(error) = served {
        debug!(%error, "a connection of the panel was lost");
    }
}
