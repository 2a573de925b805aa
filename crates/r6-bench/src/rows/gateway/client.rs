//! A small client of the gateway over HTTP.

use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Read, Write as _};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::serve::Running;

/// A connection that was at rest for longer is not used again: the gateway closes it after some seconds.
const REST: Duration = Duration::from_secs(1);

/// A client of the gateway over one connection, or another one after a rest.
pub struct Client {
    address: SocketAddr,
    stream: BufReader<TcpStream>,
    used: Instant,
    token: String,
}

fn connect(address: SocketAddr) -> BufReader<TcpStream> {
    let stream = TcpStream::connect(address).expect("it listens");
    stream.set_nodelay(true).expect("small requests leave at once");
    BufReader::new(stream)
}

impl Client {
    pub fn new(running: &Running) -> Self {
        let token = running.words.get(1).expect("a token").clone();
        Self { address: running.address, stream: connect(running.address), used: Instant::now(), token }
    }

    pub fn ask(&mut self, method: &str, path: &str, body: &str) -> (u16, String) {
        let mut request = format!("{method} {path} HTTP/1.1\r\nHost: localhost\r\n");
        write!(request, "Authorization: Bearer {}\r\nContent-Type: application/json\r\n", self.token)
            .and_then(|()| write!(request, "Content-Length: {}\r\n\r\n{body}", body.len()))
            .expect("a text can be written");
        if self.used.elapsed() > REST {
            self.stream = connect(self.address);
        }
        self.stream.get_mut().write_all(request.as_bytes()).expect("it is read");
        let (mut line, mut status, mut length) = (String::new(), 0, 0);
        loop {
            line.clear();
            self.stream.read_line(&mut line).expect("an answer");
            if let Some(rest) = line.strip_prefix("HTTP/1.1 ") {
                status = rest.get(..3).and_then(|status| status.parse().ok()).expect("a status");
            } else if let Some(told) = line.strip_prefix("content-length: ") {
                length = told.trim().parse().expect("a length");
            } else if line.trim().is_empty() {
                break;
            }
        }
        let mut body = vec![0; length];
        self.stream.read_exact(&mut body).expect("the body");
        self.used = Instant::now();
        (status, String::from_utf8(body).expect("text"))
    }

    pub fn json(&mut self, method: &str, path: &str, body: &str) -> Value {
        let (status, answer) = self.ask(method, path, body);
        assert_eq!(status, 200, "{method} {path}: {answer}");
        serde_json::from_str(&answer).expect("JSON")
    }

    /// The sum of a metric over all robots.
    pub fn total(&mut self, metric: &str) -> f64 {
        let (_, text) = self.ask("GET", "/metrics", "");
        let rows =
            text.lines().filter(|line| line.starts_with(metric) && line[metric.len()..].starts_with('{'));
        rows.map(|row| row.rsplit(' ').next().and_then(|value| value.parse::<f64>().ok()).expect("a number"))
            .sum()
    }
}
