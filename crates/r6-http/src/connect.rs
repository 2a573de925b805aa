//! TLS to another server of r6, which is known by its certificate alone.

use std::fmt;
use std::io;
use std::sync::Arc;

use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, ring, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::{CertificateDer, IpAddr, ServerName, UnixTime};
use rustls::sign::SingleCertAndKey;
use rustls::{CertificateError, ClientConfig, DigitallySignedStruct, Error, SignatureScheme};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;

use crate::shown::PROTOCOL;
use crate::tls::Tls;

/// Speaks TLS with a server over this connection, if its certificate is the expected one. No
/// authority, no name and no time matters: who has the key of that certificate is the server. `own`: the
/// certificate that this one shows; without one the other does not ask for it.
///
/// # Errors
/// The connection fails, or it is another certificate.
pub async fn connect_to(
    stream: TcpStream,
    own: Option<&Tls>,
    is_expected: impl Fn(&[u8]) -> bool + Send + Sync + 'static,
) -> io::Result<TlsStream<TcpStream>> {
    let provider = Arc::new(ring::default_provider());
    let verifier = Expected { is_expected: Box::new(is_expected), provider: Arc::clone(&provider) };
    let config = ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(io::Error::other)?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(verifier));
    let config = match own {
        Some(own) => {
            let shown = SingleCertAndKey::from(own.own());
            let mut config = config.with_client_cert_resolver(Arc::new(shown));
            config.alpn_protocols = vec![PROTOCOL.to_vec()];
            config
        }
        None => config.with_no_client_auth(),
    };
    // A name has to be there; with an address none is sent.
    let name = ServerName::IpAddress(IpAddr::from(stream.peer_addr()?.ip()));
    TlsConnector::from(Arc::new(config)).connect(name, stream).await
}

/// Whether these bytes are the certificate that is expected.
type IsExpected = dyn Fn(&[u8]) -> bool + Send + Sync;

struct Expected {
    is_expected: Box<IsExpected>,
    provider: Arc<CryptoProvider>,
}

impl fmt::Debug for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Expected")
    }
}

impl ServerCertVerifier for Expected {
    fn verify_server_cert(
        &self,
        certificate: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _name: &ServerName<'_>,
        _ocsp: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, Error> {
        if (self.is_expected)(certificate) {
            return Ok(ServerCertVerified::assertion());
        }
        Err(Error::InvalidCertificate(CertificateError::ApplicationVerificationFailure))
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls12_signature(message, certificate, signed, &self.provider.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls13_signature(message, certificate, signed, &self.provider.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider.signature_verification_algorithms.supported_schemes()
    }
}
