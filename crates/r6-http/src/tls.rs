//! TLS: the certificate of a server, which can change while it runs.

use std::fmt;
use std::io;
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use axum::http::StatusCode;
use r6_api::{Code, Problem};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::server::{Acceptor, ParsedCertificate, WantsServerCert};
use rustls::sign::CertifiedKey;
use rustls::{ConfigBuilder, ServerConfig, WantsVerifier};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::LazyConfigAcceptor;
use tokio_rustls::server::TlsStream;

use crate::in_json::bare_answer;
use crate::shown::{Any, PROTOCOL};
use crate::slowed::Slowed;

/// How long the handshake may take, from the opening of the connection: three messages each way over a slow
/// radio link.
const HANDSHAKE_TIME: Duration = Duration::from_secs(5);

/// The first byte of a TLS connection. No request of HTTP begins with it.
const HANDSHAKE_RECORD: u8 = 22;

/// The most certificates of one chain: its own, some of issuers, and a root.
const MAX_CHAIN: usize = 16;

/// The certificate of a server. Its clones are the same certificate: [`Self::replace`] changes it for all
/// connections that come later. The server shows it to its clients, and to another server that it connects to
/// ([`crate::connect_to`]).
#[derive(Clone)]
pub struct Tls(Arc<RwLock<Arc<Configs>>>);

/// One certificate, for each kind of connection.
struct Configs {
    /// From clients, which have no certificates.
    clients: Arc<ServerConfig>,
    /// From other servers, which show theirs.
    servers: Arc<ServerConfig>,
    /// What this server shows to others.
    own: Arc<CertifiedKey>,
}

/// A configuration that has no key yet.
type Unkeyed = ConfigBuilder<ServerConfig, WantsServerCert>;

/// Why a certificate cannot be used.
#[derive(Debug)]
#[non_exhaustive]
pub enum BadCertificate {
    /// The text has no certificate in PEM that can be read.
    Certificate(String),
    /// The text has no private key in PEM that can be read.
    Key(String),
    /// The key is not that of the first certificate, or of a kind that TLS does not use.
    Pair(rustls::Error),
}

impl fmt::Display for BadCertificate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Certificate(why) => write!(f, "there is no certificate in PEM that can be read: {why}"),
            Self::Key(why) => write!(f, "there is no private key in PEM that can be read: {why}"),
            Self::Pair(why) => write!(f, "certificate and key do not go together: {why}"),
        }
    }
}

impl std::error::Error for BadCertificate {}

impl Tls {
    /// A certificate chain in PEM, that of the server first, and its private key in PEM.
    ///
    /// # Errors
    /// [`BadCertificate`].
    pub fn new(certificates: &[u8], key: &[u8]) -> Result<Self, BadCertificate> {
        Ok(Self(Arc::new(RwLock::new(configs(certificates, key)?))))
    }

    /// Uses another certificate for connections from now on. Those that are open keep theirs.
    ///
    /// # Errors
    /// [`BadCertificate`]: nothing was changed.
    pub fn replace(&self, certificates: &[u8], key: &[u8]) -> Result<(), BadCertificate> {
        let configs = configs(certificates, key)?;
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = configs;
        Ok(())
    }

    /// What this server shows to another one.
    pub(crate) fn own(&self) -> Arc<CertifiedKey> {
        Arc::clone(&self.now().own)
    }

    fn now(&self) -> Arc<Configs> {
        Arc::clone(&self.0.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Does the handshake with a peer. A peer that speaks plain HTTP gets an answer that says so.
    ///
    /// # Errors
    /// The peer closed the connection, took too long, or is no client of TLS.
    pub(crate) async fn accept(&self, stream: TcpStream) -> io::Result<TlsStream<Slowed<TcpStream>>> {
        let configs = self.now();
        let shake = async {
            let mut first = [0];
            if stream.peek(&mut first).await? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if first != [HANDSHAKE_RECORD] {
                turn_away(stream).await;
                return Err(io::Error::other("the peer does not speak TLS"));
            }
            let begun = LazyConfigAcceptor::new(Acceptor::default(), Slowed::new(stream)).await?;
            let spoken = begun.client_hello().alpn();
            let is_server = spoken.is_some_and(|mut spoken| spoken.any(|protocol| protocol == PROTOCOL));
            let config = if is_server { &configs.servers } else { &configs.clients };
            begun.into_stream(Arc::clone(config)).await
        };
        tokio::time::timeout(HANDSHAKE_TIME, shake).await.map_err(|_| io::ErrorKind::TimedOut)?
    }
}

impl fmt::Debug for Tls {
    /// Without the key.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Tls")
    }
}

/// Whether the first certificate of a chain in PEM is for this host name or address.
///
/// # Errors
/// [`BadCertificate`].
pub fn is_for(certificates: &[u8], host: &str) -> Result<bool, BadCertificate> {
    let chain = chain(certificates)?;
    let Some(first) = chain.first() else { return Ok(false) };
    let parsed =
        ParsedCertificate::try_from(first).map_err(|error| BadCertificate::Certificate(error.to_string()))?;
    let Ok(host) = ServerName::try_from(host) else { return Ok(false) };
    Ok(rustls::client::verify_server_name(&parsed, &host).is_ok())
}

/// The bytes of the first certificate of a chain in PEM.
///
/// # Errors
/// [`BadCertificate`].
pub fn first_der(certificates: &[u8]) -> Result<Vec<u8>, BadCertificate> {
    Ok(chain(certificates)?.first().map(|first| first.to_vec()).unwrap_or_default())
}

fn chain(certificates: &[u8]) -> Result<Vec<CertificateDer<'static>>, BadCertificate> {
    let chain: Vec<_> = CertificateDer::pem_slice_iter(certificates)
        .take(MAX_CHAIN)
        .collect::<Result<_, _>>()
        .map_err(|error| BadCertificate::Certificate(error.to_string()))?;
    if chain.is_empty() {
        return Err(BadCertificate::Certificate("it has no CERTIFICATE part".to_owned()));
    }
    Ok(chain)
}

fn configs(certificates: &[u8], key: &[u8]) -> Result<Arc<Configs>, BadCertificate> {
    let chain = chain(certificates)?;
    let key = PrivateKeyDer::from_pem_slice(key).map_err(|error| BadCertificate::Key(error.to_string()))?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let own = CertifiedKey::from_der(chain.clone(), key.clone_key(), &provider);
    let own = Arc::new(own.map_err(BadCertificate::Pair)?);
    let config = |verifier: fn(ConfigBuilder<ServerConfig, WantsVerifier>) -> Unkeyed, protocol: &[u8]| {
        // TLS 1.2 and 1.3.
        let builder = ServerConfig::builder_with_provider(Arc::clone(&provider));
        let builder = builder.with_safe_default_protocol_versions().map_err(BadCertificate::Pair)?;
        let config = verifier(builder).with_single_cert(chain.clone(), key.clone_key());
        let mut config = config.map_err(BadCertificate::Pair)?;
        config.alpn_protocols = vec![protocol.to_vec()];
        Ok(Arc::new(config))
    };
    let clients = config(|builder| builder.with_no_client_auth(), b"http/1.1")?;
    let servers = config(
        |builder| {
            let provider = Arc::clone(builder.crypto_provider());
            builder.with_client_cert_verifier(Arc::new(Any(provider)))
        },
        PROTOCOL,
    )?;
    Ok(Arc::new(Configs { clients, servers, own }))
}

/// Says that the connection needs TLS, and lets the peer read it.
async fn turn_away(mut stream: TcpStream) {
    let problem = Problem::new(Code::NeedsTls, "this server speaks TLS: begin the URL with https");
    let Some(answer) = bare_answer(StatusCode::BAD_REQUEST, &problem) else { return };
    if stream.write_all(&answer).await.is_err() || stream.shutdown().await.is_err() {
        return;
    }
    // A socket that is closed with unread bytes resets the connection, and the peer loses the answer.
    let mut read = [0; 1024];
    for _ in 0..64 {
        if !matches!(stream.read(&mut read).await, Ok(1..)) {
            return;
        }
    }
}
