//! Connections of any kind, opened by the same code for every driver.

use std::io;
use std::pin::Pin;
use std::sync::Arc;

use r6_client::Connect;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::sync::Mutex;

/// Carries the bytes of a connection.
pub trait Carrier: AsyncRead + AsyncWrite + Unpin + Send {}

impl<S: AsyncRead + AsyncWrite + Unpin + Send> Carrier for S {}

/// An attempt to connect.
pub type Attempt = Pin<Box<dyn Future<Output = io::Result<Box<dyn Carrier>>> + Send>>;

/// Opens connections, one attempt at a time.
pub trait Dial: Send + Sync {
    fn dial(self: Arc<Self>) -> Attempt;
}

struct Shared<C>(Mutex<C>);

/// Converts a `connect` of any type.
pub fn dialler(connect: impl Connect) -> Arc<dyn Dial> {
    Arc::new(Shared(Mutex::new(connect)))
}

impl<C: Connect> Dial for Shared<C> {
    fn dial(self: Arc<Self>) -> Attempt {
        Box::pin(async move {
            let stream = self.0.lock().await.connect().await?;
            Ok(Box::new(stream) as Box<dyn Carrier>)
        })
    }
}

/// Sockets to a port of this machine.
pub struct Tcp(pub String);

impl std::fmt::Display for Tcp {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl Connect for Tcp {
    type Stream = TcpStream;

    async fn connect(&mut self) -> io::Result<TcpStream> {
        let stream = TcpStream::connect(&self.0).await?;
        stream.set_nodelay(true)?;
        Ok(stream)
    }
}
