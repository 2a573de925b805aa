//! Requests made while a connection is being opened.

use std::fmt;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use r6_client::{Address, Connect, Robot, RobotSettings};
use r6_proto::message::Command;
use serde_json::json;
use tokio::io::DuplexStream;
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};

use crate::controller::{Peer, command_word, values, verdict};

/// The first connection opens at once, the others after ten seconds.
struct Slow(mpsc::UnboundedSender<DuplexStream>, bool);

impl Connect for Slow {
    type Stream = DuplexStream;

    async fn connect(&mut self) -> io::Result<DuplexStream> {
        if std::mem::replace(&mut self.1, true) {
            sleep(Duration::from_secs(10)).await;
        }
        let (here, there) = tokio::io::duplex(64 * 1024);
        self.0.send(there).map_err(|_| io::ErrorKind::ConnectionRefused)?;
        Ok(here)
    }
}

impl fmt::Display for Slow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a slow one")
    }
}

/// A program that requests a stop repeatedly, and each time gives up waiting.
#[tokio::test(start_paused = true)]
async fn stops_that_nobody_waits_for_any_more_do_not_pile_up() {
    let (made, mut accepted) = mpsc::unbounded_channel();
    let settings = RobotSettings { connect_timeout: Duration::from_secs(60), ..RobotSettings::default() };
    let robot = Robot::connect_with(Slow(made, false), settings).await.unwrap();
    drop(accepted.recv().await.unwrap());
    sleep(Duration::from_secs(1)).await;
    let asking = tokio::spawn({
        let robot = robot.clone();
        async move { robot.query(&[Address::CurMode]).await }
    });
    sleep(Duration::from_millis(500)).await;
    for _ in 0..200 {
        timeout(Duration::from_millis(20), robot.command(Command::ActionStop)).await.ok();
    }
    let peer = Peer::in_memory(accepted.recv().await.unwrap());
    let stops = Arc::new(AtomicUsize::new(0));
    let seen = Arc::clone(&stops);
    let answering = peer.answer_all(move |request| match command_word(request) {
        "actionStop" => {
            seen.fetch_add(1, Ordering::Relaxed);
            Some(verdict(request, &["actionStop", "ok"]))
        }
        _ => Some(values(request, json!(["7"]))),
    });
    timeout(Duration::from_secs(3), answering).await.ok();
    let stops = stops.load(Ordering::Relaxed);
    assert_eq!(stops, 1);
    asking.abort();
}
