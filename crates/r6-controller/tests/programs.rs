//! Taught programs: the effect of each step, and how programs begin, continue and end.

mod common;

use common::{Cell, assert_near};
use r6_controller::{ControllerSettings, Event, PanelAction, Profile, RobotModel, StartState};
use r6_proto::alarm::AlarmCode;
use serde_json::json;

const PHOTO: &str = r#"{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":0}"#;

/// Counters 0, 2 and 5 at 0, as every new controller has them.
fn cell_with(profile: Profile, programs: &[(&str, &str)], start: StartState) -> Cell {
    let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
    let mut settings = ControllerSettings { start, ..ControllerSettings::new(profile, model) };
    for (name, text) in programs {
        settings.library.load(name, text).unwrap_or_else(|error| panic!("{error}"));
    }
    programs[0].0.clone_into(&mut settings.mold);
    Cell::of(settings)
}

/// A controller that runs this program.
fn running(text: &str) -> Cell {
    cell_with(Profile::hc1(), &[("test", text)], StartState::Waiting)
}

/// The same, waiting for the start button.
fn ready(text: &str) -> Cell {
    cell_with(Profile::hc1(), &[("test", text)], StartState::Auto)
}

fn count(cell: &mut Cell, id: u32) -> i64 {
    let value = cell.value(&format!("counter-{id}"));
    // Old firmware: `name[id][T:target][C:current]`.
    let old =
        |text: &str| text.split_once("[C:").and_then(|(_, rest)| rest.trim_end_matches(']').parse().ok());
    value[2].as_i64().or_else(|| value.as_str().and_then(old)).unwrap_or_else(|| panic!("{value}"))
}

const COUNT: &str = "[[step]]\ndo=\"counter\"\nnumber=0\nby=1\n";

fn axis_move(j1: f64, more: &str) -> String {
    format!("[[step]]\ndo=\"axis-move\"\nto=[{j1}]\nspeed=50\n{more}\n")
}

fn wait(seconds: f64) -> String {
    format!("[[step]]\ndo=\"wait\"\nseconds={seconds}\n")
}

#[test]
fn a_cycle_is_counted_timed_and_begun_again() {
    let mut cell = running(&format!("{COUNT}{}", wait(2.0)));
    cell.pass(1.0);
    assert_eq!(count(&mut cell, 0), 1);
    assert!((cell.number("curCycle") - 1.0).abs() < 1e-6);
    cell.pass(9.5);
    assert_eq!(count(&mut cell, 0), 6);
    assert!((cell.number("lastCycle") - 2.0).abs() < 1e-6);
    cell.ok(&["modifyCounter", "0", "100", "-1"]);
    cell.pass(2.0);
    assert_eq!(count(&mut cell, 0), 101);
}

#[test]
fn moves_blend_from_step_to_step() {
    let program = |blend: u8| {
        let more = format!("blend={blend}");
        [
            axis_move(20.0, &more),
            axis_move(40.0, &more),
            axis_move(0.0, ""),
            "[[step]]\ndo=\"remote\"\n".into(),
        ]
        .concat()
    };
    let stops = |blend| {
        let mut cell = running(&program(blend));
        let (mut stops, mut stood) = (0, true);
        while cell.text("isMoving") == "1" {
            let stands = cell.number("curSpeed-0").abs() < 1.0;
            stops += u32::from(stands && !stood);
            stood = stands;
            cell.pass(0.005);
            assert!(cell.now.since(r6_proto::time::Instant::ORIGIN).as_secs() < 20);
        }
        assert_near(cell.axes(), [0.0; 6], 1e-6);
        stops
    };
    // It turns back at 40 and rests there for an instant; level 0 also stops at 20.
    assert!(stops(0) >= 2);
    assert!(stops(5) <= 1);
}

#[test]
fn points_are_waited_for_and_set() {
    let mut cell = running(
        "[[step]]\ndo=\"wait\"\npoint=\"X012\"\nuntil=\"rising\"\n\
         [[step]]\ndo=\"output\"\npoint=\"Y011\"\non=true\n\
         [[step]]\ndo=\"output\"\npoint=\"Y1.013\"\non=true\n\
         [[step]]\ndo=\"output\"\npoint=\"Y014\"\npulse=0.5\n\
         [[step]]\ndo=\"board-output\"\nset=[\"M010\",\"M047\"]\n\
         [[step]]\ndo=\"remote\"\n",
    );
    cell.pass(3.0);
    assert_eq!(cell.text("output-0"), "0");
    cell.controller.set_input(cell.now, 0, 2, true);
    assert_eq!(cell.query(&["output-0", "output-1", "M-0"]), [json!("18"), json!("8"), json!("2147483649")]);
    cell.pass(0.6);
    assert_eq!(cell.text("output-0"), "2", "the pulse is over");
}

#[test]
fn a_wait_that_runs_out_goes_on_elsewhere_or_is_an_alarm() {
    let mut cell = running(
        "[[step]]\ndo=\"wait\"\npoint=\"X010\"\nlimit=2\nelse=\"late\"\n\
         [[step]]\ndo=\"remote\"\n\
         [[step]]\ndo=\"label\"\nname=\"late\"\n\
         [[step]]\ndo=\"wait\"\npoint=\"X015\"\nlimit=1\n",
    );
    cell.pass(2.5);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(1.0);
    assert_eq!(cell.query(&["curAlarm", "curMode"]), [json!("2053"), json!("2")]);
}

#[test]
fn programs_call_one_another_and_return() {
    let main = "[[step]]\ndo=\"call\"\nprogram=\"sub\"\n[[step]]\ndo=\"register\"\nnumber=801\nby=1\n[[step]]\ndo=\"remote\"";
    let sub = "[[step]]\ndo=\"register\"\nnumber=800\nto=7\n[[step]]\ndo=\"return\"\n[[step]]\ndo=\"alarm\"\nnumber=5000";
    let mut cell = cell_with(Profile::hc1(), &[("main", main), ("sub", sub)], StartState::Waiting);
    assert_eq!(cell.query(&["Addr-800", "Addr-801", "curAlarm"]), [json!("7"), json!("1"), json!("0")]);
    // A program that calls itself is an error and does not hang.
    let mut cell = running("[[step]]\ndo=\"call\"\nprogram=\"test\"");
    assert_eq!(cell.text("curAlarm"), "10");
    assert!(cell.log().contains("program `test`, step 1: programs call one another more than 16 deep"));
    let mut cell = running("[[step]]\ndo=\"call\"\nprogram=\"nowhere\"");
    assert_eq!(cell.text("curAlarm"), "10");
}

#[test]
fn end_ends_the_cycle_from_any_depth() {
    let main = format!(
        "{COUNT}{}[[step]]\ndo=\"call\"\nprogram=\"sub\"\n[[step]]\ndo=\"alarm\"\nnumber=5000",
        wait(1.0)
    );
    let sub = "[[step]]\ndo=\"end\"";
    let mut cell = cell_with(Profile::hc1(), &[("main", &main), ("sub", sub)], StartState::Waiting);
    cell.pass(4.5);
    assert_eq!((count(&mut cell, 0), cell.text("curAlarm").as_str()), (5, "0"));
}

#[test]
fn a_loop_that_takes_no_time_takes_a_millisecond_a_round() {
    let mut cell = running(&format!(
        "[[step]]\ndo=\"label\"\nname=\"again\"\n{COUNT}[[step]]\ndo=\"jump\"\nto=\"again\""
    ));
    cell.pass(1.0);
    let rounds = count(&mut cell, 0);
    assert!((990..=1010).contains(&rounds), "{rounds}");
    let mut cell = running(COUNT);
    cell.pass(1.0);
    let rounds = count(&mut cell, 0);
    assert!((990..=1010).contains(&rounds), "{rounds}");
}

#[test]
fn conditions_choose_the_way() {
    let program = "[[step]]\ndo=\"if\"\npoint=\"X010\"\nto=\"a\"\n\
                   [[step]]\ndo=\"if\"\ncounter=0\nat_least=3\nto=\"b\"\n\
                   [[step]]\ndo=\"if\"\nregister=810\nequals=5\nto=\"c\"\n\
                   [[step]]\ndo=\"if\"\ncounter=2\nreached=true\nto=\"d\"\n\
                   [[step]]\ndo=\"if\"\npoints=1\nmodel=4\nto=\"e\"\n\
                   [[step]]\ndo=\"remote\"\n";
    let ends = |name: &str, value: u32| {
        format!(
            "[[step]]\ndo=\"label\"\nname=\"{name}\"\n[[step]]\ndo=\"register\"\nnumber=800\nto={value}\n[[step]]\ndo=\"remote\"\n"
        )
    };
    let program = ["a", "b", "c", "d", "e"]
        .iter()
        .zip(1..)
        .fold(program.to_owned(), |program, (name, value)| program + &ends(name, value));
    let way = |prepare: &dyn Fn(&mut Cell)| {
        let mut cell = ready(&program);
        prepare(&mut cell);
        cell.ok(&["startButton"]);
        cell.text("Addr-800")
    };
    assert_eq!(way(&|_| ()), "0");
    assert_eq!(way(&|cell| cell.controller.set_input(cell.now, 0, 0, true)), "1");
    assert_eq!(way(&|cell| cell.ok(&["modifyCounter", "0", "3", "-1"])), "2");
    assert_eq!(way(&|cell| cell.ok(&["rewriteData", "810", "5", "0"])), "3");
    assert_eq!(way(&|cell| cell.ok(&["modifyCounter", "2", "4", "4"])), "4");
    assert_eq!(way(&|cell| assert!(points(cell, 1, &[(4, 0.0)]).contains("AddPoints"))), "5");
    assert_eq!(way(&|cell| assert!(points(cell, 1, &[(3, 0.0)]).contains("AddPoints"))), "0");
}

/// Sends points of a camera: template, and offset along Y from the middle of the reach.
fn points(cell: &mut Cell, camera: u32, found: &[(u32, f64)]) -> String {
    let data: Vec<_> = found
        .iter()
        .map(|(model, y)| json!({"ModelID": model, "X": 400.0, "Y": y, "Z": 450.0, "Angel": 90.0, "Rel": 0}))
        .collect();
    cell.ask(json!({"dsID": "www.hc-system.com.cam", "reqType": "AddPoints", "dsData": [{"camID": camera, "data": data}]}).to_string())
}

#[test]
fn the_snapshot_tells_the_step_whose_turn_it_is() {
    let mut cell = running(&format!(
        "{}[[step]]\ndo=\"wait\"\npoint=\"X011\"\n[[step]]\ndo=\"call\"\nprogram=\"remote\"",
        axis_move(20.0, "")
    ));
    let step = |cell: &mut Cell| {
        let step = cell.controller.snapshot(cell.now).step.unwrap();
        (step.program, step.number, step.steps, step.text)
    };
    cell.pass(0.1);
    assert_eq!(step(&mut cell), ("test".to_owned(), 1, 3, "axis move".to_owned()));
    cell.pass(10.0);
    assert_eq!(step(&mut cell), ("test".to_owned(), 2, 3, "wait until X011 is on".to_owned()));
    assert!(!cell.controller.snapshot(cell.now).is_ready(), "mode 7, and no list is taken");
    cell.controller.operate(cell.now, &PanelAction::SetInput { board: 0, point: 1, on: true }).unwrap();
    cell.pass(0.1);
    assert_eq!(step(&mut cell), ("remote".to_owned(), 1, 1, "wait for remote commands".to_owned()));
    assert!(cell.controller.snapshot(cell.now).is_ready());
}

#[test]
fn points_of_cameras_are_told_shown_and_removed() {
    let mut cell = running("[[step]]\ndo=\"remote\"");
    points(&mut cell, 2, &[(1, 70.0), (1, 71.0)]);
    points(&mut cell, 0, &[(1, 70.0)]);
    assert_eq!(cell.controller.snapshot(cell.now).points, [(0, 1), (2, 2)]);
    cell.controller.operate(cell.now, &PanelAction::ClearPoints).unwrap();
    assert_eq!(cell.controller.snapshot(cell.now).points, []);
    let log = std::iter::from_fn(|| cell.controller.poll_log()).map(|entry| entry.event);
    let about_points =
        |event: &Event| matches!(event, Event::PointsTaken { .. } | Event::PointsCleared { .. });
    let told: Vec<_> = log.filter(about_points).collect();
    assert_eq!(
        told,
        [
            Event::PointsTaken { camera: 2, points: 2, waiting: 2 },
            Event::PointsTaken { camera: 0, points: 1, waiting: 3 },
            Event::PointsCleared { points: 3 },
        ]
    );
}

const TOOL_DOWN: &str = "[[step]]\ndo=\"axis-move\"\nto=[0,10,-20,0,-80,0]\nspeed=100\n";

#[test]
fn points_of_a_camera_are_targets_in_the_order_they_came() {
    let mut cell = running(&format!(
        "{TOOL_DOWN}[[step]]\ndo=\"label\"\nname=\"next\"\n\
         [[step]]\ndo=\"take-point\"\ncamera=0\nmodel=2\n\
         [[step]]\ndo=\"move-to-point\"\nabove=10\nspeed=50\n{COUNT}{}\
         [[step]]\ndo=\"jump\"\nto=\"next\"",
        wait(1.0)
    ));
    cell.pass(5.0);
    assert_eq!(cell.text("isMoving"), "0", "it waits for a point");
    // Points of another template, and of another camera, are not for this program.
    points(&mut cell, 0, &[(1, 70.0)]);
    points(&mut cell, 1, &[(2, 70.0)]);
    cell.pass(5.0);
    assert_eq!(count(&mut cell, 0), 0);
    points(&mut cell, 0, &[(2, -40.0), (2, 40.0)]);
    cell.pass(1.9);
    let [x, y, z, ..] = cell.world();
    assert!((x - 400.0).abs() < 1e-3 && (y + 40.0).abs() < 1e-3 && (z - 460.0).abs() < 1e-3, "{x} {y} {z}");
    assert!((cell.number("world-5") - 90.0).abs() < 1e-3, "Angel is W");
    cell.pass(4.0);
    assert!((cell.number("world-1") - 40.0).abs() < 1e-3);
    assert_eq!(count(&mut cell, 0), 2);
    assert_eq!(cell.controller.machine().points().len(), 2, "the others wait for somebody else");
}

#[test]
fn a_relative_point_is_a_way_from_here() {
    let mut cell = running(&format!(
        "{TOOL_DOWN}[[step]]\ndo=\"take-point\"\n[[step]]\ndo=\"move-to-point\"\nspeed=50\n[[step]]\ndo=\"remote\""
    ));
    cell.pass(5.0);
    let from = cell.world();
    let point = json!({"ModelID": 0, "X": "10.5", "Y": "-20.0", "Z": "5", "U": "0", "V": "0", "Angel": "15", "Rel": "1"});
    cell.ask(json!({"dsID": "www.hc-system.com.cam", "reqType": "AddPoints", "dsData": [{"camID": 0, "data": [point]}]}).to_string());
    cell.pass(5.0);
    let to = cell.world();
    for (n, way) in [10.5, -20.0, 5.0, 0.0, 0.0, 15.0].into_iter().enumerate() {
        let turned = (to[n] - from[n] - way + 540.0).rem_euclid(360.0) - 180.0;
        assert!(turned.abs() < 1e-3, "component {n}: from {} to {}", from[n], to[n]);
    }
}

#[test]
fn points_that_do_not_come() {
    let take = |more: &str| {
        format!(
            "[[step]]\ndo=\"take-point\"\n{more}\n[[step]]\ndo=\"remote\"\n[[step]]\ndo=\"label\"\nname=\"none\"\n[[step]]\ndo=\"alarm\"\nnumber=5003\n"
        )
    };
    let mut cell = running(&take("limit=3"));
    cell.pass(2.9);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(0.2);
    assert_eq!(cell.text("curAlarm"), "201");
    let mut cell = running(&take("else=\"none\""));
    assert_eq!(cell.text("curAlarm"), "5003", "at once");
    let mut cell = running(&take("limit=3\nelse=\"none\""));
    points(&mut cell, 5, &[(0, 0.0)]);
    cell.pass(2.0);
    points(&mut cell, 6, &[(0, 0.0)]);
    cell.pass(0.9);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(0.2);
    assert_eq!(cell.text("curAlarm"), "5003", "points of other cameras do not lengthen the wait");
}

/// After an alarm in the middle of a wait, the wait has its whole limit again, not the rest of the old one.
#[test]
fn a_wait_that_an_alarm_ended_begins_anew() {
    let mut cell = running("[[step]]\ndo=\"take-point\"\nlimit=3\n[[step]]\ndo=\"remote\"");
    cell.pass(1.0);
    cell.controller.operate(cell.now, &r6_controller::PanelAction::RaiseAlarm(AlarmCode(5000))).unwrap();
    cell.pass(10.0);
    cell.ok(&["clearAlarmContinue"]);
    cell.pass(2.9);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(0.2);
    assert_eq!(cell.text("curAlarm"), "201");
    // A point of another camera does not lengthen the wait, and the next step has its own limit.
    let take = "[[step]]\ndo=\"take-point\"\nlimit=3\n";
    let mut cell = running(&format!("{take}{take}[[step]]\ndo=\"remote\""));
    cell.pass(2.0);
    points(&mut cell, 0, &[(0, 0.0)]);
    cell.pass(2.9);
    assert_eq!(cell.text("curAlarm"), "0");
    cell.pass(0.2);
    assert_eq!(cell.text("curAlarm"), "201");
}

fn photo_answer(cell: &mut Cell, ret: u32) {
    let answer = json!({"dsID": "www.hc-system.com.cam", "reqType": "photo", "camID": 0, "ret": ret});
    cell.send(answer.to_string());
}

#[test]
fn a_photo_is_asked_for_again_and_then_is_an_alarm() {
    let program =
        format!("[[step]]\ndo=\"photo\"\nlimit=2\ntries=3\nalarm=5001\n{COUNT}[[step]]\ndo=\"remote\"");
    let mut cell = running(&program);
    cell.pass(0.0);
    assert_eq!(cell.frame().as_deref(), Some(PHOTO));
    assert_eq!(cell.frame(), None);
    cell.pass(2.0);
    assert_eq!(cell.frame().as_deref(), Some(PHOTO), "no answer within 2 s");
    photo_answer(&mut cell, 0);
    assert_eq!(cell.frame().as_deref(), Some(PHOTO), "the camera could not");
    cell.pass(1.0);
    photo_answer(&mut cell, 1);
    assert_eq!((count(&mut cell, 0), cell.text("curAlarm").as_str()), (1, "0"));

    let mut cell = running(&program);
    cell.pass(6.1);
    assert_eq!(std::iter::from_fn(|| cell.frame()).count(), 3);
    assert_eq!(cell.text("curAlarm"), "5001");
    assert!(
        cell.log().contains("program `test`, step 1: camera 0: no answer to the photo request within 2 s")
    );
}

#[test]
fn an_alarm_of_the_program_is_cleared_and_it_goes_on_behind_it() {
    let mut cell = running(&format!(
        "{COUNT}[[step]]\ndo=\"alarm\"\nnumber=5005\n[[step]]\ndo=\"counter\"\nnumber=2\nby=1\n[[step]]\ndo=\"remote\""
    ));
    assert_eq!(cell.query(&["curAlarm", "curMode"]), [json!("5005"), json!("2")]);
    cell.ok(&["clearAlarmContinue"]);
    assert_eq!(cell.query(&["curAlarm", "curMode"]), [json!("0"), json!("7")]);
    assert_eq!((count(&mut cell, 0), count(&mut cell, 2)), (1, 1));
}

#[test]
fn a_step_that_cannot_be_is_left_out_by_run_next() {
    let mut cell = running(&format!("{}{COUNT}[[step]]\ndo=\"remote\"", axis_move(170.0, "")));
    assert_eq!(cell.text("curAlarm"), "130");
    assert!(cell.log().contains("program `test`, step 1: J1 above its upper soft limit"));
    cell.ok(&["clearAlarmContinue"]);
    assert_eq!((cell.text("curAlarm").as_str(), count(&mut cell, 0)), ("130", 0), "the same step again");
    cell.ok(&["clearAlarmRunNext"]);
    assert_eq!((cell.text("curAlarm").as_str(), count(&mut cell, 0)), ("0", 1));
    // A step with a missing counter is not an instruction, but is skipped as well.
    let mut cell =
        running(&format!("[[step]]\ndo=\"counter\"\nnumber=77\nby=1\n{COUNT}[[step]]\ndo=\"remote\""));
    assert_eq!(cell.text("curAlarm"), "300");
    cell.ok(&["clearAlarmRunNext"]);
    assert_eq!((cell.text("curAlarm").as_str(), count(&mut cell, 0)), ("0", 1));
}

#[test]
fn stop_begins_anew_and_pause_goes_on() {
    let program = format!("{COUNT}{}{}", axis_move(20.0, ""), wait(3.0));
    for (word, counted) in [("actionStop", 2), ("actionPause", 1)] {
        let mut cell = running(&program);
        cell.pass(0.2);
        cell.ok(&[word]);
        cell.pass(1.0);
        assert_eq!(cell.text("isMoving"), "0");
        cell.ok(&["startButton"]);
        assert_eq!(count(&mut cell, 0), counted, "{word}");
        cell.pass(1.5);
        assert_near(cell.axes(), [20.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
        // The same in the wait.
        cell.ok(&[word]);
        cell.pass(10.0);
        assert_eq!(count(&mut cell, 0), counted);
        cell.ok(&["startButton"]);
        assert_eq!(count(&mut cell, 0), if word == "actionStop" { 3 } else { 1 });
    }
}

#[test]
fn the_first_press_of_stop_finishes_the_cycle_and_the_second_stops() {
    let program = format!("{COUNT}{}", wait(4.0));
    let mut cell = running(&program);
    cell.pass(1.0);
    cell.ok(&["stopButton"]);
    cell.pass(2.0);
    assert_eq!(cell.text("curMode"), "7");
    cell.pass(2.0);
    assert_eq!((cell.text("curMode").as_str(), count(&mut cell, 0)), ("2", 1));
    cell.ok(&["startButton"]);
    cell.ok(&["stopButton"]);
    cell.ok(&["stopButton"]);
    assert_eq!(cell.text("curMode"), "2");
}

#[test]
fn a_single_cycle_is_one_cycle() {
    let mut cell = ready(&format!("{COUNT}{}", wait(2.0)));
    cell.ok(&["actionSingleCycle"]);
    assert_eq!(cell.text("curMode"), "9");
    cell.pass(10.0);
    assert_eq!((cell.text("curMode").as_str(), count(&mut cell, 0)), ("2", 1));
}

/// Each press runs one step, also if the step is not an instruction.
#[test]
fn a_taught_program_goes_step_by_step() {
    use r6_controller::panel::{Button, PanelAction};
    let mut cell = ready(&format!(
        "{COUNT}{}[[step]]\ndo=\"label\"\nname=\"a\"\n{}",
        axis_move(10.0, "blend=5"),
        axis_move(0.0, "")
    ));
    let press = |cell: &mut Cell| {
        cell.controller.operate(cell.now, &PanelAction::Press(Button::SingleStep)).unwrap();
        let began = cell.text("curMode");
        cell.pass(3.0);
        assert_eq!(cell.text("curMode"), "2", "it rests behind each step");
        began
    };
    assert_eq!((press(&mut cell).as_str(), count(&mut cell, 0)), ("2", 1));
    assert_eq!((press(&mut cell).as_str(), cell.text("axis-0").as_str()), ("8", "10.000000"));
    assert_eq!((press(&mut cell).as_str(), cell.text("axis-0").as_str()), ("2", "10.000000"), "the label");
    assert_eq!((press(&mut cell).as_str(), cell.text("axis-0").as_str()), ("8", "0.000000"));
    assert_eq!(count(&mut cell, 0), 1);
    // A jump back that would rest for a millisecond is one step, too.
    let mut cell =
        ready(&format!("[[step]]\ndo=\"label\"\nname=\"a\"\n{COUNT}[[step]]\ndo=\"jump\"\nto=\"a\""));
    for (pressed, counted) in [(1, 0), (2, 1), (3, 1), (4, 1), (5, 2), (6, 2), (7, 2), (8, 3)] {
        press(&mut cell);
        assert_eq!(count(&mut cell, 0), counted, "press {pressed}");
    }
}

#[test]
fn remote_commands_are_one_step_of_a_program() {
    let mut cell = running(&format!("{}[[step]]\ndo=\"remote\"\n{COUNT}{}", axis_move(10.0, ""), wait(1.0)));
    let list = json!([common::axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]);
    assert_eq!(cell.run(&list), ["AddRCC", "err"], "the program moves");
    cell.pass(2.0);
    assert_eq!(cell.text("axis-0"), "10.000000");
    cell.run_ok(&list);
    assert_eq!(cell.query(&["RemoteCmdLen", "isMoving"]), [json!("1"), json!("1")]);
    cell.pass(0.7);
    assert_eq!(cell.query(&["RemoteCmdLen", "axis-0"]), [json!("0"), json!("5.000000")]);
    assert_eq!(count(&mut cell, 0), 1, "the list is over, and the program goes on");
    assert_eq!(cell.run(&list), ["AddRCC", "err"], "it waits for something else");
    cell.pass(3.0);
    assert_eq!(cell.text("axis-0"), "10.000000", "and begins again");
    cell.run_ok(&list);
}

/// A client that clears leftovers does not affect the program.
#[test]
fn an_empty_list_does_not_touch_a_program_that_moves_or_waits() {
    let program = format!("{COUNT}{}[[step]]\ndo=\"wait\"\npoint=\"X010\"\nlimit=4\n", axis_move(150.0, ""));
    for profile in ["hc1", "r6-host"] {
        let mut cell =
            cell_with(Profile::named(profile).unwrap(), &[("test", &program)], StartState::Waiting);
        cell.pass(1.0);
        let speed = cell.number("curSpeed-0");
        cell.run_ok(&json!([]));
        assert_eq!(cell.query(&["isMoving", "curAlarm"]), [json!("1"), json!("0")], "{profile}");
        assert!((cell.number("curSpeed-0") - speed).abs() < 1.0);
        assert!(cell.number("curCycle") > 1.0);
        cell.pass(1.5);
        assert_eq!(cell.text("isMoving"), "0");
        cell.run_ok(&json!([]));
        cell.pass(3.5);
        assert_eq!(cell.text("curAlarm"), "2048", "the wait's limit went on counting");
    }
}

#[test]
fn registers_tell_a_pose_where_the_program_says_so() {
    let mut cell = running(&format!(
        "{TOOL_DOWN}[[step]]\ndo=\"wait-for-registers\"\nfirst=820\ncount=6\nlimit=9\n[[step]]\ndo=\"move-to-registers\"\nfirst=820\npose=true\nspeed=40\n[[step]]\ndo=\"remote\""
    ));
    cell.pass(5.0);
    let [_, _, _, u, v, w] = cell.world().map(|value| (value * 1000.0).round().to_string());
    cell.ok(&["rewriteDataList", "820", "6", "0", "410000", "-30000", "460000", &u, &v, &w]);
    cell.pass(5.0);
    let [x, y, z, ..] = cell.world();
    assert!((x - 410.0).abs() < 1e-2 && (y + 30.0).abs() < 1e-2 && (z - 460.0).abs() < 1e-2, "{x} {y} {z}");
    let mut cell = running("[[step]]\ndo=\"wait-for-registers\"\nfirst=820\nlimit=9\n");
    cell.pass(9.1);
    assert_eq!(cell.text("curAlarm"), "10");
}

#[test]
fn a_switched_program_begins_at_its_beginning() {
    let mut cell = running(&format!("{COUNT}{}", wait(100.0)));
    cell.ok(&["switchMold", "remote"]);
    assert_eq!(cell.text("curMode"), "7");
    cell.run_ok(&json!([common::axis_move([5.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]));
    cell.pass(2.0);
    cell.ok(&["switchMold", "test"]);
    assert_eq!(count(&mut cell, 0), 2);
    assert_eq!(
        cell.command(&["switchMold", "tset"]),
        ["switchMold", "err", "there is no program `tset`; nearest: `test`"]
    );
}

#[test]
fn tools_and_workbenches_are_chosen() {
    let mut cell = running(
        "[[step]]\ndo=\"tool\"\nnumber=3\n[[step]]\ndo=\"workbench\"\nnumber=2\n[[step]]\ndo=\"remote\"",
    );
    assert_eq!(cell.value("toolCoord"), json!(["3", "2", "0"]));
}

/// A camera and a belt around the shipped program.
#[test]
fn pick_and_place_picks_what_the_camera_found() {
    for profile in ["hc1", "legacy"] {
        let (name, text) =
            r6_controller::Library::shipped().find(|(name, _)| *name == "pick-and-place").unwrap();
        let mut cell = cell_with(Profile::named(profile).unwrap(), &[(name, text)], StartState::Waiting);
        cell.controller.set_input(cell.now, 0, 0, true);
        cell.pass(1.5);
        assert!(cell.frame().is_some_and(|frame| frame.contains("photo")), "{profile}");
        photo_answer(&mut cell, 1);
        points(&mut cell, 0, &[(0, -40.0), (0, 0.0), (0, 40.0)]);
        let (mut grips, mut pulses, mut before) = (0, 0, 0);
        for _ in 0..6000 {
            cell.pass(0.01);
            let now: u32 = cell.text("output-0").parse().unwrap();
            grips += u32::from(now & 1 > before & 1);
            pulses += u32::from(now & 2 > before & 2);
            before = now;
            if cell.controller.machine().points().len() == 0 && now == 0 && count(&mut cell, 0) == 3 {
                break;
            }
        }
        assert_eq!((grips, pulses, count(&mut cell, 0)), (3, 3, 3), "{profile}");
        assert_eq!(cell.text("curAlarm"), "0");
        // Then it asks for the next photo.
        cell.pass(3.0);
        assert!(cell.frame().is_some_and(|frame| frame.contains("photo")), "{profile}");
    }
}

/// The pallet is filled place by place, and the PC changes the pattern.
#[test]
fn palletise_fills_the_stack_that_the_pc_describes() {
    let (name, text) = r6_controller::Library::shipped().find(|(name, _)| *name == "palletise").unwrap();
    let mut cell = cell_with(Profile::hc1(), &[(name, text)], StartState::Auto);
    // Two by one by two, wider apart.
    cell.ok(&["modifyStackData", "0", "60", "40", "30", "2", "1", "2"]);
    cell.ok(&["startButton"]);
    cell.controller.set_input(cell.now, 0, 0, true);
    let (mut places, mut held) = (Vec::new(), false);
    for _ in 0..20_000 {
        cell.pass(0.01);
        let outputs: u32 = cell.text("output-0").parse().unwrap();
        let holds = outputs & 1 == 1;
        if held && !holds {
            let [x, y, z, ..] = cell.world();
            places.push([x.round(), y.round(), z.round()]);
        }
        held = holds;
        if outputs & 4 == 4 {
            break;
        }
    }
    assert_eq!(
        places,
        [[340.0, -20.0, 440.0], [400.0, -20.0, 440.0], [340.0, -20.0, 470.0], [400.0, -20.0, 470.0]]
    );
    assert_eq!((count(&mut cell, 0), count(&mut cell, 2), cell.text("curAlarm").as_str()), (4, 4, "0"));
    // An empty pallet.
    cell.controller.set_input(cell.now, 0, 1, true);
    cell.pass(0.5);
    assert_eq!((cell.text("output-0").as_str(), count(&mut cell, 0)), ("0", 0));
}

#[test]
fn a_stack_that_is_not_there_is_an_error() {
    let program = "[[step]]\ndo=\"move-to-stack\"\nstack=3\ncounter=0\nfirst=[340,0,440]\nspeed=10";
    let mut cell = running(program);
    assert_eq!(cell.text("curAlarm"), "10");
    assert!(cell.log().contains("program `test`, step 1: there is no stack 3"));
}

/// A counter that the program defines counts; a counter that exists keeps its count.
#[test]
fn a_program_brings_its_counters_along() {
    let step = |number: u32| format!("[[step]]\ndo=\"counter\"\nnumber={number}\nby=1\n");
    let steps = step(3) + &step(0) + "[[step]]\ndo=\"remote\"";
    let mut cell = running(&format!(
        "[[counter]]\nnumber=3\ntarget=9\ncurrent=4\n[[counter]]\nnumber=0\ncurrent=50\n{steps}"
    ));
    assert_eq!(cell.text("curAlarm"), "0");
    assert_eq!((cell.value("counter-3"), cell.value("counter-0")), (json!([3, 9, 5]), json!([0, 0, 1])));
    let mut cell = running(&steps);
    assert_eq!(cell.text("curAlarm"), "300");
    let wrong = |counter: &str| {
        let text = format!("[[counter]]\n{counter}\n{steps}");
        r6_controller::Program::read("cell", &text).unwrap_err().to_string()
    };
    assert!(wrong("target=1").ends_with("`number` is missing: the number of a counter"));
    assert!(
        wrong("number=1\ntagret=1").ends_with("counter]] 1: there is no key `tagret`; nearest: `target`")
    );
}
