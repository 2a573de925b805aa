//! Peers that ask for a stream and do not read it.

use std::time::{Duration, Instant};

use r6_api::gateway::Role;
use r6_client::Address;
use r6_gateway::RobotConfig;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};

use crate::support::{Hall, PATIENCE, name};

/// How many robots it takes to say more than the systems of both sides hold.
const ROBOTS: usize = 60;

/// A gateway with many robots of many values, behind whose addresses nothing answers.
async fn talkative() -> Hall {
    let addresses: Vec<_> = (800..860).map(|at| Address::parse(&format!("Addr-{at}")).unwrap()).collect();
    let config = |at| RobotConfig {
        addresses: addresses.clone(),
        ..RobotConfig::new(name(&format!("d{at:02}")), format!("127.0.3.{}:9", at + 1))
    };
    let configs = (0..ROBOTS).map(config).collect();
    Hall::at(tempfile::tempdir().unwrap(), configs, Vec::new()).await
}

/// Asks for a stream with a small window, and reads nothing.
async fn unread(hall: &Hall, token: &str, path: &str) -> TcpStream {
    let address = hall.gateway.address();
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let mut stream = socket.connect(address).await.unwrap();
    let head = format!("GET {path} HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\n\r\n");
    stream.write_all(head.as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_millis(500)).await;
    stream
}

/// What comes until nothing new comes for a second, or until the end; and whether it is the end.
async fn rest(stream: &mut TcpStream) -> (Vec<u8>, bool) {
    let (mut all, mut part) = (Vec::new(), vec![0; 1 << 16]);
    loop {
        match tokio::time::timeout(Duration::from_secs(1), stream.read(&mut part)).await {
            Err(_) => return (all, false),
            Ok(Ok(0) | Err(_)) => return (all, true),
            Ok(Ok(read)) => all.extend_from_slice(&part[..read]),
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_that_is_not_read_ends_after_its_token_is_revoked() {
    let hall = talkative().await;
    let made = r6_gateway::make_token(hall.data.path(), Role::Viewer, None, String::new()).unwrap();
    // The gateway looks at the folder for new tokens.
    while hall.call(&made.1, "GET", "/v1/robots", None).await.0 != 200 {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let mut stream = unread(&hall, &made.1, "/v1/live").await;
    assert_eq!(r6_gateway::revoke_token(hall.data.path(), made.0), Ok(true));
    tokio::time::sleep(Duration::from_secs(3)).await;
    let (all, is_end) = rest(&mut stream).await;
    assert!(is_end && !all.ends_with(b"0\r\n\r\n"), "the connection was closed, {} bytes", all.len());
    assert!(all.len() < 400_000, "{} bytes", all.len());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_that_is_not_read_for_some_seconds_ends() {
    let hall = talkative().await;
    let mut stalled = unread(&hall, &hall.viewer, "/v1/live").await;
    let mut slow = unread(&hall, &hall.viewer, "/v1/live").await;
    let begun = Instant::now();
    let mut part = vec![0; 16 * 1024];
    while begun.elapsed() < Duration::from_secs(7) {
        // A slow reader is not closed.
        let read = tokio::time::timeout(PATIENCE, slow.read(&mut part)).await.unwrap();
        assert!(read.unwrap() > 0, "{:?}", begun.elapsed());
        tokio::time::sleep(Duration::from_millis(400)).await;
    }
    let (all, is_end) = rest(&mut stalled).await;
    assert!(is_end && !all.ends_with(b"0\r\n\r\n"), "the connection was closed, {} bytes", all.len());
    assert!(!rest(&mut slow).await.1, "the slow one goes on");
}

/// `curl --http2` names a protocol that the gateway does not have.
#[tokio::test]
async fn another_protocol_in_upgrade_is_not_a_websocket() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    for upgrade in ["h2c", "TLS/1.0, h2c"] {
        let mut stream = TcpStream::connect(address).await.unwrap();
        let head = format!(
            "GET /v1/live HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {}\r\n\
             Connection: Upgrade, HTTP2-Settings\r\nUpgrade: {upgrade}\r\nHTTP2-Settings: AAMAAABkAAQ\r\n\r\n",
            hall.viewer
        );
        stream.write_all(head.as_bytes()).await.unwrap();
        let mut answer = vec![0; 12];
        tokio::time::timeout(PATIENCE, stream.read_exact(&mut answer)).await.unwrap().unwrap();
        assert_eq!(answer, b"HTTP/1.1 200", "{upgrade}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn an_event_never_comes_before_what_was_read_before_it() {
    let hall = talkative().await;
    let mut stream = unread(&hall, &hall.viewer, "/v1/live?events=true").await;
    for at in 0..ROBOTS {
        let (status, lease) =
            hall.post(&hall.operator, &format!("/v1/robots/d{at:02}/lease"), &json!({})).await;
        assert_eq!(status, 200, "{lease}");
    }
    let (all, _) = rest(&mut stream).await;
    let text = String::from_utf8(all).unwrap();
    let mut leased = std::collections::BTreeSet::new();
    let (mut snapshots, mut between) = (0, 0);
    for line in text.lines().filter_map(|line| line.strip_prefix("data: ")) {
        let data: Value = serde_json::from_str(line).unwrap();
        if data["event"] == "lease_began" {
            leased.insert(data["robot"].as_str().unwrap().to_owned());
            between += usize::from((1..ROBOTS).contains(&snapshots));
        } else if let Some(robot) = data["name"].as_str() {
            snapshots += 1;
            let knows = !data["lease"].is_null();
            assert!(
                knows || !leased.contains(robot),
                "{robot} begins without the lease that was told before"
            );
        }
    }
    assert_eq!((snapshots, leased.len()), (ROBOTS, ROBOTS));
    assert!(between > 0, "the leases came while the stream was held up");
}
