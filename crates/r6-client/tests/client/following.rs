//! Following a target over a busy link.

use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{Cause, FollowOptions, Robot, TargetSender};
use r6_proto::address::Address;
use serde_json::Value;
use tokio::time::{Instant, sleep, timeout};

use crate::controller::{Peer, Wires, asked, settings, values, verdict};

/// The reply of a machine that is ready and stands.
fn reply(request: &Value) -> String {
    let value = |name: &str| match name {
        "curMode" => "7",
        "origin" => "1",
        "axisNum" => "6",
        _ => "0",
    };
    values(
        request,
        asked(request).into_iter().map(|name| Value::from(value(name))).collect::<Vec<_>>().into(),
    )
}

/// Answers until the state has been requested this often. Returns the last request unanswered.
async fn until_looked(peer: &mut Peer, times: usize) -> Value {
    let mut looks = 0;
    loop {
        let request = peer.any_frame().await;
        assert_eq!(request["reqType"], "query", "nothing is sent: {request}");
        looks += usize::from(asked(&request).contains(&"isMoving"));
        if looks == times {
            return request;
        }
        peer.send(reply(&request)).await;
    }
}

/// Eight queries of another caller: one more than the link has room for beside the read that waits for its
/// reply.
fn crowd(robot: &Robot) {
    for _ in 0..8 {
        let robot = robot.clone();
        tokio::spawn(async move { robot.query(&[Address::CurMold]).await });
    }
}

#[tokio::test(start_paused = true)]
async fn a_step_does_not_leave_once_its_target_is_old() {
    let (_wires, robot, mut peer) = Wires::with_robot(settings()).await;
    let fresh = Duration::from_millis(200);
    let options = FollowOptions { fresh_within: fresh, ..FollowOptions::default() };
    let (target, targets) = TargetSender::new();
    target.send(AxisPosition::degrees([5.0]));
    let playing = async {
        // The first read comes before it begins; the second leads to the step.
        let look = until_looked(&mut peer, 2).await;
        crowd(&robot);
        let mut crowd = Vec::new();
        while crowd.len() < 7 {
            crowd.push(peer.any_frame().await);
        }
        // The eighth query waits for this reply, and the step waits behind the query.
        peer.send(reply(&look)).await;
        crowd.push(peer.any_frame().await);
        sleep(fresh * 2).await;
        for request in crowd {
            peer.send(reply(&request)).await;
        }
        let look = until_looked(&mut peer, 1).await;
        drop(target);
        peer.send(reply(&look)).await;
    };
    let following = async { tokio::join!(robot.follow(targets, options), playing).0 };
    let followed = timeout(Duration::from_secs(60), following).await.expect("it never ends").unwrap();
    assert_eq!(followed.steps, 0);
}

/// The reply of the same machine, but whether it moves cannot be read.
fn odd_reply(request: &Value) -> String {
    let value = |name: &str| if name == "isMoving" { "perhaps" } else { "7" };
    let data: Vec<_> = asked(request).into_iter().map(|name| Value::from(value(name))).collect();
    values(request, data.into())
}

/// One odd reply says nothing about the arm, but an arm that cannot be seen is not followed blindly.
#[tokio::test(start_paused = true)]
async fn the_third_look_in_a_row_that_tells_nothing_ends_it_and_a_good_one_between_begins_anew() {
    let (_wires, robot, mut peer) = Wires::with_robot(settings()).await;
    // No target comes, so nothing is sent but looks.
    let (_target, targets) = TargetSender::new();
    let playing = async {
        // The first look comes before it begins.
        for is_odd in [false, true, true, false, true, true, true] {
            let look = until_looked(&mut peer, 1).await;
            peer.send(if is_odd { odd_reply(&look) } else { reply(&look) }).await;
        }
        until_looked(&mut peer, 1).await;
    };
    let following = robot.follow(targets, FollowOptions::default());
    let error = tokio::select! {
        followed = following => followed.unwrap_err(),
        () = playing => panic!("it looks once more"),
    };
    assert!(matches!(error.cause, Cause::Unreadable(_)), "{error}");
    assert!(error.to_string().contains("isMoving"), "{error}");
}

#[tokio::test(start_paused = true)]
async fn an_arm_that_does_not_begin_a_step_is_told_once_its_time_to_start_is_over() {
    let (_wires, robot, peer) = Wires::with_robot(settings()).await;
    let (accepted, told) = tokio::sync::oneshot::channel();
    let mut accepted = Some(accepted);
    tokio::spawn(peer.answer_all(move |request| {
        if request["reqType"] == "query" {
            return Some(reply(request));
        }
        accepted.take().expect("one step").send(Instant::now()).unwrap();
        Some(verdict(request, &["AddRCC", "ok"]))
    }));
    let start_within = Duration::from_secs(3);
    let options = FollowOptions { start_within, stop_on_failure: false, ..FollowOptions::default() };
    let (target, targets) = TargetSender::new();
    target.send(AxisPosition::degrees([5.0]));
    let error = timeout(Duration::from_secs(60), robot.follow(targets, options)).await.unwrap().unwrap_err();
    let Cause::Elsewhere(missed) = &error.cause else { panic!("{error}") };
    assert_eq!((missed.wanted, missed.found), (5.0, Some(0.0)));
    let waited = told.await.unwrap().elapsed();
    assert!(waited >= start_within && waited < start_within * 2, "{waited:?}");
    drop(target);
}
