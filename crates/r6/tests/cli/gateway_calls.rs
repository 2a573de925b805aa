//! Starts `r6 gateway` for tests, and sends it requests. Some tests kill or freeze it: those expect that no
//! answer may come.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{Running, r6};

/// A request as it is sent. `lines`: more lines of its head.
fn request(host: &str, token: &str, method: &str, path: &str, lines: &str, body: &str) -> String {
    let head = format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n{lines}");
    let length = format!("Content-Type: application/json\r\nContent-Length: {}\r\n", body.len());
    format!("{head}{length}Authorization: Bearer {token}\r\n\r\n{body}")
}

/// One request: the status and the body.
pub(crate) fn call(gateway: &str, token: &str, method: &str, path: &str, body: &str) -> (u16, Value) {
    call_with(gateway, token, method, path, "", body)
}

/// The same, with these lines of the head besides.
pub(crate) fn call_with(
    gateway: &str,
    token: &str,
    method: &str,
    path: &str,
    lines: &str,
    body: &str,
) -> (u16, Value) {
    let host = gateway.strip_prefix("http://").unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    stream.write_all(request(host, token, method, path, lines, body).as_bytes()).unwrap();
    let mut reply = String::new();
    // A gateway that is killed meanwhile sends none.
    let _ = stream.read_to_string(&mut reply);
    let status = reply.split(' ').nth(1).map_or(0, |status| status.parse().unwrap());
    let body = reply.split_once("\r\n\r\n").map_or("", |(_, body)| body);
    (status, serde_json::from_str(body).unwrap_or(Value::Null))
}

/// One request to a gateway that may be killed or frozen. `None`: there was no whole answer in time.
pub(crate) fn attempt(
    gateway: &str,
    token: &str,
    method: &str,
    path: &str,
    lines: &str,
    body: &Value,
    within: Duration,
) -> Option<(u16, Value)> {
    let mut stream = begin_call(gateway, token, method, path, lines, body)?;
    stream.set_read_timeout(Some(within)).ok()?;
    answer(&mut stream)
}

/// Sends a request to a gateway that may be killed or frozen. `None`: it could not be sent.
pub(crate) fn begin_call(
    gateway: &str,
    token: &str,
    method: &str,
    path: &str,
    lines: &str,
    body: &Value,
) -> Option<TcpStream> {
    let host = gateway.strip_prefix("http://")?;
    // A gateway that is frozen takes no more connections than the system keeps for it.
    let mut stream = TcpStream::connect_timeout(&host.parse().ok()?, Duration::from_secs(1)).ok()?;
    let body = if body.is_null() { String::new() } else { body.to_string() };
    stream.write_all(request(host, token, method, path, lines, &body).as_bytes()).ok()?;
    Some(stream)
}

/// The answer to a request. A part of an answer does not count.
pub(crate) fn answer(stream: &mut TcpStream) -> Option<(u16, Value)> {
    let mut reply = String::new();
    stream.read_to_string(&mut reply).ok()?;
    let (head, body) = reply.split_once("\r\n\r\n")?;
    let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
    let is_whole = length.is_none_or(|length| length.parse() == Ok(body.len()));
    let status = head.split(' ').nth(1)?.parse().ok()?;
    is_whole.then(|| (status, serde_json::from_str(body).unwrap_or(Value::Null)))
}

pub(crate) fn get(gateway: &str, token: &str, path: &str) -> (u16, Value) {
    call(gateway, token, "GET", path, "")
}

/// A gateway of this folder with this robot, and its URL.
pub(crate) fn gateway(data: &str, more: &[&str]) -> (Running, String) {
    let start = [["gateway", "--listen", "127.0.0.1:0", "--data", data].as_slice(), more].concat();
    let mut gateway = Running::start_with_pipes(&start);
    let line = gateway.line();
    let url = line.split([' ', ',']).find(|word| word.starts_with("http://") || word.starts_with("https://"));
    let url = url.unwrap_or_else(|| panic!("{line}")).to_owned();
    (gateway, url)
}

/// A token of this folder.
pub(crate) fn token(data: &str, role: &str) -> String {
    r6(&["gateway", "token", "--data", data, "--role", role]).out.trim().to_owned()
}

/// Asks until `done` returns something.
pub(crate) fn until<T>(mut done: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(done) = done() {
            return done;
        }
        assert!(begun.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(20));
    }
}
