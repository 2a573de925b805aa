//! The client of the panel's HTTP API.

use std::time::Duration;

use http_body_util::Full;
use hyper::body::Bytes;
use hyper::header::{CONTENT_TYPE, HOST};
use hyper::http::uri::Authority;
use hyper::{Method, Request, StatusCode};
use r6_api::Problem;
use r6_api::panel::{Action, Snapshot};
use r6_sim::panel::DEFAULT_PORT;

use crate::exit::{Exit, Failure};
use crate::http_client::{HttpClient, Lost, in_path};

/// How long a reply may take. The panel runs on this machine or nearby.
const PATIENCE: Duration = Duration::from_secs(5);

/// The longest reply that is read. A state has about two thousand bytes.
const MAX_REPLY_BYTES: usize = 64 * 1024;

/// A client of one panel.
#[derive(Debug)]
pub struct Panel {
    http: HttpClient,
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
        let http = |address| HttpClient::new(address, PATIENCE, MAX_REPLY_BYTES);
        address.map(|address| Self { http: http(address) }).ok_or_else(|| {
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
        let kind = if method == Method::PUT { "text/plain; charset=utf-8" } else { "application/json" };
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header(HOST, self.http.authority())
            .header(CONTENT_TYPE, kind)
            .body(Full::new(body))
            .map_err(|error| Failure::usage(format!("no such request: {error}")))?;
        let address = self.http.authority();
        let no_reply = |why: &str| {
            Failure::no_reply(format!("{address} gave no reply to {path}: {why}")).with_exit(lost)
        };
        let (status, body) = match self.http.ask(request).await {
            Ok(reply) => reply,
            Err(Lost::NotConnected(why)) => return Err(unreachable(address, &why)),
            Err(Lost::NoReply(why)) => {
                return Err(no_reply(&why).advise("the port of a robot is not that of its panel"));
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
}

fn unreachable(address: &str, why: &str) -> Failure {
    Failure::no_reply(format!("no panel at {address}: {why}")).advise(
        "where `r6 up` or `r6 sim --panel` runs already, name the panel that it shows with --panel ADDR:PORT (or R6_PANEL; \
         R6_ROBOT does not count here); else start one; real machines have no panel",
    )
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
            assert_eq!(Panel::at(url).unwrap().http.authority(), address);
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
