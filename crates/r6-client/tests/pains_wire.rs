//! Problems of people who program these controllers, each with its number in docs/PAINS.md, and the solution.
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

#[allow(dead_code, reason = "it has more than these tests need")]
#[path = "client/controller.rs"]
mod controller;
#[allow(dead_code, unused_imports, unused_macros, reason = "it has more than these tests need")]
#[path = "hands/hands.rs"]
mod hands;

use std::time::Duration;

use r6_client::{
    Address, AxisIndex, Command, Keep, Listen, NoReading, Pushed, Reading, RegisterIndex, Robot,
    RobotSettings, WaitError, WaitOptions, discover,
};
use r6_controller::{Profile, Scenario};
use r6_sim::{Builder, Camera, VirtualController};
use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::controller::{Controller, Peer, asked, settings, soon, values};
use crate::hands::{on_every_hand, spawn};

on_every_hand! { in Real:
    pain_02_frames_in_pieces_and_frames_between_replies,
    pain_03_a_short_reply_is_not_taken_for_another,
    pain_06_one_connection_is_shared_and_closed,
    pain_09_an_alarm_is_told_in_words_with_its_axis,
    pain_11_the_simulator_answers_as_captured,
    pain_12_a_register_is_written_and_read_back,
    pain_16_any_text_is_read_and_only_clean_text_is_sent,
}

async fn cell(builder: Builder) -> (VirtualController, Robot) {
    let controller = builder.start().await.unwrap();
    let address = controller.address().to_string();
    let robot = hands::connect(&address, RobotSettings::default()).await.unwrap();
    (controller, robot)
}

/// A robot on a controller that the test plays, and the controller's end of its connection.
async fn with_robot() -> (Controller, Robot, Peer) {
    let controller = Controller::listen().await;
    let robot = hands::connect(&controller.address(), settings()).await.unwrap();
    let peer = controller.accept().await;
    (controller, robot, peer)
}

/// Reads what a bare socket gets: the bytes of one reply, and any bytes that come with it.
async fn raw(controller: &VirtualController, request: &str) -> String {
    let mut socket = TcpStream::connect(controller.address()).await.unwrap();
    socket.write_all(request.as_bytes()).await.unwrap();
    let mut bytes = vec![0; 4096];
    let read = soon(socket.read(&mut bytes)).await.unwrap();
    bytes.truncate(read);
    String::from_utf8(bytes).unwrap()
}

async fn pain_02_frames_in_pieces_and_frames_between_replies() {
    // One byte at a time, several frames in one segment, photo requests in between.
    let pieces = "[[fault]]\nfault = \"pieces\"\nbytes = 1\nfrom = 0\nfor = 600";
    let builder = VirtualController::builder().scenario(Scenario::read(pieces).unwrap());
    let (controller, robot) = cell(builder).await;
    let mut pushed = robot.pushed();
    robot.query(&[Address::CurMode]).await.unwrap();
    let asking: Vec<_> = (0..8)
        .map(|n| {
            let (robot, axis) = (robot.clone(), Address::Axis(AxisIndex::ALL[n]));
            spawn(async move { robot.query(&[axis, Address::CurMode]).await.unwrap() })
        })
        .collect();
    controller.handle().request_photo(3);
    for (n, task) in asking.into_iter().enumerate() {
        let read = soon(task).await.unwrap();
        assert_eq!(read.rows()[0].0, Address::Axis(AxisIndex::ALL[n]));
        assert_eq!(read.integer(Address::CurMode), Some(7));
    }
    let event = soon(pushed.recv()).await.unwrap();
    assert!(matches!(event, Pushed::Photo { cam_id: 3 }), "{event:?}");
    // Two replies and a photo in one segment, and a brace within a string.
    let (_controller, robot, mut peer) = with_robot().await;
    let (mode, name) = (robot.query(&[Address::CurMode]), robot.query(&[Address::MachineName]));
    let (mode, name, ()) = tokio::join!(mode, name, async {
        let (first, second) = (peer.frame().await, peer.frame().await);
        let [first, second] = [first, second].map(|request| {
            let data = if asked(&request) == ["curMode"] { json!(["7"]) } else { json!(["cell } 4"]) };
            values(&request, data)
        });
        let photo = "{\"dsID\":\"www.hc-system.com.cam\",\"reqType\":\"photo\",\"camID\":0}";
        peer.send(format!("{first}\r\n{photo}{second}\0")).await;
    });
    assert_eq!(mode.unwrap().integer(Address::CurMode), Some(7));
    assert_eq!(name.unwrap().text(Address::MachineName), Some("cell } 4"));
}

async fn pain_03_a_short_reply_is_not_taken_for_another() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    // A script that zips the two lists takes the position of J1 for the program's name, and the mode for J1.
    let request = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"query","queryAddr":["curMold","axis-0","counter-3","curMode"]}"#;
    let reply = raw(&controller, request).await;
    assert!(reply.contains(r#""queryData":["0.000000","7"]"#), "{reply}");
    let addresses = ["curMold", "axis-0", "counter-3", "curMode"].map(|name| name.parse().unwrap());
    let read = robot.query(&addresses).await.unwrap();
    let rows: Vec<_> = read.rows().iter().map(|(_, value)| value.clone()).collect();
    assert_eq!(rows[0], Err(NoReading::Unsupported));
    assert_eq!(rows[1], Ok(Reading::Decimal(0.0)));
    assert_eq!(rows[2], Err(NoReading::Unsupported));
    assert_eq!(rows[3], Ok(Reading::Integer(7)));
}

async fn pain_06_one_connection_is_shared_and_closed() {
    let profile = Profile::from_toml("max_connections = 1").unwrap();
    let (controller, robot) = cell(VirtualController::builder().profile(profile)).await;
    let asking: Vec<_> = (0..64)
        .map(|_| {
            let robot = robot.clone();
            spawn(async move { robot.query(&[Address::CurMode]).await.unwrap() })
        })
        .collect();
    for task in asking {
        assert_eq!(soon(task).await.unwrap().integer(Address::CurMode), Some(7));
    }
    assert_eq!(controller.handle().snapshot().connections, 1, "64 tasks, one connection");
    // The controller has no room for a second connection. Closing the first one in order makes room.
    let impatient = RobotSettings { reply_timeout: Duration::from_millis(200), ..RobotSettings::default() };
    let address = controller.address().to_string();
    let second = hands::connect(&address, impatient.clone()).await;
    let answered = match second {
        Ok(second) => second.status().await.is_ok(),
        Err(_) => false,
    };
    assert!(!answered);
    robot.close().await;
    let next = soon(async {
        loop {
            let next = hands::connect(&address, impatient.clone()).await;
            if let Ok(next) = next
                && next.status().await.is_ok()
            {
                return next;
            }
        }
    });
    assert!(next.await.status().await.unwrap().is_ready());
}

async fn pain_09_an_alarm_is_told_in_words_with_its_axis() {
    let (_controller, robot) = cell(VirtualController::builder()).await;
    let beyond =
        r6_client::units::AxisPosition::none().with(AxisIndex::ALL[5], r6_client::units::Degrees(350.0));
    let motion = r6_client::Motion::new().axis_move(beyond, r6_client::units::Percent::MAX);
    robot.add_rcc(true, motion.instructions().unwrap().to_vec()).await.unwrap();
    let error = robot.wait_until_done(WaitOptions::default()).await.unwrap_err();
    assert_eq!(error, WaitError::AlarmRaised { code: 135 });
    let text = error.to_string();
    assert!(text.contains("135") && text.contains("J6") && text.contains("soft limit"), "{text}");
    let unmet = robot.status().await.unwrap().unmet();
    assert!(unmet.iter().any(|unmet| unmet.to_string().contains("J6")), "{unmet:?}");
}

async fn pain_11_the_simulator_answers_as_captured() {
    let controller = VirtualController::start().await.unwrap();
    // Captured from a real controller (unit C), except for the version: keys in its order, and no byte after
    // the brace.
    let request = r#"{"dsID": "www.hc-system.com.RemoteMonitor", "reqType": "query", "packID": "0", "queryAddr": ["version","curMold"]}"#;
    let wanted = r#"{"dsID":"www.hc-system.com.RemoteMonitor","packID":"0","queryAddr":["version","curMold"],"queryData":["HC-QC-RX-7.8.07-master-F5.2.1"],"reqType":"query"}"#;
    assert_eq!(raw(&controller, request).await, wanted);
}

async fn pain_12_a_register_is_written_and_read_back() {
    let (controller, robot) = cell(VirtualController::builder()).await;
    // Captured: text with commas is answered with ok, without regard to its effect.
    let request = r#"{"dsID":"www.hc-system.com.RemoteMonitor","reqType":"command","packID":"1000","cmdData":["rewriteData","800","-456,754,826,179,0,-89","0"]}"#;
    assert!(raw(&controller, request).await.contains(r#""cmdReply":["rewriteData","ok"]"#));
    let first = RegisterIndex::new(800).unwrap();
    let values = [10.5, -20.001, 0.0].map(|degrees| r6_client::to_thousandths(degrees).unwrap());
    robot.write_registers(first, &values, Keep::UntilPowerCut).await.unwrap();
    let read = robot.read_registers(first, 3).await.unwrap();
    assert_eq!(read, [10_500, -20_001, 0]);
    assert!(RegisterIndex::new(799).is_none() && RegisterIndex::new(901).is_none());
    let last = RegisterIndex::new(900).unwrap();
    assert!(robot.write_registers(last, &values, Keep::UntilPowerCut).await.is_err(), "beyond the last");
}

/// On tokio only, because the other drivers neither discover controllers nor listen for them.
#[tokio::test]
async fn pain_15_any_port_found_by_asking_and_either_side_dials() {
    let (one, other) = (VirtualController::start().await.unwrap(), VirtualController::start().await.unwrap());
    let nobody = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let addresses = [one.address(), nobody.local_addr().unwrap(), other.address()].map(|at| at.to_string());
    drop(nobody);
    let found = discover(&addresses.each_ref().map(String::as_str), &RobotSettings::default()).await;
    assert_eq!(
        found.iter().map(|found| &found.address).collect::<Vec<_>>(),
        addresses.iter().collect::<Vec<_>>()
    );
    assert_eq!(found[0].who.as_ref().unwrap().axis_count, Some(6));
    assert!(found[1].who.is_err() && found[2].who.is_ok());
    // The controller is the client.
    let listen = Listen::on("127.0.0.1:0").await.unwrap();
    let camera = Camera { cam_id: None, address: listen.address().unwrap() };
    let dials = VirtualController::builder().camera(camera).start().await.unwrap();
    let robot = Robot::connect_with(listen, RobotSettings::default()).await.unwrap();
    assert!(robot.status().await.unwrap().is_ready());
    robot.command(Command::ModifyGspd { percent: 30.0 }).await.unwrap();
    assert_eq!(dials.handle().snapshot().global_speed_percent, 30.0);
    let mut pushed = robot.pushed();
    dials.handle().request_photo(0);
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::Photo { cam_id: 0 }));
}

async fn pain_16_any_text_is_read_and_only_clean_text_is_sent() {
    let (_controller, robot, mut peer) = with_robot().await;
    // GBK text, numbers for addresses that are documented as texts, and a counter in the form of old
    // firmware.
    let addresses = ["machineName", "curMode", "counter-0"].map(|name| name.parse().unwrap());
    let (read, ()) = tokio::join!(robot.query(&addresses), gbk(&mut peer));
    let read = read.unwrap();
    assert_eq!(read.text(Address::MachineName), Some("\u{534e}\u{6210}"));
    assert_eq!(read.integer(Address::CurMode), Some(7));
    let counter = read.reading(Address::Counter(0));
    assert!(matches!(counter, Some(Reading::Counter(counter)) if counter.current == 12), "{counter:?}");
    // The client sends JSON strings. Each number has a decimal point and never a comma.
    let (result, ()) = tokio::join!(robot.command(Command::ModifyGspd { percent: 12.5 }), async {
        let request = peer.frame().await;
        assert_eq!(request["cmdData"], json!(["modifyGSPD", "125"]));
        peer.send(controller::verdict(&request, &["modifyGSPD", "ok"])).await;
    });
    result.unwrap();
}

/// Answers a query for name, mode and counter like a firmware that writes GBK.
async fn gbk(peer: &mut Peer) {
    let request = peer.frame().await;
    let reply = values(&request, json!(["NAME", 7, "COUNTER"]));
    let mut bytes = reply.into_bytes();
    let mut put = |word: &[u8], instead: &[u8]| {
        let at = bytes.windows(word.len()).position(|window| window == word).unwrap();
        bytes.splice(at..at + word.len(), instead.iter().copied());
    };
    put(b"NAME", b"\xbb\xaa\xb3\xc9");
    put(b"COUNTER", b"\xbc\xc6[0][T:50][C:12]");
    peer.send(bytes).await;
}
