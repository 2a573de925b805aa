//! A link between client and controller that records the traffic to the controller, adds delay, and breaks at
//! a chosen frame.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::sleep;

/// Where a link breaks, once: at the frame of this type with this number, counted from 1.
#[derive(Clone, Copy, Debug)]
pub enum Break {
    /// The request arrives, but the reply does not.
    Reply(&'static str, usize),
    /// The request does not arrive.
    Request(&'static str, usize),
}

#[derive(Clone, Debug, Default)]
pub struct Relay {
    state: Arc<Mutex<State>>,
}

#[derive(Debug, Default)]
struct State {
    breaks: Option<Break>,
    delay: Duration,
    /// All frames that the controller received, in order.
    sent: Vec<Value>,
    requests: Vec<String>,
    replies: Vec<String>,
}

impl Relay {
    /// Creates a link to this controller. Returns the address for the client.
    pub async fn to(
        controller: SocketAddr,
        breaks: impl Into<Option<Break>>,
        delay: Duration,
    ) -> (Self, SocketAddr) {
        let relay = Self::default();
        {
            let mut state = relay.state.lock().unwrap();
            state.breaks = breaks.into();
            state.delay = delay;
        }
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let own = relay.clone();
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let server = TcpStream::connect(controller).await.unwrap();
                client.set_nodelay(true).unwrap();
                server.set_nodelay(true).unwrap();
                let (from_client, to_client) = client.into_split();
                let (from_server, to_server) = server.into_split();
                let relay = own.clone();
                tokio::spawn(async move {
                    // When one direction ends, both end.
                    tokio::select! {
                        () = relay.carry(from_client, to_server, false) => {}
                        () = relay.carry(from_server, to_client, true) => {}
                    }
                });
            }
        });
        (relay, address)
    }

    /// The lists that the controller received.
    pub fn lists(&self) -> Vec<Value> {
        let state = self.state.lock().unwrap();
        state.sent.iter().filter(|frame| frame["reqType"] == "AddRCC").cloned().collect()
    }

    /// The number of stops that the controller received.
    pub fn stops(&self) -> usize {
        let state = self.state.lock().unwrap();
        state.sent.iter().filter(|frame| frame["cmdData"][0] == "actionStop").count()
    }

    /// Whether the link has broken at the chosen frame.
    pub fn has_broken(&self) -> bool {
        self.state.lock().unwrap().breaks.is_none()
    }

    async fn carry(&self, mut from: OwnedReadHalf, mut to: OwnedWriteHalf, is_reply: bool) {
        let mut received = Vec::new();
        let mut bytes = [0; 4096];
        while let Ok(count @ 1..) = from.read(&mut bytes).await {
            received.extend_from_slice(&bytes[..count]);
            loop {
                let mut frames = serde_json::Deserializer::from_slice(&received).into_iter::<Value>();
                let Some(Ok(frame)) = frames.next() else { break };
                let used = frames.byte_offset();
                let raw: Vec<u8> = received.drain(..used).collect();
                let delay = self.state.lock().unwrap().delay;
                if !delay.is_zero() {
                    sleep(delay).await;
                }
                if self.breaks_at(frame, is_reply) || to.write_all(&raw).await.is_err() {
                    return;
                }
            }
        }
    }

    /// Records the frame. Returns whether the link breaks instead of carrying it.
    fn breaks_at(&self, frame: Value, is_reply: bool) -> bool {
        let mut state = self.state.lock().unwrap();
        let kind = frame["reqType"].as_str().unwrap_or_default().to_owned();
        let seen = if is_reply { &mut state.replies } else { &mut state.requests };
        seen.push(kind.clone());
        let number = seen.iter().filter(|seen| **seen == kind).count();
        let breaks = match state.breaks {
            Some(Break::Reply(at, n)) => is_reply && kind == at && n == number,
            Some(Break::Request(at, n)) => !is_reply && kind == at && n == number,
            None => false,
        };
        if breaks {
            state.breaks = None;
        } else if !is_reply {
            state.sent.push(frame);
        }
        breaks
    }
}
