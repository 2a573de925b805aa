//! The conditions to begin a motion, how a motion ends, and what a stop may claim.

use std::pin::pin;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_client::units::{AxisPosition, Degrees, Millimetres, Percent, Pose};
use r6_client::{
    Cause, Envelope, FollowOptions, Heartbeat, Motion, MotionError, NotSent, RequestError, Robot,
    RobotSettings, RunOptions, TargetSender,
};
use r6_proto::Command;
use r6_proto::address::Address;
use serde_json::Value;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep};

use crate::controller::{Peer, Wires, asked, command_word, settings, soon, values, verdict};
use crate::driving::begun;

/// The reply of a machine that is ready and stands at zero, with this many instructions in its list. It
/// accepts everything else.
fn reply(request: &Value, list: usize) -> String {
    reply_at(request, list, "0")
}

/// The same reply with J1 at another position.
fn reply_at(request: &Value, list: usize, j1: &str) -> String {
    if request["reqType"] != "query" {
        let word = request["cmdData"][0].as_str().unwrap_or("AddRCC");
        return verdict(request, &[word, "ok"]);
    }
    let value = |name: &str| match name {
        "curMode" => "7".to_owned(),
        "origin" => "1".to_owned(),
        // As on a reconnection.
        "version" => "F5".to_owned(),
        "machineName" => "cell 4".to_owned(),
        "axisNum" => "6".to_owned(),
        "RemoteCmdLen" => list.to_string(),
        "axis-0" => j1.to_owned(),
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
    let (target, targets) = TargetSender::new();
    let source = async {
        loop {
            target.send(AxisPosition::degrees([5.0]));
            sleep(Duration::from_millis(50)).await;
        }
    };
    tokio::select! {
        result = robot.follow(targets, FollowOptions::default()) => result.unwrap_err(),
        () = source => unreachable!("it goes on"),
    }
}

/// A call that is slow to take its reply, while another call drives the connection.
#[tokio::test(start_paused = true)]
async fn a_call_that_was_slow_looks_again_before_its_list_leaves() {
    let slow_for = Duration::from_secs(10);
    for guarded in [false, true] {
        let settings = RobotSettings {
            reply_timeout: Duration::from_secs(2),
            heartbeat: Heartbeat::Managed { every: Duration::from_secs(1) },
            ..settings()
        };
        let (_wires, robot, peer) = Wires::with_robot(settings).await;
        let told = Arc::new(Mutex::new(Vec::new()));
        let (telling, started) = (Arc::clone(&told), Instant::now());
        tokio::spawn(peer.answer_all(move |request| {
            let what = request["reqType"].as_str().unwrap_or_default().to_owned();
            telling.lock().unwrap().push((started.elapsed(), what));
            Some(reply(request, 0))
        }));
        let path = there_and_back();
        let robot = robot.with_guard(Envelope::new().largest_axis_step(Degrees(30.0)));
        let mut kept = pin!(async {
            if guarded {
                robot.add_motion(true, &path).await.map(drop).unwrap();
            } else {
                robot.run(&path, RunOptions::default()).await.map(drop).unwrap();
            }
        });
        assert!(begun(kept.as_mut()).await);
        sleep(slow_for).await;
        soon(kept).await;
        sleep(Duration::from_secs(1)).await;
        let told = told.lock().unwrap();
        let list = told.iter().position(|(_, what)| what == "AddRCC").expect("it leaves");
        let look = told[..list].iter().rfind(|(_, what)| what == "query").expect("it looks");
        assert!(told[list].0 >= slow_for && told[list].0 - look.0 <= Duration::from_secs(1), "{told:?}");
    }
}

/// The requests that a controller received, and a stop that it keeps unanswered until it is released.
#[derive(Default)]
struct Kept {
    stop: Option<Value>,
    let_go: bool,
    told: Vec<String>,
}

#[tokio::test(start_paused = true)]
async fn no_motion_begins_while_a_stop_is_under_way_and_a_pause_in_it_is_no_stop() {
    for following in [false, true] {
        // Its peer is in mode 7 all the time.
        let settings = RobotSettings { stays_in_mode_7: true, ..settings() };
        let (_wires, robot, peer) = Wires::with_robot(settings).await;
        let kept = Arc::new(Mutex::new(Kept::default()));
        let playing = Arc::clone(&kept);
        tokio::spawn(peer.answer_all(move |request| {
            let mut kept = playing.lock().unwrap();
            let clears = request["reqType"] == "AddRCC" && request["instructions"] == serde_json::json!([]);
            if request["reqType"] != "query" && !clears {
                kept.told.push(request["cmdData"][0].as_str().unwrap_or("AddRCC").to_owned());
            }
            if !command_word(request).is_empty() && !kept.let_go {
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
        let told = kept.lock().unwrap().told.clone();
        assert!(told.iter().all(|told| told != "AddRCC"), "following: {following}: {told:?}");
        kept.lock().unwrap().let_go = true;
        robot.query(&[Address::CurMold]).await.unwrap();
        assert!(soon(stopping).await.unwrap().unwrap().confirmed);
        sleep(Duration::from_secs(1)).await;
        assert!(kept.lock().unwrap().told.contains(&"AddRCC".to_owned()), "following: {following}");
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
        // The peer is gone from here on.
        drop((wires, peer));
    });
    let error = result.unwrap_err();
    assert!(matches!(error, RequestError::OutcomeUnknown(_)), "{error}");
}

/// Answers partial reads of the state. Returns the first complete read unanswered.
async fn until_looked(peer: &mut Peer, list: usize) -> Value {
    loop {
        let request = peer.any_frame().await;
        if asked(&request).contains(&"isMoving") {
            return request;
        }
        peer.send(reply(&request, list)).await;
    }
}

/// Nine other callers that query the state of the machine: one more than the link has room for.
fn crowd(robot: &Robot) {
    for _ in 0..9 {
        let robot = robot.clone();
        tokio::spawn(async move { robot.query(&[Address::CurMode, Address::CurAlarm]).await });
    }
}

#[tokio::test(start_paused = true)]
async fn a_list_that_was_judged_on_one_connection_does_not_leave_on_another() {
    for clears in [false, true] {
        let (mut wires, robot, mut peer) = Wires::with_robot(settings()).await;
        // A controller that has not answered yet gets one request at a time.
        let known = robot.clone();
        let known = tokio::spawn(async move { known.query(&[Address::CurMold]).await });
        for _ in 0..2 {
            let request = peer.any_frame().await;
            peer.send(reply(&request, 0)).await;
        }
        soon(known).await.unwrap().unwrap();
        // A list is left over if the test clears one.
        let list = usize::from(clears);
        let mover = robot.clone();
        let sending = tokio::spawn(async move {
            if clears {
                let options = RunOptions { clear_leftover: true, ..RunOptions::default() };
                let error = mover.run(&there_and_back(), options).await.unwrap_err();
                match error.cause {
                    Cause::NotCleared(error) => error,
                    other => panic!("{other}"),
                }
            } else {
                let box_of = [-900.0, 900.0].map(|at| [at; 3].map(Millimetres));
                let guarded = mover.with_guard(Envelope::new().workspace(box_of[0], box_of[1]));
                let slow = Percent::new(5.0).unwrap();
                let motion = Motion::new().linear_move(Pose::position([1.0; 3].map(Millimetres)), slow);
                guarded.add_rcc(true, motion.instructions().unwrap().to_vec()).await.unwrap_err()
            }
        });
        let look = until_looked(&mut peer, list).await;
        crowd(&robot);
        for _ in 0..7 {
            peer.any_frame().await;
        }
        // Its list waits behind the ninth query.
        peer.send(reply(&look, list)).await;
        peer.any_frame().await;
        sleep(Duration::from_millis(100)).await;
        drop(peer);
        let peer = wires.recv().await.unwrap();
        let (told, mut heard) = mpsc::unbounded_channel();
        tokio::spawn(peer.answer_all(move |request| {
            if request["reqType"] != "query" {
                told.send(request.clone()).unwrap();
            }
            Some(reply(request, list))
        }));
        let error = soon(sending).await.unwrap();
        assert_eq!(error, RequestError::NotSent(NotSent::Disconnected), "clears: {clears}");
        assert!(heard.try_recv().is_err(), "clears: {clears}");
    }
}

/// Plays a machine until it has the whole motion. Then plays another connection, with this many instructions
/// in the list and J1 at this position.
async fn after_a_break((list, j1): (usize, &'static str), following: bool) -> MotionError {
    let (mut wires, robot, mut peer) = Wires::with_robot(settings()).await;
    let (target, targets) = TargetSender::new();
    target.send(AxisPosition::degrees([5.0]));
    let moving = tokio::spawn(async move {
        if following {
            robot.follow(targets, FollowOptions::default()).await.unwrap_err()
        } else {
            runs(&robot).await
        }
    });
    let (mut left, mut looks) = (0, 0);
    while looks < 3 {
        let request = peer.any_frame().await;
        if request["reqType"] == "AddRCC" {
            left = request["instructions"].as_array().unwrap().len();
        }
        looks += usize::from(left > 0 && asked(&request).contains(&"isMoving"));
        peer.send(reply(&request, left)).await;
    }
    drop((peer, target));
    let peer = wires.recv().await.unwrap();
    tokio::spawn(peer.answer_all(move |request| Some(reply_at(request, list, j1))));
    soon(moving).await.unwrap()
}

#[tokio::test(start_paused = true)]
async fn what_another_connection_shows_is_no_progress_of_a_motion() {
    // A controller that was switched off and on has an empty list and stands where the motion ends, or it has
    // another client's list.
    for (then, following) in [((0, "0"), false), ((1, "0"), false), ((0, "5"), true)] {
        let error = after_a_break(then, following).await;
        let lost = RequestError::NotSent(NotSent::Disconnected);
        assert_eq!(error.cause, Cause::Unreadable(lost), "{then:?}: {error}");
        let steps = if following { 1 } else { 2 };
        assert_eq!((error.progress.done, error.progress.left), (0, steps), "{then:?}: {error}");
    }
}
