//! The examples that move one arm with lists.

use std::time::Duration;

use r6_controller::StartState;
use r6_proto::OperationMode;

use crate::cell::{Cell, look_on};
use crate::{follow_target, move_axes, read_state, stream_path};

#[tokio::test(start_paused = true)]
async fn read_state_reads_and_moves_nothing() {
    let mut cell = Cell::new().await;
    let (status, fresh) = read_state::run(&cell.robot, 20).await.unwrap();
    assert!(status.is_ready());
    assert_eq!(status.machine_name.as_deref(), Some("r6 virtual BRTIRUS0707A"));
    assert!(fresh >= 20, "{fresh}");
    assert_eq!(cell.lists().len(), 0);
    assert_eq!(cell.error(&[0.0; 6]), 0.0);
}

#[tokio::test(start_paused = true)]
async fn move_axes_goes_there_and_back() {
    let mut cell = Cell::new().await;
    let target = [20.0, 0.0, -10.0, 0.0, 30.0, 0.0];
    let (handle, mut farthest) = (cell.handle().clone(), 0.0_f64);
    let moving = move_axes::run(&cell.robot, target);
    let ends = look_on(&handle, |now| farthest = farthest.max(now.axes[0]), moving).await.unwrap();
    assert_eq!(ends[0].axes[..6], target.map(Some));
    assert_eq!(farthest, 20.0, "the arm itself was there");
    assert_eq!(cell.error(&[0.0; 6]), 0.0, "and is back");
    assert_eq!(cell.lists().len(), 2, "{:?}", cell.lists());
}

#[tokio::test(start_paused = true)]
async fn move_axes_says_what_is_in_the_way_and_sends_nothing() {
    let mut cell = Cell::standing(StartState::Stopped).await;
    let error = move_axes::run(&cell.robot, [20.0; 6]).await.unwrap_err().to_string();
    assert!(error.contains("not READY") && error.contains("switch to Auto"), "{error}");
    assert_eq!(cell.lists().len(), 0);
    assert_eq!(cell.handle().snapshot().mode, OperationMode::Stop);
}

#[tokio::test(start_paused = true)]
async fn move_axes_is_held_back_by_its_own_envelope() {
    let mut cell = Cell::new().await;
    let error = move_axes::run(&cell.robot, [120.0, 0.0, 0.0, 0.0, 0.0, 0.0]).await.unwrap_err().to_string();
    assert!(error.contains("J1 goes 120 deg in one step, more than 90 deg"), "{error}");
    assert_eq!(cell.lists().len(), 0);
}

#[tokio::test(start_paused = true)]
async fn stream_path_ends_where_it_should_each_point_once_and_without_a_pause() {
    let mut cell = Cell::new().await;
    let handle = cell.handle().clone();
    let mut standing = 0;
    let look = |now: &r6_controller::ControllerSnapshot| {
        standing += usize::from(now.list_length > 1 && !now.moving);
    };
    let (end, done) = look_on(&handle, look, stream_path::run(&cell.robot)).await.unwrap();
    assert!(done.moved);
    assert!(cell.error(&end) < 0.01, "{}", cell.error(&end));
    assert_eq!(standing, 0, "looks at which the arm stood within the path");
    assert_eq!(cell.lists().iter().map(|(count, _)| count).sum::<usize>(), stream_path::POINTS as usize);
}

/// Returns the maximum distance of the arm from the moving target, and the maximum length of the list.
async fn follow(while_moving: bool) -> (f64, usize, Vec<(usize, bool)>) {
    let mut cell = Cell::new().await;
    let handle = cell.handle().clone();
    let time = Duration::from_secs(10);
    let (mut reach, mut longest) = (0.0_f64, 0);
    let look = |now: &r6_controller::ControllerSnapshot| {
        reach = reach.max(now.axes[0].abs());
        longest = longest.max(now.list_length);
    };
    let followed = look_on(&handle, look, follow_target::run(&cell.robot, time, while_moving)).await.unwrap();
    assert!(followed.behind.is_some_and(|behind| behind.value() <= 1.0), "{followed:?}");
    assert!(cell.error(&[0.0; 6]) <= 1.0, "it ends where the target ended");
    let now = cell.handle().snapshot();
    assert!(!now.moving && now.list_length == 0 && now.alarm == 0, "{now:?}");
    assert_eq!(cell.lists().len(), followed.steps, "each step was taken once");
    (reach, longest, cell.lists())
}

#[tokio::test(start_paused = true)]
async fn follow_target_steps_only_while_the_arm_stands() {
    let (reach, longest, lists) = follow(false).await;
    assert!((12.0..=16.0).contains(&reach), "{reach}");
    assert_eq!(longest, 1);
    assert!(lists.len() < 60 && lists.iter().all(|list| list.0 == 1), "{lists:?}");
}

#[tokio::test(start_paused = true)]
async fn follow_target_while_moving_never_has_more_than_two_steps_in_the_list() {
    let (reach, longest, lists) = follow(true).await;
    assert!((12.0..=16.0).contains(&reach), "{reach}");
    assert_eq!(longest, 2);
    assert!(lists.iter().all(|list| !list.1), "alarm 200 otherwise: {lists:?}");
}
