//! A peer that never stops sending: requests are still sent and end in time.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fmt;
use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, ready};
use std::time::{Duration, Instant};

use r6_client::{Connect, Heartbeat, OutcomeUnknown, RequestError, Robot, RobotSettings};
use r6_proto::Address;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::task::coop::poll_proceed;
use tokio::time::timeout;

/// Long enough for a loaded machine.
const PATIENCE: Duration = Duration::from_secs(20);

/// Connections that can be read at any time, and the bytes written to them. The time of the test is real,
/// because a paused clock moves only while nothing is ready to run, which never happens here.
#[derive(Clone, Default)]
struct Flood {
    written: Arc<Mutex<Vec<u8>>>,
}

impl Flood {
    fn heartbeats(&self) -> usize {
        String::from_utf8_lossy(&self.written.lock().unwrap()).matches("heartbreak").count()
    }
}

impl fmt::Display for Flood {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a flood")
    }
}

impl Connect for Flood {
    type Stream = Self;

    async fn connect(&mut self) -> io::Result<Self> {
        Ok(self.clone())
    }
}

impl AsyncRead for Flood {
    fn poll_read(
        self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        // Yields now and then, as sockets do, so that other tasks can run.
        let turn = ready!(poll_proceed(cx));
        buffer.put_slice(br#"{"reqType":"nobody knows"}"#);
        turn.made_progress();
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Flood {
    fn poll_write(self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.written.lock().unwrap().extend_from_slice(bytes);
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

#[test]
fn a_flood_of_input_holds_up_no_heartbeat_and_no_time_out() {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
    let flood = Flood::default();
    let heartbeat = Heartbeat::Managed { every: Duration::from_millis(100) };
    let reply_timeout = Duration::from_millis(150);
    let settings = RobotSettings { heartbeat, reply_timeout, ..RobotSettings::default() };
    runtime.block_on(async {
        let robot = Robot::connect_with(flood.clone(), settings).await.unwrap();
        // Each of them ends, one after the other: an earlier deadline does not block a later one.
        for _ in 0..2 {
            let asked = timeout(PATIENCE, robot.query(&[Address::CurMode])).await.expect("it ends");
            let error = asked.unwrap_err();
            assert!(
                matches!(&error, RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { .. })),
                "{error:?}"
            );
        }
        let begun = Instant::now();
        while flood.heartbeats() < 5 {
            assert!(begun.elapsed() < PATIENCE, "{} heartbeats", flood.heartbeats());
            tokio::task::yield_now().await;
        }
    });
    // The flood never ends, so the test does not wait for it.
    runtime.shutdown_background();
}
