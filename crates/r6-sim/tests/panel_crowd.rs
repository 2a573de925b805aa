//! The panel while other clients hold its connections: an emergency stop never waits for them.

use std::time::Duration;

use r6_sim::{SimSettings, Simulation};
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::timeout;

const ESTOP: &str = r#"{"do":"emergency_stop"}"#;

/// Far below the times after which the panel gives up incomplete requests, and long for a loaded machine.
const AT_ONCE: Duration = Duration::from_millis(1_500);

async fn start() -> Simulation {
    let settings = SimSettings { panel: Some("127.0.0.1:0".parse().unwrap()), ..SimSettings::default() };
    Simulation::start(settings).await.unwrap()
}

fn head(simulation: &Simulation) -> String {
    let host = simulation.panel().unwrap();
    format!(
        "POST /v1/controllers/1/actions HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\nContent-Type: application/json\r\n"
    )
}

/// A connection that has sent this and sends no more.
async fn silent(simulation: &Simulation, said: &str) -> TcpStream {
    let mut stream = TcpStream::connect(simulation.panel().unwrap()).await.unwrap();
    stream.write_all(said.as_bytes()).await.unwrap();
    stream
}

async fn answer(stream: &mut TcpStream) -> (u16, Value) {
    let mut reply = Vec::new();
    stream.read_to_end(&mut reply).await.unwrap();
    let reply = String::from_utf8(reply).unwrap();
    let status = reply.split(' ').nth(1).unwrap_or_else(|| panic!("{reply:?}")).parse().unwrap();
    let (head, body) = reply.split_once("\r\n\r\n").unwrap();
    assert!(head.to_lowercase().contains("content-type: application/json"), "{reply}");
    (status, serde_json::from_str(body).unwrap_or_else(|error| panic!("{error}: {reply}")))
}

/// 193 incomplete requests once kept it waiting for 29 s.
#[tokio::test]
async fn an_emergency_stop_waits_for_no_half_sent_request() {
    let simulation = start().await;
    let head = head(&simulation);
    let half_head = head[..20].to_owned();
    let half_body = format!("{head}Content-Length: 100\r\n\r\n{{");
    for said in ["", half_head.as_str(), half_body.as_str()] {
        let mut crowd = Vec::new();
        for _ in 0..193 {
            crowd.push(silent(&simulation, said).await);
        }
        let mut stream =
            silent(&simulation, &format!("{head}Content-Length: {}\r\n\r\n{ESTOP}", ESTOP.len())).await;
        let (status, state) =
            timeout(AT_ONCE, answer(&mut stream)).await.expect("it waits behind the others");
        assert_eq!((status, &state["emergency_stop"]), (200, &true.into()));
    }
}

/// However many connections one address holds open, another address still gets one.
#[tokio::test]
async fn a_crowd_takes_no_connection_of_another_address() {
    let simulation = start().await;
    let head = head(&simulation);
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind("127.0.0.2:0".parse().unwrap()).unwrap();
    let mut other = socket.connect(simulation.panel().unwrap()).await.unwrap();
    let (first, rest) = ESTOP.split_at(5);
    other
        .write_all(format!("{head}Content-Length: {}\r\n\r\n{first}", ESTOP.len()).as_bytes())
        .await
        .unwrap();
    let mut crowd = Vec::new();
    for _ in 0..200 {
        crowd.push(silent(&simulation, &head).await);
    }
    other.write_all(rest.as_bytes()).await.unwrap();
    let (status, _) = timeout(Duration::from_secs(10), answer(&mut other)).await.unwrap();
    assert_eq!(status, 200);
    assert!(simulation.controllers()[0].snapshot().emergency_stop);
}

/// Requests whose bodies never end once held all places of their address but one: each new connection was
/// pushed out by the next.
#[tokio::test]
async fn requests_that_never_end_push_no_emergency_stop_out() {
    let simulation = start().await;
    let head = head(&simulation);
    let host = simulation.panel().unwrap();
    let look = format!("GET /v1/controllers/1 HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
    let mut crowd = Vec::new();
    for _ in 0..31 {
        crowd.push(silent(&simulation, &format!("{head}Content-Length: 100\r\n\r\n{{")).await);
    }
    // The panel handles connections in turn: it has read those of before by now.
    assert_eq!(answer(&mut silent(&simulation, &look).await).await.0, 200);
    let estop = format!("{head}Content-Length: {}\r\n\r\n{ESTOP}", ESTOP.len());
    let (first, rest) = estop.split_at(30);
    let mut stream = silent(&simulation, first).await;
    for _ in 0..5 {
        crowd.push(silent(&simulation, "").await);
    }
    assert_eq!(answer(&mut silent(&simulation, &look).await).await.0, 200);
    stream.write_all(rest.as_bytes()).await.unwrap();
    assert_eq!(answer(&mut stream).await.0, 200);
}

/// Time passes at once if no task has anything to do.
#[tokio::test(start_paused = true)]
async fn half_a_head_is_given_up_after_two_seconds() {
    let simulation = start().await;
    let head = head(&simulation);
    for said in ["", &head[..20]] {
        let begun = tokio::time::Instant::now();
        let mut stream = silent(&simulation, said).await;
        let _ = stream.read_to_end(&mut Vec::new()).await;
        let waited = begun.elapsed();
        assert!((2_000..2_100).contains(&waited.as_millis()), "{said:?}: {waited:?}");
    }
}

/// Bytes that are not HTTP are refused in JSON like any other request.
#[tokio::test]
async fn what_is_no_request_is_refused_in_json() {
    let simulation = start().await;
    let host = simulation.panel().unwrap();
    let long = "x".repeat(40_000);
    for (said, status, code) in [
        ("GARBAGE\r\n\r\n".to_owned(), 400, "bad_request"),
        (format!("GET / HTTP/1.1\r\nHost: {host}\r\nContent-Length: many\r\n\r\n"), 400, "bad_request"),
        (format!("GET /{long} HTTP/1.1\r\nHost: {host}\r\n\r\n"), 431, "too_long"),
        (format!("GET / HTTP/1.1\r\nHost: {host}\r\nX: {long}\r\n\r\n"), 431, "too_long"),
    ] {
        let mut stream = silent(&simulation, &said).await;
        let (found, problem) = timeout(Duration::from_secs(10), answer(&mut stream)).await.unwrap();
        assert!(problem["message"].as_str().is_some_and(|message| !message.is_empty()), "{problem}");
        assert_eq!((found, &problem["code"]), (status, &Value::from(code)), "{said:.60}");
    }
}
