//! How often the client reconnects to a controller that drops every connection.

use std::fmt;
use std::future;
use std::io;
use std::time::Duration;

use r6_client::{Connect, Reconnect, Robot, RobotSettings};
use r6_proto::address::Address;
use tokio::io::DuplexStream;
use tokio::time::{Instant, sleep};

use crate::controller::Wires;

fn defaults() -> RobotSettings {
    let reconnect = Reconnect { jitter_seed: Some(1), ..Reconnect::default() };
    RobotSettings { reconnect, ..RobotSettings::default() }
}

#[tokio::test(start_paused = true)]
async fn a_peer_that_says_who_it_is_and_closes_is_not_hammered() {
    let (mut wires, robot, first) = Wires::with_robot(defaults()).await;
    drop(first);
    let _watching = robot.subscribe(&[Address::CurMode], Duration::from_millis(20)).unwrap();
    let begun = Instant::now();
    let minute = Duration::from_secs(60);
    let mut connections = 0;
    while begun.elapsed() < minute {
        let mut peer = wires.recv().await.unwrap();
        connections += 1;
        peer.introduces().await;
        peer.introduces().await;
    }
    assert!(connections > 60, "it goes on trying: {connections}");
    assert!(connections < 60 * 6, "{connections} connections in {minute:?}");
}

#[tokio::test(start_paused = true)]
async fn after_a_connection_that_lived_the_first_wait_comes_again() {
    let settings = defaults();
    let (mut wires, robot, first) = Wires::with_robot(settings.clone()).await;
    drop(first);
    // The period is so long that it does not shorten any wait.
    let _watching = robot.subscribe(&[Address::CurMode], Duration::from_secs(60)).unwrap();
    for _ in 0..6 {
        let mut peer = wires.recv().await.unwrap();
        peer.introduces().await;
        peer.introduces().await;
    }
    let begun = Instant::now();
    let mut peer = wires.recv().await.unwrap();
    assert!(begun.elapsed() > Duration::from_secs(2), "{:?}", begun.elapsed());
    peer.introduces().await;
    peer.introduces().await;
    sleep(Duration::from_secs(10)).await;
    drop(peer);
    let begun = Instant::now();
    wires.recv().await.unwrap();
    assert!(begun.elapsed() <= settings.reconnect.first_wait, "{:?}", begun.elapsed());
}

/// Connects once; every later attempt hangs.
struct OnceThenNever(Option<DuplexStream>);

impl Connect for OnceThenNever {
    type Stream = DuplexStream;

    async fn connect(&mut self) -> io::Result<DuplexStream> {
        match self.0.take() {
            Some(stream) => Ok(stream),
            None => future::pending().await,
        }
    }
}

impl fmt::Display for OnceThenNever {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a robot that has left")
    }
}

#[tokio::test(start_paused = true)]
async fn closing_does_not_wait_for_an_attempt_to_connect() {
    let (here, there) = tokio::io::duplex(1024);
    drop(there);
    let connect_timeout = Duration::from_secs(60);
    let settings = RobotSettings { connect_timeout, ..defaults() };
    let robot = Robot::connect_with(OnceThenNever(Some(here)), settings).await.unwrap();
    let asking = tokio::spawn({
        let robot = robot.clone();
        async move { robot.query(&[Address::CurMode]).await }
    });
    sleep(Duration::from_secs(5)).await;
    let begun = Instant::now();
    robot.close().await;
    assert!(begun.elapsed() < Duration::from_secs(1), "{:?}", begun.elapsed());
    asking.await.unwrap().unwrap_err();
}
