//! Registers, photos, a moving target and a controller that dials, without async.

use std::time::Duration;

use r6_client::blocking::{Engine, Robot};
use r6_client::units::{AxisPosition, Degrees};
use r6_client::{
    FollowOptions, Keep, Listen, PhotosEnded, Point, RegisterError, RegisterIndex, RobotSettings, Shot,
};
use r6_sim::{Camera, Clock, VirtualController};

fn cell() -> (VirtualController, Robot) {
    let builder = VirtualController::builder().clock(Clock::AsFastAsPossible);
    let controller = builder.start_blocking().unwrap();
    let robot = Robot::connect(&controller.address().to_string(), RobotSettings::default()).unwrap();
    (controller, robot)
}

#[test]
fn registers_are_written_and_read_back() {
    let (_controller, robot) = cell();
    let first = RegisterIndex::new(850).unwrap();
    robot.write_registers(first, &[7, -8], Keep::Always).unwrap();
    assert_eq!(robot.read_registers(first, 2).unwrap(), [7, -8]);
    let error = robot.read_registers(first, 60).unwrap_err();
    assert!(matches!(error, RegisterError::NoSuchRegisters { count: 60, .. }), "{error}");
}

#[test]
fn photos_are_served_until_the_handle_is_closed() {
    let (controller, robot) = cell();
    robot.status().unwrap();
    let (asked, seen) = std::sync::mpsc::channel();
    let serving = std::thread::spawn({
        let robot = robot.clone();
        move || {
            robot.serve_photos(|cam_id| {
                asked.send(cam_id).unwrap();
                Shot::Points(vec![Point::default()])
            })
        }
    });
    // The thread may not listen yet, so the program repeats its request, as real programs do.
    let cam_id = loop {
        controller.handle().request_photo(2);
        if let Ok(cam_id) = seen.recv_timeout(Duration::from_millis(50)) {
            break cam_id;
        }
    };
    assert_eq!(cam_id, 2);
    robot.block_on(robot.as_async().clone().close());
    let ended = serving.join().unwrap();
    assert!(matches!(ended, PhotosEnded::Closed | PhotosEnded::Request { cam_id: 2, .. }), "{ended}");
}

/// Looking at a picture may take long. Other calls to the robot do not wait for it.
#[test]
fn a_stop_does_not_wait_for_a_picture() {
    let (controller, robot) = cell();
    robot.status().unwrap();
    let (asked, seen) = std::sync::mpsc::channel();
    let (taken, picture) = std::sync::mpsc::channel::<()>();
    let serving = std::thread::spawn({
        let robot = robot.clone();
        move || {
            robot.serve_photos(|_| {
                asked.send(()).unwrap();
                picture.recv().ok();
                Shot::Failed
            })
        }
    });
    loop {
        controller.handle().request_photo(2);
        if seen.recv_timeout(Duration::from_millis(50)).is_ok() {
            break;
        }
    }
    assert!(robot.stop().unwrap().confirmed);
    drop(taken);
    robot.close();
    serving.join().unwrap();
}

#[test]
fn a_target_is_followed_until_its_sender_is_gone() {
    let (controller, robot) = cell();
    let (target, targets) = r6_client::TargetSender::new();
    target.send(AxisPosition::degrees([25.0]));
    let (done, follows) = std::sync::mpsc::channel();
    let following = std::thread::spawn(move || {
        let followed = robot.follow(targets, FollowOptions::default());
        done.send(()).unwrap();
        followed.map_err(Box::new)
    });
    // Sends the same target repeatedly, as a real source does.
    while controller.handle().snapshot().axes[0] < 24.9 {
        target.send(AxisPosition::degrees([25.0]));
        let ended = follows.recv_timeout(Duration::from_millis(20));
        assert!(ended.is_err(), "it ended before its source");
    }
    drop(target);
    let followed = following.join().unwrap().unwrap();
    assert_eq!((followed.steps, followed.behind), (3, Some(Degrees(0.0))));
}

#[test]
fn a_controller_that_dials_is_waited_for() {
    let engine = Engine::start().unwrap();
    let listen = engine.block_on(Listen::on("127.0.0.1:0")).unwrap();
    let camera = Camera { cam_id: None, address: listen.address().unwrap() };
    let controller = VirtualController::builder().camera(camera).start_blocking().unwrap();
    let robot = Robot::connect_with(&engine, listen, RobotSettings::default()).unwrap();
    assert!(robot.status().unwrap().is_ready());
    drop(controller);
}
