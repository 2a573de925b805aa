//! What a move takes from the profile, from earlier steps and from the list that it replaces.

mod common;

use common::{Cell, assert_near, axis_move, linear_move};
use r6_controller::Profile;
use serde_json::{Value, json};

/// The arm with its tool down except for 10 degrees, J6 at this many degrees.
fn tool_down(profile: &str, j6: f64) -> Cell {
    let mut cell = Cell::with(Profile::from_toml(profile).unwrap(), Default::default());
    cell.run_ok(&json!([axis_move([0.0, -20.0, 0.0, 0.0, -60.0, j6], 100.0)]));
    cell.pass(5.0);
    cell
}

/// How far J6 turns, and the alarm, when a line from J6 at `j6` degrees keeps the position of the tool and
/// changes one angle (3 to 5 for U to W).
fn turned_to(profile: &str, j6: f64, angle: usize, told: impl Fn(f64) -> f64) -> (f64, String) {
    let mut cell = tool_down(profile, j6);
    let mut target = cell.world();
    // W reads ±180 with J6 at 0. No other angle is close enough for rounding to decide its sign.
    assert!((target[5] - 180.0 * j6.signum() + j6).abs() < 3.0 && target[3].abs() < 179.9, "{target:?}");
    target[angle] = told(target[angle]);
    cell.run_ok(&json!([linear_move(target, 20.0)]));
    cell.pass(30.0);
    (cell.number("axis-5") - j6, cell.text("curAlarm"))
}

/// A real unit's wrist turned the long way for U +180 where U read −180 (reported). The profile decides.
#[test]
fn the_profile_says_which_way_round_the_wrist_turns() {
    // `hc1` does what was seen.
    const AS_TOLD: &str = "";
    const SHORTEST: &str = "turning = \"shortest\"";
    #[track_caller]
    fn turns(seen: (f64, String), by: f64) {
        // The tool is tilted, so the other axes turn a little too, and W is not exactly J6.
        assert!((seen.0 - by).abs() < 10.0 && seen.1 == "0", "{seen:?}, not {by}");
    }
    let whole_turn_less = |u: f64| u - 360.0 * u.signum();
    for side in [1.0, -1.0] {
        // From W = 100 to −100 there is room for either way: 160 degrees through 180, 200 through 0.
        turns(turned_to(SHORTEST, 80.0 * side, 5, |w| -w), -160.0 * side);
        turns(turned_to(AS_TOLD, 80.0 * side, 5, |w| -w), 200.0 * side);
        // From 175 to −175 the long way is further than J6 can turn.
        turns(turned_to(SHORTEST, 5.0 * side, 5, |w| -w), -10.0 * side);
        let end_of_j6 = if side > 0.0 { "135" } else { "145" };
        assert_eq!(turned_to(AS_TOLD, 5.0 * side, 5, |w| -w), (0.0, end_of_j6.to_owned()));
        // The same orientation with U a whole turn away: no arm can make that turn.
        turns(turned_to(SHORTEST, 80.0 * side, 3, whole_turn_less), 0.0);
        assert_ne!(turned_to(AS_TOLD, 80.0 * side, 3, whole_turn_less).1, "0");
    }
}

fn without_speed(mut step: Value) -> Value {
    step.as_object_mut().unwrap().remove("speed");
    step
}

fn path_speed(mm_per_second: &str) -> Value {
    json!({"oneshot": "1", "action": "51", "isUse": "1", "speed": mm_per_second})
}

/// Two lines in one direction with a path speed between them: the second has no speed of its own.
#[test]
fn a_line_after_a_corner_goes_by_the_path_speed_told_before_it() {
    // With and without an older path speed, which no longer counts.
    for older in [vec![], vec![path_speed("120")]] {
        let mut cell = tool_down("", 0.0);
        let start = cell.world();
        let line_to =
            |y: f64| linear_move([start[0], start[1] + y, start[2], start[3], start[4], start[5]], 2.0);
        let mut first = line_to(40.0);
        first["smooth"] = json!("9");
        let mut list = older;
        list.extend([first, path_speed("20"), without_speed(line_to(80.0))]);
        cell.run_ok(&list.into());
        let mut before = cell.number("world-1");
        let mut speeds = Vec::new();
        while cell.text("isMoving") == "1" {
            cell.pass(0.01);
            let here = cell.number("world-1");
            speeds.push((here - before) / 0.01);
            before = here;
        }
        // Without the ramps at both ends: no stop at the corner, and 20 mm/s from there on.
        let way = &speeds[40..speeds.len() - 40];
        let slowest = way.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(slowest > 19.0, "{slowest}");
        assert!((way[way.len() - 1] - 20.0).abs() < 0.01, "{way:?}");
        assert_near(cell.world(), [start[0], start[1] + 80.0, start[2], start[3], start[4], start[5]], 1e-3);
    }
}

#[test]
fn a_list_that_takes_over_begins_a_cycle_of_its_own() {
    let profile = Profile::from_toml("replace_in_motion = \"take-over\"").unwrap();
    let mut cell = Cell::with(profile, Default::default());
    cell.run_ok(&json!([axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(1.0);
    cell.add_rcc("1", &json!([axis_move([40.0, 5.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    let taken = cell.now;
    let since = |cell: &Cell| cell.now.since(taken).as_secs_f64();
    cell.pass(0.018);
    cell.frame().unwrap();
    cell.pass(0.5);
    assert!((cell.number("curCycle") - since(&cell)).abs() < 1e-5);
    while cell.text("isMoving") == "1" {
        cell.pass(0.001);
    }
    assert_eq!(cell.text("curAlarm"), "0");
    assert!((cell.number("lastCycle") - since(&cell)).abs() < 0.002, "the list that was left does not count");
}
