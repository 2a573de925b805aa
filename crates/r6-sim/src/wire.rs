//! The transport of a connection's bytes.

use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tracing::debug;

/// The transport of a connection's bytes, in order and in both directions: a TCP stream, or a substitute.
///
/// Dropping it ends the connection in good order, unless [`Self::reset`] was called before.
pub trait Wire: AsyncRead + AsyncWrite + Unpin + Send + 'static {
    /// Makes the connection end with a reset when this is dropped: the peer then gets an error instead of an
    /// end.
    fn reset(&mut self);
}

impl Wire for TcpStream {
    fn reset(&mut self) {
        if let Err(error) = socket2::SockRef::from(&*self).set_linger(Some(Duration::ZERO)) {
            debug!(%error, "the connection is closed instead of reset");
        }
    }
}
