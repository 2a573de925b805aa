//! Counts allocations in a separate process, `r6-bench-allocations`, because counting has a cost.

use std::env;
use std::process::Command;

use crate::report::{Figure, Goal, Row};

/// The program that counts, in the same folder as this one.
const COUNTER: &str = "r6-bench-allocations";

/// One row for each line that it prints: the count per frame, and the path.
pub fn rows() -> Vec<Row> {
    let program = env::current_exe().expect("this program has a path").with_file_name(COUNTER);
    let output = Command::new(&program).output().expect("it was built together with this");
    assert!(output.status.success(), "{COUNTER}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let row = |line: &str| {
        let (count, what) = line.split_once(' ').expect("a count and what it is of");
        Row {
            what: format!("allocations per frame in steady state, {what}"),
            against: "–",
            goal: Some(Goal::AmountAtMost(0.0)),
            figure: Figure::Amount(count.parse().expect("a number"), ""),
            in_the_way: in_the_way(what),
        }
    };
    text.lines().map(row).collect()
}

/// What allocates, as the reason for a missed goal.
fn in_the_way(what: &str) -> &'static str {
    match what.split(", ").next() {
        Some("SDK") => {
            "the way of the answer to its caller, the list of addresses, and the values that are handed out: they are the caller's and outlive the frame"
        }
        Some("virtual controller") => {
            "what is asked for is kept: the instructions in the list and the plan of each move, some ten pieces of a motion"
        }
        _ => "",
    }
}
