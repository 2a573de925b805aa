//! How long a change at the controller takes to a client of the gateway's live values.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use futures_util::StreamExt;
use serde_json::Value;
use tokio::runtime::Builder;
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

use super::{Bare, percentiles};
use crate::serve::Running;

/// How many changes are measured.
const CHANGES: usize = 200;

/// Between two changes. No multiple of the period of the polls, so that changes come at all times between two
/// polls.
const BETWEEN: Duration = Duration::from_millis(137);

/// How long a change is waited for.
const PATIENCE: Duration = Duration::from_secs(5);

/// The median and the 99th of 100 of the times, in ms, from the controller's reply to a command over a bare
/// socket, which switches an output, to the message with the new value at a WebSocket client of the gateway.
pub fn changes(gateway: &Running, robot: SocketAddr, name: &str) -> [f64; 2] {
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    let url = format!("ws://{}/v1/live?robot={name}&signal=output-0", gateway.address);
    let mut request = url.into_client_request().expect("a request");
    let token = format!("Bearer {}", gateway.words.get(1).expect("a token"));
    request.headers_mut().insert("authorization", token.parse().expect("a header"));
    runtime.block_on(async {
        let stream = tokio::net::TcpStream::connect(gateway.address).await.expect("it listens");
        stream.set_nodelay(true).expect("small frames leave at once");
        let (mut socket, _) = tokio_tungstenite::client_async(request, stream).await.expect("a WebSocket");
        let mut bare = Bare::new(robot);
        let mut times = Vec::new();
        for number in 0..CHANGES {
            let on = (number + 1) % 2;
            bare.set_output(on);
            let begun = Instant::now();
            let seen = async {
                loop {
                    let message = socket.next().await.expect("a message").expect("an open socket");
                    if let Message::Text(text) = message
                        && is_switched(&text) == Some(on == 1)
                    {
                        return;
                    }
                }
            };
            tokio::time::timeout(PATIENCE, seen).await.expect("the change is seen in time");
            times.push(begun.elapsed().as_secs_f64() * 1e3);
            tokio::time::sleep(BETWEEN).await;
        }
        percentiles(times, [50, 99])
    })
}

/// Whether Y013 is on, if the message tells the outputs.
fn is_switched(message: &str) -> Option<bool> {
    let message: Value = serde_json::from_str(message).expect("JSON");
    let signals = message["signals"].as_array()?;
    let outputs = signals.iter().find(|signal| signal["address"] == "output-0")?["value"].as_u64()?;
    Some(outputs & 0b1000 != 0)
}
