//! The client on a controller that misbehaves on purpose (`r6_testkit::hostile`), with each driver
//! (`tests/hands`).
#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests too")]

mod cable;
mod ended;
mod first;
mod fresh;
#[allow(dead_code, unused_imports, unused_macros, reason = "it has more than these tests need")]
#[path = "../hands/hands.rs"]
mod hands;
mod odd_lists;
mod overtaken;
mod standing;
mod untold;

use std::sync::Arc;
use std::time::Duration;

use cable::Cable;
use r6_client::units::{AxisPosition, Percent};
use r6_client::{
    Command, Motion, OutcomeUnknown, RequestError, Robot, RobotSettings, RunOptions, WaitOptions,
};
use r6_testkit::hostile::serve::HostileController;
use r6_testkit::hostile::{Cabinet, Character, Effect, Reaction, Stops, Swap, SwapWhen};
use tokio::net::TcpListener;

use hands::on_every_hand;

on_every_hand! {
    one_that_behaves_is_ready_and_moves_where_it_is_sent,
    a_stop_that_is_answered_ok_may_have_no_effect,
    another_robot_may_answer_on_the_next_connection,
    what_is_pushed_ends_when_the_handle_is_closed_although_a_clone_lives,
}

on_every_hand! { in Real:
    it_is_reached_over_tcp_too,
}

/// A robot behind wires in memory, and the controller at their other end.
async fn robot_at(character: Character) -> (Arc<HostileController>, Robot) {
    robot_with(character, RobotSettings::default()).await
}

/// The same with these settings of the client.
async fn robot_with(character: Character, settings: RobotSettings) -> (Arc<HostileController>, Robot) {
    let controller = HostileController::new(character);
    let robot = hands::connect_with(Cable(Arc::clone(&controller)), settings).await.unwrap();
    (controller, robot)
}

fn to_j1(degrees: f64) -> Motion {
    let target = AxisPosition::degrees([degrees, 0.0, 0.0, 0.0, 0.0, 0.0]);
    Motion::new().axis_move(target, Percent::new(50.0).unwrap())
}

/// This many steps. Each moves J1 5 degrees further than the one before.
fn there_and_on(steps: u32) -> Motion {
    let slow = Percent::new(50.0).unwrap();
    let to = |n: u32| AxisPosition::degrees([5.0 * f64::from(n), 0.0, 0.0, 0.0, 0.0, 0.0]);
    (1..=steps).fold(Motion::new(), |motion, n| motion.axis_move(to(n), slow))
}

async fn one_that_behaves_is_ready_and_moves_where_it_is_sent() {
    let (controller, robot) = robot_at(Character::default()).await;
    let status = robot.status().await.unwrap();
    assert!(status.is_ready(), "{:?}", status.unmet());
    assert_eq!(status.machine_name.as_deref(), Some("cell 4"));
    let handle = robot.run(&to_j1(20.0), RunOptions::default()).await.unwrap();
    handle.finished().await.unwrap();
    controller.arm(|arm, now| {
        assert_eq!(arm.position_at(1, now)[0], 20.0);
        assert!(arm.carried(1).iter().all(|step| step.whole));
    });
}

async fn a_stop_that_is_answered_ok_may_have_no_effect() {
    let no_effect = Reaction { effect: Effect::NoEffect, ..Reaction::default() };
    let stops = Stops { action_stop: no_effect, ..Stops::default() };
    let (controller, robot) = robot_at(Character { stops, ..Character::default() }).await;
    let handle = robot.run(&to_j1(90.0), RunOptions::default()).await.unwrap();
    assert!(handle.step(1).unwrap().started().await);
    robot.command(Command::ActionStop).await.unwrap();
    let told = controller.now();
    hands::pause(Duration::from_secs(1)).await;
    let path = controller.arm(|arm, _| arm.path_since(1, told));
    assert!((29.0..31.0).contains(&path[0]), "it moves on, 30 degrees a second: {path:?}");
    drop(handle);
}

async fn another_robot_may_answer_on_the_next_connection() {
    let to = Cabinet { name: "cell 5".to_owned(), ..Cabinet::default() };
    let swap = Swap { when: SwapWhen::Told, links: r6_testkit::hostile::Links::End, to };
    let (controller, robot) = robot_at(Character { swap: Some(swap), ..Character::default() }).await;
    assert_eq!(robot.status().await.unwrap().machine_name.as_deref(), Some("cell 4"));
    controller.arm(|arm, now| arm.swap(now));
    let mut told = None;
    for _ in 0..50 {
        if let Err(RequestError::OutcomeUnknown(OutcomeUnknown::AnotherRobot { found, .. })) =
            robot.status().await
        {
            told = found.machine_name;
            break;
        }
        hands::pause(Duration::from_millis(100)).await;
    }
    assert_eq!(told.as_deref(), Some("cell 5"));
}

async fn it_is_reached_over_tcp_too() {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let controller = HostileController::new(Character::default());
    let served = tokio::spawn(Arc::clone(&controller).listen(listener));
    let robot = hands::connect(&address, RobotSettings::default()).await.unwrap();
    robot.run(&to_j1(3.0), RunOptions::default()).await.unwrap().finished().await.unwrap();
    let waited = robot.wait_until_done(WaitOptions::default()).await.unwrap();
    assert_eq!(waited.axes[0], Some(3.0));
    served.abort();
}

async fn what_is_pushed_ends_when_the_handle_is_closed_although_a_clone_lives() {
    let (_controller, robot) = robot_at(Character::default()).await;
    let clone = robot.clone();
    let mut pushed = robot.pushed();
    let listens = hands::spawn(async move { while pushed.recv().await.is_ok() {} });
    robot.close().await;
    tokio::time::timeout(std::time::Duration::from_secs(1), listens).await.unwrap().unwrap();
    assert!(clone.pushed().recv().await.is_err());
}
