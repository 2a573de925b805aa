//! A stop on a handle works, even if another stop came before.

use std::time::Duration;

use r6_client::units::AxisPosition;
use r6_client::{Motion, Robot, RobotSettings, RunOptions};
use r6_controller::Profile;
use r6_proto::Command;
use r6_sim::Clock;
use tokio::time::sleep;

use crate::cell::{Cell, percent, soon, through, wave};
use crate::relay::Relay;

#[tokio::test(start_paused = true)]
async fn an_older_stop_is_not_taken_for_the_one_that_is_asked_for() {
    let unanswered = "[[fault]]\nfault = \"not-acknowledged\"\nfrom = 5\nfor = 2";
    // Another clone stops the path, or the path stops the arm because it fails.
    for fails in [false, true] {
        let scenario = if fails { unanswered } else { "" };
        let cell = Cell::with(Profile::hc1(), Clock::Real, scenario, RobotSettings::default()).await;
        let (relay, address) = Relay::to(cell.controller.address(), None, Duration::ZERO).await;
        let robot = Robot::connect(&address.to_string(), RobotSettings::default()).await.unwrap();
        let path = through(&wave(100), 20.0, 5);
        let handle = robot.run(&path, RunOptions::default()).await.unwrap();
        if !fails {
            assert!(soon(handle.step(30).unwrap().started()).await);
            assert!(robot.clone().stop().await.unwrap().confirmed);
        }
        let mut watch = handle.watch();
        soon(watch.wait_for(|progress| progress.ended)).await.unwrap();
        // The stop comes after it and ends within this time.
        sleep(Duration::from_secs(30)).await;
        robot.command(Command::StartButton).await.unwrap();
        let far = Motion::new().axis_move(AxisPosition::degrees([-90.0]), percent(2.0));
        robot.add_rcc(true, far.instructions().unwrap().to_vec()).await.unwrap();
        sleep(Duration::from_millis(300)).await;
        assert!(cell.handle().snapshot().moving, "fails: {fails}");
        let stops = relay.stops();
        assert!(stops > 0);
        let report = handle.stop().await.unwrap();
        assert_eq!((relay.stops(), report.confirmed), (stops + 1, true), "fails: {fails}");
        assert!(!cell.handle().snapshot().moving, "fails: {fails}");
    }
}
