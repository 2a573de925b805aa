//! The other gateways of the hall, as this one reaches them: over HTTP where callers find them, with a pass.
//!
//! With TLS, both gateways show the certificates whose SHA-256 their rows in the store have, and no authority
//! is asked. With TLS and without, the signature of the pass proves that this gateway asks
//! (`core/pass.rs`). Each request has a connection of its own: none waits behind another one.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use axum::body::Bytes;
use axum::http::header::{CONNECTION, CONTENT_LENGTH, HOST, HeaderValue, TRANSFER_ENCODING};
use axum::http::{HeaderMap, HeaderName, Method};
use http_body_util::{BodyExt, Full, Limited};
use hyper::body::Incoming;
use hyper::client::conn::http1;
use hyper::{Request, Response};
use hyper_util::rt::TokioIo;
use r6_http::Tls;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_tungstenite::WebSocketStream;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;

use crate::core::pass::{self, Bearer, Pass, PassKey, Taken};
use crate::secret;

/// The header that has a pass.
pub const PASS: &str = "r6-pass";

/// The longest answer that a gateway reads for itself: a robot takes some kilobytes in a list.
const MAX_ANSWER: usize = 8 * 1024 * 1024;

/// What that header says in an answer: the request was taken.
pub const ADMITTED: &str = "admitted";

/// The request was not taken, and nothing was done.
pub const REFUSED: &str = "refused";

/// How long a connection may take, with TLS. Gateways of one hall are close to each other.
const CONNECT_WITHIN: Duration = Duration::from_secs(1);

/// How long a WebSocket may take until it is open.
const OPEN_WITHIN: Duration = Duration::from_secs(2);

/// The longest message over it: it has the values of one robot.
const MAX_MESSAGE: usize = 1024 * 1024;

/// A WebSocket to a gateway.
pub type LiveStream = WebSocketStream<Box<dyn Stream>>;

/// How many gateways are remembered whose passes came. Those that do not live are forgotten.
const MAX_GATEWAYS: usize = 256;

/// Where callers find a gateway, and how it proves itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Door {
    /// `http://HOST:PORT` or `https://HOST:PORT`.
    pub url: String,
    /// What its passes are signed with, the public half.
    pub key: String,
    /// The SHA-256 of its certificate.
    pub certificate: Option<String>,
}

/// What this gateway reads from another one for its own readers.
#[must_use]
pub fn asks(target: &str) -> Onward {
    asks_for(target, (Bearer::Gateway, None))
}

/// What this gateway reads from another one for this caller, who gets what is for it alone.
#[must_use]
pub fn asks_for(target: &str, bearer: (Bearer, Option<std::net::SocketAddr>)) -> Onward {
    let (headers, body) = (HeaderMap::new(), Bytes::new());
    Onward { method: Method::GET, target: target.to_owned(), headers, body, bearer }
}

/// What an answer to that says.
///
/// # Errors
/// What is wrong with the answer, for people.
pub async fn read<T: DeserializeOwned>(answer: Response<Incoming>) -> Result<T, String> {
    if !answer.status().is_success() || !is_admitted(answer.headers()) {
        return Err(format!("status {}", answer.status()));
    }
    let body = Limited::new(answer.into_body(), MAX_ANSWER).collect().await;
    let body = body.map_err(|error| error.to_string())?;
    serde_json::from_slice(&body.to_bytes()).map_err(|error| error.to_string())
}

/// A request to pass on.
#[derive(Clone, Debug)]
pub struct Onward {
    /// Its method.
    pub method: Method,
    /// Its path, with its query.
    pub target: String,
    /// Its head, without what is about the connection or says who asks.
    pub headers: HeaderMap,
    /// Its body.
    pub body: Bytes,
    /// Who asks, and from where.
    pub bearer: (Bearer, Option<std::net::SocketAddr>),
}

/// Why no answer came.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failed {
    /// Nothing was sent.
    NotSent(String),
    /// It was sent, at least in part: it may have been carried out.
    Unknown(String),
}

/// This gateway, for the others.
#[derive(Debug)]
pub struct Peers {
    key: PassKey,
    /// The certificate of this gateway.
    own: Option<Tls>,
    /// The number of the last pass.
    last: AtomicU64,
    /// The passes that came, by the gateways that signed them.
    taken: Mutex<BTreeMap<u64, Taken>>,
}

impl Peers {
    /// A gateway with a key that is drawn now, and with this certificate.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new(own: Option<Tls>) -> Result<Self, String> {
        let mut seed = [0; 32];
        secret::fill(&mut seed).map_err(|error| format!("no random numbers: {error}"))?;
        let key = PassKey::of_seed(seed).ok_or_else(|| "no key could be made".to_owned())?;
        Ok(Self { key, own, last: AtomicU64::new(0), taken: Mutex::default() })
    }

    /// The public half of its key.
    #[must_use]
    pub fn public_key(&self) -> String {
        self.key.public()
    }

    /// Whether a request that came with a certificate of this SHA-256 can be of the gateway behind this door:
    /// with TLS, another gateway asks with its certificate. `None`: it came with none, as from a gateway that
    /// has no TLS.
    #[must_use]
    pub fn fits(&self, door: &Door, shown: Option<&str>) -> bool {
        self.own.is_none() || door.certificate.as_deref() == shown
    }

    /// The pass in this text, if it is for a request with this head to the gateway `own`, and came with this
    /// certificate. `door`: the door of a gateway.
    #[must_use]
    pub fn open<'a>(
        &self,
        text: &str,
        own: u64,
        (head, shown): (&[u8; 32], Option<&str>),
        door: impl FnOnce(u64) -> Option<&'a Door>,
    ) -> Option<Pass> {
        let key = |from| Some(door(from).filter(|door| self.fits(door, shown))?.key.clone());
        pass::open(text, key).filter(|pass| pass.to == own && pass.head == *head)
    }

    /// The pass, if it is for a request with this body, and was not taken before.
    #[must_use]
    pub fn admit(&self, pass: Pass, body: &[u8]) -> Option<Pass> {
        if pass.body != hash(body) {
            return None;
        }
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        if taken.len() >= MAX_GATEWAYS && !taken.contains_key(&pass.from) {
            // More gateways than live at once: the passes of others are still remembered.
            return None;
        }
        taken.entry(pass.from).or_default().take(pass.number, pass.until).then_some(pass)
    }

    /// Forgets gateways that are not there any more, once what they signed is too old at this time of the
    /// store. One whose beats fail goes on to sign.
    pub fn retain(&self, now: u64, is_there: impl Fn(u64) -> bool) {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        taken.retain(|number, taken| is_there(*number) || !taken.is_over(now));
    }

    /// Opens a WebSocket to the gateway `to`. `until`: until when a pass is taken that is made now.
    ///
    /// # Errors
    /// Why it could not be opened, for people.
    pub async fn open_stream(
        &self,
        way: (u64, u64),
        door: &Door,
        onward: Onward,
        until: impl Fn() -> u64,
    ) -> Result<LiveStream, String> {
        let open = async {
            let (stream, at) = connect(door, self.own.as_ref()).await?;
            let address = format!("ws://{at}{}", onward.target);
            let mut request = address.into_client_request().map_err(|error| error.to_string())?;
            request.headers_mut().extend(onward.headers.clone());
            // The pass is for the head as it is sent.
            let pass = self.pass(way, until(), &Onward { headers: request.headers().clone(), ..onward })?;
            request.headers_mut().insert(PASS, pass);
            let mut config = WebSocketConfig::default();
            config.max_message_size = Some(MAX_MESSAGE);
            config.max_frame_size = Some(MAX_MESSAGE);
            let opened = tokio_tungstenite::client_async_with_config(request, stream, Some(config)).await;
            let (stream, answer) = opened.map_err(|error| error.to_string())?;
            match is_admitted(answer.headers()) {
                true => Ok(stream),
                false => Err("what answers there is no gateway of this database".to_owned()),
            }
        };
        let opened = tokio::time::timeout(OPEN_WITHIN, open).await;
        opened.unwrap_or_else(|_| Err(format!("no stream within {OPEN_WITHIN:?}")))
    }

    /// A pass for this request, as a header.
    fn pass(&self, (from, to): (u64, u64), until: u64, onward: &Onward) -> Result<HeaderValue, String> {
        let number = self.last.fetch_add(1, Ordering::Relaxed) + 1;
        let (head, body) = (head(&onward.method, &onward.target, &onward.headers), hash(&onward.body));
        let (bearer, source) = onward.bearer.clone();
        let pass = Pass { from, to, number, until, head, body, bearer, source };
        HeaderValue::from_str(&self.key.sign(&pass)).map_err(|error| error.to_string())
    }

    /// Passes a request on to the gateway `to`, once, and returns its answer, whose body goes on. `until`:
    /// until when a pass is taken that is made now.
    ///
    /// # Errors
    /// [`Failed`].
    pub async fn send(
        &self,
        way: (u64, u64),
        door: &Door,
        onward: Onward,
        until: impl Fn() -> u64,
    ) -> Result<Response<Incoming>, Failed> {
        let not_sent = |error: String| Failed::NotSent(format!("{}: {error}", door.url));
        let connected = tokio::time::timeout(CONNECT_WITHIN, connect(door, self.own.as_ref())).await;
        let (stream, at) = connected
            .map_err(|_| not_sent(format!("no connection within {CONNECT_WITHIN:?}")))?
            .map_err(not_sent)?;
        let header = self.pass(way, until(), &onward).map_err(not_sent)?;
        let Onward { method, target, headers, body, .. } = onward;
        let mut request = Request::new(Full::new(body));
        *request.method_mut() = method;
        *request.uri_mut() = target.parse().map_err(|error| not_sent(format!("{error}")))?;
        *request.headers_mut() = headers;
        let host = HeaderValue::from_str(&at).map_err(|error| not_sent(error.to_string()))?;
        request.headers_mut().insert(HOST, host);
        request.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
        request.headers_mut().insert(PASS, header);
        let (mut sender, connection) =
            http1::handshake(TokioIo::new(stream)).await.map_err(|error| not_sent(error.to_string()))?;
        // It ends with the answer, or once it is not waited for any more.
        tokio::spawn(connection);
        let unknown = |error: hyper::Error| Failed::Unknown(format!("{}: {error}", door.url));
        sender.send_request(request).await.map_err(unknown)
    }
}

/// A connection to a gateway.
pub trait Stream: AsyncRead + AsyncWrite + Send + Unpin {}
impl<S: AsyncRead + AsyncWrite + Send + Unpin> Stream for S {}

/// Connects to a gateway. Returns the address that was reached, too: every gateway takes requests to that.
async fn connect(door: &Door, own: Option<&Tls>) -> Result<(Box<dyn Stream>, String), String> {
    let (is_secure, host) = match (door.url.strip_prefix("https://"), door.url.strip_prefix("http://")) {
        (Some(host), _) => (true, host),
        (None, Some(host)) => (false, host),
        (None, None) => return Err("this is no address of a gateway".to_owned()),
    };
    let stream = TcpStream::connect(host).await.map_err(|error| error.to_string())?;
    let at = stream.peer_addr().map_err(|error| error.to_string())?.to_string();
    // A stop must not wait for the acknowledgement of what was sent before it.
    let _ = stream.set_nodelay(true);
    if !is_secure {
        return Ok((Box::new(stream), at));
    }
    let expected = door.certificate.clone().ok_or("the store does not have its certificate")?;
    let is_it = move |der: &[u8]| crate::certificate::fingerprint_of(der) == expected;
    let stream = r6_http::connect_to(stream, own, is_it).await.map_err(|error| error.to_string())?;
    Ok((Box::new(stream), at))
}

/// Whether an answer with this head is of a gateway that took the pass.
#[must_use]
pub fn is_admitted(headers: &HeaderMap) -> bool {
    headers.get(PASS).is_some_and(|mark| mark == ADMITTED)
}

/// The hash of a head. All headers count but those about the connection: no one on the way may change, add or
/// take away one.
#[must_use]
pub fn head(method: &Method, target: &str, headers: &HeaderMap) -> [u8; 32] {
    let of_connection = [HOST, CONNECTION, CONTENT_LENGTH, TRANSFER_ENCODING];
    let counts = |name: &HeaderName| name.as_str() != PASS && !of_connection.contains(name);
    let mut lines: Vec<_> = headers.iter().filter(|(name, _)| counts(name)).collect();
    // Those with one name stay in their order.
    lines.sort_by_key(|(name, _)| name.as_str());
    let lines = lines.into_iter().flat_map(|(name, value)| [name.as_str().as_bytes(), value.as_bytes()]);
    let mut hash = Sha256::new();
    for part in [method.as_str().as_bytes(), target.as_bytes()].into_iter().chain(lines) {
        hash.update(u64::try_from(part.len()).unwrap_or(u64::MAX).to_be_bytes());
        hash.update(part);
    }
    hash.finalize().into()
}

fn hash(body: &[u8]) -> [u8; 32] {
    Sha256::digest(body).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn certificate() -> Tls {
        let made = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
        Tls::new(made.cert.pem().as_bytes(), made.signing_key.serialize_pem().as_bytes()).unwrap()
    }

    fn headers(lines: &[(&'static str, &'static str)]) -> HeaderMap {
        let of = |(name, value): &(&'static str, &'static str)| {
            (HeaderName::from_static(name), HeaderValue::from_static(value))
        };
        lines.iter().map(of).collect()
    }

    #[test]
    fn a_pass_is_for_one_request_to_one_gateway_once() {
        let peers = Peers::new(None).unwrap();
        let (to, sent, body) = (9, [1; 32], b"{}");
        let door = Door { key: peers.public_key(), certificate: Some("A".to_owned()), ..Door::default() };
        let pass = Pass {
            from: 3,
            to,
            number: 1,
            until: 0,
            head: sent,
            body: hash(body),
            bearer: Bearer::Token(4),
            source: None,
        };
        let text = peers.key.sign(&pass);
        let of = |number| (number == 3).then_some(&door);
        let open = |to, head, shown| peers.open(&text, to, (head, shown), of);
        assert_eq!(open(to, &sent, None), Some(pass.clone()));
        assert_eq!(open(8, &sent, None), None, "another gateway, or an earlier start");
        assert_eq!(open(to, &[2; 32], None), None, "another head");
        assert_eq!(peers.open(&text, to, (&sent, None), |_| None), None, "who signed is not known");
        let secure = Peers { own: Some(certificate()), ..Peers::new(None).unwrap() };
        let open = |shown| secure.open(&text, to, (&sent, shown), of);
        assert_eq!(open(Some("A")), Some(pass.clone()));
        assert_eq!((open(Some("B")), open(None)), (None, None), "the pass alone is not enough");
        let plain = Door { certificate: None, ..door.clone() };
        let open = |shown| secure.open(&text, to, (&sent, shown), |_| Some(&plain));
        assert_eq!(open(None), Some(pass.clone()), "a gateway without TLS has none to show");
        assert_eq!(open(Some("A")), None);
        assert_eq!(peers.admit(pass.clone(), b"{ }"), None, "another body");
        assert_eq!(peers.admit(pass.clone(), body), Some(pass.clone()));
        peers.retain(pass.until, |_| false);
        assert_eq!(peers.admit(pass.clone(), body), None, "it came before, and its gateway's beats fail");
        peers.retain(pass.until + 1, |_| true);
        assert_eq!(peers.admit(pass.clone(), body), None, "its gateway lives");
        peers.retain(pass.until + 1, |_| false);
        assert!(peers.taken.lock().unwrap().is_empty(), "what it signed is too old by now");
    }

    #[test]
    fn whatever_changes_in_a_head_changes_its_hash() {
        let of = |target: &str, lines: &[_]| head(&Method::POST, target, &headers(lines));
        let sent = of("/v1/a", &[("idempotency-key", "one"), ("accept", "a"), ("accept", "b")]);
        let came =
            [("host", "x"), ("accept", "a"), ("content-length", "3"), ("accept", "b"), ("r6-pass", "p")];
        assert_eq!(of("/v1/a", &[&came[..], &[("idempotency-key", "one")]].concat()), sent);
        let changed: [&[_]; 6] = [
            &[("idempotency-key", "two"), ("accept", "a"), ("accept", "b")],
            &[("accept", "a"), ("accept", "b")],
            &[("idempotency-key", "one"), ("accept", "b"), ("accept", "a")],
            &[("idempotency-key", "one"), ("accept", "ab")],
            &[("idempotency-key", "one"), ("accept", "a"), ("accept", "b"), ("authorization", "x")],
            &[("idempotency-key", "one"), ("accept", "a"), ("accept", "b"), ("valid-until", "9")],
        ];
        for lines in changed {
            assert_ne!(of("/v1/a", lines), sent, "{lines:?}");
        }
        assert_ne!(of("/v1/b", &[("idempotency-key", "one"), ("accept", "a"), ("accept", "b")]), sent);
    }
}
