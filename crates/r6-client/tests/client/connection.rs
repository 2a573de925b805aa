//! How a connection begins, ends, and is reopened.

use std::io;
use std::time::Duration;

use r6_client::{
    Heartbeat, LostReason, NotSent, OutcomeUnknown, Pushed, Reconnect, RequestError, Robot, RobotSettings,
};
use r6_proto::address::Address;
use r6_proto::message::Command;
use tokio::net::TcpListener;

use crate::controller::{Controller, asked, command_word, impatient, settings, soon, values, verdict};

/// An address on which no program listens.
async fn nobody() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    listener.local_addr().unwrap().to_string()
}

#[tokio::test]
async fn a_refused_connection_sent_nothing() {
    let address = nobody().await;
    match soon(Robot::connect(&address, settings())).await.unwrap_err() {
        RequestError::NotSent(NotSent::Unreachable { address: tried, kind, .. }) => {
            assert_eq!(tried, address);
            assert_eq!(kind, io::ErrorKind::ConnectionRefused);
        }
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn dropping_the_last_clone_ends_the_connection_in_order() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let clone = robot.clone();
    drop(robot);
    let (result, ()) = tokio::join!(clone.query(&[Address::CurMode]), async {
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7"]))).await;
    });
    result.unwrap();
    drop(clone);
    peer.ends().await;
    // Unread data from the controller does not turn the end into a reset, which would break the second write.
    for _ in 0..2 {
        peer.send("{\"dsID\":\"www.hc-system.com.cam\",\"reqType\":\"photo\",\"camID\":0}").await;
    }
}

/// Whether the outcome is unknown because this side closed the connection.
fn was_closed_here(error: &RequestError) -> bool {
    let closed_here = LostReason::ClosedHere;
    matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { reason, .. }) if *reason == closed_here)
}

#[tokio::test]
async fn closing_ends_it_for_all_clones() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let clone = robot.clone();
    let (query, ()) = tokio::join!(biased; clone.query(&[Address::CurMode]), async {
        peer.frame().await;
        soon(robot.close()).await;
    });
    let lost = query.unwrap_err();
    assert!(was_closed_here(&lost), "{lost}");
    peer.ends().await;
    assert_eq!(clone.command(Command::ClearAlarm).await, Err(NotSent::Closed.into()));
}

#[tokio::test]
async fn a_query_is_asked_again_over_a_new_connection() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let first = peer.frame().await;
        drop(peer);
        let mut peer = controller.accept().await;
        let second = peer.frame().await;
        assert_eq!(asked(&second), asked(&first));
        assert_ne!(
            second["packID"], first["packID"],
            "a late reply to the first would be taken for the second's"
        );
        peer.send(values(&second, serde_json::json!(["7"]))).await;
    });
    assert_eq!(result.unwrap().integer(Address::CurMode), Some(7));
}

#[tokio::test]
async fn a_query_is_asked_again_only_once() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode]), async {
        peer.frame().await;
        drop(peer);
        let mut peer = controller.accept().await;
        peer.frame().await;
        drop(peer);
    });
    let error = result.unwrap_err();
    assert!(
        matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { .. })),
        "{error:?}"
    );
    assert!(error.may_send_again(), "it only reads");
}

#[tokio::test]
async fn a_list_is_never_sent_again_and_brings_no_connection_back() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    let (sent, ()) = tokio::join!(robot.clear_list(), async {
        peer.frame().await;
        drop(peer);
    });
    match sent.unwrap_err() {
        RequestError::OutcomeUnknown(OutcomeUnknown::ConnectionLost { request, .. }) => {
            assert_eq!(request.word, "AddRCC");
        }
        other => panic!("{other:?}"),
    }
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(_)));
    assert_eq!(soon(robot.clear_list()).await, Err(NotSent::Disconnected.into()));

    // The first frame on the new connection is the query that caused the reconnection.
    let (result, mut peer) = tokio::join!(robot.query(&[Address::CurMode]), async {
        let mut peer = controller.accept().await;
        let request = peer.frame().await;
        assert_eq!(asked(&request), ["curMode"]);
        peer.send(values(&request, serde_json::json!(["7"]))).await;
        peer
    });
    result.unwrap();
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::Reconnected(_)));

    // Mode and alarm were not read since.
    assert_eq!(soon(robot.clear_list()).await, Err(NotSent::StateNotRead.into()));
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMode, Address::CurAlarm]), async {
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["7", "0"]))).await;
    });
    result.unwrap();
    let (sent, ()) = tokio::join!(robot.clear_list(), async {
        let request = peer.frame().await;
        assert_eq!(request["reqType"], "AddRCC");
        peer.send(verdict(&request, &["AddRCC", "ok"])).await;
    });
    assert!(sent.is_ok());
}

#[tokio::test]
async fn one_failed_attempt_answers_everybody_who_waits() {
    let wait = Duration::from_secs(20);
    let reconnect = Reconnect { first_wait: wait, cap: wait, jitter_seed: Some(1) };
    let (controller, robot, peer) = Controller::with_robot(RobotSettings { reconnect, ..settings() }).await;
    let mut pushed = robot.pushed();
    drop((controller, peer));
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(_)));
    // From here on time passes only when nothing else is ready to run.
    tokio::time::pause();
    let begun = tokio::time::Instant::now();
    let queries = tokio::join!(robot.query(&[Address::CurMode]), robot.query(&[Address::CurAlarm]));
    for result in [queries.0, queries.1] {
        let error = result.unwrap_err();
        assert!(matches!(error, RequestError::NotSent(NotSent::Unreachable { .. })), "{error:?}");
    }
    let took = begun.elapsed();
    assert!(took >= wait / 2, "no backoff: {took:?}");
    assert!(took <= wait, "a second attempt for the second query: {took:?}");
}

#[tokio::test]
async fn a_new_connection_forgets_what_the_last_did_not_support() {
    let (controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let mut pushed = robot.pushed();
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMold]), async {
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!([]))).await;
        drop(peer);
    });
    assert_eq!(result.unwrap().text(Address::CurMold), None);
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(_)));
    let (result, ()) = tokio::join!(robot.query(&[Address::CurMold]), async {
        let mut peer = controller.accept().await;
        let request = peer.frame().await;
        peer.send(values(&request, serde_json::json!(["A1"]))).await;
    });
    assert_eq!(result.unwrap().text(Address::CurMold), Some("A1"));
}

#[tokio::test]
async fn replies_that_cannot_be_told_apart_end_the_connection() {
    let (controller, robot, mut peer) = Controller::with_robot(impatient()).await;
    let mut pushed = robot.pushed();
    // The client sees that the controller sends no packID. Then the controller leaves a command unanswered.
    let who = [Address::Version, Address::MachineName, Address::AxisNum];
    let (result, ()) = tokio::join!(robot.query(&who), async {
        peer.any_frame().await;
        peer.send("{\"reqType\":\"query\",\"queryData\":[\"F5\",\"cell 4\",\"6\"]}").await;
    });
    result.unwrap();
    let (sent, _) = tokio::join!(robot.command(Command::ClearAlarm), peer.frame());
    assert!(matches!(sent, Err(RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { .. }))), "{sent:?}");
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(LostReason::OutOfStep)));
    peer.ends().await;
    let (result, ()) = tokio::join!(robot.query(&[Address::CurAlarm]), async {
        let mut peer = controller.accept().await;
        for values in ["\"F5\",\"cell 4\",\"6\",\"7\",\"0\"", "\"0\"", "\"42\""] {
            peer.any_frame().await;
            peer.send(format!("{{\"reqType\":\"query\",\"queryData\":[{values}]}}")).await;
        }
    });
    assert_eq!(result.unwrap().integer(Address::CurAlarm), Some(42));
}

#[tokio::test]
async fn a_controller_that_never_answers_is_given_up() {
    let (_controller, robot, mut peer) = Controller::with_robot(impatient()).await;
    let mut pushed = robot.pushed();
    for _ in 0..3 {
        let error = soon(robot.query(&[Address::CurMode])).await.unwrap_err();
        assert!(matches!(error, RequestError::OutcomeUnknown(OutcomeUnknown::TimedOut { .. })), "{error:?}");
        assert!(error.may_send_again());
    }
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(LostReason::Unresponsive)));
    // The client asked twice for the identity. That alone would not have ended the connection.
    for _ in 0..2 {
        assert_eq!(asked(&peer.any_frame().await), ["version", "machineName", "axisNum"]);
    }
    for _ in 0..3 {
        assert_eq!(asked(&peer.any_frame().await), ["curMode"]);
    }
    peer.ends().await;
}

#[tokio::test]
async fn heartbeats_go_on_while_nothing_is_answered() {
    let settings =
        RobotSettings { heartbeat: Heartbeat::Managed { every: Duration::from_millis(100) }, ..settings() };
    let (_controller, robot, mut peer) = Controller::with_robot(settings).await;
    assert_eq!(peer.frame().await["reqType"], "heartbreak");
    let waiting: Vec<_> = (0..12)
        .map(|_| {
            let robot = robot.clone();
            tokio::spawn(async move { robot.command(Command::ClearAlarm).await })
        })
        .collect();
    let (mut beats, mut commands) = (0, 0);
    while beats < 3 {
        let frame = peer.frame().await;
        if frame["reqType"] == "heartbreak" {
            assert!(frame.get("packID").is_none(), "{frame}");
            beats += 1;
        } else {
            assert_eq!(command_word(&frame), "clearAlarm");
            commands += 1;
        }
    }
    assert!(commands <= 8, "{commands} unanswered requests at once");
    for task in waiting {
        task.abort();
    }
}

#[tokio::test]
async fn without_a_wish_no_heartbeat_is_sent() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    robot.close().await;
    peer.ends().await;
}

#[tokio::test]
async fn a_handle_and_its_futures_move_between_threads() {
    fn moves<T: Send + 'static>(_: &T) {}
    let (_controller, robot, _peer) = Controller::with_robot(settings()).await;
    let handle = robot.clone();
    moves(&handle);
    moves(&async move {
        handle.stop().await.ok();
        handle.status().await.ok();
        handle.wait_until_done(r6_client::WaitOptions::default()).await.ok();
        handle.firmware().await.ok();
        handle.close().await;
    });
}

#[tokio::test]
async fn a_stop_that_cannot_be_sent_says_first_that_the_arm_may_go_on() {
    let (controller, robot, peer) = Controller::with_robot(RobotSettings::default()).await;
    let mut pushed = robot.pushed();
    drop((controller, peer));
    assert!(matches!(soon(pushed.recv()).await.unwrap(), Pushed::ConnectionLost(_)));
    tokio::time::pause();
    let error = robot.stop().await.unwrap_err();
    let first = "the arm was NOT stopped: it may go on with what is in its list; use the emergency stop; nothing was sent: ";
    assert!(error.to_string().starts_with(first), "{error}");
    assert!(
        matches!(&error, RequestError::NotSent(NotSent::NotStopped(_))) && error.may_send_again(),
        "{error:?}"
    );
    robot.clone().close().await;
    let closed = robot.stop().await.unwrap_err();
    assert_eq!(closed, NotSent::NotStopped(Box::new(NotSent::Closed)).into());
}

#[tokio::test]
async fn after_a_disconnect_nothing_leaves_and_what_was_under_way_is_unknown() {
    let (_controller, robot, mut peer) = Controller::with_robot(settings()).await;
    let clone = robot.clone();
    let (query, ()) = tokio::join!(biased; clone.query(&[Address::CurMode]), async {
        // The reply to this never comes.
        peer.frame().await;
        robot.disconnect();
    });
    let lost = query.unwrap_err();
    assert!(was_closed_here(&lost), "{lost}");
    assert_eq!(robot.query(&[Address::CurMode]).await, Err(NotSent::Closed.into()));
    peer.ends().await;
}
