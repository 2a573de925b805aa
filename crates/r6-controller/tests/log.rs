//! The log of a peer that sends rubbish as fast as it can.

mod common;

use common::Cell;
use r6_controller::Event;
use r6_controller::{Controller, ControllerSettings, FastClock, Profile, RobotModel};
use r6_proto::time::Instant;

/// Reads the lines one by one, like a shell that reads after each piece. Returns their number, and how many
/// they say were left out.
fn told(cell: &mut Cell) -> (u64, u64) {
    let (mut lines, mut left_out) = (0, 0);
    while let Some(line) = cell.controller.poll_log() {
        match line.event {
            Event::WarningsLeftOut { count, .. } => left_out += count,
            _ => lines += 1,
        }
    }
    (lines, left_out)
}

/// Sends this many invalid frames and returns the same counts for the log.
fn rubbish(cell: &mut Cell, frames: u64) -> (u64, u64) {
    let (mut lines, mut left_out) = (0, 0);
    for _ in 0..frames {
        cell.send("{nope}");
        let (more, more_left_out) = told(cell);
        lines += more;
        left_out += more_left_out;
    }
    (lines, left_out)
}

#[test]
fn of_too_many_warnings_the_rest_is_counted() {
    let mut cell = Cell::new();
    assert_eq!(rubbish(&mut cell, 32), (32, 0));
    assert_eq!(rubbish(&mut cell, 5_000), (0, 0));
    // The connection sends nothing more: the count still comes, a second after the first warning.
    cell.pass(0.999);
    assert_eq!(told(&mut cell), (0, 0));
    cell.pass(0.002);
    assert_eq!(told(&mut cell), (0, 5_000));
    cell.pass(60.0);
    assert_eq!(told(&mut cell), (0, 0));
    assert_eq!(rubbish(&mut cell, 33), (32, 0));
}

#[test]
fn each_second_and_each_connection_has_its_own_warnings() {
    let mut cell = Cell::new();
    let mut sum = (0, 0);
    for _ in 0..100 {
        let (lines, left_out) = rubbish(&mut cell, 10);
        sum = (sum.0 + lines, sum.1 + left_out);
        cell.pass(0.04);
        let (lines, left_out) = told(&mut cell);
        sum = (sum.0 + lines, sum.1 + left_out);
    }
    // 1 000 in four seconds.
    assert!((4 * 32..=5 * 32).contains(&sum.0), "{sum:?}");
    cell.pass(2.0);
    assert_eq!(sum.0 + sum.1 + told(&mut cell).1, 1_000);

    rubbish(&mut cell, 100);
    cell.id = cell.controller.connect(cell.now);
    assert_eq!(rubbish(&mut cell, 10), (10, 0));
}

#[test]
fn a_connection_that_ends_leaves_its_count() {
    let mut cell = Cell::new();
    rubbish(&mut cell, 100);
    cell.controller.disconnect(cell.id);
    assert_eq!(told(&mut cell), (0, 68));
    assert_eq!(cell.controller.poll_timeout(), None);
}

/// Other events than warnings are always logged: a fault that struck, a command that was accepted.
#[test]
fn orders_are_told_beside_the_warnings() {
    let mut cell = Cell::new();
    rubbish(&mut cell, 100);
    cell.ok(&["modifyOutput", "0", "3", "1"]);
    assert_eq!(told(&mut cell), (1, 0));
}

/// `{{{{…` once caused one line for each brace beyond the depth limit.
#[test]
fn an_endless_nest_is_no_endless_log() {
    let mut cell = Cell::new();
    let (mut lines, mut left_out) = (0, 0);
    for _ in 0..1_000 {
        cell.send("{".repeat(4_096));
        let (more, more_left_out) = told(&mut cell);
        (lines, left_out) = (lines + more, left_out + more_left_out);
    }
    assert_eq!(lines, 32);
    cell.pass(10.0);
    left_out += told(&mut cell).1;
    assert!(left_out > 1_000, "{left_out}");
}

/// With a clock that only the input drives, the count comes once no input comes.
#[test]
fn a_clock_that_stands_tells_the_count_too() {
    let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
    let mut controller = Controller::new(ControllerSettings::new(Profile::hc1(), model), Instant::ORIGIN);
    let mut clock = FastClock::new(Instant::ORIGIN);
    let id = controller.connect(clock.now());
    clock.handle_input(&mut controller, id, "{nope}".repeat(100).as_bytes());
    while controller.poll_log().is_some() {}
    assert_eq!(clock.pause(&controller).map(|pause| pause.as_secs()), Some(1));
    clock.go_on(&mut controller);
    assert!(matches!(controller.poll_log().unwrap().event, Event::WarningsLeftOut { count: 68, told: 32 }));
    assert_eq!(clock.pause(&controller), None);
}
