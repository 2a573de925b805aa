//! Cameras: over which connection a photo request goes, and which camera's points a program takes.

mod common;

use common::{Cell, axis_move};
use r6_controller::{ConnectionId, ControllerSettings, Profile, RobotModel};
use serde_json::{Value, json};

fn photo(camera: i64) -> String {
    format!(r#"{{"dsID":"www.hc-system.com.cam","reqType":"photo","camID":{camera}}}"#)
}

/// The `camID` of the photo request that each of these connections gets now, if any.
fn asked(cell: &mut Cell, connections: &[ConnectionId]) -> Vec<Option<String>> {
    let frame = |id: &ConnectionId| {
        let frame = cell.controller.poll_transmit(cell.now, *id)?;
        Some(String::from_utf8(frame.to_vec()).unwrap())
    };
    connections.iter().map(frame).collect()
}

/// Asks for a photo, and returns which of the connections got the request.
#[track_caller]
fn takers(cell: &mut Cell, camera: i64, connections: &[ConnectionId]) -> Vec<usize> {
    cell.controller.request_photo(cell.now, camera);
    let frames = asked(cell, connections);
    assert!(frames.iter().flatten().all(|frame| *frame == photo(camera)), "{frames:?}");
    frames.iter().enumerate().filter(|(_, frame)| frame.is_some()).map(|(n, _)| n).collect()
}

fn point(model: u32, y: f64) -> Value {
    json!({"ModelID": model, "X": 400.0, "Y": y, "Z": 450.0, "Angel": 90.0, "Rel": 0})
}

fn add_points(cell: &mut Cell, id: ConnectionId, sets: &[(i64, Vec<Value>)]) -> String {
    let data: Vec<_> = sets.iter().map(|(camera, points)| json!({"camID": camera, "data": points})).collect();
    let frame = json!({"dsID": "www.hc-system.com.cam", "reqType": "AddPoints", "dsData": data}).to_string();
    cell.controller.handle_input(cell.now, id, frame.as_bytes());
    String::from_utf8(cell.controller.poll_transmit(cell.now, id).unwrap().to_vec()).unwrap()
}

fn answer(cell: &mut Cell, id: ConnectionId, camera: i64, ret: u32) {
    let frame = json!({"dsID": "www.hc-system.com.cam", "reqType": "photo", "camID": camera, "ret": ret});
    cell.controller.handle_input(cell.now, id, frame.to_string().as_bytes());
}

#[test]
fn cameras_that_connect_are_told_apart_by_what_they_spoke_as() {
    let mut cell = Cell::new();
    let second = cell.controller.connect(cell.now);
    let both = [cell.id, second];
    assert_eq!(takers(&mut cell, 1, &both), [0, 1], "no connection has said that it is the camera");
    answer(&mut cell, both[0], 1, 1);
    add_points(&mut cell, second, &[(2, vec![point(0, 0.0)])]);
    assert_eq!(takers(&mut cell, 1, &both), [0]);
    assert_eq!(takers(&mut cell, 2, &both), [1]);
    assert_eq!(takers(&mut cell, 3, &both), [1], "the last that spoke as any camera");
    // The last frame counts: camera 1 has connected again.
    add_points(&mut cell, second, &[(1, vec![])]);
    assert_eq!(takers(&mut cell, 1, &both), [1]);
    cell.controller.disconnect(second);
    assert_eq!(takers(&mut cell, 1, &both), [0], "the camera is not known any more");
    answer(&mut cell, both[0], 1, 1);
    assert_eq!(takers(&mut cell, 2, &both), [0]);
}

#[test]
fn a_camera_that_was_dialled_is_known_from_its_first_moment() {
    let mut cell = Cell::new();
    let pc = cell.id;
    let first = cell.controller.connect_camera(cell.now, Some(1));
    let second = cell.controller.connect_camera(cell.now, Some(2));
    let all = [pc, first, second];
    assert_eq!(takers(&mut cell, 1, &all), [1]);
    assert_eq!(takers(&mut cell, 2, &all), [2]);
    // Camera 3 is neither of them, so it may be any other connection.
    assert_eq!(takers(&mut cell, 3, &all), [0]);
    // If the shell dialled camera 1, a PC that speaks as it does not count.
    add_points(&mut cell, pc, &[(1, vec![])]);
    assert_eq!(takers(&mut cell, 1, &all), [1]);

    let every = cell.controller.connect_camera(cell.now, None);
    let all = [pc, first, second, every];
    assert_eq!(takers(&mut cell, 1, &all), [1]);
    assert_eq!(takers(&mut cell, 3, &all), [3]);
}

#[test]
fn a_dialled_camera_that_is_away_is_not_looked_for_elsewhere() {
    for dialled in [Some(0), None] {
        let mut cell = Cell::new();
        cell.controller.expect_camera(dialled);
        let pc = cell.id;
        assert_eq!(takers(&mut cell, 0, &[pc]), [0; 0], "before it is there: {dialled:?}");
        assert!(cell.log().contains("photo requested from camera 0, but the camera is not connected"));
        let camera = cell.controller.connect_camera(cell.now, dialled);
        assert_eq!(takers(&mut cell, 0, &[pc, camera]), [1]);
        cell.controller.disconnect(camera);
        assert_eq!(takers(&mut cell, 0, &[pc]), [0; 0], "after it has gone: {dialled:?}");
        // Meanwhile the camera connected itself.
        answer(&mut cell, pc, 0, 1);
        assert_eq!(takers(&mut cell, 0, &[pc]), [0]);
        let camera = cell.controller.connect_camera(cell.now, dialled);
        assert_eq!(takers(&mut cell, 0, &[pc, camera]), [1], "and is back");
    }
}

#[test]
fn a_connection_to_a_camera_takes_no_socket_from_others() {
    let mut cell = Cell::new();
    let most = cell.controller.profile().max_connections;
    // The cell itself has one.
    let accepted: Vec<_> = (1..most).map(|_| cell.controller.connect(cell.now)).collect();
    let camera = cell.controller.connect_camera(cell.now, None);
    let refused = cell.controller.connect(cell.now);
    let query = br#"{"reqType":"query","queryAddr":["curMode"]}"#;
    for (id, is_served) in accepted.into_iter().chain([camera]).map(|id| (id, true)).chain([(refused, false)])
    {
        cell.controller.handle_input(cell.now, id, query);
        assert_eq!(cell.controller.poll_transmit(cell.now, id).is_some(), is_served, "{id:?}");
    }
    assert_eq!(cell.controller.snapshot(cell.now).connections, most + 1);
    // In the other order: the camera is there first, and all others have room.
    let mut cell = Cell::new();
    cell.controller.connect_camera(cell.now, None);
    for _ in 1..most {
        let id = cell.controller.connect(cell.now);
        cell.controller.handle_input(cell.now, id, query);
        assert!(cell.controller.poll_transmit(cell.now, id).is_some());
    }
}

#[test]
fn a_camera_that_was_dialled_is_answered_like_any_peer() {
    let mut cell = Cell::new();
    let camera = cell.controller.connect_camera(cell.now, Some(1));
    let reply = add_points(&mut cell, camera, &[(1, vec![point(0, 1.0), point(0, 2.0)])]);
    assert_eq!(
        reply,
        r#"{"cmdReply":["AddPoints","2"],"dsID":"www.hc-system.com.cam","reqType":"AddPoints"}"#
    );
    assert!(!cell.log().contains("speaks as"), "it is who it was said to be");
    add_points(&mut cell, camera, &[(5, vec![point(0, 1.0)])]);
    assert!(cell.log().contains("the camera that was dialled as camera 1 speaks as camera 5"));
    add_points(&mut cell, camera, &[(5, vec![point(0, 1.0)])]);
    assert!(!cell.log().contains("speaks as"), "told once");
}

/// A cell that runs this text as its only program.
fn running(model: &str, text: &str) -> Cell {
    let model = RobotModel::named(model).unwrap().clone();
    let mut settings = ControllerSettings::new(Profile::hc1(), model);
    settings.library.load("test", text).unwrap();
    "test".clone_into(&mut settings.mold);
    Cell::of(settings)
}

#[test]
fn a_photo_that_nobody_takes_is_told_and_is_the_programs_alarm() {
    let mut cell =
        running("BRTIRUS0707A", "[[step]]\ndo=\"photo\"\ncamera=4\nlimit=2\ntries=2\nalarm=5004\n");
    cell.controller.disconnect(cell.id);
    cell.pass(5.0);
    let log = cell.log();
    let lost = "photo requested from camera 4, but no camera is connected: the request is lost";
    // The first request was made when it was switched on, before the connection ended.
    assert!(log.contains(lost) && log.contains("alarm 5004"), "{log}");
    assert_eq!(cell.controller.snapshot(cell.now).alarm, 5004);
}

const TOOL_DOWN: &str = "[[step]]\ndo=\"axis-move\"\nto=[0,10,-20,0,-80,0]\nspeed=100\n";

/// Points are kept apart by camera and template, for any sender and any order.
#[test]
fn a_program_takes_points_of_its_camera_and_template_only() {
    let mut cell = running(
        "BRTIRUS0707A",
        &format!(
            "{TOOL_DOWN}[[step]]\ndo=\"label\"\nname=\"next\"\n\
             [[step]]\ndo=\"take-point\"\ncamera=1\nmodel=7\n[[step]]\ndo=\"move-to-point\"\nspeed=100\n\
             [[step]]\ndo=\"counter\"\nnumber=0\nby=1\n[[step]]\ndo=\"take-point\"\ncamera=2\n\
             [[step]]\ndo=\"move-to-point\"\nspeed=100\n[[step]]\ndo=\"counter\"\nnumber=2\nby=1\n\
             [[step]]\ndo=\"jump\"\nto=\"next\""
        ),
    );
    cell.pass(5.0);
    let first = cell.controller.connect_camera(cell.now, Some(1));
    // All sets in one frame, the wrong ones first.
    let sets = [
        (2, vec![point(7, -60.0), point(1, -30.0)]),
        (1, vec![point(3, 20.0), point(7, 40.0), point(3, 50.0), point(7, 60.0)]),
        (11, vec![point(7, 10.0)]),
    ];
    assert!(add_points(&mut cell, first, &sets).contains(r#"["AddPoints","7"]"#));
    let mut visited = Vec::new();
    for _ in 0..2000 {
        cell.pass(0.01);
        if cell.text("isMoving") == "0" {
            let y = cell.number("world-1").round();
            if visited.last() != Some(&y) {
                visited.push(y);
            }
        }
        if visited.len() == 4 {
            break;
        }
    }
    cell.pass(2.0);
    let counts = [cell.value("counter-0")[2].clone(), cell.value("counter-2")[2].clone()];
    assert_eq!(counts, [json!(2), json!(2)]);
    assert!(visited.ends_with(&[-30.0]) || cell.number("world-1").round() == -30.0, "{visited:?}");
    let left: Vec<_> =
        cell.controller.machine().points().map(|(camera, point)| (*camera, point.model_id)).collect();
    assert_eq!(left, [(1, 3), (1, 3), (11, 7)]);
}

/// `Rel`: the move above the place and the move down to it mean the same place, as with an absolute point.
#[test]
fn all_moves_to_a_relative_point_mean_one_place() {
    let mut cell = running(
        "BRTIRUS0707A",
        &format!(
            "{TOOL_DOWN}[[step]]\ndo=\"take-point\"\n\
             [[step]]\ndo=\"move-to-point\"\nabove=40\nspeed=100\n[[step]]\ndo=\"move-to-point\"\nspeed=100\n\
             [[step]]\ndo=\"move-to-point\"\nabove=30\nspeed=100\n[[step]]\ndo=\"remote\""
        ),
    );
    cell.pass(5.0);
    let from = cell.world();
    let way = json!({"ModelID": "0", "X": "12", "Y": "-20", "Z": "-25", "U": "0", "V": "0", "Angel": "2", "Rel": "1"});
    let id = cell.id;
    add_points(&mut cell, id, &[(0, vec![way])]);
    cell.pass(20.0);
    let to = cell.world();
    for (n, way) in [12.0, -20.0, 5.0, 0.0, 0.0, 2.0].into_iter().enumerate() {
        let turned = (to[n] - from[n] - way + 540.0).rem_euclid(360.0) - 180.0;
        assert!(turned.abs() < 1e-3, "component {n}: from {} to {}", from[n], to[n]);
    }
    assert_eq!(cell.text("curAlarm"), "0");
}

/// On four axes `Angel` is U (manual 5.2), relative or not.
#[test]
fn on_four_axes_the_angle_is_u() {
    let mut cell = running(
        "GENERIC-SCARA",
        "[[step]]\ndo=\"axis-move\"\nto=[20,40,-50,10]\nspeed=100\n\
         [[step]]\ndo=\"label\"\nname=\"next\"\n[[step]]\ndo=\"take-point\"\n\
         [[step]]\ndo=\"move-to-point\"\nspeed=100\n[[step]]\ndo=\"jump\"\nto=\"next\"",
    );
    cell.pass(10.0);
    let from = cell.world();
    let id = cell.id;
    let way = json!({"ModelID": 0, "X": 5.0, "Y": -4.0, "Z": 3.0, "Angel": 15.0, "Rel": 1});
    add_points(&mut cell, id, &[(0, vec![way])]);
    cell.pass(10.0);
    let there = cell.world();
    for (n, way) in [5.0, -4.0, 3.0, 15.0].into_iter().enumerate() {
        assert!((there[n] - from[n] - way).abs() < 1e-3, "component {n}: from {} to {}", from[n], there[n]);
    }
    let place = json!({"ModelID": 0, "X": from[0], "Y": from[1], "Z": from[2], "Angel": from[3], "Rel": 0});
    add_points(&mut cell, id, &[(0, vec![place])]);
    cell.pass(10.0);
    common::assert_near(cell.world(), from, 1e-3);
    assert_eq!(cell.text("curAlarm"), "0");
}

/// A missing `Angel`, missing angles or a missing `Z` (manual 5.2 always has them) do not count as 0. With 0,
/// a wrist that looks down would turn over, and the tool would go down to the table.
#[test]
fn what_a_point_leaves_out_stays_as_it_is() {
    let program = |first: &str| {
        format!(
            "[[step]]\ndo=\"axis-move\"\nto={first}\nspeed=100\n[[step]]\ndo=\"take-point\"\n\
             [[step]]\ndo=\"move-to-point\"\nabove=20\nspeed=100\n[[step]]\ndo=\"move-to-point\"\nspeed=100\n\
             [[step]]\ndo=\"remote\""
        )
    };
    for (model, first, orientation) in
        [("BRTIRUS0707A", "[0,10,-20,0,-80,40]", 3..6), ("GENERIC-SCARA", "[20,40,-50,70]", 3..4)]
    {
        let mut cell = running(model, &program(first));
        cell.pass(10.0);
        let from = cell.world();
        assert!(from[orientation.clone()].iter().any(|angle| angle.abs() > 30.0), "{model}: {from:?}");
        let id = cell.id;
        let place = json!({"ModelID": 0, "X": from[0] + 15.0, "Y": from[1] - 10.0, "Rel": 0});
        add_points(&mut cell, id, &[(0, vec![place])]);
        cell.pass(20.0);
        let to = cell.world();
        for (n, way) in [15.0, -10.0, 0.0].into_iter().enumerate() {
            assert!((to[n] - from[n] - way).abs() < 1e-3, "{model}, component {n}: from {from:?} to {to:?}");
        }
        for n in orientation {
            let turned = (to[n] - from[n] + 540.0).rem_euclid(360.0) - 180.0;
            assert!(turned.abs() < 1e-3, "{model}, component {n}: from {from:?} to {to:?}");
        }
        assert_eq!(cell.text("curAlarm"), "0");
    }
}

#[test]
fn a_camera_that_sends_too_much_loses_its_own_points() {
    let mut cell = Cell::new();
    let id = cell.id;
    add_points(&mut cell, id, &[(1, vec![point(9, 1.0)])]);
    for _ in 0..15 {
        let many: Vec<_> = (0..100).map(|n| point(n, 0.0)).collect();
        add_points(&mut cell, id, &[(2, many), (3, vec![])]);
    }
    let points =
        |cell: &Cell| -> Vec<i64> { cell.controller.machine().points().map(|(camera, _)| *camera).collect() };
    let kept = points(&cell);
    assert_eq!((kept.len(), kept[0]), (1000, 1), "camera 1 still has its one");
    assert_eq!(
        cell.log().matches("old points are lost").count(),
        1,
        "told once, not with each of six frames"
    );
    add_points(&mut cell, id, &[(3, vec![point(0, 0.0)])]);
    assert!(points(&cell).ends_with(&[3]), "a camera without any has room");
    // Cameras do not affect the list of a PC.
    cell.run_ok(&json!([axis_move([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 100.0)]));
}
