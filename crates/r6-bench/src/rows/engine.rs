//! The cost of the SDK alone: complete polls over an in-memory transport, without system calls.

use std::time::Instant;

use r6_client::{Robot, RobotSettings};
use tokio::runtime::Builder;

use super::echo;
use super::memory::Memory;
use crate::measure::{SLICE, beside, time_of_this_thread};
use crate::report::{Figure, Goal, Row};

/// Nanoseconds per poll at a million polls a second.
const A_MILLIONTH: f64 = 1000.0;

/// Nanoseconds of processor time for each poll of twelve addresses through a handle, one after the other.
fn nanoseconds_per_poll() -> f64 {
    let addresses = echo::addresses();
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let robot = Robot::connect_with(Memory, RobotSettings::default()).await.expect("memory connects");
        let asking = tokio::spawn(async move {
            // The first query waits for the identity of the controller. This end does not answer that, so it
            // takes half a second.
            let mut result = robot.query(&addresses).await.expect("an answer");
            let (begun, before) = (Instant::now(), time_of_this_thread());
            let mut polls = 0_u32;
            while begun.elapsed() < SLICE {
                for _ in 0..100 {
                    robot.query_again(&mut result).await.expect("an answer");
                    assert!(result.decimal(addresses[0]).is_some());
                    polls += 1;
                }
            }
            (time_of_this_thread() - before).as_secs_f64() * 1e9 / f64::from(polls)
        });
        asking.await.expect("it does not panic")
    })
}

/// Compares it with a million polls a second.
pub fn rows() -> Vec<Row> {
    let ratio = beside(A_MILLIONTH, Box::new(|| vec![nanoseconds_per_poll()]));
    vec![Row {
        what: "the SDK over memory in place of a network, complete polls of 12 addresses per second and core"
            .to_owned(),
        against: "one million",
        goal: Some(Goal::AtLeastFast(1.0)),
        figure: Figure::Ratio(ratio),
        in_the_way: "nothing by itself (callgrind): some two fifths find the reply and read its twelve numbers, a sixth is the other end, which is in \
                     memory here; the rest is spread over lanes, checks, locks and wakers",
    }]
}
