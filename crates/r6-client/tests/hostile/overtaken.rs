//! A request that was made before a stop and was not sent yet is not sent after it (docs/EVIDENCE.md,
//! "Stops").

use std::time::Duration;

use r6_client::{Address, AxisIndex, Command, Conditions, NotSent, Permission, RequestError};
use r6_testkit::hostile::{Character, Delays, Effect, Program, Reaction, Stops};
use serde_json::json;

use crate::hands::{on_every_hand, pause, spawn, yield_now};
use crate::{robot_at, to_j1};

on_every_hand! {
    what_waits_behind_queries_does_not_leave_after_a_stop,
    a_list_that_waits_for_another_does_not_leave_after_a_stop,
    a_command_leaves_only_under_its_conditions,
}

/// A controller that accepts lists and the start button again right after a stop, and answers slowly.
fn ready_again(delay: u64) -> Character {
    let delay = Duration::from_millis(delay);
    let action_stop = Reaction { mode: Some(2), effect: Effect::Works, ..Reaction::default() };
    let moves = json!({ "action": "4", "m0": "40", "ckStatus": "0x3F", "speed": "10" });
    Character {
        arms_itself: true,
        stops: Stops { action_stop, ..Stops::default() },
        delays: Delays { query: delay, command: delay, list: delay },
        program: Some(Program { at: Duration::from_secs(1000), steps: vec![moves] }),
        ..Character::default()
    }
}

async fn what_waits_behind_queries_does_not_leave_after_a_stop() {
    for queries in [1, 5, 15, 60] {
        for list in [false, true] {
            let (controller, robot) = robot_at(ready_again(100)).await;
            robot.status().await.unwrap();
            for _ in 0..queries {
                let reader = robot.clone();
                spawn(async move { reader.query(&[Address::Axis(AxisIndex::ALL[0])]).await.ok() });
            }
            yield_now().await;
            let mover = robot.clone();
            let asked = spawn(async move {
                if list {
                    mover.add_motion(true, &to_j1(60.0)).await.err()
                } else {
                    mover.command(Command::StartButton).await.err()
                }
            });
            pause(Duration::from_millis(5)).await;
            let report = robot.stop().await.unwrap();
            let told = controller.now();
            let answer = asked.await.unwrap();
            pause(Duration::from_secs(5)).await;
            let path = controller.arm(|arm, _| arm.path_since(1, told)[0]);
            assert!(
                !report.confirmed || path == 0.0,
                "{queries}, {list}: moved {path} after {report}: {answer:?}"
            );
        }
    }
}

/// Lists wait for each other. A stop that is requested meanwhile takes back the waiting lists.
async fn a_list_that_waits_for_another_does_not_leave_after_a_stop() {
    let (controller, robot) = robot_at(ready_again(500)).await;
    robot.status().await.unwrap();
    let (one, other) = (robot.clone(), robot.clone());
    let first = spawn(async move { one.add_motion(true, &to_j1(1.0)).await });
    pause(Duration::from_millis(10)).await;
    let second = spawn(async move { other.add_motion(false, &to_j1(60.0)).await });
    pause(Duration::from_millis(10)).await;
    let report = robot.stop().await.unwrap();
    let told = controller.now();
    first.await.unwrap().ok();
    let error = second.await.unwrap().unwrap_err();
    assert_eq!(error, RequestError::NotSent(NotSent::Overtaken));
    assert!(error.to_string().contains("a stop was asked for"), "{error}");
    pause(Duration::from_secs(5)).await;
    let path = controller.arm(|arm, _| arm.path_since(1, told)[0]);
    assert!(report.confirmed && path == 0.0, "moved {path} after {report}");
    // Requests made after the stop are sent.
    robot.add_motion(true, &to_j1(2.0)).await.unwrap();
}

/// A command that waits behind queries is not sent once its permission is withdrawn, its time is up, or on
/// another connection.
async fn a_command_leaves_only_under_its_conditions() {
    let (controller, robot) = robot_at(ready_again(100)).await;
    robot.status().await.unwrap();
    let told = controller.now();
    let here = Some(robot.connection());
    let over = Permission::new().only_while(|| false);
    for (conditions, withdraws, refused) in [
        (Conditions { permission: Some(Permission::new()), ..Conditions::default() }, true, "withdrawn"),
        (
            Conditions { leave_within: Some(Duration::from_millis(50)), ..Conditions::default() },
            false,
            "waited",
        ),
        (Conditions { only_on: here.map(|here| here + 1), ..Conditions::default() }, false, "lost"),
        (Conditions { permission: Some(over), ..Conditions::default() }, false, "withdrawn"),
    ] {
        for _ in 0..15 {
            let reader = robot.clone();
            spawn(async move { reader.query(&[Address::Axis(AxisIndex::ALL[0])]).await.ok() });
        }
        yield_now().await;
        let permission = conditions.permission.clone().unwrap_or_default();
        let mover = robot.clone();
        let asked = spawn(async move { mover.command_under(conditions, Command::StartButton).await });
        pause(Duration::from_millis(5)).await;
        if withdraws {
            permission.withdraw();
        }
        let error = asked.await.unwrap().unwrap_err();
        assert!(matches!(error, RequestError::NotSent(_)), "{error}");
        assert!(error.to_string().contains(refused), "{error}");
    }
    pause(Duration::from_secs(1)).await;
    assert_eq!(controller.arm(|arm, _| arm.path_since(1, told)[0]), 0.0);
    let leave_within = Some(Duration::from_secs(1));
    let all = Conditions { leave_within, only_on: here, permission: Some(Permission::new()) };
    robot.command_under(all, Command::StartButton).await.unwrap();
}
