//! One HTTP request at a time, each on its own connection: to the panel of a virtual controller, and to a
//! gateway.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Full, Limited};
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper::{Request, StatusCode};
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore};

/// How long a connection may take, with its TLS handshake. The server runs on this machine or nearby.
const CONNECT_WITHIN: Duration = Duration::from_secs(5);

/// Where requests go.
pub struct HttpClient {
    /// Host and port.
    authority: String,
    tls: Option<(TlsConnector, ServerName<'static>)>,
    /// How long a reply may take.
    patience: Duration,
    /// The longest body of a reply that is read, in bytes.
    longest: usize,
}

impl fmt::Debug for HttpClient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HttpClient").field("authority", &self.authority).finish_non_exhaustive()
    }
}

/// Why there is no reply.
#[derive(Debug, PartialEq, Eq)]
pub enum Lost {
    /// There is no connection. Nothing was sent.
    NotConnected(String),
    /// The request was sent, or a part of it.
    NoReply(String),
}

impl HttpClient {
    /// A client of the server at this host and port. `patience`: how long a reply may take. `longest`: how
    /// many bytes the body of a reply may have.
    pub fn new(authority: String, patience: Duration, longest: usize) -> Self {
        Self { authority, tls: None, patience, longest }
    }

    /// With TLS, to a server that is known as `host`. Its certificate is one of these (PEM), or was issued by
    /// one of them.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn with_tls(self, host: &str, trusted: &[u8]) -> Result<Self, String> {
        let mut roots = RootCertStore::empty();
        for certificate in CertificateDer::pem_slice_iter(trusted) {
            let added = certificate.map_err(|error| error.to_string());
            added.and_then(|one| roots.add(one).map_err(|error| error.to_string()))?;
        }
        if roots.is_empty() {
            return Err("it has no certificate in PEM".to_owned());
        }
        let name = ServerName::try_from(host.to_owned());
        let name = name.map_err(|_| format!("`{host}` is not a name that a certificate can have"))?;
        let config = ClientConfig::builder().with_root_certificates(roots).with_no_client_auth();
        Ok(Self { tls: Some((TlsConnector::from(Arc::new(config)), name)), ..self })
    }

    /// Host and port.
    pub fn authority(&self) -> &str {
        &self.authority
    }

    /// Sends one request and reads its reply. The request is never sent again.
    ///
    /// # Errors
    /// [`Lost`].
    pub async fn ask(&self, request: Request<Full<Bytes>>) -> Result<(StatusCode, Bytes), Lost> {
        let connecting = async {
            let stream = TcpStream::connect(&self.authority).await.map_err(|error| error.to_string())?;
            match &self.tls {
                None => Ok(Connection::Plain(stream)),
                Some((tls, name)) => {
                    let stream = tls.connect(name.clone(), stream).await;
                    Ok(Connection::Tls(Box::new(stream.map_err(|error| format!("TLS: {error}"))?)))
                }
            }
        };
        let connection = match tokio::time::timeout(CONNECT_WITHIN, connecting).await {
            Ok(connection) => connection.map_err(Lost::NotConnected)?,
            Err(_) => return Err(Lost::NotConnected(format!("no connection within {CONNECT_WITHIN:?}"))),
        };
        let exchange = async {
            match connection {
                Connection::Plain(stream) => exchange(stream, request, self.longest).await,
                Connection::Tls(stream) => exchange(stream, request, self.longest).await,
            }
        };
        match tokio::time::timeout(self.patience, exchange).await {
            Ok(reply) => reply.map_err(Lost::NoReply),
            Err(_) => Err(Lost::NoReply(format!("none came within {:?}", self.patience))),
        }
    }
}

enum Connection {
    Plain(TcpStream),
    Tls(Box<tokio_rustls::client::TlsStream<TcpStream>>),
}

/// Sends one request and reads its reply, on its own connection.
async fn exchange(
    stream: impl AsyncRead + AsyncWrite + Unpin,
    request: Request<Full<Bytes>>,
    longest: usize,
) -> Result<(StatusCode, Bytes), String> {
    let (mut sender, connection) =
        http1::handshake(TokioIo::new(stream)).await.map_err(|error| error.to_string())?;
    let reply = async {
        let reply = sender.send_request(request).await.map_err(|error| error.to_string())?;
        let status = reply.status();
        let body = Limited::new(reply.into_body(), longest).collect().await;
        Ok((status, body.map_err(|error| error.to_string())?.to_bytes()))
    };
    // The reply comes only while the connection is polled. If the connection ends early, the reply ends too.
    let mut reply = std::pin::pin!(reply);
    tokio::select! {
        reply = &mut reply => reply,
        _ = connection => reply.await,
    }
}

/// Escapes a name for use as one segment of a path, or as a value of a query.
pub fn in_path(name: &str) -> String {
    name.bytes().fold(String::new(), |mut path, byte| {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            path.push(char::from(byte));
        } else {
            path.push_str(&format!("%{byte:02X}"));
        }
        path
    })
}
