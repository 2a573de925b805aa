//! The other end of the connection: threads that answer as the test specifies.

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use r6_client::blocking::Robot;
use r6_client::{Reconnect, RobotSettings};
use serde_json::{Value, json};

/// How the peer answers a request.
pub enum Reply {
    /// At once: with the values of its addresses, or with an acceptance.
    Now,
    /// After a time, while other requests are answered.
    After(Duration),
    Never,
    /// At once. A while later the controller ends its side of the connection.
    Last(Duration),
}

type Answer = dyn Fn(&Value) -> Reply + Send + Sync;

/// A controller that listens.
pub struct Peer {
    pub address: String,
    /// Connections that are open now, and the total number of connections so far.
    open: Arc<AtomicUsize>,
    made: Arc<AtomicUsize>,
}

impl Peer {
    pub fn start(answer: impl Fn(&Value) -> Reply + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (open, made) = (Arc::<AtomicUsize>::default(), Arc::<AtomicUsize>::default());
        let answer: Arc<Answer> = Arc::new(answer);
        let counts = (Arc::clone(&open), Arc::clone(&made));
        thread::spawn(move || {
            for stream in listener.incoming() {
                let (answer, open) = (Arc::clone(&answer), Arc::clone(&counts.0));
                open.fetch_add(1, Ordering::SeqCst);
                counts.1.fetch_add(1, Ordering::SeqCst);
                thread::spawn(move || {
                    serve(stream.unwrap(), &*answer);
                    open.fetch_sub(1, Ordering::SeqCst);
                });
            }
        });
        Self { address, open, made }
    }

    pub fn robot(&self) -> Robot {
        self.robot_with(settings())
    }

    pub fn robot_with(&self, settings: RobotSettings) -> Robot {
        Robot::connect(&self.address, settings).unwrap()
    }

    pub fn open(&self) -> usize {
        self.open.load(Ordering::SeqCst)
    }

    pub fn made(&self) -> usize {
        self.made.load(Ordering::SeqCst)
    }
}

/// Settings that never time out by accident, and reconnect at once.
pub fn settings() -> RobotSettings {
    RobotSettings {
        reply_timeout: super::PATIENCE,
        reconnect: Reconnect {
            first_wait: Duration::from_millis(1),
            cap: Duration::from_millis(2),
            jitter_seed: Some(1),
        },
        ..RobotSettings::default()
    }
}

/// Serves until the client has closed the connection, or the test has.
fn serve(mut stream: TcpStream, answer: &Answer) {
    stream.set_nodelay(true).unwrap();
    let mut received = Vec::new();
    let mut bytes = [0; 4096];
    loop {
        match stream.read(&mut bytes) {
            Ok(0) | Err(_) => return,
            Ok(count) => received.extend_from_slice(&bytes[..count]),
        }
        let mut frames = serde_json::Deserializer::from_slice(&received).into_iter::<Value>();
        let requests: Vec<_> = frames.by_ref().map_while(Result::ok).collect();
        let used = frames.byte_offset();
        received.drain(..used);
        for request in requests {
            let Some(reply) = reply_to(&request) else {
                answer(&request);
                continue;
            };
            match answer(&request) {
                Reply::Now => stream.write_all(reply.as_bytes()).unwrap_or_default(),
                Reply::After(time) => {
                    let mut stream = stream.try_clone().unwrap();
                    thread::spawn(move || {
                        thread::sleep(time);
                        stream.write_all(reply.as_bytes()).ok();
                    });
                }
                Reply::Never => {}
                Reply::Last(after) => {
                    stream.write_all(reply.as_bytes()).unwrap_or_default();
                    let stream = stream.try_clone().unwrap();
                    thread::spawn(move || {
                        thread::sleep(after);
                        stream.shutdown(Shutdown::Write).ok();
                    });
                }
            }
        }
    }
}

/// The addresses of a query; empty for any other request.
pub fn asked(request: &Value) -> Vec<&str> {
    request["queryAddr"].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
}

/// The word of a command; empty for any other request.
pub fn command_word(request: &Value) -> &str {
    request["cmdData"][0].as_str().unwrap_or_default()
}

pub fn is_heartbreak(request: &Value) -> bool {
    request["reqType"] == "heartbreak"
}

/// The value of a register is its number.
fn value_of(address: &str) -> String {
    let number: String = address.chars().filter(char::is_ascii_digit).collect();
    match address {
        "version" => "F5".to_owned(),
        "machineName" => "cell 4".to_owned(),
        "axisNum" => "6".to_owned(),
        "curMode" => "7".to_owned(),
        _ if number.is_empty() => "0".to_owned(),
        _ => number,
    }
}

fn reply_to(request: &Value) -> Option<String> {
    if is_heartbreak(request) {
        return None;
    }
    let mut reply =
        json!({ "dsID": request["dsID"], "packID": request["packID"], "reqType": request["reqType"] });
    if request["reqType"] == "query" {
        reply["queryAddr"] = request["queryAddr"].clone();
        reply["queryData"] = asked(request).into_iter().map(value_of).collect();
    } else {
        reply["cmdReply"] = json!([command_word(request), "ok"]);
    }
    Some(reply.to_string())
}
