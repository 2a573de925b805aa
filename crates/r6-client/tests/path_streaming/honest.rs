//! Machines without a fault: none of their motions is reported as not seen, at any clock speed and with any
//! interval between looks.

use std::time::Duration;

use r6_client::units::{AxisPosition, Millimetres, Pose};
use r6_client::{Motion, RunOptions};
use r6_controller::Profile;
use r6_sim::Clock;

use crate::cell::{Cell, percent};

fn on(axis: usize, angle: f64) -> AxisPosition {
    let mut axes = [0.0; 6];
    axes[axis] = angle;
    AxisPosition::degrees(axes)
}

fn every(interval: u64) -> RunOptions {
    RunOptions { interval: Duration::from_millis(interval), ..RunOptions::default() }
}

/// Slow small steps, a wait, and one fast step at the end.
fn slow_then_fast(axis: usize, degrees: f64, wait: u64) -> Motion {
    let slow =
        (1..=8).fold(Motion::new(), |motion, n| motion.axis_move(on(axis, f64::from(n) * 2.0), percent(2.0)));
    slow.wait(Duration::from_millis(wait)).axis_move(on(axis, 16.0 + degrees), percent(100.0))
}

#[tokio::test(start_paused = true)]
async fn a_fast_step_after_slow_ones_is_done() {
    for interval in [50, 200, 500, 1000] {
        for axis in [0, 5] {
            for (degrees, wait) in [(20.0, 100), (80.0, 300), (120.0, 1000), (120.0, 700)] {
                let cell = Cell::new(Profile::hc1(), Clock::Real).await;
                let motion = slow_then_fast(axis, degrees, wait);
                let ended = cell.robot.run(&motion, every(interval)).await.unwrap().finished().await;
                assert!(ended.is_ok(), "{interval} ms, J{}, {degrees}: {}", axis + 1, ended.unwrap_err());
            }
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_fast_step_after_slow_ones_is_done_on_a_fast_clock() {
    for times in [5.0, 10.0, 20.0, 100.0] {
        for (degrees, wait) in [(20.0, 100), (40.0, 400), (80.0, 700), (120.0, 1000)] {
            let cell = Cell::new(Profile::hc1(), Clock::Times(times)).await;
            let motion = slow_then_fast(5, degrees, wait);
            let ended = cell.robot.run(&motion, RunOptions::default()).await.unwrap().finished().await;
            assert!(ended.is_ok(), "{times} x, {degrees}: {}", ended.unwrap_err());
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_path_of_short_steps_with_a_tool_is_done() {
    for interval in [50, 200] {
        for (count, mm, speed) in [(4, 1.0, 100.0), (8, 0.2, 50.0), (20, 1.0, 100.0), (60, 0.5, 100.0)] {
            for blend in [0_u8, 5, 9] {
                let cell = Cell::new(Profile::hc1(), Clock::Real).await;
                let away = Motion::new()
                    .axis_move(AxisPosition::degrees([0.0, -20.0, 10.0, 0.0, 40.0, 0.0]), percent(100.0));
                let there =
                    cell.robot.run(&away, RunOptions::default()).await.unwrap().finished().await.unwrap();
                let [x, y, z] = [0, 1, 2].map(|axis| there.pose[axis].unwrap());
                let motion = (1..=count).fold(Motion::new(), |motion, n| {
                    let place = Pose::position([x, y + mm * f64::from(n), z].map(Millimetres));
                    motion.linear_move(place, percent(speed)).tool(0).blend(blend)
                });
                let ended = cell.robot.run(&motion, every(interval)).await.unwrap().finished().await;
                assert!(
                    ended.is_ok(),
                    "{interval} ms, {count} of {mm} mm at {speed} %, {blend}: {}",
                    ended.unwrap_err()
                );
            }
        }
    }
}

#[tokio::test(start_paused = true)]
async fn a_path_that_goes_to_and_fro_is_done() {
    for (clock, interval) in [
        (Clock::Real, 50),
        (Clock::Real, 200),
        (Clock::Times(3.0), 50),
        (Clock::Times(10.0), 50),
        (Clock::AsFastAsPossible, 50),
        (Clock::AsFastAsPossible, 1),
    ] {
        for (count, degrees, speed) in [(2, 30.0, 50.0), (2, 3.0, 100.0), (9, 8.0, 100.0), (60, 2.0, 30.0)] {
            let cell = Cell::new(Profile::hc1(), clock).await;
            let motion = (1..=count).fold(Motion::new(), |motion, n| {
                motion.axis_move(on(0, if n % 2 == 0 { 0.0 } else { degrees }), percent(speed))
            });
            let ended = cell.robot.run(&motion, every(interval)).await.unwrap().finished().await;
            assert!(
                ended.is_ok(),
                "{clock}, {interval} ms, {count} of {degrees} at {speed} %: {}",
                ended.unwrap_err()
            );
        }
    }
}
