//! The wires to a hostile controller.

use std::fmt;
use std::io;
use std::sync::Arc;

use r6_client::Connect;
use r6_testkit::hostile::serve::HostileController;
use tokio::io::DuplexStream;

/// Connections in memory to a hostile controller. They work with a paused clock.
pub struct Cable(pub Arc<HostileController>);

impl fmt::Display for Cable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a hostile controller")
    }
}

impl Connect for Cable {
    type Stream = DuplexStream;

    async fn connect(&mut self) -> io::Result<DuplexStream> {
        self.0.dial()
    }
}
