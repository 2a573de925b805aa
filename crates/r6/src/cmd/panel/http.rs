//! The client of the panel's HTTP API.

use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper::header::{CONTENT_TYPE, HOST};
use hyper::http::uri::Authority;
use hyper::{Method, Request, StatusCode};
use hyper_util::rt::TokioIo;
use r6_api::Problem;
use r6_api::panel::{Action, Snapshot};
use r6_sim::panel::DEFAULT_PORT;
use tokio::net::TcpStream;

use crate::exit::{Exit, Failure};

/// How long a connection or a reply may take. The panel runs on this machine or nearby.
const PATIENCE: Duration = Duration::from_secs(5);

/// The longest reply that is read. A state has about two thousand bytes.
const MAX_REPLY_BYTES: usize = 64 * 1024;

/// A client of one panel.
#[derive(Debug)]
pub struct Panel {
    /// Host and port.
    address: String,
}

impl Panel {
    /// The panel at `http://HOST:PORT`, or `HOST:PORT`.
    pub fn at(url: &str) -> Result<Self, Failure> {
        let rest = url.strip_prefix("http://").unwrap_or(url);
        let rest = rest.strip_suffix('/').unwrap_or(rest);
        let told =
            rest.parse::<Authority>().ok().filter(|told| !told.host().is_empty() && !rest.contains('@'));
        let address = told.and_then(|told| match told.port_u16() {
            Some(port) => Some(format!("{}:{port}", told.host())),
            // `host:abc` has no valid port. It is an error and does not fall back to the default port.
            None => (told.as_str() == told.host()).then(|| format!("{}:{DEFAULT_PORT}", told.host())),
        });
        address.map(|address| Self { address }).ok_or_else(|| {
            Failure::usage(format!("--panel: `{url}` is no panel's address"))
                .advise("write it as http://127.0.0.1:9770 or 127.0.0.1:9770")
        })
    }

    /// Reads what an operator sees at the machine.
    pub async fn state(&self, controller: usize) -> Result<Snapshot, Failure> {
        self.ask(Method::GET, &format!("/v1/controllers/{controller}"), Bytes::new(), Exit::NoReply).await
    }

    /// Performs an operator's action, and returns what an operator then sees.
    pub async fn act(&self, controller: usize, action: &Action) -> Result<Snapshot, Failure> {
        let body = serde_json::to_vec(action)
            .map_err(|error| Failure::usage(format!("this cannot be written as JSON: {error}")))?;
        let path = format!("/v1/controllers/{controller}/actions");
        self.ask(Method::POST, &path, body.into(), Exit::Unknown).await
    }

    /// Loads a program, and returns what an operator then sees.
    pub async fn load(&self, controller: usize, name: &str, text: String) -> Result<Snapshot, Failure> {
        let path = format!("/v1/controllers/{controller}/programs/{}", in_path(name));
        self.ask(Method::PUT, &path, text.into(), Exit::Unknown).await
    }

    /// Sends a request. `lost`: how the run ends if no reply comes.
    async fn ask(&self, method: Method, path: &str, body: Bytes, lost: Exit) -> Result<Snapshot, Failure> {
        let stream = self.connect().await?;
        let kind = if method == Method::PUT { "text/plain; charset=utf-8" } else { "application/json" };
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header(HOST, &self.address)
            .header(CONTENT_TYPE, kind)
            .body(Full::new(body))
            .map_err(|error| Failure::usage(format!("no such request: {error}")))?;
        let exchange = exchange(stream, request);
        let no_reply = |why: &str| {
            Failure::no_reply(format!("{} gave no reply to {path}: {why}", self.address)).with_exit(lost)
        };
        let (status, body) = match tokio::time::timeout(PATIENCE, exchange).await {
            Ok(Ok(reply)) => reply,
            Ok(Err(why)) => return Err(no_reply(&why)),
            Err(_) => {
                return Err(no_reply(&format!(
                    "none came within {PATIENCE:?}; the port of a robot is not that of its panel"
                )));
            }
        };
        if status.is_success() {
            return serde_json::from_slice(&body)
                .map_err(|error| no_reply(&format!("not a panel's: {error}")));
        }
        match serde_json::from_slice::<Problem>(&body) {
            // These two depend on the state of the machine and are refusals. Other statuses mean that the
            // request itself is wrong.
            Ok(problem) if matches!(status, StatusCode::CONFLICT | StatusCode::FORBIDDEN) => {
                Err(Failure::refused(problem.message))
            }
            Ok(problem) => Err(Failure::usage(problem.message)),
            Err(_) => Err(no_reply(&format!("status {status}, which is not a panel's"))),
        }
    }

    async fn connect(&self) -> Result<TcpStream, Failure> {
        let unreachable = |why: String| {
            Failure::no_reply(format!("no panel at {}: {why}", self.address)).advise(
                "where `r6 up` or `r6 sim --panel` runs already, name the panel that it shows with --panel ADDR:PORT (or R6_PANEL; \
                 R6_ROBOT does not count here); else start one; real machines have no panel",
            )
        };
        match tokio::time::timeout(PATIENCE, TcpStream::connect(&self.address)).await {
            Ok(Ok(stream)) => Ok(stream),
            Ok(Err(error)) => Err(unreachable(error.to_string())),
            Err(_) => Err(unreachable(format!("no connection within {PATIENCE:?}"))),
        }
    }
}

/// Escapes a name for use as one segment of a path.
fn in_path(name: &str) -> String {
    name.bytes().fold(String::new(), |mut path, byte| {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            path.push(char::from(byte));
        } else {
            path.push_str(&format!("%{byte:02X}"));
        }
        path
    })
}

/// Sends one request and reads its reply, on its own connection.
async fn exchange(stream: TcpStream, request: Request<Full<Bytes>>) -> Result<(StatusCode, Bytes), String> {
    let (mut sender, connection) =
        http1::handshake(TokioIo::new(stream)).await.map_err(|error| error.to_string())?;
    let reply = async {
        let reply = sender.send_request(request).await.map_err(|error| error.to_string())?;
        let status = reply.status();
        let body = Limited::new(reply.into_body(), MAX_REPLY_BYTES).collect().await;
        Ok((status, body.map_err(|error| error.to_string())?.to_bytes()))
    };
    // The reply comes only while the connection is polled. If the connection ends early, the reply ends too.
    let mut reply = std::pin::pin!(reply);
    tokio::select! {
        reply = &mut reply => reply,
        _ = connection => reply.await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_goes_by_its_url_or_its_address() {
        for (url, address) in [
            ("http://127.0.0.1:9771", "127.0.0.1:9771"),
            ("http://localhost:9771/", "localhost:9771"),
            ("localhost", "localhost:9770"),
            ("[::1]:1", "[::1]:1"),
        ] {
            assert_eq!(Panel::at(url).unwrap().address, address);
        }
        for wrong in [
            "",
            "https://localhost:9770",
            "http://",
            "localhost:99999",
            "a b",
            "me@localhost",
            "localhost/v1",
        ] {
            assert_eq!(Panel::at(wrong).unwrap_err().exit(), Exit::Usage, "{wrong}");
        }
    }
}
