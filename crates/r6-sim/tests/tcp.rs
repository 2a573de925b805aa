//! Virtual controllers over real sockets.

use std::io::ErrorKind;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use r6_controller::Profile;
use r6_sim::{SimError, SimSettings, Simulation};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

const QUERY: &[u8] =
    br#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","packID":"0","queryAddr":["version","curMold"]}"#;
const REPLY: &str = r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["version","curMold"],"queryData":["HC-QC-RX-7.8.07-master-F5.2.1"],"reqType":"query"}"#;

/// Long enough for a loaded machine; a reply takes well under a millisecond.
const PATIENCE: Duration = Duration::from_secs(20);

async fn start(settings: SimSettings) -> Simulation {
    Simulation::start(settings).await.unwrap()
}

async fn connect(simulation: &Simulation) -> TcpStream {
    TcpStream::connect(simulation.controllers()[0].address()).await.unwrap()
}

/// Reads exactly as many bytes as `expected` has.
async fn read(stream: &mut TcpStream, expected: &str) -> String {
    let mut bytes = vec![0; expected.len()];
    tokio::time::timeout(PATIENCE, stream.read_exact(&mut bytes)).await.unwrap().unwrap();
    String::from_utf8(bytes).unwrap()
}

#[tokio::test]
async fn a_query_is_answered_byte_for_byte() {
    let simulation = start(SimSettings::default()).await;
    let mut stream = connect(&simulation).await;
    stream.write_all(QUERY).await.unwrap();
    assert_eq!(read(&mut stream, REPLY).await, REPLY);
    simulation.shutdown().await.unwrap();
    // Nothing came after the closing brace.
    assert_eq!(stream.read(&mut [0; 16]).await.unwrap_or(0), 0);
}

#[tokio::test]
async fn pieces_and_bursts_are_answered_alike() {
    let simulation = start(SimSettings::default()).await;
    let mut stream = connect(&simulation).await;
    stream.set_nodelay(true).unwrap();
    for byte in QUERY {
        stream.write_all(&[*byte]).await.unwrap();
    }
    assert_eq!(read(&mut stream, REPLY).await, REPLY);
    stream.write_all(&QUERY.repeat(50)).await.unwrap();
    for _ in 0..50 {
        assert_eq!(read(&mut stream, REPLY).await, REPLY);
    }
}

#[tokio::test]
async fn a_peer_that_has_closed_its_half_still_gets_its_acknowledgement() {
    let simulation = start(SimSettings::default()).await;
    let mut stream = connect(&simulation).await;
    stream.write_all(br#"{"reqType":"AddRCC","emptyList":"1","instructions":[]}"#).await.unwrap();
    stream.shutdown().await.unwrap();
    let mut reply = String::new();
    tokio::time::timeout(PATIENCE, stream.read_to_string(&mut reply)).await.unwrap().unwrap();
    assert_eq!(
        reply,
        r#"{"cmdReply":["AddRCC","ok"],"dsID":"www.hc-system.com.HCRemoteCommand","reqType":"AddRCC"}"#
    );
}

#[tokio::test]
async fn an_oversized_add_rcc_resets_only_its_own_connection() {
    let simulation = start(SimSettings::default()).await;
    let mut other = connect(&simulation).await;
    let mut stream = connect(&simulation).await;
    let frame =
        format!(r#"{{"reqType":"AddRCC","emptyList":"1","spare":"{}","instructions":[]}}"#, "x".repeat(5000));
    stream.write_all(frame.as_bytes()).await.unwrap();
    let end = tokio::time::timeout(PATIENCE, stream.read(&mut [0; 16])).await.unwrap();
    assert_eq!(end.unwrap_err().kind(), ErrorKind::ConnectionReset);
    other.write_all(QUERY).await.unwrap();
    assert_eq!(read(&mut other, REPLY).await, REPLY);
}

#[tokio::test]
async fn a_pushed_photo_arrives_without_being_asked_for() {
    let simulation = start(SimSettings::default()).await;
    let mut stream = connect(&simulation).await;
    // An answered query shows that the connection is being served.
    stream.write_all(QUERY).await.unwrap();
    read(&mut stream, REPLY).await;
    simulation.controllers()[0].request_photo(2);
    let photo = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":2}"#;
    assert_eq!(read(&mut stream, photo).await, photo);
}

#[tokio::test]
async fn a_connection_beyond_the_limit_is_accepted_and_never_answered() {
    let profile = Profile::from_toml("max_connections = 1").unwrap();
    let simulation = start(SimSettings { profile, ..SimSettings::default() }).await;
    let mut first = connect(&simulation).await;
    first.write_all(QUERY).await.unwrap();
    read(&mut first, REPLY).await;
    let mut second = connect(&simulation).await;
    second.write_all(QUERY).await.unwrap();
    // A frame for the second one would come before the answer to a later query on the first.
    for _ in 0..20 {
        first.write_all(QUERY).await.unwrap();
        read(&mut first, REPLY).await;
    }
    let mut buffer = [0; 16];
    assert_eq!(second.try_read(&mut buffer).map_err(|error| error.kind()), Err(ErrorKind::WouldBlock));
    assert_eq!(simulation.controllers()[0].snapshot().connections, 1);
}

#[tokio::test]
async fn two_hundred_controllers_each_have_their_own_port_and_state() {
    let simulation = start(SimSettings { count: 200, ..SimSettings::default() }).await;
    let mut ports: Vec<u16> = simulation.controllers().iter().map(|one| one.address().port()).collect();
    ports.sort_unstable();
    ports.dedup();
    assert_eq!(ports.len(), 200);
    for (n, controller) in simulation.controllers().iter().enumerate() {
        let mut stream = TcpStream::connect(controller.address()).await.unwrap();
        let write = format!(r#"{{"reqType":"command","cmdData":["rewriteData","800","{n}","0"]}}"#);
        stream.write_all(write.as_bytes()).await.unwrap();
        let ok = r#"{"cmdReply":["rewriteData","ok"],"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command"}"#;
        assert_eq!(read(&mut stream, ok).await, ok);
    }
    for (n, controller) in simulation.controllers().iter().enumerate() {
        let mut stream = TcpStream::connect(controller.address()).await.unwrap();
        stream.write_all(br#"{"reqType":"query","queryAddr":["Addr-800"]}"#).await.unwrap();
        let value = format!(
            r#"{{"dsID":"www.hc-system.com.RemoteMonitor","queryAddr":["Addr-800"],"queryData":["{n}"],"reqType":"query"}}"#
        );
        assert_eq!(read(&mut stream, &value).await, value);
    }
    simulation.shutdown().await.unwrap();
}

/// A port that is free on every loopback address, and that the system gives to no other program while this
/// lives. The socket is bound everywhere but does not listen, so others can bind only by that number.
fn reserved_port() -> (socket2::Socket, u16) {
    let socket = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::STREAM, None).unwrap();
    socket.set_reuse_address(true).unwrap();
    socket.bind(&SocketAddr::from(([0, 0, 0, 0], 0)).into()).unwrap();
    let port = socket.local_addr().unwrap().as_socket_ipv4().unwrap().port();
    (socket, port)
}

/// Writes a register of the controller at this address.
async fn write_800(address: SocketAddr, value: u8) {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let write = format!(r#"{{"reqType":"command","cmdData":["rewriteData","800","{value}","0"]}}"#);
    stream.write_all(write.as_bytes()).await.unwrap();
    let ok =
        r#"{"cmdReply":["rewriteData","ok"],"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command"}"#;
    assert_eq!(read(&mut stream, ok).await, ok);
}

async fn assert_800(address: SocketAddr, value: u8) {
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(br#"{"reqType":"query","queryAddr":["Addr-800"]}"#).await.unwrap();
    let reply = format!(
        r#"{{"dsID":"www.hc-system.com.RemoteMonitor","queryAddr":["Addr-800"],"queryData":["{value}"],"reqType":"query"}}"#
    );
    assert_eq!(read(&mut stream, &reply).await, reply, "{address}");
}

#[tokio::test]
async fn each_loopback_address_has_a_controller_of_its_own_on_one_port() {
    let (_reserved, port) = reserved_port();
    let listen: Vec<SocketAddr> = (2..=5).map(|host| SocketAddr::from(([127, 0, 0, host], port))).collect();
    let simulation = start(SimSettings { listen: listen.clone(), ..SimSettings::default() }).await;
    let addresses: Vec<_> = simulation.controllers().iter().map(|one| one.address()).collect();
    assert_eq!(addresses, listen);
    for (address, value) in listen.iter().zip(2..) {
        write_800(*address, value).await;
    }
    for (address, value) in listen.iter().zip(2..) {
        assert_800(*address, value).await;
    }
    assert!(TcpStream::connect((Ipv4Addr::LOCALHOST, port)).await.is_err(), "it was not asked for");
}

#[tokio::test]
async fn one_controller_listens_on_every_address_of_the_machine() {
    let (_reserved, port) = reserved_port();
    let listen = vec![SocketAddr::from(([0, 0, 0, 0], port))];
    let simulation = start(SimSettings { listen, ..SimSettings::default() }).await;
    assert_eq!(simulation.controllers().len(), 1);
    write_800(SocketAddr::from(([127, 0, 0, 1], port)), 9).await;
    for host in [[127, 0, 0, 1], [127, 0, 0, 2], [127, 3, 2, 1]] {
        assert_800(SocketAddr::from((host, port)), 9).await;
    }
}

#[tokio::test]
async fn what_cannot_be_started_says_why() {
    let taken = start(SimSettings::default()).await;
    let listen = vec![taken.controllers()[0].address()];
    let error = Simulation::start(SimSettings { listen, ..SimSettings::default() }).await.unwrap_err();
    assert!(matches!(&error, SimError::Listen { .. }));
    assert!(error.to_string().contains("is taken by another program"), "{error}");
    let error = Simulation::start(SimSettings { count: 0, ..SimSettings::default() }).await.unwrap_err();
    assert!(matches!(error, SimError::BadCount { controllers: 0 }));
    let listen = vec!["127.0.0.1:65530".parse().unwrap()];
    let error =
        Simulation::start(SimSettings { listen, count: 10, ..SimSettings::default() }).await.unwrap_err();
    assert!(matches!(error, SimError::NoSuchPort { count: 10, .. }));
}

#[tokio::test]
async fn a_dropped_simulation_stops_listening() {
    let simulation = start(SimSettings::default()).await;
    let address = simulation.controllers()[0].address();
    let mut stream = TcpStream::connect(address).await.unwrap();
    drop(simulation);
    let ended = tokio::time::timeout(PATIENCE, stream.read(&mut [0; 16])).await.unwrap();
    assert!(matches!(ended, Ok(0) | Err(_)));
    assert!(TcpStream::connect(address).await.is_err());
}
