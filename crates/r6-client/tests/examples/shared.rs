//! The examples with two arms, and those in which a taught program moves the arm.

use std::time::Duration;

use r6_client::{ListAfterStop, PhotosEnded};
use r6_controller::io::OutputPoint;
use r6_controller::{PanelAction, StartState};

use crate::cell::{Cell, look_on};
use crate::{camera_pick, registers, two_robots};

#[tokio::test(start_paused = true)]
async fn two_robots_move_at_the_same_time() {
    let (left, right) = (Cell::new().await, Cell::new().await);
    let other = right.handle().clone();
    let (mut both, mut reach) = (0, [0.0_f64; 2]);
    let look = |now: &r6_controller::ControllerSnapshot| {
        let then = other.snapshot();
        both += usize::from(now.moving && then.moving);
        reach = [reach[0].max(now.axes[0]), reach[1].min(then.axes[0])];
    };
    look_on(left.handle(), look, two_robots::run(&left.robot, &right.robot)).await.unwrap();
    assert!(both > 100, "they moved together at {both} looks");
    assert_eq!(reach, [15.0, -15.0]);
    assert!(left.error(&[0.0; 6]) < 1e-6 && right.error(&[0.0; 6]) < 1e-6);
}

#[tokio::test(start_paused = true)]
async fn two_robots_are_both_stopped_when_one_fails() {
    let (left, right) = (Cell::new().await, Cell::new().await);
    let (handle, mut done) = (right.handle().clone(), false);
    let look = |now: &r6_controller::ControllerSnapshot| {
        if now.axes[0] > 5.0 && !done {
            done = true;
            handle.operate(&PanelAction::EmergencyStop).unwrap();
        }
    };
    let error = look_on(left.handle(), look, two_robots::run(&left.robot, &right.robot)).await.unwrap_err();
    assert!(error.to_string().contains("emergency stop"), "{error}");
    let now = left.handle().snapshot();
    assert!(!now.moving && now.list_length == 0, "{now:?}");
    assert!(now.axes[0] < 15.0, "the other arm did not finish its move: {}", now.axes[0]);
    let stopped = left.robot.stop().await.unwrap();
    assert_eq!(stopped.list, ListAfterStop::WasEmpty);
}

#[tokio::test(start_paused = true)]
async fn two_robots_begin_only_when_both_are_ready() {
    let (mut left, right) = (Cell::new().await, Cell::standing(StartState::Manual).await);
    let error = two_robots::run(&left.robot, &right.robot).await.unwrap_err().to_string();
    assert!(error.contains(right.robot.address()) && error.contains("not READY"), "{error}");
    assert_eq!(left.lists().len(), 0);
}

const TARGET: [f64; 6] = [10.0, -5.5, 7.25, 0.0, 30.0, 0.0];

#[tokio::test(start_paused = true)]
async fn registers_are_read_back_and_the_program_moves_there() {
    let mut cell = Cell::running("register-move").await;
    let read = registers::run(&cell.robot, TARGET).await.unwrap();
    assert_eq!(read, [10_000, -5_500, 7_250, 0, 30_000, 0]);
    assert!(cell.error(&TARGET) < 1e-6);
    assert_eq!(cell.lists().len(), 0, "no list moved it");
}

#[tokio::test(start_paused = true)]
async fn registers_tells_that_the_program_does_not_move_there() {
    let cell = Cell::new().await;
    let error = registers::run(&cell.robot, TARGET).await.unwrap_err().to_string();
    assert!(error.contains("does the program (another one) move to registers"), "{error}");
    assert_eq!(cell.error(&[0.0; 6]), 0.0);
}

#[tokio::test(start_paused = true)]
async fn camera_pick_has_all_parts_picked() {
    let cell = Cell::running("pick-and-place").await;
    let handle = cell.handle().clone();
    // The belt has room.
    handle.operate(&PanelAction::SetInput { board: 0, point: 0, on: true }).unwrap();
    let mut grips = Vec::new();
    let mut closed = false;
    let wanted = camera_pick::parts().iter().map(Vec::len).sum::<usize>();
    let robot = cell.robot.clone();
    let look = |now: &r6_controller::ControllerSnapshot| {
        let now_closed = now.io.is_set(OutputPoint::Y(0, 0));
        if now_closed && !closed {
            grips.push([now.world[0], now.world[1], now.world[2]]);
        }
        closed = now_closed;
        if grips.len() == wanted && !closed {
            let robot = robot.clone();
            tokio::spawn(async move { robot.close().await });
        }
    };
    let ended = look_on(&handle, look, camera_pick::run(&cell.robot, camera_pick::parts())).await;
    assert_eq!(ended, PhotosEnded::Closed);
    let parts: Vec<_> = camera_pick::parts().into_iter().flatten().collect();
    assert_eq!(grips.len(), parts.len());
    for (grip, part) in grips.iter().zip(parts) {
        let way = [grip[0] - part.x, grip[1] - part.y, grip[2] - part.z.unwrap_or(grip[2])];
        assert!(way.iter().all(|mm| mm.abs() < 0.5), "{grip:?} {part:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn without_the_camera_nothing_is_picked() {
    let cell = Cell::running("pick-and-place").await;
    let handle = cell.handle().clone();
    let mut gripped = false;
    let look = |now: &r6_controller::ControllerSnapshot| gripped |= now.io.is_set(OutputPoint::Y(0, 0));
    look_on(&handle, look, tokio::time::sleep(Duration::from_secs(30))).await;
    assert!(!gripped, "the test of the example can fail");
}
