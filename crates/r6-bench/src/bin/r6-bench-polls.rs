//! Polls twelve addresses over memory and prints how long each poll took: `r6-bench-polls [COUNT]`, by
//! default a million.
//!
//! Use it with a profiler to see where the time of a query goes:
//! `valgrind --tool=callgrind target/release/r6-bench-polls 20000`.

use std::time::Instant;

use r6_client::{Robot, RobotSettings};
use tokio::runtime::Builder;

#[path = "../rows/echo.rs"]
#[allow(dead_code, reason = "the server in it is for others")]
mod echo;
#[path = "../rows/memory.rs"]
mod memory;

fn main() {
    let count = std::env::args().nth(1).map_or(1_000_000, |count| count.parse().expect("how many polls"));
    let addresses = echo::addresses();
    let runtime = Builder::new_current_thread().enable_all().build().expect("a runtime");
    let asking = async move {
        let robot =
            Robot::connect_with(memory::Memory, RobotSettings::default()).await.expect("memory connects");
        // The first query waits for the identity of the controller. This end does not answer that, so it
        // takes half a second.
        let mut result = robot.query(&addresses).await.expect("an answer");
        let begun = Instant::now();
        for _ in 0..count {
            robot.query_again(&mut result).await.expect("an answer");
            assert!(result.decimal(addresses[0]).is_some());
        }
        begun.elapsed()
    };
    let took = runtime.block_on(async { tokio::spawn(asking).await.expect("it does not panic") });
    println!("{:.0} ns a poll", took.as_secs_f64() * 1e9 / f64::from(count));
}
