//! Events on the client's side of a connection are reported as data.

use r6_client::{Event, LostReason, NotSent, OutcomeUnknown, Pushed, RequestError};
use r6_proto::Language;
use r6_proto::address::Address;
use serde_json::json;
use tokio::sync::broadcast::error::RecvError;

use crate::controller::{Controller, SHORT, asked, impatient, soon, values};

#[tokio::test]
async fn a_lost_connection_and_another_robot_are_told() {
    let (controller, robot, mut peer) = Controller::with_robot(impatient()).await;
    let (mut events, mut pushed) = (robot.events(), robot.pushed());
    let (read, ()) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
        let request = peer.frame().await;
        peer.send(values(&request, json!(["7", "0"]))).await;
    });
    read.unwrap();
    // The peer does not answer.
    let error = robot.query(&[Address::CurMode]).await.unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { .. })), "{error}");
    assert_eq!(soon(events.recv()).await, Ok(Event::NoReply { request: "query", after: SHORT }));

    drop(peer);
    // A frame is still unread, so the system may report a reset.
    let Event::ConnectionEnded { reason } = soon(events.recv()).await.unwrap() else { panic!("no end") };
    assert!(matches!(reason, LostReason::ClosedByPeer | LostReason::Io(_)), "{reason}");
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(_)));

    let (read, peer) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let mut peer = controller.accept().await;
        peer.name = "cell 5";
        let request = peer.frame().await;
        assert_eq!(asked(&request), ["curMode"]);
        peer.send(values(&request, json!(["7"]))).await;
        peer
    });
    read.unwrap_err();
    assert_eq!(soon(events.recv()).await, Ok(Event::ConnectedAnew));
    let another = soon(events.recv()).await.unwrap();
    let Event::AnotherRobot { found } = &another else { panic!("{another:?}") };
    assert_eq!(found.machine_name.as_deref(), Some("cell 5"));
    assert!(another.is_warning());
    assert!(another.text(Language::English).contains("cell 5"), "{another}");
    assert!(another.text(Language::Chinese).contains("cell 5"), "{another}");

    // No program listens there any more.
    drop((controller, peer));
    let ended = soon(events.recv()).await.unwrap();
    assert!(matches!(ended, Event::ConnectionEnded { .. }), "{ended:?}");
    soon(robot.query(&[Address::CurMode])).await.unwrap_err();
    let none = soon(events.recv()).await.unwrap();
    let Event::NotConnected { error } = &none else { panic!("{none:?}") };
    assert!(matches!(error, NotSent::Unreachable { .. }), "{error:?}");

    soon(robot.clone().close()).await;
    assert_eq!(soon(events.recv()).await, Err(RecvError::Closed));
    assert_eq!(soon(robot.events().recv()).await, Err(RecvError::Closed), "there is nothing to come");
}
