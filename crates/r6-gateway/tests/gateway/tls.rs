//! HTTP with TLS.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use futures_util::StreamExt;
use r6_api::gateway::Role;
use r6_gateway::{Gateway, GatewaySettings, RobotConfig, TlsSettings};
use r6_sim::VirtualController;
use serde_json::Value;
use tempfile::TempDir;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;

use crate::support::{PASSWORD, PATIENCE, call, name, settings};

/// A gateway with TLS and one robot, `press`, and a token of a viewer.
async fn start(data: &Path, tls: TlsSettings, robot: &VirtualController) -> (Gateway, String) {
    let press = RobotConfig::new(name("press"), robot.address().to_string());
    let names = vec!["hall.example".to_owned()];
    let settings = GatewaySettings { tls, names, ..settings(data, vec![press]) };
    let gateway = Gateway::start(settings).await.unwrap();
    let token = r6_gateway::make_token(data, Role::Viewer, None, String::new()).unwrap().1;
    (gateway, token)
}

/// A connection to a gateway that is known as `host`, for a client that trusts these certificates.
async fn connect(
    gateway: SocketAddr,
    host: &'static str,
    trusted: &[u8],
) -> std::io::Result<TlsStream<TcpStream>> {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_slice(trusted).unwrap()).unwrap();
    let config = ClientConfig::builder().with_root_certificates(roots).with_no_client_auth();
    let stream = TcpStream::connect(gateway).await?;
    TlsConnector::from(Arc::new(config)).connect(ServerName::try_from(host).unwrap(), stream).await
}

/// One request: the status and the body.
async fn ask(
    mut stream: impl AsyncRead + AsyncWrite + Unpin,
    host: &str,
    origin: &str,
    token: &str,
) -> (u16, Value) {
    let head = format!(
        "GET /v1/robots HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nAuthorization: Bearer {token}\r\n\
         Connection: close\r\n\r\n"
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).await.unwrap();
    let status = reply.split(' ').nth(1).unwrap().parse().unwrap();
    (status, serde_json::from_str(reply.split_once("\r\n\r\n").unwrap().1).unwrap())
}

struct Made {
    gateway: Gateway,
    token: String,
    certificate: Vec<u8>,
    data: TempDir,
    _robot: VirtualController,
}

async fn made() -> Made {
    let data = tempfile::tempdir().unwrap();
    let robot = VirtualController::start().await.unwrap();
    let (gateway, token) = start(data.path(), TlsSettings::Made, &robot).await;
    let certificate = std::fs::read(gateway.certificate().unwrap().path()).unwrap();
    Made { gateway, token, certificate, data, _robot: robot }
}

#[tokio::test]
async fn a_client_that_trusts_the_certificate_is_served_under_its_names_only() {
    let made = made().await;
    let address = made.gateway.address();
    let stream = connect(address, "hall.example", &made.certificate).await.unwrap();
    let (status, robots) = ask(stream, "hall.example", "https://hall.example", &made.token).await;
    assert_eq!((status, &robots["robots"][0]["name"]), (200, &Value::from("press")));
    // A page that was loaded without TLS is not the gateway's own: anyone on the way could have written it.
    let stream = connect(address, "127.0.0.1", &made.certificate).await.unwrap();
    let (status, problem) = ask(stream, "127.0.0.1", "http://127.0.0.1", &made.token).await;
    assert_eq!((status, &problem["code"]), (403, &Value::from("foreign_origin")));
    let error = connect(address, "other.example", &made.certificate).await.unwrap_err();
    assert!(error.to_string().contains("not valid for name"), "{error}");
}

/// One request of a client that trusts the certificate: head and body.
async fn exchange(made: &Made, method: &str, path: &str, headers: &str, body: &str) -> String {
    exchange_with((made.gateway.address(), &made.certificate), method, path, headers, body).await.unwrap()
}

/// The same with the gateway that has this address and this certificate.
pub async fn exchange_with(
    (gateway, certificate): (SocketAddr, &[u8]),
    method: &str,
    path: &str,
    headers: &str,
    body: &str,
) -> std::io::Result<String> {
    let mut stream = connect(gateway, "localhost", certificate).await?;
    let head = format!(
        "{method} {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{headers}\
         Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    stream.write_all(head.as_bytes()).await.unwrap();
    let mut reply = String::new();
    stream.read_to_string(&mut reply).await.unwrap();
    Ok(reply)
}

/// Clients of people are not asked for a certificate, as the other tests here show.
#[tokio::test]
async fn who_says_to_be_a_gateway_has_to_show_a_certificate() {
    let made = made().await;
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_slice(&made.certificate).unwrap()).unwrap();
    let mut config = ClientConfig::builder().with_root_certificates(roots).with_no_client_auth();
    config.alpn_protocols = vec![b"http/1.1".to_vec(), b"r6-server".to_vec()];
    let stream = TcpStream::connect(made.gateway.address()).await.unwrap();
    let name = ServerName::try_from("localhost").unwrap();
    let connected = TlsConnector::from(Arc::new(config)).connect(name, stream).await;
    // With TLS 1.3 the client learns it with the first bytes that it reads.
    let read = async { connected?.read_u8().await };
    let error = read.await.unwrap_err();
    assert!(error.to_string().contains("CertificateRequired"), "{error}");
}

#[tokio::test]
async fn with_tls_the_cookie_has_a_name_that_only_this_host_can_set() {
    let made = made().await;
    let admin = r6_gateway::make_token(made.data.path(), Role::Admin, None, String::new()).unwrap().1;
    let bearer = format!("Authorization: Bearer {admin}\r\n");
    let wanted = format!("{{\"role\":\"viewer\",\"password\":\"{PASSWORD}\"}}");
    let user = exchange(&made, "PUT", "/v1/users/anna", &bearer, &wanted).await;
    assert!(user.starts_with("HTTP/1.1 201"), "{user}");
    let asked = format!("{{\"name\":\"anna\",\"password\":\"{PASSWORD}\"}}");
    let signed_in = exchange(&made, "POST", "/v1/session", "", &asked).await;
    let cookie = signed_in.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap();
    let (cookie, attributes) = cookie.split_once(';').unwrap();
    let named = format!("__Host-r6_session_{}=", made.gateway.address().port());
    assert!(cookie.starts_with(&named), "{cookie}");
    assert_eq!(attributes, " HttpOnly; SameSite=Strict; Path=/; Secure");
    let show = async |cookie: &str| {
        exchange(&made, "GET", "/v1/session", &format!("Cookie: {cookie}\r\n"), "").await
    };
    assert!(show(cookie).await.starts_with("HTTP/1.1 200"));
    let plain = show(cookie.strip_prefix("__Host-").unwrap()).await;
    assert!(plain.starts_with("HTTP/1.1 401"), "any page of this host could have set it: {plain}");
}

#[tokio::test]
async fn tokens_of_all_robots_see_when_the_certificate_ends() {
    let made = made().await;
    let metrics = async |token: &str| {
        exchange(&made, "GET", "/metrics", &format!("Authorization: Bearer {token}\r\n"), "").await
    };
    let name = "r6_gateway_certificate_expires_timestamp_seconds ";
    let of_all = metrics(&made.token).await;
    let end: i64 = of_all.lines().find_map(|line| line.strip_prefix(name)).unwrap().parse().unwrap();
    assert_eq!(end, made.gateway.certificate().unwrap().expires());
    let press = Some(crate::support::name("press").into());
    let of_one = r6_gateway::make_token(made.data.path(), Role::Viewer, press, String::new()).unwrap().1;
    let of_one = metrics(&of_one).await;
    assert!(of_one.contains("r6_gateway_robot_up") && !of_one.contains(name), "{of_one}");
}

#[tokio::test]
async fn a_stream_over_a_web_socket_has_tls_too() {
    let made = made().await;
    let stream = connect(made.gateway.address(), "localhost", &made.certificate).await.unwrap();
    let mut request = "wss://localhost/v1/live".into_client_request().unwrap();
    let bearer = format!("Bearer {}", made.token).parse().unwrap();
    request.headers_mut().insert("authorization", bearer);
    let (mut socket, _) = tokio_tungstenite::client_async(request, stream).await.unwrap();
    let first = tokio::time::timeout(PATIENCE, socket.next()).await.unwrap().unwrap().unwrap();
    let message: Value = serde_json::from_str(first.to_text().unwrap()).unwrap();
    assert_eq!((&message["type"], &message["name"]), (&"snapshot".into(), &"press".into()));
}

#[tokio::test]
async fn a_request_without_tls_is_told_so_and_its_token_opens_nothing() {
    let made = made().await;
    let (status, problem) = call(made.gateway.address(), &made.token, "GET", "/v1/robots", None).await;
    assert_eq!((status, &problem["code"]), (400, &Value::from("needs_tls")), "{problem}");
    assert!(problem["message"].as_str().unwrap().contains("https"));
}

#[tokio::test]
async fn a_peer_that_does_not_end_its_handshake_is_closed_and_delays_no_other() {
    let made = made().await;
    let address = made.gateway.address();
    let begun = Instant::now();
    let mut silent = TcpStream::connect(address).await.unwrap();
    let mut half = TcpStream::connect(address).await.unwrap();
    half.write_all(&[22, 3, 1, 2, 0, 1]).await.unwrap();
    let mut wrong = TcpStream::connect(address).await.unwrap();
    wrong.write_all(&[22; 600]).await.unwrap();
    let stream = connect(address, "localhost", &made.certificate).await.unwrap();
    assert_eq!(ask(stream, "localhost", "https://localhost", &made.token).await.0, 200);
    assert!(begun.elapsed() < Duration::from_secs(4));
    for (peer, closes_at_once) in [(&mut wrong, true), (&mut half, false), (&mut silent, false)] {
        let mut rest = Vec::new();
        let read = tokio::time::timeout(PATIENCE, peer.read_to_end(&mut rest)).await;
        assert!(read.is_ok(), "the gateway closes it");
        assert_eq!(begun.elapsed() < Duration::from_secs(4), closes_at_once, "{:?}", begun.elapsed());
    }
}

#[tokio::test]
async fn another_certificate_is_used_once_its_files_change() {
    let data = tempfile::tempdir().unwrap();
    let robot = VirtualController::start().await.unwrap();
    let pair = |folder: &TempDir| -> (PathBuf, PathBuf) {
        let tls = folder.path().join("tls");
        (tls.join("certificate.pem"), tls.join("key.pem"))
    };
    // Two certificates that gateways have made.
    let (first, second) = (made().await.data, made().await.data);
    let ((certificate, key), (next, next_key)) = (pair(&first), pair(&second));
    let tls = TlsSettings::Files { certificate: certificate.clone(), key: key.clone() };
    let (gateway, token) = start(data.path(), tls, &robot).await;
    let old = std::fs::read(&certificate).unwrap();
    connect(gateway.address(), "localhost", &old).await.unwrap();

    // Half of a change cannot be used: the old one goes on.
    std::fs::copy(&next, &certificate).unwrap();
    tokio::time::sleep(Duration::from_secs(3)).await;
    connect(gateway.address(), "localhost", &old).await.unwrap();
    std::fs::copy(&next_key, &key).unwrap();
    let new = std::fs::read(&next).unwrap();
    let begun = Instant::now();
    while connect(gateway.address(), "localhost", &new).await.is_err() {
        assert!(begun.elapsed() < PATIENCE, "the new certificate is used");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    connect(gateway.address(), "localhost", &old).await.unwrap_err();
    let stream = connect(gateway.address(), "localhost", &new).await.unwrap();
    assert_eq!(ask(stream, "localhost", "https://localhost", &token).await.0, 200);
}
