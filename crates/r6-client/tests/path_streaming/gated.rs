//! A gate decides about each list of a motion.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use r6_client::{
    Cause, Conditions, ListGate, MotionError, NotSent, Permission, Robot, RobotSettings, RunOptions,
};
use r6_controller::Profile;
use r6_sim::Clock;

use crate::cell::{Cell, soon, through, wave};

/// Runs 40 steps through a gate that decides about each list by its number, from 0. Returns the lists that it
/// was asked for, and the end.
async fn run(
    decide: impl Fn(usize) -> Option<Conditions> + Send + Sync + 'static,
) -> (Vec<(bool, usize)>, Result<(), MotionError>) {
    let cell = Cell::with(Profile::hc1(), Clock::Real, "", RobotSettings::default()).await;
    let robot =
        Robot::connect(&cell.controller.address().to_string(), RobotSettings::default()).await.unwrap();
    let asked = Arc::new(Mutex::new(Vec::new()));
    let lists = Arc::clone(&asked);
    let gate = ListGate::new(move |replace, steps| {
        let mut lists = lists.lock().unwrap();
        lists.push((replace, steps.len()));
        decide(lists.len() - 1)
    });
    let options = RunOptions { room: 10, frame_instructions: 5, ..RunOptions::default() };
    let handle = robot.run_under(&through(&wave(40), 50.0, 5), options, gate).await.unwrap();
    let ended = soon(handle.finished()).await.map(drop);
    let asked = asked.lock().unwrap().clone();
    (asked, ended)
}

#[tokio::test(start_paused = true)]
async fn a_gate_is_asked_before_each_list_and_what_it_refuses_is_never_sent() {
    let (asked, ended) = run(|_| Some(Conditions::default())).await;
    ended.unwrap();
    assert_eq!(asked.len(), 8);
    assert!(asked.iter().enumerate().all(|(at, list)| *list == (at == 0, 5)), "{asked:?}");

    let (asked, ended) = run(|at| (at < 2).then(Conditions::default)).await;
    let MotionError { cause, progress, stop } = ended.unwrap_err();
    assert_eq!((asked.len(), cause), (3, Cause::NotSent(NotSent::Withdrawn)));
    assert_eq!((progress.left, progress.accepted), (10, 10), "the third list was not sent");
    assert!(stop.unwrap().unwrap().confirmed);
}

#[tokio::test(start_paused = true)]
async fn a_list_leaves_only_under_the_conditions_of_its_gate() {
    let over = Permission::new();
    over.withdraw();
    for (conditions, cause) in [
        (Conditions { permission: Some(over), ..Conditions::default() }, NotSent::Withdrawn),
        (Conditions { only_on: Some(9), ..Conditions::default() }, NotSent::Disconnected),
    ] {
        let (asked, ended) =
            run(move |at| Some(if at == 0 { Conditions::default() } else { conditions.clone() })).await;
        let error = ended.unwrap_err();
        assert_eq!((asked.len(), error.cause), (2, Cause::NotSent(cause)));
        assert_eq!(error.progress.accepted, 5);
    }
    // A list that is too late is not sent. The gate is asked again for it.
    let late = |at| {
        let leave_within = (at == 1).then_some(Duration::ZERO);
        Some(Conditions { leave_within, ..Conditions::default() })
    };
    let (asked, ended) = run(late).await;
    ended.unwrap();
    assert!((8..=9).contains(&asked.len()), "{asked:?}");
}
