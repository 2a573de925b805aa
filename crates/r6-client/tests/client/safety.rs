//! What a motion may begin on, what it ends with, and what a stop may say of itself.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_client::units::{AxisPosition, Percent};
use r6_client::{Cause, FollowOptions, Motion, MotionError, RequestError, Robot, RunOptions};
use r6_proto::Command;
use r6_proto::address::Address;
use serde_json::Value;
use tokio::sync::watch;
use tokio::time::sleep;

use crate::controller::{Wires, asked, command_word, settings, soon, values, verdict};

/// The answer of a machine that is ready and stands at zero, with so much in its list; its yes to all else.
fn reply(request: &Value, list: usize) -> String {
    if request["reqType"] != "query" {
        let word = request["cmdData"][0].as_str().unwrap_or("AddRCC");
        return verdict(request, &[word, "ok"]);
    }
    let value = |name: &str| match name {
        "curMode" => "7".to_owned(),
        "origin" => "1".to_owned(),
        "axisNum" => "6".to_owned(),
        "RemoteCmdLen" => list.to_string(),
        _ => "0".to_owned(),
    };
    let data: Vec<Value> = asked(request).into_iter().map(|name| Value::from(value(name))).collect();
    values(request, data.into())
}

/// A motion of two steps, back to where the arm stands.
fn there_and_back() -> Motion {
    let fast = Percent::new(50.0).unwrap();
    let to = |motion: Motion, angle| motion.axis_move(AxisPosition::degrees([angle]), fast);
    to(to(Motion::new(), 5.0), 0.0)
}

async fn runs(robot: &Robot) -> MotionError {
    match robot.run(&there_and_back(), RunOptions::default()).await {
        Ok(handle) => handle.finished().await.unwrap_err(),
        Err(error) => error,
    }
}

async fn follows(robot: &Robot) -> MotionError {
    let (_target, targets) = watch::channel(AxisPosition::degrees([5.0]));
    robot.follow(targets, FollowOptions::default()).await.unwrap_err()
}

/// What a controller was told, and a stop that it keeps without an answer until it is let.
#[derive(Default)]
struct Kept {
    stop: Option<Value>,
    let_go: bool,
    told: Vec<String>,
}

#[tokio::test(start_paused = true)]
async fn no_motion_begins_while_a_stop_is_under_way_and_a_pause_in_it_is_no_stop() {
    for following in [false, true] {
        let (_wires, robot, peer) = Wires::with_robot(settings()).await;
        let kept = Arc::new(Mutex::new(Kept::default()));
        let playing = Arc::clone(&kept);
        tokio::spawn(peer.answer_all(move |request| {
            let mut kept = playing.lock().unwrap();
            if request["reqType"] != "query" {
                kept.told.push(request["cmdData"][0].as_str().unwrap_or("AddRCC").to_owned());
            }
            if command_word(request) == "actionStop" {
                kept.stop = Some(request.clone());
                return None;
            }
            let stopped = if kept.let_go { kept.stop.take() } else { None };
            let late = stopped.map_or(String::new(), |stop| reply(&stop, 0));
            let list = usize::from(kept.told.iter().any(|told| told == "AddRCC"));
            Some(late + &reply(request, list))
        }));
        let other = robot.clone();
        let stopping = tokio::spawn(async move { other.stop().await });
        sleep(Duration::from_millis(100)).await;
        let mover = robot.clone();
        let moving =
            tokio::spawn(async move { if following { follows(&mover).await } else { runs(&mover).await } });
        sleep(Duration::from_secs(1)).await;
        assert_eq!(kept.lock().unwrap().told, ["actionStop"], "following: {following}");
        kept.lock().unwrap().let_go = true;
        robot.query(&[Address::CurMold]).await.unwrap();
        assert!(soon(stopping).await.unwrap().unwrap().confirmed);
        sleep(Duration::from_secs(1)).await;
        assert_eq!(kept.lock().unwrap().told[..2], ["actionStop", "AddRCC"], "following: {following}");
        robot.command(Command::ActionPause).await.unwrap();
        let error = soon(moving).await.unwrap();
        assert_eq!((error.cause, error.stop), (Cause::StoppedHere, None), "following: {following}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_stop_that_left_is_not_said_to_be_unsent() {
    let (wires, robot, mut peer) = Wires::with_robot(settings()).await;
    let (result, ()) = tokio::join!(soon(robot.stop()), async {
        assert_eq!(command_word(&peer.any_frame().await), "actionStop");
        // Nobody listens from here on.
        drop((wires, peer));
    });
    let error = result.unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(_)), "{error}");
}
