//! The effect of each setting of a profile: where real controllers differ from the manual, or their behaviour
//! is unknown.

mod common;

use common::{Cell, assert_near, axis_move, linear_move};
use r6_controller::{Profile, StartState};
use serde_json::{Value, json};

fn cell(settings: &str) -> Cell {
    Cell::with(Profile::from_toml(settings).unwrap(), StartState::Waiting)
}

/// A cell with the arm at a position with room for lines and curves of some 100 mm.
fn cell_with_room(settings: &str) -> Cell {
    let mut cell = cell(settings);
    cell.run_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
    cell.pass(5.0);
    cell
}

/// A pose this many millimetres along Y.
fn beside(pose: [f64; 6], y: f64) -> [f64; 6] {
    let [x, from, z, u, v, w] = pose;
    [x, from + y, z, u, v, w]
}

/// A one-shot curve from a pose to one 40 mm beside it.
fn curve(from: [f64; 6]) -> Value {
    let mut middle = beside(from, 20.0);
    middle[2] += 10.0;
    let mut step = linear_move(middle, 5.0);
    step["action"] = json!("17");
    for (n, value) in beside(from, 40.0).into_iter().enumerate() {
        step[format!("m{n}_p")] = json!(format!("{value:.6}"));
    }
    step
}

fn output(point: &str) -> Value {
    json!({"oneshot": "1", "action": "200", "type": "0", "point": point, "io_status": "1", "delay": "0"})
}

fn watch(on: bool, io_status: &str) -> Value {
    let in_use = if on { "1" } else { "0" };
    json!({"oneshot": "1", "action": "52", "isUse": in_use, "ioNumber": "3", "io_status": io_status})
}

/// Reported: a curve without a line before it is answered ok and not executed. Only the arm and the log show
/// it.
#[test]
fn a_lone_curve_is_answered_ok_and_not_executed() {
    for before in [vec![], vec![axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]] {
        let mut cell = cell_with_room("");
        let start = cell.world();
        cell.run_ok(&Value::from([before, vec![curve(start), output("5")]].concat()));
        cell.pass(30.0);
        assert_near(cell.world(), start, 1e-6);
        // The list continues, and no value shows that anything is wrong.
        let seen = cell.query(&["RemoteCmdLen", "curAlarm", "curMode", "isMoving", "output-0"]);
        assert_eq!(seen, [json!("0"), json!("0"), json!("7"), json!("0"), json!("32")]);
        let log = cell.log();
        assert!(log.contains("action 17") && log.contains("not executed"), "{log}");
    }
}

#[test]
fn a_curve_behind_a_line_is_executed() {
    let mut cell = cell_with_room("");
    let start = cell.world();
    let line = || linear_move(beside(start, 0.5), 5.0);
    cell.run_ok(&json!([line(), curve(start)]));
    cell.pass(30.0);
    assert_near(cell.world(), beside(start, 40.0), 1e-3);
    // A line of the same list counts, however long ago it was executed, and whatever came between.
    cell.append_ok(&json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
    cell.pass(30.0);
    assert_near(cell.world(), start, 1e-3);
    cell.append_ok(&json!([curve(start)]));
    cell.pass(30.0);
    assert_near(cell.world(), beside(start, 40.0), 1e-3);
    assert_eq!(cell.text("curAlarm"), "0");
}

/// A run of the list ends when it is replaced, or when the program begins again.
#[test]
fn a_line_of_an_earlier_run_does_not_count() {
    let back = axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0);
    let endings: [fn(&mut Cell, Value); 3] = [
        |cell, back| cell.run_ok(&json!([back])),
        |cell, back| {
            cell.run_ok(&json!([]));
            cell.append_ok(&json!([back]));
        },
        |cell, back| {
            cell.ok(&["actionStop"]);
            cell.pass(1.0);
            cell.ok(&["startButton"]);
            cell.append_ok(&json!([back]));
        },
    ];
    for ending in endings {
        let mut cell = cell_with_room("");
        let start = cell.world();
        cell.run_ok(&json!([linear_move(beside(start, 5.0), 5.0)]));
        cell.pass(5.0);
        ending(&mut cell, back.clone());
        cell.pass(5.0);
        cell.append_ok(&json!([curve(start)]));
        cell.pass(30.0);
        assert_near(cell.world(), start, 1e-3);
        assert_eq!(cell.query(&["RemoteCmdLen", "curAlarm"]), [json!("0"), json!("0")]);
    }
}

/// A move with a blend level does not blend into a curve that is not executed.
#[test]
fn no_corner_is_rounded_into_a_curve_that_is_not_executed() {
    let mut cell = cell_with_room("");
    let mut first = axis_move([5.0, -20.0, 10.0, 0.0, 40.0, 0.0], 50.0);
    first["smooth"] = json!("9");
    let start = cell.world();
    cell.run_ok(&json!([first, curve(start)]));
    cell.pass(30.0);
    assert_near(cell.axes(), [5.0, -20.0, 10.0, 0.0, 40.0, 0.0], 1e-6);
    assert_eq!(cell.query(&["RemoteCmdLen", "curAlarm"]), [json!("0"), json!("0")]);
}

/// A list that takes over the arm in mid-move and begins with such a curve stops it.
#[test]
fn a_list_that_takes_over_with_a_lone_curve_stops_the_arm() {
    let mut cell = cell_with_room("replace_in_motion = \"take-over\"");
    let start = cell.world();
    cell.run_ok(&json!([linear_move(beside(start, 80.0), 2.0)]));
    cell.pass(1.0);
    cell.run_ok(&json!([curve(start)]));
    cell.pass(1.0);
    let here = cell.world();
    cell.pass(30.0);
    assert_near(cell.world(), here, 1e-6);
    assert_eq!(cell.query(&["isMoving", "RemoteCmdLen", "curAlarm"]), [json!("0"), json!("0"), json!("0")]);
}

#[test]
fn a_lone_curve_is_executed_where_the_profile_says_so() {
    for settings in
        ["lone_curve = \"run\"", "base = \"r6-host\"", "base = \"r6-pendant\"", "base = \"legacy\""]
    {
        let mut cell = cell(settings);
        let acknowledged = |cell: &mut Cell, list: &Value| {
            cell.add_rcc("1", list);
            cell.pass(0.018);
            assert!(cell.frame().unwrap().contains(r#""ok""#), "{settings}");
        };
        acknowledged(&mut cell, &json!([axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]));
        cell.pass(5.0);
        let start = cell.world();
        acknowledged(&mut cell, &json!([curve(start)]));
        cell.pass(30.0);
        assert_near(cell.world(), beside(start, 40.0), 1e-3);
    }
}

/// Steps that stay are skipped in each pass, and the log says so only once.
#[test]
fn a_lone_curve_that_stays_is_told_once() {
    let mut cell = cell_with_room("");
    cell.log();
    let mut kept = curve(cell.world());
    kept["oneshot"] = json!("0");
    cell.run_ok(&json!([kept]));
    cell.pass(10.0);
    assert_eq!(cell.text("RemoteCmdLen"), "1");
    let log = cell.log();
    assert_eq!(log.matches("not executed").count(), 1, "{log}");
}

/// Reported, unit B: `["AddRCC","err"]` came for a list of actions 51 and 10 that nevertheless ran.
#[test]
fn a_path_speed_before_a_line_is_answered_err_and_runs_where_the_profile_says_so() {
    let path_speed = json!({"oneshot": "1", "action": "51", "isUse": "1", "speed": "50"});
    for (settings, answer) in [("", "ok"), ("path_speed_answer = \"err\"", "err")] {
        let mut cell = cell_with_room(settings);
        let start = cell.world();
        cell.log();
        assert_eq!(cell.run(&json!([path_speed, linear_move(beside(start, 30.0), 5.0)])), ["AddRCC", answer]);
        assert_eq!(cell.log().contains("answered err, and executed"), answer == "err");
        cell.pass(30.0);
        assert_near(cell.world(), beside(start, 30.0), 1e-3);
        assert_eq!(cell.query(&["RemoteCmdLen", "curAlarm"]), [json!("0"), json!("0")]);
        // Neither of the two alone, nor in the other order.
        for list in [
            json!([path_speed]),
            json!([linear_move(start, 5.0)]),
            json!([linear_move(beside(start, 9.0), 5.0), path_speed]),
            json!([path_speed, axis_move([0.0, -20.0, 10.0, 0.0, 40.0, 0.0], 100.0)]),
        ] {
            assert_eq!(cell.run(&list), ["AddRCC", "ok"], "{list}");
            cell.pass(30.0);
        }
    }
}

/// Whether a move is cut short: if its watched signal is already there, and if the signal comes during the
/// move.
fn cut_short(settings: &str) -> [bool; 2] {
    [true, false].map(|is_there_before| {
        let mut cell = cell(settings);
        cell.controller.set_input(cell.now, 0, 3, is_there_before);
        cell.run_ok(&json!([watch(true, "1"), axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
        cell.pass(0.5);
        cell.controller.set_input(cell.now, 0, 3, true);
        cell.pass(20.0);
        assert_eq!(
            cell.query(&["RemoteCmdLen", "curAlarm", "isMoving"]),
            [json!("0"), json!("0"), json!("0")]
        );
        cell.number("axis-0") < 89.0
    })
}

#[test]
fn the_profile_says_whether_a_signal_that_is_there_already_stops_a_move() {
    assert_eq!(cut_short(""), [true, true]);
    assert_eq!(cut_short("signal_stop = \"level\""), [true, true]);
    assert_eq!(cut_short("signal_stop = \"edge\""), [false, true]);
}

/// An edge counts in the watched direction, and again for the next move.
#[test]
fn an_edge_stops_each_move_during_which_it_comes() {
    let mut cell = cell("signal_stop = \"edge\"");
    let to = |j1: f64| axis_move([j1, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0);
    cell.run_ok(&json!([watch(true, "0"), to(90.0), to(-90.0)]));
    cell.pass(0.5);
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.pass(0.5);
    assert_eq!(cell.text("RemoteCmdLen"), "2", "it came, and that it goes is watched");
    cell.controller.set_input(cell.now, 0, 3, false);
    cell.pass(0.2);
    assert_eq!(cell.text("RemoteCmdLen"), "1");
    cell.pass(0.5);
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.controller.set_input(cell.now, 0, 3, false);
    cell.pass(0.2);
    assert_eq!(cell.query(&["RemoteCmdLen", "isMoving", "curAlarm"]), [json!("0"), json!("0"), json!("0")]);
}

/// Whether the watch of one list still stops a move of the next list, if that is appended and if it replaces
/// the first.
fn outlives(settings: &str) -> [bool; 2] {
    [false, true].map(|replaces| {
        let mut cell = cell(settings);
        cell.run_ok(&json!([watch(true, "1"), axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]));
        cell.pass(5.0);
        assert_near(cell.axes(), [5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
        cell.controller.set_input(cell.now, 0, 3, true);
        let next = json!([axis_move([60.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]);
        if replaces {
            cell.run_ok(&next)
        } else {
            cell.append_ok(&next)
        }
        cell.pass(20.0);
        assert_eq!(cell.query(&["RemoteCmdLen", "curAlarm"]), [json!("0"), json!("0")]);
        cell.number("axis-0") < 59.0
    })
}

#[test]
fn the_profile_says_whether_the_watch_outlives_its_list() {
    assert_eq!(outlives(""), [true, true], "manual 6.1.4: it ends with `isUse` 0");
    assert_eq!(outlives("signal_stop_outlives_list = false"), [false, false]);
}

/// The watch also ends if its list is replaced while it still runs.
#[test]
fn a_watch_ends_with_the_list_that_is_replaced_before_its_end() {
    let mut cell = cell("signal_stop_outlives_list = false\nreplace_in_motion = \"take-over\"");
    cell.run_ok(&json!([watch(true, "1"), axis_move([90.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]));
    cell.pass(1.0);
    cell.run_ok(&json!([axis_move([0.0, 30.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.pass(20.0);
    assert_near(cell.axes(), [0.0, 30.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
}

/// The watch lasts as long as its list, not only as long as one step.
#[test]
fn a_watch_that_ends_with_its_list_lasts_until_then() {
    let mut cell = cell("signal_stop_outlives_list = false");
    let to = |j1: f64| axis_move([j1, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0);
    cell.run_ok(&json!([watch(true, "1"), to(10.0), to(90.0)]));
    cell.pass(0.7);
    assert_eq!(cell.text("RemoteCmdLen"), "1");
    cell.controller.set_input(cell.now, 0, 3, true);
    cell.pass(20.0);
    assert!(cell.number("axis-0") < 89.0);
}

#[test]
fn a_single_cycle_without_a_list_waits_for_one() {
    for start in [StartState::Waiting, StartState::Auto] {
        let mut cell = Cell::with(Profile::hc1(), start);
        cell.ok(&["actionSingleCycle"]);
        cell.pass(60.0);
        assert_eq!(cell.text("curMode"), "9");
        // One list, and the cycle is over; a step that stays is not executed a second time.
        let mut kept = axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0);
        kept["oneshot"] = json!("0");
        cell.run_ok(&json!([kept]));
        assert_eq!(cell.query(&["curMode", "isMoving"]), [json!("9"), json!("1")]);
        cell.pass(20.0);
        assert_eq!(
            cell.query(&["curMode", "isMoving", "axis-0"]),
            [json!("2"), json!("0"), json!("10.000000")]
        );
        assert_eq!(cell.run(&json!([axis_move([0.0; 6], 50.0)])), ["AddRCC", "err"]);
    }
}

#[test]
fn a_single_cycle_that_waits_for_a_list_can_be_left() {
    for command in ["stopButton", "actionStop", "actionPause"] {
        let mut cell = Cell::new();
        cell.ok(&["actionSingleCycle"]);
        cell.ok(&[command]);
        assert_eq!(cell.text("curMode"), "2", "{command}");
        assert_eq!(cell.run(&json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)])), ["AddRCC", "err"]);
    }
}

#[test]
fn a_single_cycle_without_a_list_ends_where_the_profile_says_so() {
    let mut cell = cell("idle_single_cycle = \"end\"");
    cell.ok(&["actionSingleCycle"]);
    assert_eq!(cell.text("curMode"), "2");
}

#[test]
fn the_profile_says_what_an_instruction_without_oneshot_is() {
    for (settings, left) in
        [("", "1"), ("oneshot_missing = \"keep\"", "1"), ("oneshot_missing = \"remove\"", "0")]
    {
        let mut cell = cell(settings);
        let mut step = axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0);
        step.as_object_mut().unwrap().remove("oneshot");
        // An instruction with `oneshot` keeps its own value.
        let own = axis_move([0.0; 6], 100.0);
        cell.run_ok(&json!([own, step]));
        cell.pass(20.0);
        assert_eq!(cell.text("RemoteCmdLen"), left, "{settings}");
        let log = cell.log();
        assert!(log.contains("instruction 2 has no `oneshot`"), "{log}");
        let mut kept = axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0);
        kept["oneshot"] = json!("0");
        cell.run_ok(&json!([kept]));
        cell.pass(20.0);
        assert_eq!(cell.text("RemoteCmdLen"), "1", "{settings}");
        assert!(!cell.log().contains("has no `oneshot`"));
    }
}

#[test]
fn the_profile_says_whether_an_arm_that_waits_to_set_out_moves() {
    for (settings, moving) in [("", "0"), ("moving_in_delay = false", "0"), ("moving_in_delay = true", "1")] {
        let mut cell = cell(settings);
        let mut step = axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0);
        step["delay"] = json!("1.0");
        cell.run_ok(&json!([step]));
        cell.pass(0.9);
        assert_eq!(
            cell.query(&["axis-0", "isMoving", "RemoteCmdLen"]),
            [json!("0.000000"), json!(moving), json!("1")],
            "{settings}"
        );
        let now = cell.now;
        assert_eq!(cell.controller.snapshot(now).moving, moving == "1");
        cell.pass(0.2);
        assert_eq!(cell.text("isMoving"), "1");
        cell.pass(10.0);
        assert_eq!(cell.query(&["axis-0", "isMoving"]), [json!("10.000000"), json!("0")]);
    }
}

/// A client that polls right after the reply must not see an arm that seems to have arrived already.
#[test]
fn a_move_without_a_delay_moves_from_the_start() {
    let mut cell = cell("add_rcc_ack_ms = 0");
    cell.run_ok(&json!([axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    assert_eq!(cell.text("isMoving"), "1");
}

/// Replies come as usual, because it is unknown what a real controller does with them.
#[test]
fn a_wrong_ds_id_is_told_once_for_each_connection() {
    let query = |ds_id: &str| format!(r#"{{{ds_id}"reqType":"query","queryAddr":["curMode"]}}"#);
    for (wrong, named) in [
        (r#""dsID":"www.hc-system.com.cam","#, "`www.hc-system.com.cam`"),
        (r#""dsID":"www.hc-system.com.RemoteMonitr","#, "`www.hc-system.com.RemoteMonitr`"),
        ("", "no `dsID`"),
    ] {
        let mut cell = Cell::new();
        for _ in 0..3 {
            assert!(cell.ask(query(wrong)).contains(r#""queryData":["7"]"#));
        }
        let log = cell.log();
        assert!(log.contains(named) && log.contains("www.hc-system.com.RemoteMonitor"), "{log}");
        assert_eq!(log.lines().filter(|line| line.contains("dsID")).count(), 1, "{log}");
        cell.id = cell.controller.connect(cell.now);
        cell.ask(query(wrong));
        assert!(cell.log().contains(named));
    }
    for right in ["www.hc-system.com.RemoteMonitor", "HCRemoteMonitor"] {
        let mut cell = Cell::new();
        cell.ask(query(&format!(r#""dsID":"{right}","#)));
        assert_eq!(cell.log(), "");
    }
}
