//! What carries the bytes of a connection.

use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tracing::debug;

/// What carries the bytes of a connection, in order, both ways: a TCP stream, or whatever stands for one.
///
/// Dropping it ends the connection in good order, unless [`Self::reset`] was called before.
pub trait Wire: AsyncRead + AsyncWrite + Unpin + Send + 'static {
    /// Has the connection end with a reset once this is dropped: the peer then gets an error instead of an end.
    fn reset(&mut self);
}

impl Wire for TcpStream {
    fn reset(&mut self) {
        if let Err(error) = socket2::SockRef::from(&*self).set_linger(Some(Duration::ZERO)) {
            debug!(%error, "the connection is closed instead of reset");
        }
    }
}
