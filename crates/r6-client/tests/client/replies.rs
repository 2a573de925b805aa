//! Replies in every form and order that controllers send.

use r6_client::{Pushed, RequestError};
use r6_proto::address::Address;
use r6_proto::axis::AxisIndex;
use r6_proto::client::StrayReason;
use r6_proto::dialect::DsIdForm;
use r6_proto::message::{Command, TypeKey};

use crate::controller::{Controller, asked, command_word, settings, soon, values, verdict};

const J1: Address = Address::Axis(AxisIndex::ALL[0]);

#[tokio::test]
async fn a_reply_may_come_byte_by_byte() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (result, ()) = tokio::join!(robot.query(&[Address::Version, J1]), async {
        let request = peer.frame().await;
        peer.dribble(values(&request, serde_json::json!(["HC-QC-RX-7.8.07-master-F5", "12.500000"]))).await;
    });
    let result = result.unwrap();
    assert_eq!(result.text(Address::Version), Some("HC-QC-RX-7.8.07-master-F5"));
    assert_eq!(result.decimal(J1), Some(12.5));
}

#[tokio::test]
async fn two_replies_may_come_in_one_segment() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (first, second, ()) =
        tokio::join!(robot.query(&[Address::CurMode]), robot.query(&[Address::CurAlarm]), async {
            let (one, two) = (peer.frame().await, peer.frame().await);
            let answer = |request| {
                let value = if asked(request) == ["curMode"] { "7" } else { "135" };
                values(request, serde_json::json!([value]))
            };
            peer.send(answer(&one) + "\r\n" + &answer(&two)).await;
        });
    assert_eq!(first.unwrap().integer(Address::CurMode), Some(7));
    assert_eq!(second.unwrap().integer(Address::CurAlarm), Some(135));
}

#[tokio::test]
async fn a_photo_request_may_come_in_between() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        // Captured, unit D.
        peer.send("{\"dsID\":\"www.hc-system.com.cam\",\"reqType\":\"photo\",\"camID\":3}").await;
        peer.send(values(&request, serde_json::json!(["2"]))).await;
    });
    assert_eq!(result.unwrap().integer(Address::CurMode), Some(2));
    assert!(matches!(soon(pushed.recv()).await, Ok(Pushed::Photo { cam_id: 3 })));
}

#[tokio::test]
async fn replies_may_come_out_of_order() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (list, mode, ()) = tokio::join!(biased; robot.clear_list(), robot.query(&[Address::CurMode]), async {
        let (list, query) = (peer.frame().await, peer.frame().await);
        assert_eq!((list["reqType"].as_str(), query["reqType"].as_str()), (Some("AddRCC"), Some("query")));
        assert_eq!((list["emptyList"].as_str(), &list["instructions"]), (Some("1"), &serde_json::json!([])));
        peer.send(values(&query, serde_json::json!(["7"]))).await;
        peer.send(verdict(&list, &["AddRCC", "ok"])).await;
    });
    assert_eq!(mode.unwrap().integer(Address::CurMode), Some(7));
    assert!(list.is_ok());
}

#[tokio::test]
async fn old_firmware_answers_without_names_and_numbers() {
    let settings =
        r6_client::RobotSettings { type_key: TypeKey::CmdType, ds_id: DsIdForm::Short, ..settings() };
    let (_controller, robot, mut peer) = Controller::with_robot(settings).await;
    let (who, ()) =
        tokio::join!(robot.query(&[Address::Version, Address::MachineName, Address::AxisNum]), async {
            peer.any_frame().await;
            let reply = "{'dsID':'HCRemoteMonitor','cmdType':'queryEcho','queryData':['E1','cell 4','6']}";
            peer.send(reply.replace('\'', "\"")).await;
        });
    assert_eq!(who.unwrap().text(Address::MachineName), Some("cell 4"));
    let (result, stored, ()) = tokio::join!(biased; robot.query(&[J1, Address::Counter(0)]), robot.command(Command::ClearAlarm), async {
        // One request at a time: if a reply is lost, the next one must not be taken for it.
        let query = peer.frame().await;
        assert_eq!(query["cmdType"], "query");
        assert_eq!(query["dsID"], "HCRemoteMonitor");
        // The form of unit E.
        let reply = "{'dsID':'HCRemoteMonitor','cmdType':'queryEcho','queryData':['-90','x[0][T:20][C:7]']}";
        peer.send(reply.replace('\'', "\"")).await;
        assert_eq!(command_word(&peer.frame().await), "clearAlarm");
        peer.send("{'dsID':'HCRemoteMonitor','cmdType':'cmdEcho','cmdReply':['ok']}".replace('\'', "\"")).await;
    });
    let result = result.unwrap();
    assert_eq!(result.decimal(J1), Some(-90.0));
    assert_eq!(result.rows()[1].1.as_ref().unwrap().to_string(), "7 of 20 (counter 0)");
    assert!(stored.is_ok());
    let learned = robot.learned();
    assert_eq!(learned.echoes_pack_id, Some(false));
    assert_eq!(learned.echoes_query_addr, Some(false));
    assert_eq!(learned.names_command, Some(false));
    assert_eq!(learned.echo_types, Some(true));
}

#[tokio::test]
async fn what_answers_nothing_is_told_and_does_no_harm() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        let mut other = request.clone();
        other["packID"] = "4711".into();
        peer.send(values(&other, serde_json::json!(["3"]))).await;
        peer.send("}}garbage ").await;
        peer.send("{\"reqType\":nonsense}").await;
        peer.send(values(&request, serde_json::json!(["7"]))).await;
    });
    assert_eq!(result.unwrap().integer(Address::CurMode), Some(7));
    match soon(pushed.recv()).await.unwrap() {
        Pushed::Stray { reason, frame } => {
            assert_eq!(reason, StrayReason::UnknownPackId);
            assert!(String::from_utf8_lossy(&frame).contains("4711"));
        }
        other => panic!("{other:?}"),
    }
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::BadFrame(_)));
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::NotJson(_)));
}

#[tokio::test]
async fn points_are_counted_and_a_photo_answer_only_leaves() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    robot.answer_photo(r6_proto::message::PhotoAnswer { cam_id: 0, ret: 1 }).await.unwrap();
    let answer = peer.frame().await;
    assert_eq!((&answer["reqType"], &answer["ret"]), (&"photo".into(), &1.into()));
    let sets = vec![r6_client::CameraSet { cam_id: 0, points: vec![r6_proto::message::Point::default(); 2] }];
    let (accepted, ()) = tokio::join!(robot.add_points(sets), async {
        let request = peer.frame().await;
        peer.send(verdict(&request, &["AddPoints", "2"])).await;
    });
    assert_eq!(accepted.unwrap().points, Some(2));
}

#[tokio::test]
async fn a_value_of_the_wrong_kind_is_told_for_its_address_alone() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode, J1]), async {
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7", "n/a"]))).await;
    });
    let result: Result<_, RequestError> = result;
    let result = result.unwrap();
    assert_eq!(result.integer(Address::CurMode), Some(7));
    assert_eq!(result.decimal(J1), None);
    let error = result.rows()[1].1.as_ref().unwrap_err().to_string();
    assert_eq!(error, "`axis-0` is \"n/a\", but has to be a finite number");
}
