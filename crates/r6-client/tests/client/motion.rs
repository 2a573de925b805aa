//! Waiting for the end of a motion by the state only.

use std::time::Duration;

use r6_client::{OperationMode, WaitError, WaitOptions};
use serde_json::Value;

use crate::controller::{Controller, Peer, asked, settings, soon, values};

const QUICK: WaitOptions = WaitOptions {
    interval: Duration::from_millis(1),
    timeout: Duration::from_secs(15),
    settle: Duration::from_millis(20),
    start_within: Duration::from_secs(10),
    idle_mode: OperationMode::Running,
};

/// The result of one read: moving, alarm, mode, J1, instructions left.
type State = (&'static str, &'static str, &'static str, &'static str, &'static str);

/// Plays the states, one for each read, and repeats the last one. If `lengths` is false there is no
/// `RemoteCmdLen`.
fn play<const N: usize>(peer: Peer, states: &[State; N], lengths: bool) {
    let states = *states;
    let mut reads = 0;
    tokio::spawn(peer.answer_all(move |request| {
        let (moving, alarm, mode, j1, length) = states[reads.min(N - 1)];
        let names = asked(request);
        if names.contains(&"isMoving") {
            reads += 1;
        }
        let data: Vec<Value> = names
            .into_iter()
            .filter(|name| lengths || *name != "RemoteCmdLen")
            .map(|name| match name {
                "isMoving" => moving,
                "curAlarm" => alarm,
                "curMode" => mode,
                "axis-0" => j1,
                "RemoteCmdLen" => length,
                _ => "0.000000",
            })
            .map(Value::from)
            .collect();
        Some(values(request, data.into()))
    }));
}

#[tokio::test]
async fn the_end_is_where_the_arm_stands_with_an_empty_list() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    play(
        peer,
        &[
            ("0", "0", "7", "0.000000", "0"),
            ("0", "0", "7", "0.000000", "0"),
            ("1", "0", "7", "3.000000", "1"),
            ("0", "0", "7", "5.000000", "1"),
            ("0", "0", "7", "5.000000", "1"),
            ("1", "0", "7", "8.000000", "0"),
            ("0", "0", "7", "10.000000", "0"),
        ],
        true,
    );
    let done = soon(robot.wait_until_done(QUICK)).await.unwrap();
    assert_eq!(done.axes[0], Some(10.0));
    assert!(done.moved);
    assert_eq!(done.mode, Some(OperationMode::Running));
}

#[tokio::test]
async fn without_a_list_length_standing_has_to_last() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    // The client needs extra reads to find out that there is no `RemoteCmdLen`.
    let moving = ("1", "0", "7", "3.000000", "");
    play(peer, &[moving, moving, moving, moving, ("0", "0", "7", "10.000000", "")], false);
    let done = soon(robot.wait_until_done(QUICK)).await.unwrap();
    assert_eq!(done.axes[0], Some(10.0));
    assert!(done.moved);
    assert!(done.took >= QUICK.settle);
}

#[tokio::test]
async fn an_alarm_ends_it() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    play(peer, &[("1", "0", "7", "3.000000", "2"), ("0", "135", "3", "5.000000", "2")], true);
    let error = soon(robot.wait_until_done(QUICK)).await.unwrap_err();
    assert_eq!(error, WaitError::AlarmRaised { code: 135 });
}

#[tokio::test]
async fn a_program_that_does_not_run_ends_it() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    play(peer, &[("0", "0", "2", "0.000000", "1")], true);
    let error = soon(robot.wait_until_done(QUICK)).await.unwrap_err();
    assert_eq!(error, WaitError::Stopped { mode: OperationMode::Auto });
}

#[tokio::test]
async fn an_endless_list_ends_with_the_time_out() {
    let (_controller, robot, peer) = Controller::with_robot(settings()).await;
    play(peer, &[("1", "0", "7", "3.000000", "4")], true);
    let options = WaitOptions { timeout: Duration::from_millis(100), ..QUICK };
    let error = soon(robot.wait_until_done(options)).await.unwrap_err();
    assert_eq!(error, WaitError::TimedOut { after: options.timeout, list_length: Some(4) });
}

#[tokio::test]
async fn a_state_that_cannot_be_read_is_no_end() {
    let (controller, robot, peer) = Controller::with_robot(settings()).await;
    drop((controller, peer));
    let error = soon(robot.wait_until_done(QUICK)).await.unwrap_err();
    assert!(matches!(error, WaitError::Request(_)), "{error:?}");
}
