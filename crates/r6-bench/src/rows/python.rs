//! The round trip from Python, compared with code written by hand. Python measures; this program starts it
//! and judges the result.

use std::path::Path;
use std::process::Command;

use serde::Deserialize;

use crate::measure::judge;
use crate::report::{Figure, Goal, Row};
use crate::serve::Server;

/// Where `tools/python/run bench` installs the package, built for release.
pub const PYTHON: &str = "target/tools/python/bench/bin/python";
const SCRIPT: &str = "crates/r6-python/benches/round_trip.py";

#[derive(Deserialize)]
struct Measured {
    read: Contenders,
    rounds: Vec<Contenders>,
}

#[derive(Deserialize)]
struct Contenders {
    by_hand: f64,
    r6: f64,
}

/// One row.
pub fn rows() -> Vec<Row> {
    vec![Row {
        what: "Python, round trip of a 12-address query, sync, p50".to_owned(),
        against: "`socket` + `json` by hand",
        goal: Some(Goal::AtMost(0.7)),
        figure: measured(),
        in_the_way: "the kernel's part, the same on both sides, is most of it; what is left of ours is the SDK's own round trip",
    }]
}

fn measured() -> Figure {
    if !Path::new(PYTHON).exists() {
        return Figure::NotMeasured("it takes what `tools/python/run bench` installs");
    }
    let server = Server::Echo.start();
    let output = Command::new(PYTHON)
        .args([SCRIPT, &server.address.to_string()])
        .stderr(std::process::Stdio::inherit())
        .output()
        .expect("Python starts");
    assert!(output.status.success(), "{SCRIPT} failed");
    let measured: Measured = serde_json::from_slice(&output.stdout).expect("what the script prints");
    assert!((measured.read.by_hand - measured.read.r6).abs() < 1e-9, "both read the same");
    let rounds = measured.rounds.iter().map(|round| vec![vec![round.by_hand], vec![round.r6]]).collect();
    Figure::Ratio(judge(rounds).remove(0).remove(0))
}
