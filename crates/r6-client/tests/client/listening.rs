//! A controller that dials, and the program that waits for it.

use std::net::{IpAddr, SocketAddr};
use std::time::Duration;

use r6_client::{Address, Listen, NotSent, RequestError, Robot};
use r6_testkit::hostile::Character;
use r6_testkit::hostile::serve::HostileController;
use serde_json::json;
use tokio::io::AsyncReadExt;
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::controller::{Peer, impatient, settings, soon, values};

async fn dial(address: SocketAddr) -> Peer {
    Peer::of(soon(TcpStream::connect(address)).await.unwrap())
}

async fn reads(robot: &Robot, peer: &mut Peer) {
    let (read, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        peer.send(values(&request, json!(["7"]))).await;
    });
    assert_eq!(read.unwrap().integer(Address::CurMode), Some(7));
}

#[tokio::test]
async fn it_is_waited_for_and_waited_for_again() {
    let listen = Listen::on("127.0.0.1:0").await.unwrap();
    let address = listen.address().unwrap();
    let (robot, mut peer) = tokio::join!(Robot::connect_with(listen, settings()), dial(address));
    let robot = robot.unwrap();
    assert_eq!(robot.address(), format!("the controller that dials {address}"));
    reads(&robot, &mut peer).await;
    drop(peer);
    // The next query uses the next connection.
    let mut peer = dial(address).await;
    reads(&robot, &mut peer).await;
}

#[tokio::test]
async fn of_several_that_wait_the_newest_counts() {
    let listen = Listen::on("127.0.0.1:0").await.unwrap();
    let address = listen.address().unwrap();
    let (left_behind, mut newest) = (dial(address).await, dial(address).await);
    let robot = Robot::connect_with(listen, settings()).await.unwrap();
    reads(&robot, &mut newest).await;
    let mut left_behind = left_behind;
    left_behind.ends().await;
}

#[tokio::test]
async fn somebody_else_is_sent_away_and_nobody_is_told() {
    let elsewhere: IpAddr = "192.0.2.1".parse().unwrap();
    let listen = Listen::on("127.0.0.1:0").await.unwrap().only_from(elsewhere);
    let address = listen.address().unwrap();
    let mut stranger = soon(TcpStream::connect(address)).await.unwrap();
    let mut wait = impatient();
    wait.connect_timeout = Duration::from_millis(100);
    let error = Robot::connect_with(listen, wait).await.unwrap_err();
    assert!(matches!(error, RequestError::NotSent(NotSent::ConnectTimedOut { .. })), "{error}");
    let read = soon(stranger.read(&mut [0; 8])).await;
    assert!(matches!(read, Ok(0) | Err(_)), "{read:?}");
}

/// The first robot never identifies itself. The next robot that dials may be another, so it gets no stop
/// that was meant for the first.
#[tokio::test]
async fn a_stop_of_one_that_never_said_who_it_is_does_not_reach_the_next_that_dials() {
    let listen = Listen::on("127.0.0.1:0").await.unwrap();
    let address = listen.address().unwrap();
    let (robot, _deaf) = tokio::join!(Robot::connect_with(listen, settings()), dial(address));
    let robot = robot.unwrap();
    let mut next = soon(TcpStream::connect(address)).await.unwrap();
    let stopping = tokio::spawn(async move { robot.stop().await });
    // A second connection would be used after 300 ms.
    let heard = timeout(Duration::from_millis(700), next.read(&mut [0; 256])).await;
    assert!(heard.is_err(), "{heard:?}");
    stopping.abort();
}

#[tokio::test]
async fn a_stop_that_reaches_the_next_that_dials_is_not_confirmed_where_nobody_said_who_he_is() {
    let listen = Listen::on("127.0.0.1:0").await.unwrap();
    let address = listen.address().unwrap();
    let (robot, first) = tokio::join!(Robot::connect_with(listen, settings()), dial(address));
    let robot = robot.unwrap();
    drop(first);
    let controller = HostileController::new(Character::default());
    let next = soon(TcpStream::connect(address)).await.unwrap();
    let served = tokio::spawn(async move { controller.serve(next).await });
    let report = soon(robot.stop()).await.unwrap();
    assert!(!report.confirmed, "{report}");
    served.abort();
}
