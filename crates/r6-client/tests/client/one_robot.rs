//! All values of a query belong to one robot, and knowledge of one connection is not used for the next.

use r6_client::{LostReason, OutcomeUnknown, Pushed, RequestError};
use r6_proto::address::Address;
use serde_json::json;

use crate::controller::{Controller, asked, settings, soon, values};

#[tokio::test]
async fn what_one_controller_lacks_is_not_told_of_the_next() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let wanted = [Address::CurMode, Address::RemoteCmdLen];
    let (result, ()) = tokio::join!(robot.query(&wanted), async {
        for data in [json!(["7"]), json!(["7"]), json!([])] {
            let request = peer.frame().await;
            peer.send(values(&request, data)).await;
        }
    });
    assert_eq!(result.unwrap().integer(Address::RemoteCmdLen), None);
    let mut pushed = robot.pushed();
    let (result, ()) = tokio::join!(robot.query(&wanted), async {
        let request = peer.frame().await;
        assert_eq!(asked(&request), ["curMode"], "the other one is known to be missing");
        drop(peer);
        let lost = soon(pushed.recv()).await.unwrap();
        assert!(!matches!(lost, Pushed::ConnectionLost(LostReason::ClosedHere)), "{lost:?}");
        let mut peer = controller.accept().await;
        let request = peer.frame().await;
        assert_eq!(asked(&request), ["curMode"]);
        peer.send(values(&request, json!(["7"]))).await;
        let request = peer.frame().await;
        assert_eq!(asked(&request), ["curMode", "RemoteCmdLen"], "all of it is asked for on this connection");
        peer.send(values(&request, json!(["7", "3"]))).await;
    });
    assert_eq!(result.unwrap().integer(Address::RemoteCmdLen), Some(3));
}

#[tokio::test]
async fn a_firmware_that_lacks_the_name_says_who_it_is_on_the_first_connection_too() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (result, ()) = tokio::join!(robot.query(&[Address::IsMoving]), async {
        let request = peer.any_frame().await;
        assert_eq!(asked(&request), ["version", "machineName", "axisNum"]);
        peer.send(values(&request, json!(["F5", "6"]))).await;
        loop {
            let request = peer.any_frame().await;
            let data = match asked(&request).as_slice() {
                ["version"] => json!(["F5"]),
                ["axisNum"] => json!(["6"]),
                ["machineName"] => json!([]),
                last => {
                    assert_eq!(last, ["isMoving"]);
                    return peer.send(values(&request, json!(["0"]))).await;
                }
            };
            peer.send(values(&request, data)).await;
        }
    });
    result.unwrap();
    let identity = robot.identity().unwrap();
    assert_eq!((identity.machine_name, identity.axis_count), (None, Some(6)));
}

#[tokio::test]
async fn who_said_who_he_is_right_before_the_connection_ended_is_meant() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let who = [Address::Version, Address::MachineName, Address::AxisNum];
    let (told, ()) = tokio::join!(robot.query(&who), async {
        peer.introduces().await;
        drop(peer);
    });
    assert_eq!(told.unwrap().text(Address::MachineName), Some("cell 4"));
    let (result, ()) = tokio::join!(robot.query(&[Address::IsMoving]), async {
        let mut peer = controller.accept().await;
        peer.name = "cell 5";
        let request = peer.frame().await;
        peer.send(values(&request, json!(["0"]))).await;
    });
    let error = result.unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. })), "{error}");
}
