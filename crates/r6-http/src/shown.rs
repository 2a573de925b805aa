//! The certificate that another server of r6 shows when it opens a connection: TLS on both sides.
//!
//! Such a server says in its first message that it speaks [`PROTOCOL`] (ALPN), and only then is asked for a
//! certificate. Browsers and scripts never say so: they would show a dialog, or fail. Whose certificate it is
//! does not matter here; the other side has proved that it has the key. Who may ask for what, the receiver of
//! the request decides by [`Shown`].

use std::fmt;
use std::sync::Arc;

use rustls::client::danger::HandshakeSignatureValid;
use rustls::crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::{CertificateDer, UnixTime};
use rustls::server::danger::{ClientCertVerified, ClientCertVerifier};
use rustls::{DigitallySignedStruct, DistinguishedName, Error, ServerConnection, SignatureScheme};

/// What a server of r6 says that it speaks when it connects to another one: HTTP/1.1, after both have shown
/// their certificates.
pub const PROTOCOL: &[u8] = b"r6-server";

/// The certificate that the peer of a connection has shown: an extension of each request of another server.
/// The peer has its key; no authority was asked, and its names and its end were not looked at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown(pub Arc<[u8]>);

/// The certificate that was shown in this handshake.
pub fn of(connection: &ServerConnection) -> Option<Shown> {
    let first = connection.peer_certificates()?.first()?;
    Some(Shown(first.as_ref().into()))
}

/// Asks for a certificate and takes every one whose key the peer has.
pub struct Any(pub Arc<CryptoProvider>);

impl fmt::Debug for Any {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Any")
    }
}

impl ClientCertVerifier for Any {
    fn root_hint_subjects(&self) -> &[DistinguishedName] {
        &[]
    }

    fn verify_client_cert(
        &self,
        _certificate: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _now: UnixTime,
    ) -> Result<ClientCertVerified, Error> {
        Ok(ClientCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls12_signature(message, certificate, signed, &self.0.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signed: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, Error> {
        verify_tls13_signature(message, certificate, signed, &self.0.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.0.signature_verification_algorithms.supported_schemes()
    }
}
