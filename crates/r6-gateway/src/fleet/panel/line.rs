//! The connection to the panel of a virtual robot: one request over each.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::time::Duration;

use axum::body::Bytes;
use axum::http::header::{CONTENT_TYPE, HOST};
use axum::http::{Method, Request, StatusCode};
use http_body_util::{BodyExt, Full, Limited};
use hyper::client::conn::http1::{self, Connection, SendRequest};
use hyper_util::rt::TokioIo;
use r6_api::panel::{Action, Faults, Snapshot};
use serde::de::DeserializeOwned;
use tokio::net::TcpStream;

/// How long a connection to a panel may take. It is on this machine.
const CONNECT_WITHIN: Duration = Duration::from_secs(2);

/// How long an answer may take: the panel holds it up for nothing.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// The longest answer that is read. A state has about two thousand bytes, and names of 200 programs.
const MAX_ANSWER: usize = 256 * 1024;

/// Where the panel of a virtual robot is: over HTTP, on this machine. A real robot has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Panel {
    address: SocketAddr,
    controller: usize,
}

impl Panel {
    /// The panel that listens at this address, and the number of the controller there, from 1. `None` if it
    /// cannot be reached over the loopback interface: it has no login.
    #[must_use]
    pub fn new(address: SocketAddr, controller: usize) -> Option<Self> {
        let address = match address.ip() {
            IpAddr::V4(ip) if ip.is_unspecified() => SocketAddr::from((Ipv4Addr::LOCALHOST, address.port())),
            IpAddr::V6(ip) if ip.is_unspecified() => SocketAddr::from((Ipv6Addr::LOCALHOST, address.port())),
            _ => address,
        };
        address.ip().is_loopback().then_some(Self { address, controller })
    }

    /// Where it listens.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Connects. Nothing is sent yet.
    pub(super) async fn connect(self) -> Result<Line, String> {
        let connecting = async {
            let stream = TcpStream::connect(self.address).await.map_err(|error| error.to_string())?;
            http1::handshake(TokioIo::new(stream)).await.map_err(|error| error.to_string())
        };
        let connected = tokio::time::timeout(CONNECT_WITHIN, connecting).await;
        let connected = connected.unwrap_or_else(|_| Err(format!("no connection within {CONNECT_WITHIN:?}")));
        let (sender, connection) = connected?;
        Ok(Line { panel: self, sender, connection })
    }
}

/// A connection to a panel, for one request.
pub(super) struct Line {
    panel: Panel,
    sender: SendRequest<Full<Bytes>>,
    connection: Connection<TokioIo<TcpStream>, Full<Bytes>>,
}

/// Why a panel did not do what it was asked for.
#[derive(Debug)]
pub(super) enum Failed {
    /// It refused, for this reason.
    Refused(r6_api::Problem),
    /// No usable answer came: it may have acted.
    NoAnswer(String),
}

impl Line {
    /// What a person sees at the machine.
    pub(super) async fn look(self) -> Result<Snapshot, Failed> {
        let path = format!("/v1/controllers/{}", self.panel.controller);
        self.ask(Method::GET, &path, Bytes::new()).await
    }

    /// Does this at the machine, and returns what a person then sees.
    pub(super) async fn act(self, action: &Action) -> Result<Snapshot, Failed> {
        let path = format!("/v1/controllers/{}/actions", self.panel.controller);
        let body = serde_json::to_vec(action).map_err(|error| Failed::NoAnswer(error.to_string()))?;
        self.ask(Method::POST, &path, body.into()).await
    }

    /// The faults that the controller can be given.
    pub(super) async fn faults(self) -> Result<Faults, Failed> {
        let path = format!("/v1/controllers/{}/faults", self.panel.controller);
        self.ask(Method::GET, &path, Bytes::new()).await
    }

    async fn ask<T: DeserializeOwned>(self, method: Method, path: &str, body: Bytes) -> Result<T, Failed> {
        let Self { panel, mut sender, connection } = self;
        let request = Request::builder()
            .method(method)
            .uri(path)
            .header(HOST, panel.address.to_string())
            .header(CONTENT_TYPE, "application/json")
            .body(Full::new(body))
            .map_err(|error| Failed::NoAnswer(error.to_string()))?;
        let answer = async {
            let answer = sender.send_request(request).await.map_err(|error| error.to_string())?;
            let status = answer.status();
            let body = Limited::new(answer.into_body(), MAX_ANSWER).collect().await;
            Ok((status, body.map_err(|error| error.to_string())?.to_bytes()))
        };
        // The answer comes only while the connection is polled. If the connection ends early, the answer ends
        // too.
        let exchange = async {
            let mut answer = std::pin::pin!(answer);
            tokio::select! {
                answer = &mut answer => answer,
                _ = connection => answer.await,
            }
        };
        let answer = tokio::time::timeout(ANSWER_WITHIN, exchange).await;
        let answer = answer.unwrap_or_else(|_| Err(format!("none came within {ANSWER_WITHIN:?}")));
        let (status, body) = answer.map_err(Failed::NoAnswer)?;
        read(status, &body)
    }
}

/// An answer of a panel.
fn read<T: DeserializeOwned>(status: StatusCode, body: &[u8]) -> Result<T, Failed> {
    if status.is_success() {
        return serde_json::from_slice(body)
            .map_err(|error| Failed::NoAnswer(format!("it is not that of a panel: {error}")));
    }
    match serde_json::from_slice(body) {
        Ok(problem) => Err(Failed::Refused(problem)),
        Err(_) => Err(Failed::NoAnswer(format!("status {status}, which is not a panel's"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_is_on_this_machine() {
        for (listens, reached) in [
            ("127.0.0.1:9770", Some("127.0.0.1:9770")),
            ("0.0.0.0:9770", Some("127.0.0.1:9770")),
            ("[::1]:9770", Some("[::1]:9770")),
            ("[::]:9770", Some("[::1]:9770")),
            ("192.168.1.5:9770", None),
        ] {
            let panel = Panel::new(listens.parse().unwrap(), 1);
            assert_eq!(panel.map(|panel| panel.address().to_string()).as_deref(), reached, "{listens}");
        }
    }

    #[test]
    fn an_answer_that_is_no_panels_tells_nothing() {
        let refused = read::<Snapshot>(StatusCode::CONFLICT, br#"{"code":"moving","message":"it moves"}"#);
        assert!(matches!(refused, Err(Failed::Refused(problem)) if problem.code == r6_api::Code::Moving));
        for (status, body) in [(200, "{}"), (200, ""), (409, "no"), (502, "<html>")] {
            let told = read::<Snapshot>(StatusCode::from_u16(status).unwrap(), body.as_bytes());
            assert!(matches!(told, Err(Failed::NoAnswer(_))), "{status} {body}");
        }
    }
}
