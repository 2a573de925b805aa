//! Identity: which robot is at the other end, and what happens when it is a different one than before.

use r6_client::{
    Found, Identity, LostReason, NotSent, OperationMode, OutcomeUnknown, Pushed, RequestError, Robot,
};
use r6_proto::address::Address;
use r6_proto::message::Command;
use tokio::sync::broadcast::Receiver;

use crate::controller::{Controller, Peer, asked, command_word, impatient, settings, soon, values, verdict};

fn identity(name: &str) -> Identity {
    let (firmware, machine_name) = (Some("F5".to_owned()), Some(name.to_owned()));
    Identity { firmware, machine_name, axis_count: Some(6) }
}

/// Sends a command, and answers it.
async fn commanded(robot: &Robot, peer: &mut Peer) -> Result<(), RequestError> {
    let (sent, ()) = tokio::join!(robot.command(Command::ClearAlarm), async {
        let request = peer.frame().await;
        assert_eq!(command_word(&request), "clearAlarm");
        peer.send(verdict(&request, &["clearAlarm", "ok"])).await;
    });
    sent.map(|_| ())
}

/// Reads mode and alarm as a caller.
async fn looked(robot: &Robot, peer: &mut Peer) {
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
        let request = peer.frame().await;
        assert_eq!(asked(&request), ["curMode", "curAlarm"]);
        peer.send(values(&request, serde_json::json!(["7", "0"]))).await;
    });
    result.unwrap();
}

async fn lost(pushed: &mut Receiver<Pushed>) {
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(_)));
}

async fn reconnected(pushed: &mut Receiver<Pushed>) -> Found {
    match soon(pushed.recv()).await.unwrap() {
        Pushed::Reconnected(found) => found,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn who_is_there_is_read_once_before_the_first_command() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    assert_eq!(robot.identity(), None);
    let (sent, ()) = tokio::join!(robot.command(Command::ClearAlarm), async {
        peer.introduces().await;
        let request = peer.any_frame().await;
        peer.send(verdict(&request, &["clearAlarm", "ok"])).await;
    });
    sent.unwrap();
    assert_eq!(robot.identity(), Some(identity("cell 4")));
    let (sent, request) = tokio::join!(biased; robot.clear_list(), async {
        let request = peer.any_frame().await;
        peer.send(verdict(&request, &["AddRCC", "ok"])).await;
        request
    });
    assert_eq!(request["reqType"], "AddRCC", "asked only once");
    sent.unwrap();
}

#[tokio::test]
async fn a_query_that_tells_who_is_there_saves_asking() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let who = [Address::AxisNum, Address::MachineName, Address::CurMode, Address::Version];
    let (result, ()) = tokio::join!(robot.query(&who), async {
        let request = peer.any_frame().await;
        peer.send(values(&request, serde_json::json!(["6", "cell 4", "7", "F5"]))).await;
    });
    result.unwrap();
    assert_eq!(robot.identity(), Some(identity("cell 4")));
    let (sent, ()) = tokio::join!(robot.command(Command::ClearAlarm), async {
        let request = peer.any_frame().await;
        assert_eq!(command_word(&request), "clearAlarm");
        peer.send(verdict(&request, &["clearAlarm", "ok"])).await;
    });
    sent.unwrap();
}

#[tokio::test]
async fn on_a_new_connection_who_is_there_is_asked_first_of_all() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    commanded(&robot, &mut peer).await.unwrap();
    drop(peer);
    lost(&mut pushed).await;
    let (result, mut peer) = tokio::join!(robot.query(&[Address::IsMoving]), async {
        let mut peer = controller.accept().await;
        let request = peer.any_frame().await;
        assert_eq!(asked(&request), ["version", "machineName", "axisNum", "curMode", "curAlarm"]);
        peer.send(values(&request, serde_json::json!(["F5", "cell 4", "6", "3", "42"]))).await;
        let request = peer.any_frame().await;
        assert_eq!(asked(&request), ["RemoteCmdLen"]);
        peer.send(values(&request, serde_json::json!(["5"]))).await;
        let request = peer.any_frame().await;
        assert_eq!(asked(&request), ["isMoving"]);
        peer.send(values(&request, serde_json::json!(["0"]))).await;
        peer
    });
    result.unwrap();
    let mode = Some(OperationMode::of_number(3));
    let identity = identity("cell 4");
    let found = Found { identity, another: false, mode, alarm: Some(42), list_length: Some(5) };
    assert_eq!(reconnected(&mut pushed).await, found);
    // The client itself has read mode and alarm. That does not mean that the caller has.
    assert_eq!(soon(robot.command(Command::StartButton)).await, Err(NotSent::StateNotRead.into()));
    looked(&robot, &mut peer).await;
    commanded(&robot, &mut peer).await.unwrap();
}

#[tokio::test]
async fn old_firmware_without_a_list_length_is_known_again() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    commanded(&robot, &mut peer).await.unwrap();
    drop(peer);
    lost(&mut pushed).await;
    let (result, ()) = tokio::join!(robot.query(&[Address::IsMoving]), async {
        let mut peer = controller.accept().await;
        // The first reply leaves out everything, as an odd reply may do. Then all values are sent one by one.
        let request = peer.any_frame().await;
        peer.send(values(&request, serde_json::json!([]))).await;
        for value in ["F5", "cell 4", "6", "7", "0"] {
            let request = peer.any_frame().await;
            assert_eq!(asked(&request).len(), 1);
            peer.send(values(&request, serde_json::json!([value]))).await;
        }
        let request = peer.any_frame().await;
        assert_eq!(asked(&request), ["RemoteCmdLen"]);
        peer.send(values(&request, serde_json::json!([]))).await;
        let request = peer.any_frame().await;
        peer.send(values(&request, serde_json::json!(["0"]))).await;
    });
    result.unwrap();
    let found = reconnected(&mut pushed).await;
    assert_eq!((found.another, found.alarm, found.list_length), (false, Some(0), None));
}

#[tokio::test]
async fn two_robots_swapped_on_one_address_do_not_get_each_others_commands() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    commanded(&robot, &mut peer).await.unwrap();
    drop(peer);
    lost(&mut pushed).await;
    let (result, mut peer) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
        let mut peer = controller.accept().await;
        peer.name = "cell 5";
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7", "0"]))).await;
        peer
    });
    // The client does not return the values of another robot as values of the first one.
    let error = result.unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. })), "{error}");
    assert!(reconnected(&mut pushed).await.another);

    let error = soon(robot.clear_list()).await.unwrap_err();
    let text = error.to_string();
    assert!(text.contains("`cell 5`") && text.contains("`cell 4`") && text.contains("accept"), "{text}");
    let RequestError::NotSent(NotSent::AnotherRobot { expected, found }) = error else { panic!("{error:?}") };
    assert_eq!((*expected, &*found), (identity("cell 4"), &identity("cell 5")));
    // Reading again does not make it the right robot. It is not stopped either.
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7", "0"]))).await;
    });
    assert!(result.is_err(), "{result:?}");
    assert!(matches!(
        soon(robot.command(Command::ClearAlarm)).await,
        Err(RequestError::NotSent(NotSent::AnotherRobot { .. }))
    ));
    let stopped = soon(robot.command(Command::ActionStop)).await;
    assert!(matches!(stopped, Err(RequestError::NotSent(NotSent::AnotherRobot { .. }))), "{stopped:?}");

    robot.accept_identity(*found);
    commanded(&robot, &mut peer).await.unwrap();
    // Now the first robot is the stranger.
    drop(peer);
    lost(&mut pushed).await;
    let (result, _peer) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
        let mut peer = controller.accept().await;
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7", "0"]))).await;
        peer
    });
    assert!(result.is_err(), "{result:?}");
    let refused = soon(robot.command(Command::ClearAlarm)).await;
    assert!(matches!(refused, Err(RequestError::NotSent(NotSent::AnotherRobot { .. }))), "{refused:?}");
}

/// Answers the identity queries with values that cannot be understood, except where `tells` has a value. Then
/// answers a read of mode and alarm.
async fn tells_only(peer: &mut Peer, tells: impl Fn(&str) -> Option<&'static str>) {
    loop {
        let request = peer.any_frame().await;
        let asked = asked(&request);
        let data = match asked.as_slice() {
            ["curMode", "curAlarm"] => serde_json::json!(["7", "0"]),
            ["curMode"] => serde_json::json!(["7"]),
            ["curAlarm" | "RemoteCmdLen"] => serde_json::json!(["0"]),
            // Two values for the single address that was requested, so that no value fits.
            [one] => tells(one).map_or(serde_json::json!(["?", "?"]), |value| serde_json::json!([value])),
            _ => serde_json::json!(["?"]),
        };
        let last = asked.len() == 2;
        peer.send(values(&request, data)).await;
        if last {
            return;
        }
    }
}

#[tokio::test]
async fn whoever_cannot_be_read_is_not_taken_for_who_was_there() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    commanded(&robot, &mut peer).await.unwrap();
    drop(peer);
    lost(&mut pushed).await;
    let (result, mut peer) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
        let mut peer = controller.accept().await;
        tells_only(&mut peer, |_| None).await;
        peer
    });
    result.unwrap();
    assert_eq!(reconnected(&mut pushed).await.identity, Identity::default());
    assert_eq!(robot.identity(), None);
    let error = soon(robot.command(Command::StartButton)).await.unwrap_err();
    assert_eq!(error, NotSent::StateNotRead.into());
    assert!(error.to_string().contains("who it is"), "{error}");
    // Once the robot identifies itself, it gets commands again.
    let who = [Address::Version, Address::MachineName, Address::AxisNum];
    let (result, ()) = tokio::join!(robot.query(&who), peer.introduces());
    result.unwrap();
    commanded(&robot, &mut peer).await.unwrap();
}

/// On the first connection the identity could not be read. A later query could read it.
#[tokio::test]
async fn whoever_says_who_he_is_after_the_first_question_failed_is_known_again() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    let (result, ()) =
        tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), tells_only(&mut peer, |_| None));
    result.unwrap();
    let who = [Address::Version, Address::MachineName, Address::AxisNum];
    let (result, ()) = tokio::join!(robot.query(&who), peer.introduces());
    result.unwrap();
    assert_eq!(robot.identity(), Some(identity("cell 4")));
    drop(peer);
    lost(&mut pushed).await;
    let (result, _peer) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let mut peer = controller.accept().await;
        peer.name = "cell 5";
        peer.introduces().await;
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7"]))).await;
        peer
    });
    assert!(
        matches!(result, Err(RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { .. }))),
        "{result:?}"
    );
}

#[tokio::test]
async fn where_only_the_name_can_be_read_the_same_one_proves_nothing_and_another_one_does() {
    for (name, another) in [("cell 4", false), ("cell 5", true)] {
        let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
        let mut pushed = robot.pushed();
        commanded(&robot, &mut peer).await.unwrap();
        drop(peer);
        lost(&mut pushed).await;
        let (result, mut peer) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
            let mut peer = controller.accept().await;
            tells_only(&mut peer, |asked| (asked == "machineName").then_some(name)).await;
            peer
        });
        assert_eq!(result.is_err(), another, "{result:?}");
        assert_eq!(reconnected(&mut pushed).await.another, another);
        if another {
            let refused = soon(robot.command(Command::ClearAlarm)).await;
            assert!(
                matches!(refused, Err(RequestError::NotSent(NotSent::AnotherRobot { .. }))),
                "{refused:?}"
            );
        } else {
            assert_eq!(robot.identity(), None);
            let refused = soon(robot.command(Command::ClearAlarm)).await;
            assert_eq!(refused, Err(NotSent::StateNotRead.into()));
            let who = [Address::Version, Address::MachineName, Address::AxisNum];
            let (result, ()) = tokio::join!(robot.query(&who), peer.introduces());
            result.unwrap();
            assert_eq!(robot.identity(), Some(identity("cell 4")));
            commanded(&robot, &mut peer).await.unwrap();
        }
    }
}

#[tokio::test]
async fn a_stop_does_not_wait_until_it_is_known_who_is_there() {
    let (controller, robot, peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    drop(peer);
    lost(&mut pushed).await;
    let (sent, ()) = tokio::join!(robot.command(Command::ActionStop), async {
        let mut peer = controller.accept().await;
        let request = peer.any_frame().await;
        assert_eq!(command_word(&request), "actionStop");
        peer.send(verdict(&request, &["actionStop", "ok"])).await;
        peer.introduces().await;
    });
    sent.unwrap();
}

#[tokio::test]
async fn whoever_takes_a_connection_and_says_nothing_is_given_up() {
    let (controller, robot, peer) = Controller::with_robot(impatient()).await;
    let mut pushed = robot.pushed();
    drop(peer);
    lost(&mut pushed).await;
    let (results, mut peer) = tokio::join!(
        async {
            tokio::join!(soon(robot.query(&[Address::CurMode])), soon(robot.query(&[Address::CurAlarm])))
        },
        controller.accept()
    );
    for result in [results.0, results.1] {
        let error = result.unwrap_err();
        let RequestError::NotSent(NotSent::Unidentified { reason, .. }) = &error else { panic!("{error:?}") };
        assert_eq!(*reason, LostReason::Unresponsive);
        assert!(error.to_string().contains("did not say who it is"), "{error}");
    }
    // The client asked twice for the identity, and sent nothing else.
    for _ in 0..2 {
        assert_eq!(asked(&peer.any_frame().await).len(), 5);
    }
    peer.ends().await;
}

#[tokio::test]
async fn a_command_that_waits_for_who_is_there_is_not_carried_over_to_the_next_connection() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (sent, ()) = tokio::join!(robot.command(Command::StartButton), async {
        peer.any_frame().await;
        drop(peer);
    });
    assert_eq!(sent, Err(NotSent::Disconnected.into()));
    let (result, ()) = tokio::join!(robot.query(&[Address::IsMoving]), async {
        let mut peer = controller.accept().await;
        let request = peer.frame().await;
        assert_eq!(asked(&request), ["isMoving"], "no start was kept");
        peer.send(values(&request, serde_json::json!(["0"]))).await;
    });
    result.unwrap();
}
