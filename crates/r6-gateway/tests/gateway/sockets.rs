//! Live values over WebSockets: they begin, go on after a loss, change what they follow, and end.

use std::time::{Duration, Instant};

use futures_util::{SinkExt, StreamExt};
use r6_api::gateway::Role;
use r6_controller::{Key, PanelAction};
use r6_sim::VirtualController;
use serde_json::{Value, json};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{WebSocketStream, client_async};

use crate::support::{Hall, PATIENCE, Stream, name};

/// A WebSocket to `GET /v1/live`.
pub struct Socket(pub WebSocketStream<TcpStream>);

/// What a socket brought.
#[derive(Debug)]
enum Got {
    Message(Value),
    /// The code and the reason, if the gateway gave them.
    End(Option<(u16, String)>),
}

impl Socket {
    pub async fn open(hall: &Hall, token: &str, query: &str) -> Self {
        Self::try_open(hall, token, query, None).await.unwrap()
    }

    /// Opens one; or the status and the body of the refusal.
    async fn try_open(
        hall: &Hall,
        token: &str,
        query: &str,
        header: Option<(&'static str, &str)>,
    ) -> Result<Self, (u16, Value)> {
        let address = hall.gateway.address();
        let mut request = format!("ws://{address}/v1/live{query}").into_client_request().unwrap();
        let headers = request.headers_mut();
        if !token.is_empty() {
            headers.insert("authorization", format!("Bearer {token}").parse().unwrap());
        }
        if let Some((name, value)) = header {
            headers.insert(name, value.parse().unwrap());
        }
        let stream = TcpStream::connect(address).await.unwrap();
        match client_async(request, stream).await {
            Ok((socket, _)) => Ok(Self(socket)),
            Err(Error::Http(answer)) => {
                let body = answer.body().clone().unwrap_or_default();
                Err((answer.status().as_u16(), serde_json::from_slice(&body).unwrap_or_default()))
            }
            Err(error) => panic!("{error}"),
        }
    }

    async fn got(&mut self) -> Got {
        loop {
            let next = tokio::time::timeout(PATIENCE, self.0.next()).await;
            match next.expect("the socket says something in time") {
                None | Some(Err(_)) => return Got::End(None),
                Some(Ok(Message::Text(text))) => return Got::Message(serde_json::from_str(&text).unwrap()),
                Some(Ok(Message::Close(frame))) => {
                    let told = |code: CloseCode, reason: String| (u16::from(code), reason);
                    return Got::End(frame.map(|frame| told(frame.code, frame.reason.to_string())));
                }
                Some(Ok(_)) => {}
            }
        }
    }

    pub async fn next(&mut self) -> Value {
        match self.got().await {
            Got::Message(message) => message,
            Got::End(end) => panic!("the socket ended: {end:?}"),
        }
    }

    /// The next message of this type; others are passed over.
    async fn next_of(&mut self, kind: &str) -> Value {
        loop {
            let message = self.next().await;
            if message["type"] == kind {
                return message;
            }
        }
    }

    /// How the socket ends.
    async fn end(&mut self) -> Option<(u16, String)> {
        loop {
            if let Got::End(end) = self.got().await {
                return end;
            }
        }
    }

    async fn say(&mut self, message: &Value) {
        self.0.send(Message::text(message.to_string())).await.unwrap();
    }
}

fn turn_key(robot: &VirtualController, key: Key) {
    robot.handle().operate(&PanelAction::TurnKey(key)).unwrap();
}

/// The value of an address in a message, if it is in it.
fn value<'v>(message: &'v Value, address: &str) -> Option<&'v Value> {
    let mut signals = message["signals"].as_array()?.iter();
    signals.find(|signal| signal["address"] == address).map(|signal| &signal["value"])
}

/// Waits until a socket told this mode.
async fn until_mode(socket: &mut Socket, mode: &Value) {
    while value(&socket.next().await, "curMode") != Some(mode) {}
}

/// The mode of `press` now, read again and again until it is another one than before.
async fn turned(hall: &Hall, key: Key) -> Value {
    let mode = |state: &Value| value(state, "curMode").unwrap().clone();
    let before = mode(&hall.get(&hall.viewer, "/v1/robots/press").await);
    turn_key(&hall.robots[0], key);
    mode(&hall.until("press", |state| mode(state) != before).await)
}

#[tokio::test]
async fn a_socket_begins_with_a_snapshot_and_tells_changes() {
    let hall = Hall::start().await;
    let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode").await;
    let snapshot = socket.next().await;
    assert_eq!((&snapshot["type"], &snapshot["name"]), (&json!("snapshot"), &json!("press")));
    let (epoch, number) = (snapshot["epoch"].as_u64().unwrap(), snapshot["number"].as_u64().unwrap());
    assert!(snapshot["resume"].as_str().unwrap().starts_with(&format!("{epoch}-")), "{snapshot}");
    let mode = turned(&hall, Key::Manual).await;
    let change = socket.next().await;
    assert_eq!((&change["type"], &change["robot"]), (&json!("change"), &json!("press")));
    assert_eq!(change["after"], number, "no message is missing");
    assert!(change["number"].as_u64().unwrap() > number);
    assert_eq!(value(&change, "curMode"), Some(&mode));
    // Pings of the peer are answered.
    socket.0.send(Message::Ping("here".into())).await.unwrap();
    let pong = tokio::time::timeout(PATIENCE, socket.0.next()).await.unwrap().unwrap().unwrap();
    assert_eq!(pong, Message::Pong("here".into()));
}

#[tokio::test]
async fn a_reader_that_comes_back_gets_what_it_missed_and_nothing_else() {
    let hall = Hall::start().await;
    let mut first = Socket::open(&hall, &hall.viewer, "?signal=curMode,isMoving").await;
    let snapshot = first.next().await;
    let place = snapshot["resume"].as_str().unwrap().to_owned();
    drop(first);
    let mode = turned(&hall, Key::Manual).await;
    // By the place, over a WebSocket.
    let query = format!("?signal=curMode,isMoving&resume={place}");
    let change = Socket::open(&hall, &hall.viewer, &query).await.next().await;
    assert_eq!((&change["type"], value(&change, "curMode")), (&json!("change"), Some(&mode)), "{change}");
    assert_eq!(value(&change, "isMoving"), None, "it did not change");
    // By the place, as server-sent events: the browser sends the id by itself.
    let path = "/v1/live?signal=curMode,isMoving";
    let address = hall.gateway.address();
    let change = Stream::open(address, &hall.viewer, path, &place).await.next().await.unwrap();
    assert_eq!((change.kind.as_str(), value(&change.data, "curMode")), ("change", Some(&mode)));
    assert!(change.id.starts_with(&snapshot["epoch"].to_string()), "{change:?}");
    // By its numbers, in the first message.
    let mut third = Socket::open(&hall, &hall.viewer, "?subscribe=later").await;
    let resume = json!({ "epoch": snapshot["epoch"], "robots": { "press": snapshot["number"], "gone": 1 } });
    let ask = json!({ "type": "subscribe", "signals": ["isMoving", "curMode"], "resume": resume });
    third.say(&ask).await;
    let subscribed = third.next().await;
    let told =
        json!({ "type": "subscribed", "robots": null, "signals": ["curMode", "isMoving"], "events": false });
    assert_eq!(subscribed, told);
    let removed = third.next().await;
    assert_eq!((&removed["type"], &removed["robot"]), (&json!("removed"), &json!("gone")));
    let change = third.next().await;
    assert_eq!((&change["type"], value(&change, "curMode")), (&json!("change"), Some(&mode)), "{change}");
    assert_eq!(change["after"], snapshot["number"]);
}

#[tokio::test]
async fn a_reader_that_asks_for_it_is_told_that_the_stream_is_alive() {
    let hall = Hall::start().await;
    // The mode of a robot at rest does not change: without the signs of life, nothing comes after this.
    let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode&alive=true").await;
    assert_eq!(socket.next().await["type"], "snapshot");
    for _ in 0..2 {
        let alive = socket.next().await;
        assert_eq!(alive["type"], "alive", "{alive}");
        assert!(alive["time"].as_str().unwrap().ends_with('Z') && alive.get("resume").is_none(), "{alive}");
        // The reader has taken everything, so nothing older is on its way.
        assert!(alive["passed_ms_ago"].as_u64().unwrap() < 1_000, "{alive}");
    }
    let mut later = Socket::open(&hall, &hall.viewer, "?subscribe=later&alive=true").await;
    let alive = later.next().await;
    assert_eq!(alive["type"], "alive", "also before the first `subscribe`");
    assert!(alive["passed_ms_ago"].is_null(), "nothing was told yet: {alive}");
}

#[tokio::test]
async fn what_cannot_be_resumed_is_reset_and_never_silent() {
    let hall = Hall::start().await;
    let snapshot = Socket::open(&hall, &hall.viewer, "").await.next().await;
    let epoch = snapshot["epoch"].as_u64().unwrap();
    let ahead = format!("{epoch}-999999999");
    for place in ["1-1", ahead.as_str(), &format!("{}-1", epoch + 1)] {
        let mut socket = Socket::open(&hall, &hall.viewer, &format!("?resume={place}")).await;
        let reset = socket.next().await;
        assert_eq!((&reset["type"], &reset["robot"]), (&json!("reset"), &json!(null)), "{place}");
        assert_eq!(socket.next().await["type"], "snapshot", "{place}");
    }
    let address = hall.gateway.address();
    for id in ["1-1", &ahead, "no id of ours"] {
        let mut stream = Stream::open(address, &hall.viewer, "/v1/live", id).await;
        assert_eq!(stream.next().await.unwrap().kind, "reset", "{id}");
        assert_eq!(stream.next().await.unwrap().kind, "snapshot", "{id}");
    }
    // What a reader followed may be gone when it comes back.
    let place = format!("{epoch}-0");
    for (gone, status) in [("robot=gone", 404), ("robot=gone,press", 404), ("signal=Addr-899", 422)] {
        let fresh = Socket::try_open(&hall, &hall.viewer, &format!("?{gone}"), None).await;
        assert_eq!(fresh.err().map(|(status, _)| status), Some(status), "{gone}");
        let mut socket = Socket::open(&hall, &hall.viewer, &format!("?{gone}&resume={place}")).await;
        if gone == "robot=gone" {
            let next = tokio::time::timeout(Duration::from_millis(300), socket.0.next()).await;
            assert!(next.is_err(), "there is nothing to tell: {next:?}");
        } else {
            let reset = socket.next().await;
            assert_eq!((&reset["type"], &reset["robot"]), (&json!("reset"), &json!("press")), "{gone}");
            assert_eq!(socket.next().await["type"], "snapshot", "{gone}");
        }
    }
    let number = snapshot["number"].as_u64().unwrap();
    let resumes = [(epoch - 1, number, json!(null)), (epoch, number + 1_000_000, json!("press"))];
    for (epoch, number, robot) in resumes {
        let mut socket = Socket::open(&hall, &hall.viewer, "?subscribe=later").await;
        let resume = json!({ "epoch": epoch, "robots": { "press": number } });
        socket.say(&json!({ "type": "subscribe", "resume": resume })).await;
        assert_eq!(socket.next().await["type"], "subscribed");
        let reset = socket.next().await;
        assert_eq!((&reset["type"], &reset["robot"]), (&json!("reset"), &robot));
        assert_eq!(socket.next().await["type"], "snapshot");
    }
    for wrong in ["?resume=yesterday", "?resume=", "?subscribe=now", "?events=maybe"] {
        let refused = Socket::try_open(&hall, &hall.viewer, wrong, None).await.err().unwrap();
        assert_eq!((refused.0, &refused.1["code"]), (422, &json!("bad_value")), "{wrong}");
    }
}

#[tokio::test]
async fn a_robot_that_was_configured_anew_meanwhile_is_reset() {
    let hall = Hall::start().await;
    let saw = VirtualController::start().await.unwrap();
    let put = async |period: u64| {
        let wanted = json!({ "address": saw.address().to_string(), "period_ms": period });
        let (status, answer) = hall.call(&hall.admin, "PUT", "/v1/robots/saw", Some(&wanted)).await;
        assert!(status == 201 || status == 204, "{answer}");
        hall.until_up("saw").await;
    };
    put(20).await;
    let mut socket = Socket::open(&hall, &hall.viewer, "?robot=saw").await;
    let place = socket.next().await["resume"].as_str().unwrap().to_owned();
    put(30).await;
    // The reader that stays connected begins anew with it, too.
    assert_eq!(socket.next_of("snapshot").await["period_ms"], 30);
    let back = format!("?robot=saw&resume={place}");
    let mut socket = Socket::open(&hall, &hall.viewer, &back).await;
    let reset = socket.next().await;
    assert_eq!((&reset["type"], &reset["robot"]), (&json!("reset"), &json!("saw")));
    assert_eq!(socket.next().await["period_ms"], 30);
    // It goes: the reader that stays is told, and a reader that comes back too.
    assert_eq!(hall.call(&hall.admin, "DELETE", "/v1/robots/saw", None).await.0, 204);
    assert_eq!(socket.next_of("removed").await["robot"], "saw");
    let mut socket = Socket::open(&hall, &hall.viewer, &format!("?resume={place}")).await;
    assert_eq!(socket.next().await, json!({ "type": "reset", "robot": null }));
    assert_eq!(socket.next().await["name"], "press");
}

#[tokio::test]
async fn events_come_over_the_same_socket_and_are_resumed() {
    let hall = Hall::start().await;
    let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode&events=true").await;
    let place = socket.next().await["resume"].as_str().unwrap().to_owned();
    assert_eq!(place.split('-').count(), 3, "{place}");
    hall.lease(&hall.operator, "press").await;
    let event = socket.next_of("event").await;
    assert_eq!((&event["event"], &event["robot"]), (&json!("lease_began"), &json!("press")));
    let back = format!("?signal=curMode&events=true&resume={place}");
    let mut again = Socket::open(&hall, &hall.viewer, &back).await;
    let told = again.next_of("event").await;
    assert_eq!(told["id"], event["id"]);
    // An event of another start: what is lost is told, then all that is kept.
    let mut lost = Socket::open(&hall, &hall.viewer, "?signal=curMode&events=true&resume=1-1-1").await;
    let first = lost.next().await;
    assert_eq!(first["type"], "events_lost");
    assert_eq!(lost.next_of("event").await["id"], 1);
    // The other stream has no events unless it asks.
    let mut plain = Socket::open(&hall, &hall.viewer, "?signal=curMode").await;
    assert_eq!(plain.next().await["type"], "snapshot");
    hall.stop(&hall.operator, "press").await;
    let mode = turned(&hall, Key::Manual).await;
    // The stop may have changed the mode too.
    loop {
        let next = plain.next().await;
        assert_eq!(next["type"], "change");
        if value(&next, "curMode") == Some(&mode) {
            break;
        }
    }
}

#[tokio::test]
async fn a_subscription_is_changed_and_a_wrong_one_changes_nothing() {
    let robots = [VirtualController::start().await, VirtualController::start().await];
    let hall = Hall::with(robots.map(Result::unwrap).into()).await;
    let only = Some(name("press").into());
    let made = r6_gateway::make_token(hall.data.path(), Role::Viewer, only, String::new()).unwrap().1;
    let mut socket = Socket::open(&hall, &made, "?signal=curMode").await;
    assert_eq!(socket.next().await["name"], "press");
    for (wrong, code) in [
        (json!({ "type": "subscribe", "robots": ["saw"] }), "not_allowed"),
        (json!({ "type": "subscribe", "robots": ["unknown"] }), "not_allowed"),
        (json!({ "type": "subscribe", "signals": ["axis-99"] }), "bad_value"),
        (json!({ "type": "subscribe", "signals": ["Addr-800"] }), "bad_value"),
        (json!({ "type": "subscribe", "signals": vec!["axis-0"; 1001] }), "bad_value"),
        (json!({ "type": "subscribe", "token": "r6_" }), "bad_value"),
        (json!({ "type": "stop" }), "bad_value"),
        (json!("x".repeat(100_000)), "bad_value"),
    ] {
        socket.say(&wrong).await;
        let problem = socket.next().await;
        assert_eq!((&problem["type"], &problem["code"]), (&json!("problem"), &json!(code)), "{wrong}");
        assert!(
            problem["message"].as_str().unwrap().len() < 1_000,
            "a reader's words are not repeated at length"
        );
    }
    for message in [Message::text("{"), Message::binary(vec![0])] {
        socket.0.send(message).await.unwrap();
        assert_eq!(socket.next().await["type"], "problem");
    }
    let mode = turned(&hall, Key::Manual).await;
    assert_eq!(value(&socket.next().await, "curMode"), Some(&mode), "the subscription goes on");
    socket.say(&json!({ "type": "subscribe", "robots": ["press"], "signals": ["axis-1"] })).await;
    assert_eq!(socket.next().await["signals"], json!(["axis-1"]));
    let snapshot = socket.next().await;
    assert_eq!((&snapshot["type"], snapshot["signals"].as_array().unwrap().len()), (&json!("snapshot"), 1));
    let mut all = Socket::open(&hall, &hall.viewer, "?robot=press,saw&signal=curMode").await;
    assert_eq!(
        (all.next().await["name"].clone(), all.next().await["name"].clone()),
        (json!("press"), json!("saw"))
    );
}

#[tokio::test]
async fn pages_urls_with_tokens_and_wrong_handshakes_are_refused() {
    let hall = Hall::start().await;
    let foreign = Some(("origin", "http://evil.example"));
    let refused = Socket::try_open(&hall, &hall.viewer, "", foreign).await.err().unwrap();
    assert_eq!((refused.0, &refused.1["code"]), (403, &json!("foreign_origin")));
    let origin = format!("http://{}", hall.gateway.address());
    let own = Some(("origin", origin.as_str()));
    assert!(Socket::try_open(&hall, &hall.viewer, "", own).await.is_ok(), "our own page may");
    for token in ["token", "access_token", "authorization"] {
        let query = format!("?{token}={}", hall.viewer);
        assert_eq!(Socket::try_open(&hall, "", &query, None).await.err().unwrap().0, 401);
        let refused = Socket::try_open(&hall, &hall.viewer, &query, None).await.err().unwrap();
        assert_eq!((refused.0, &refused.1["code"]), (422, &json!("bad_value")));
    }
    let old = Some(("sec-websocket-version", "8"));
    let refused = Socket::try_open(&hall, &hall.viewer, "", old).await.err().unwrap();
    assert_eq!((refused.0, &refused.1["code"]), (400, &json!("bad_request")));
    // Server-sent events take no messages.
    for path in ["/v1/live?subscribe=later", "/v1/live?alive=true"] {
        let (status, problem) = hall.call(&hall.viewer, "GET", path, None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{path}");
    }
}

#[tokio::test]
async fn a_message_that_is_too_long_and_bytes_that_are_no_frame_end_the_socket() {
    let hall = Hall::start().await;
    let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode").await;
    socket.0.send(Message::text("x".repeat(200_000))).await.unwrap();
    let (code, reason) = socket.end().await.unwrap();
    assert_eq!((code, reason.starts_with("too_long: ")), (1009, true), "{reason}");
    let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode").await;
    // A client has to mask its frames.
    socket.0.get_mut().write_all(&[0x81, 0x02, b'h', b'i']).await.unwrap();
    let (code, reason) = socket.end().await.unwrap();
    assert_eq!((code, reason.starts_with("bad_request: ")), (1002, true), "{reason}");
    // A socket that says goodbye gets an answer, and no more.
    let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode").await;
    socket.0.close(None).await.unwrap();
    socket.end().await;
}

#[tokio::test]
async fn a_revoked_token_ends_its_socket_within_a_second() {
    let hall = Hall::start().await;
    let made = r6_gateway::make_token(hall.data.path(), Role::Viewer, None, String::new()).unwrap();
    let mut socket = Socket::open(&hall, &made.1, "?events=true").await;
    assert_eq!(socket.next().await["type"], "snapshot");
    let revoked = Instant::now();
    assert_eq!(r6_gateway::revoke_token(hall.data.path(), made.0), Ok(true));
    let (code, reason) = socket.end().await.unwrap();
    let took = revoked.elapsed();
    assert_eq!((code, reason.starts_with("no_token: ")), (1008, true), "{reason}");
    // The promise, and room for a machine that does other things too.
    assert!(took < Duration::from_secs(3), "{took:?}");
    println!("a socket ended {took:?} after its token was revoked");
}

#[tokio::test]
async fn sockets_count_as_connections() {
    let hall = Hall::start().await;
    let mut sockets = Vec::new();
    for _ in 0..128 {
        let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode").await;
        socket.next().await;
        sockets.push(socket);
    }
    // One address has 128 connections at most: this call closes the oldest stream.
    hall.get(&hall.viewer, "/v1/robots").await;
    assert_eq!(sockets[0].end().await, None);
    let mode = turned(&hall, Key::Manual).await;
    until_mode(sockets.last_mut().unwrap(), &mode).await;
}

#[tokio::test]
async fn a_peer_that_reads_nothing_is_closed_and_delays_no_other() {
    let hall = Hall::start().await;
    let address = hall.gateway.address();
    // A small window, so that the gateway notices soon.
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let stream = socket.connect(address).await.unwrap();
    let mut request = format!("ws://{address}/v1/live?signal=curMode").into_client_request().unwrap();
    request.headers_mut().insert("authorization", format!("Bearer {}", hall.operator).parse().unwrap());
    let (stalled, _) = client_async(request, stream).await.unwrap();
    let mut stream = stalled.into_inner();
    // Each message that is wrong is answered, and no answer is read: a masked frame with the text `x`.
    let frames = [0x81, 0x81, 0, 0, 0, 0, b'x'].repeat(20_000);
    let stalls = Instant::now();
    stream.write_all(&frames).await.unwrap();
    let mut other = Socket::open(&hall, &hall.engineer, "?signal=curMode").await;
    other.next().await;
    let mut key = [Key::Manual, Key::Auto].into_iter().cycle();
    while stalls.elapsed() < Duration::from_secs(8) {
        let begun = Instant::now();
        let mode = turned(&hall, key.next().unwrap()).await;
        until_mode(&mut other, &mode).await;
        assert!(begun.elapsed() < Duration::from_secs(3), "it is not delayed");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    // What the system had taken by then comes, and then the end: most answers were never written.
    let (mut part, mut all) = (vec![0; 1 << 16], 0);
    let end = async {
        while let Ok(read @ 1..) = stream.read(&mut part).await {
            all += read;
        }
    };
    tokio::time::timeout(PATIENCE, end).await.expect("the gateway has closed it");
    assert!(all < 1_500_000, "{all} bytes");
}

/// How long it takes from a change in the controller to a client of the gateway, most of which is the wait
/// for the next read: the values are read every 20 ms. Run it alone, with `--no-capture`, to measure.
#[tokio::test]
async fn a_change_of_the_controller_comes_soon() {
    const CHANGES: usize = 200;
    let hall = Hall::start().await;
    let mut socket = Socket::open(&hall, &hall.viewer, "?signal=curMode").await;
    socket.next().await;
    let mut times = Vec::new();
    for (number, key) in (0..CHANGES).zip([Key::Manual, Key::Auto].into_iter().cycle()) {
        // At another moment of the period each time.
        tokio::time::sleep(Duration::from_micros(25_000 + (number as u64 * 7_919) % 20_000)).await;
        turn_key(&hall.robots[0], key);
        let changed = Instant::now();
        assert_eq!(socket.next().await["type"], "change");
        times.push(changed.elapsed());
    }
    times.sort();
    let [half, most, all] = [CHANGES / 2, CHANGES * 99 / 100, CHANGES - 1].map(|at| times[at]);
    println!("{CHANGES} changes, read every 20 ms, to a WebSocket: p50 {half:?}, p99 {most:?}, max {all:?}");
    assert!(half < Duration::from_millis(500), "{half:?}");
}
