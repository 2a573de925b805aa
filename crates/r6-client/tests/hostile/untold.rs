//! A failed motion whose result no caller has requested is reported once, and only once.

use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{Cause, Command, FollowOptions, Robot, RunOptions, TargetSender, WaitError, WaitOptions};
use r6_testkit::hostile::{Character, Foreign};

use crate::hands::{on_every_hand, pause};
use crate::{robot_at, there_and_on, to_j1};

on_every_hand! {
    one_of_two_clones_is_told,
    a_cleared_list_and_a_stop_do_not_hide_it_and_follow_tells_it,
    who_waited_is_not_told_again,
}

/// A motion that another client cleared, and whose handle was dropped.
async fn failed() -> (std::sync::Arc<r6_testkit::hostile::serve::HostileController>, Robot) {
    let clears = Foreign { at: Duration::from_millis(700), replace: true, instructions: Vec::new() };
    let (controller, robot) = robot_at(Character { foreign: vec![clears], ..Character::default() }).await;
    drop(robot.run(&there_and_on(20), RunOptions::default()).await.unwrap());
    pause(Duration::from_secs(10)).await;
    (controller, robot)
}

async fn ready_again(robot: &Robot) {
    robot.command(Command::ClearAlarm).await.unwrap();
    robot.command(Command::StartButton).await.unwrap();
    pause(Duration::from_millis(200)).await;
}

async fn one_of_two_clones_is_told() {
    let (_controller, robot) = failed().await;
    ready_again(&robot).await;
    let (a, b) = (robot.clone(), robot.clone());
    let (motion, other) = (to_j1(1.0), to_j1(2.0));
    let (a, b) = tokio::join!(a.run(&motion, RunOptions::default()), b.run(&other, RunOptions::default()));
    let told = [a.as_ref().err(), b.as_ref().err()]
        .into_iter()
        .flatten()
        .filter(|e| matches!(e.cause, Cause::EarlierFailed(_)))
        .count();
    assert_eq!(told, 1);
}

async fn a_cleared_list_and_a_stop_do_not_hide_it_and_follow_tells_it() {
    let (_controller, robot) = failed().await;
    ready_again(&robot).await;
    robot.clear_list().await.unwrap();
    let report = robot.stop().await.unwrap();
    assert!(report.confirmed);
    ready_again(&robot).await;
    let (target, targets) = TargetSender::new();
    target.send(AxisPosition::degrees([1.0]));
    drop(target);
    let error = robot.follow(targets, FollowOptions::default()).await.unwrap_err();
    assert!(matches!(error.cause, Cause::EarlierFailed(_)), "{error}");
    robot.run(&to_j1(0.0), RunOptions::default()).await.unwrap().finished().await.unwrap();
}

async fn who_waited_is_not_told_again() {
    let (_controller, robot) = failed().await;
    assert!(matches!(robot.wait_until_done(WaitOptions::default()).await, Err(WaitError::Motion(_))));
    ready_again(&robot).await;
    robot.run(&to_j1(0.0), RunOptions::default()).await.unwrap().finished().await.unwrap();
}
