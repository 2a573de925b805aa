//! The other end of the connection, played by the test.

use std::fmt;
use std::io;
use std::time::Duration;

use r6_client::{Connect, Reconnect, Robot, RobotSettings};
use serde_json::{Value, json};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt, DuplexStream};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::mpsc;
use tokio::time::timeout;

/// An event that has not happened after this time never will: the test fails instead of hanging.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// A timeout for tests in which nothing answers. It is short, because the test waits for it.
pub const SHORT: Duration = Duration::from_millis(150);

/// A listening controller with its own port.
pub struct Controller {
    listener: TcpListener,
}

/// Carries the bytes of a connection.
trait Carrier: AsyncRead + AsyncWrite + Send + Unpin {}

impl<S: AsyncRead + AsyncWrite + Send + Unpin> Carrier for S {}

/// One accepted connection.
pub struct Peer {
    stream: Box<dyn Carrier>,
    received: Vec<u8>,
    /// The `machineName` to answer when the client asks for the identity.
    pub name: &'static str,
    /// Whether the client is about to ask for the length of the list, which is the last of its own queries.
    introducing: bool,
}

/// Settings that never time out by accident, and reconnect at once.
pub fn settings() -> RobotSettings {
    RobotSettings {
        reply_timeout: PATIENCE,
        reconnect: Reconnect {
            first_wait: Duration::from_millis(1),
            cap: Duration::from_millis(2),
            jitter_seed: Some(1),
        },
        ..RobotSettings::default()
    }
}

pub fn impatient() -> RobotSettings {
    RobotSettings { reply_timeout: SHORT, ..settings() }
}

/// Waits with a time limit.
pub async fn soon<T>(what: impl Future<Output = T>) -> T {
    timeout(PATIENCE, what).await.expect("it never happened")
}

impl Controller {
    pub async fn listen() -> Self {
        Self::listen_at("127.0.0.1:0").await
    }

    /// Listens on an address on which a controller listened before.
    pub async fn listen_at(address: &str) -> Self {
        Self { listener: TcpListener::bind(address).await.unwrap() }
    }

    pub fn address(&self) -> String {
        self.listener.local_addr().unwrap().to_string()
    }

    pub async fn accept(&self) -> Peer {
        let (stream, _) = soon(self.listener.accept()).await.unwrap();
        Peer::of(stream)
    }

    /// A robot that is connected, and the controller's end of its connection.
    pub async fn with_robot(settings: RobotSettings) -> (Self, Robot, Peer) {
        let controller = Self::listen().await;
        let address = controller.address();
        let (robot, peer) = tokio::join!(Robot::connect(&address, settings), controller.accept());
        (controller, robot.unwrap(), peer)
    }
}

impl Peer {
    /// The controller's end of a connection.
    pub fn of(stream: TcpStream) -> Self {
        stream.set_nodelay(true).unwrap();
        Self::over(stream)
    }

    fn over(stream: impl Carrier + 'static) -> Self {
        Self { stream: Box::new(stream), received: Vec::new(), name: "cell 4", introducing: false }
    }

    /// The controller's end of a connection in memory.
    pub fn in_memory(stream: DuplexStream) -> Self {
        Self::over(stream)
    }

    /// The next frame from the client, after answering its identity queries.
    pub async fn frame(&mut self) -> Value {
        loop {
            let frame = self.any_frame().await;
            match self.introduction(&frame) {
                Some(reply) => self.send(reply).await,
                None => return frame,
            }
        }
    }

    /// The reply to an identity query of the client; `None` for anything else.
    fn introduction(&mut self, request: &Value) -> Option<String> {
        let data = match asked(request).as_slice() {
            ["version", "machineName", "axisNum"] => json!(["F5", self.name, "6"]),
            ["version", "machineName", "axisNum", "curMode", "curAlarm"] => {
                self.introducing = true;
                json!(["F5", self.name, "6", "7", "0"])
            }
            ["RemoteCmdLen"] if std::mem::take(&mut self.introducing) => json!(["0"]),
            _ => return None,
        };
        Some(values(request, data))
    }

    /// Answers the client's identity query.
    pub async fn introduces(&mut self) {
        let request = self.any_frame().await;
        let reply = self.introduction(&request).expect("who is there?");
        self.send(reply).await;
    }

    /// The next frame from the client, of any kind.
    pub async fn any_frame(&mut self) -> Value {
        loop {
            let mut frames = serde_json::Deserializer::from_slice(&self.received).into_iter::<Value>();
            if let Some(Ok(frame)) = frames.next() {
                let used = frames.byte_offset();
                self.received.drain(..used);
                return frame;
            }
            let mut bytes = [0; 4096];
            let count = soon(self.stream.read(&mut bytes)).await.unwrap();
            assert_ne!(count, 0, "the client closed the connection instead of sending a frame");
            self.received.extend_from_slice(&bytes[..count]);
        }
    }

    pub async fn send(&mut self, bytes: impl AsRef<[u8]>) {
        self.stream.write_all(bytes.as_ref()).await.unwrap();
    }

    /// Sends bytes one at a time, each in its own segment as far as the network allows.
    pub async fn dribble(&mut self, bytes: impl AsRef<[u8]>) {
        for byte in bytes.as_ref() {
            self.send([*byte]).await;
            tokio::task::yield_now().await;
        }
    }

    /// Checks that the client ends the connection in order: an end of file, no reset, and nothing before it.
    pub async fn ends(&mut self) {
        let mut bytes = [0; 256];
        assert_eq!(soon(self.stream.read(&mut bytes)).await.expect("an orderly end"), 0);
    }

    /// Answers every frame with `answer` until the client ends the connection; `None` leaves a frame
    /// unanswered. Identity queries are answered without it.
    pub async fn answer_all(mut self, mut answer: impl FnMut(&Value) -> Option<String>) {
        let mut bytes = [0; 4096];
        loop {
            let mut frames = serde_json::Deserializer::from_slice(&self.received).into_iter::<Value>();
            let requests: Vec<_> = frames.by_ref().map_while(Result::ok).collect();
            let used = frames.byte_offset();
            self.received.drain(..used);
            for request in requests {
                let Some(reply) = self.introduction(&request).or_else(|| answer(&request)) else { continue };
                if self.stream.write_all(reply.as_bytes()).await.is_err() {
                    return;
                }
            }
            match self.stream.read(&mut bytes).await {
                Ok(0) | Err(_) => return,
                Ok(count) => self.received.extend_from_slice(&bytes[..count]),
            }
        }
    }
}

/// The reply to a query in the form of captured controllers.
pub fn values(request: &Value, data: Value) -> String {
    json!({
        "dsID": request["dsID"], "packID": request["packID"], "queryAddr": request["queryAddr"],
        "queryData": data, "reqType": "query",
    })
    .to_string()
}

/// The reply to a command, AddPoints or AddRCC in the form of captured controllers.
pub fn verdict(request: &Value, words: &[&str]) -> String {
    json!({ "cmdReply": words, "dsID": request["dsID"], "packID": request["packID"], "reqType": request["reqType"] })
        .to_string()
}

/// The addresses of a query; empty for any other request.
pub fn asked(request: &Value) -> Vec<&str> {
    request["queryAddr"].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

/// The word of a command; empty for any other request.
pub fn command_word(request: &Value) -> &str {
    request["cmdData"][0].as_str().unwrap_or_default()
}

/// Connections in memory: the other side can read at once what one side writes. They work with a clock that
/// jumps.
pub struct Wires(mpsc::UnboundedSender<Peer>);

impl Wires {
    /// Also returns the channel with the controller's ends, one for each connection.
    pub fn new() -> (Self, mpsc::UnboundedReceiver<Peer>) {
        let (made, accepted) = mpsc::unbounded_channel();
        (Self(made), accepted)
    }

    /// A robot on the first connection, and the controller's end of it.
    pub async fn with_robot(settings: RobotSettings) -> (mpsc::UnboundedReceiver<Peer>, Robot, Peer) {
        let (wires, mut accepted) = Self::new();
        let robot = Robot::connect_with(wires, settings).await.unwrap();
        let peer = accepted.recv().await.unwrap();
        (accepted, robot, peer)
    }
}

impl fmt::Display for Wires {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a wire")
    }
}

impl Connect for Wires {
    type Stream = DuplexStream;

    async fn connect(&mut self) -> io::Result<DuplexStream> {
        let (ours, theirs) = tokio::io::duplex(4096);
        self.0.send(Peer::over(theirs)).map_err(|_| io::ErrorKind::ConnectionRefused)?;
        Ok(ours)
    }
}
