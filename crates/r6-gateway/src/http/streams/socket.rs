//! A feed over a WebSocket.
//!
//! Reading, writing and the look at the caller go on side by side, so that a write that the peer does not
//! take holds up neither its own time-out nor the others.

use std::time::Duration;

use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade};
use axum::response::Response;
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use r6_api::gateway::{LiveAlive, LiveMessage, LiveRequest, LiveSent};
use r6_api::{Code, Problem};
use r6_http::{Afterwards, Refusal, read_json};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, interval_at, timeout};

use super::super::State;
use super::super::caller::Caller;
use super::LOOK;
use super::feed::Feed;
use super::subscription::{Manner, Subscription, bad_value};
use crate::clock;

/// The longest message of a reader: 1000 robots with their numbers take 60 KB.
const MAX_MESSAGE: usize = 128 * 1024;

/// The most that waits to be written: some times the longest message, which has the values of one robot.
const MAX_UNWRITTEN: usize = 256 * 1024;

/// How long the peer may take to accept a message.
const WRITE_TIME: Duration = Duration::from_secs(5);

/// How often the peer is asked whether it is there, and how long it may say nothing. Two pings may be lost.
const PING: Duration = Duration::from_secs(10);
const SILENCE: Duration = Duration::from_secs(30);

/// How often a reader that asks for it is told that the stream is alive: a browser takes the gateway for lost
/// after five of them.
const ALIVE: Duration = Duration::from_secs(2);

/// How often another gateway is told that: what this one told as fresh is so for `live/far.rs` a moment
/// longer.
const ALIVE_FOR_GATEWAY: Duration = Duration::from_millis(500);

/// When the first one comes: after a connection was lost, it says that nothing has changed.
const FIRST_ALIVE: Duration = Duration::from_millis(200);

/// How long the end may take: the last frame, and that of the peer.
const CLOSE_TIME: Duration = Duration::from_secs(1);

/// How long the peer may take to become a WebSocket after the answer.
const UPGRADE_TIME: Duration = Duration::from_secs(5);

/// The longest text about a message of the reader, in characters: it may repeat words of the reader.
const MAX_PROBLEM: usize = 300;

/// How many messages of the reader wait for their answers. Behind them no more are read.
const MAX_ORDERS: usize = 16;

/// Answers a handshake. The feed then runs in the task of the connection, which counts among all connections.
pub fn open(upgrade: WebSocketUpgrade, feed: Feed, manner: Manner) -> Response {
    let (opened, socket) = oneshot::channel();
    let upgrade = upgrade
        .max_message_size(MAX_MESSAGE)
        .max_frame_size(MAX_MESSAGE)
        .write_buffer_size(0)
        .max_write_buffer_size(MAX_UNWRITTEN);
    let mut response = upgrade.on_upgrade(move |socket| async move { drop(opened.send(socket)) });
    let work = async move {
        if let Ok(Ok(socket)) = timeout(UPGRADE_TIME, socket).await {
            converse(socket, feed, manner).await;
        }
    };
    response.extensions_mut().insert(Afterwards::new(work));
    response
}

/// Why a WebSocket ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// The peer has closed it, or the connection was lost.
    Closed,
    /// The token is not valid any more.
    NoToken,
    /// The session has ended.
    NoSession,
    /// The peer did not take a message in time.
    TooSlow,
    /// Nothing came from the peer, not even an answer to a ping.
    Silent,
    /// A message of the peer is too long.
    TooLong,
    /// The peer sends a text that is no UTF-8.
    NotText,
    /// The peer sends something else.
    NotWebSocket,
}

impl End {
    /// The code and the reason for the peer.
    fn frame(self) -> Option<(u16, Code, &'static str)> {
        match self {
            Self::Closed => None,
            Self::NoToken => Some((1008, Code::NoToken, "the token is not valid any more")),
            Self::NoSession => Some((1008, Code::NoSession, "the session has ended")),
            Self::TooSlow => Some((1013, Code::TooSlow, "a message was not read within 5 s")),
            Self::Silent => Some((1013, Code::TooSlow, "no answer to a ping within 30 s")),
            Self::TooLong => Some((1009, Code::TooLong, "a message has 128 KiB at most")),
            Self::NotText => Some((1007, Code::BadRequest, "a text has to be UTF-8")),
            Self::NotWebSocket => Some((1002, Code::BadRequest, "this is no frame of a WebSocket")),
        }
    }
}

/// What the writer has to do for a message of the reader.
enum Order {
    Subscribe(Subscription),
    Refuse(Problem),
}

async fn converse(socket: WebSocket, feed: Feed, manner: Manner) {
    let (mut sink, mut stream) = socket.split();
    let (orders, queue) = mpsc::channel(MAX_ORDERS);
    let (caller, state) = (feed.caller().clone(), feed.state().clone());
    let end = tokio::select! {
        end = write(&mut sink, feed, queue, manner) => end,
        end = read(&mut stream, &caller, &state, &orders) => end,
        end = until_not_allowed(&caller, &state) => end,
    };
    tracing::debug!(?end, by = caller.by().actor, "a WebSocket ends");
    let farewell = async {
        if let Some((code, word, text)) = end.frame() {
            let reason = format!("{}: {text}", word.word()).into();
            sink.send(Message::Close(Some(CloseFrame { code, reason }))).await.ok();
        } else {
            sink.close().await.ok();
        }
        // The peer loses our last frame if its own bytes are not read.
        while let Some(Ok(_)) = stream.next().await {}
    };
    let _ = timeout(CLOSE_TIME, farewell).await;
}

async fn until_not_allowed(caller: &Caller, state: &State) -> End {
    while caller.is_still_valid(state) {
        tokio::time::sleep(LOOK).await;
    }
    if caller.has_session() { End::NoSession } else { End::NoToken }
}

async fn write(
    sink: &mut SplitSink<WebSocket, Message>,
    mut feed: Feed,
    mut orders: mpsc::Receiver<Order>,
    Manner { mut begins_later, tells_alive }: Manner,
) -> End {
    let mut ping = interval_at(Instant::now() + PING, PING);
    let often = if feed.caller().is_gateway() { ALIVE_FOR_GATEWAY } else { ALIVE };
    let mut alive = interval_at(Instant::now() + FIRST_ALIVE, often);
    let plain = |message| text(&LiveSent { message, resume: None });
    loop {
        let message = tokio::select! {
            biased;
            Some(order) = orders.recv() => match order {
                Order::Subscribe(subscription) => {
                    let told = subscription.told();
                    feed.subscribe(subscription);
                    begins_later = false;
                    plain(LiveMessage::Subscribed(told))
                }
                Order::Refuse(problem) => plain(LiveMessage::Problem(problem)),
            },
            _ = ping.tick() => Message::Ping(axum::body::Bytes::new()),
            _ = alive.tick(), if tells_alive => {
                let passed = feed.passed_ago().map(|ago| u64::try_from(ago.as_millis()).unwrap_or(u64::MAX));
                plain(LiveMessage::Alive(LiveAlive { time: clock::time_of_day(), passed_ms_ago: passed }))
            }
            sent = feed.next(), if !begins_later => text(&sent),
        };
        match timeout(WRITE_TIME, sink.send(message)).await {
            Ok(Ok(())) => {}
            Ok(Err(_)) => return End::Closed,
            Err(_) => return End::TooSlow,
        }
    }
}

fn text(sent: &LiveSent) -> Message {
    // Our own types always become JSON.
    Message::Text(serde_json::to_string(sent).unwrap_or_default().into())
}

async fn read(
    stream: &mut SplitStream<WebSocket>,
    caller: &Caller,
    state: &State,
    orders: &mpsc::Sender<Order>,
) -> End {
    loop {
        let Ok(next) = timeout(SILENCE, stream.next()).await else { return End::Silent };
        let order = match next {
            None | Some(Ok(Message::Close(_))) => return End::Closed,
            Some(Ok(Message::Ping(_) | Message::Pong(_))) => {
                // Many of them may have come at once: others have their turn in between.
                tokio::task::yield_now().await;
                continue;
            }
            Some(Ok(Message::Text(text))) => order(text.as_str(), caller, state),
            Some(Ok(Message::Binary(_))) => Err(bad_value("send text, not bytes".to_owned())),
            Some(Err(error)) => return broken(&error),
        };
        let order = order.unwrap_or_else(|refusal| Order::Refuse(short(refusal.into_problem())));
        if orders.send(order).await.is_err() {
            return End::Closed;
        }
    }
}

/// What a message asks for. It counts as a request.
fn order(text: &str, caller: &Caller, state: &State) -> Result<Order, Refusal> {
    caller.count(state)?;
    let request = read_json(text.as_bytes(), Code::BadValue)?;
    match request {
        LiveRequest::Subscribe(asked) => Subscription::of_message(caller, state, asked).map(Order::Subscribe),
    }
}

/// The problem without the most of what the reader said.
fn short(problem: Problem) -> Problem {
    Problem { message: problem.message.chars().take(MAX_PROBLEM).collect(), ..problem }
}

/// The library tells only in a text why it cannot read on. The tests hold these words.
fn broken(error: &axum::Error) -> End {
    let error = error.to_string();
    if error.starts_with("Space limit exceeded") {
        End::TooLong
    } else if error.starts_with("UTF-8") {
        End::NotText
    } else if error.starts_with("WebSocket protocol error") && !error.contains("closing handshake") {
        End::NotWebSocket
    } else {
        End::Closed
    }
}
