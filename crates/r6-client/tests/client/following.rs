//! Following a target over a busy link.

use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{FollowOptions, Robot, TargetSender};
use r6_proto::address::Address;
use serde_json::Value;
use tokio::time::{sleep, timeout};

use crate::controller::{Peer, Wires, asked, settings, values};

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
