//! Robots that are in client mode: they connect to the gateway.

use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use r6_gateway::{Database, Gateway, GatewaySettings, RobotConfig};
use r6_motion::RobotModel;
use r6_sim::{Camera, VirtualController};
use serde_json::json;
use tokio::io::AsyncReadExt;
use tokio::net::{TcpListener, TcpSocket, TcpStream};

use crate::support::{Hall, PATIENCE, name, settings, signal};

/// A port of this machine that nothing listens on. The address is that of this process alone, so that no
/// other test takes the port meanwhile.
async fn free() -> SocketAddr {
    let [high, low] = u16::try_from(std::process::id() % 60_000).unwrap().to_be_bytes();
    let listener = TcpListener::bind((Ipv4Addr::new(127, 100, high, low), 0)).await.unwrap();
    listener.local_addr().unwrap()
}

fn config(called: &str, listen: SocketAddr, from: &str) -> RobotConfig {
    let period = Duration::from_millis(20);
    RobotConfig { period, ..RobotConfig::new(name(called), format!("listen:{listen},from:{from}")) }
}

/// A controller in client mode: it connects to this address, again and again.
async fn client_mode(model: &str, address: SocketAddr) -> VirtualController {
    let model = RobotModel::named(model).unwrap().clone();
    let camera = Camera { cam_id: None, address };
    VirtualController::builder().model(model).camera(camera).start().await.unwrap()
}

/// A hall with one robot, `press`, that connects to the gateway.
async fn hall(listen: SocketAddr) -> Hall {
    let data = tempfile::tempdir().unwrap();
    let hall = Hall::at(data, vec![config("press", listen, "127.0.0.1")], Vec::new()).await;
    let robot = client_mode("BRTIRUS0707A", listen).await;
    let hall = Hall { robots: vec![robot], ..hall };
    hall.until_up("press").await;
    hall
}

#[tokio::test]
async fn a_robot_that_connects_to_the_gateway_is_commanded_and_stopped() {
    let listen = free().await;
    let hall = hall(listen).await;
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!(state["address"], format!("listen:{listen},from:127.0.0.1"));
    assert_eq!(signal(&state, "curMode")["quality"], "fresh");
    let lease = hall.lease(&hall.operator, "press").await;
    let (status, done) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!(status, 200, "{done}");
    let (status, stopped) = hall.stop(&hall.engineer, "press").await;
    assert_eq!((status, &stopped["confirmed"]), (200, &json!(true)), "{stopped}");
    let (status, problem) = hall.command(&hall.operator, "press", &lease, "startButton").await;
    assert_eq!((status, &problem["code"]), (409, &json!("stopped")));
}

#[tokio::test]
async fn a_robot_that_connects_again_is_looked_at_anew_and_another_robot_is_noticed() {
    let listen = free().await;
    let mut hall = hall(listen).await;
    let lease = hall.lease(&hall.operator, "press").await;
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    let state = hall.until("press", |state| state["link"] == "down").await;
    assert_eq!(signal(&state, "curMode")["quality"], "stale");
    let (status, problem) = hall.command(&hall.operator, "press", &lease, "modifyGSPD 5").await;
    assert_eq!((status, &problem["code"]), (409, &json!("not_ready")));

    let same = client_mode("BRTIRUS0707A", listen).await;
    hall.until_up("press").await;
    same.shutdown().await.unwrap();
    hall.until("press", |state| state["link"] == "down").await;
    let _other = client_mode("BRTIRUS1510A", listen).await;
    let state = hall.until("press", |state| !state["identity_changed"].is_null()).await;
    assert_eq!(state["identity_changed"]["found"]["machine_name"], "r6 virtual BRTIRUS1510A");
    let (status, problem) = hall.post(&hall.operator, "/v1/robots/press/lease", &json!({})).await;
    assert_eq!((status, &problem["code"]), (409, &json!("identity_changed")));
}

/// Connects from this address of the machine.
async fn from(address: Ipv4Addr, to: SocketAddr) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((address, 0).into()).unwrap();
    socket.connect(to).await.unwrap()
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_connection_from_another_address_is_not_taken_for_the_robot() {
    let listen = free().await;
    let data = tempfile::tempdir().unwrap();
    let mut hall = Hall::at(data, vec![config("press", listen, "127.0.0.1")], Vec::new()).await;
    let mut stranger = loop {
        // The gateway may not listen yet.
        match TcpStream::connect(listen).await {
            Ok(_) => break from(Ipv4Addr::new(127, 0, 0, 9), listen).await,
            Err(_) => tokio::time::sleep(Duration::from_millis(10)).await,
        }
    };
    let closed = tokio::time::timeout(PATIENCE, stranger.read(&mut [0; 64])).await.unwrap();
    assert!(matches!(closed, Ok(0) | Err(_)), "{closed:?}: it is asked nothing");
    let state = hall.get(&hall.viewer, "/v1/robots/press").await;
    assert_eq!((&state["link"], &state["identity"]), (&json!("down"), &json!(null)));
    hall.robots.push(client_mode("BRTIRUS0707A", listen).await);
    hall.until_up("press").await;
}

#[tokio::test]
async fn an_admin_adds_and_removes_a_robot_that_connects() {
    let listen = free().await;
    let hall = Hall::start().await;
    let put = async |robot: &str, address: String| {
        let path = format!("/v1/robots/{robot}");
        hall.call(&hall.admin, "PUT", &path, Some(&json!({ "address": address }))).await
    };
    let (status, problem) = put("saw", format!("listen:{listen}")).await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    assert!(problem["message"].as_str().unwrap().contains("from which address"), "{problem}");
    assert_eq!(put("saw", format!("listen:{listen},from:127.0.0.1")).await.0, 201);
    let robot = client_mode("BRTIRUS0707A", listen).await;
    hall.until_up("saw").await;
    let (status, problem) = put("mill", format!("listen:{listen},from:127.0.0.2")).await;
    assert_eq!((status, &problem["code"]), (409, &json!("address_taken")), "one port is for one robot");

    let (status, problem) = hall.call(&hall.admin, "DELETE", "/v1/robots/saw", None).await;
    assert_eq!(status, 204, "{problem}");
    // The port is free again, for another robot.
    assert_eq!(put("mill", format!("listen:{listen},from:127.0.0.1")).await.0, 201);
    let state = hall.until_up("mill").await;
    assert_eq!(state["identity"]["machine_name"], "r6 virtual BRTIRUS0707A");
    drop(robot);
}

#[tokio::test]
async fn a_port_that_is_taken_is_waited_for() {
    let listen = free().await;
    let taken = TcpListener::bind(listen).await.unwrap();
    let data = tempfile::tempdir().unwrap();
    let mut hall = Hall::at(data, vec![config("press", listen, "127.0.0.1")], Vec::new()).await;
    hall.robots.push(client_mode("BRTIRUS0707A", listen).await);
    // It is connected to the other program.
    let (_stream, _) = taken.accept().await.unwrap();
    assert_eq!(hall.get(&hall.viewer, "/v1/robots/press").await["link"], "down");
    drop((taken, _stream));
    hall.until_up("press").await;
}

#[tokio::test]
async fn gateways_that_share_a_store_refuse_a_robot_that_only_one_of_them_can_have() {
    let data = tempfile::tempdir().unwrap();
    let robots = vec![config("press", free().await, "127.0.0.1")];
    let store = Some(Database::parse("postgres://r6@127.0.0.1:1/r6").unwrap());
    let refused = Gateway::start(GatewaySettings { store, ..settings(data.path(), robots) }).await;
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("robot `press`") && refused.contains("server mode"), "{refused}");
    assert_eq!(std::fs::read_dir(data.path()).unwrap().count(), 0, "nothing was begun");
}
