//! The addresses of the cabinet: they report what a taught program or an operator at the panel did.

use r6_controller::{Button, ControllerSettings, Key, PanelAction, Profile};
use r6_proto::alarm::AlarmCode;
use serde_json::json;

use crate::common::Cell;
use crate::{changes, count, person, press, profiles, settings, start, step, taught, told, value};

/// Addresses that no program and no operator at the panel changes, and why. Their cases show what they
/// report.
pub const BY_NOBODY: [(&str, &str); 6] = [
    ("version", "the firmware: only another one has another version"),
    (
        "counterList",
        "counters are set up, not made: a program that counts with a missing counter ends with alarm 300",
    ),
    ("boardIOnum", "boards are screwed in"),
    ("axisNum", "so are axes"),
    ("machineName", "the name is set up"),
    ("curAccount", "the panel has no login"),
];

crate::cases! { CASES: crate::address_on_each;
    version "version" => |profile| {
        let reported = if profile.name == "hc1" { "HC-QC-RX-7.8.07-master-F5.2.1" } else { &profile.version };
        assert_eq!(Cell::of(settings(profile)).text("version"), reported);
        let other = Profile { version: "HC-QC-RX-9".to_owned(), ..profile.clone() };
        assert_eq!(Cell::of(settings(&other)).text("version"), "HC-QC-RX-9");
    };
    cur_mold "curMold" => |profile| {
        let mut cell = Cell::of(settings(profile));
        let load = |cell: &mut Cell| person(cell, &PanelAction::SwitchProgram("palletise".to_owned()));
        changes(&mut cell, "curMold", "remote", load, "palletise");
    };
    counter_list "counterList" => |profile| {
        assert_eq!(Cell::of(settings(profile)).value("counterList"), json!(["0", "2", "5"]));
        let counters = [(7, (0, 0)), (999_999_999, (0, 0))].into_iter().collect();
        let mut cell = Cell::of(ControllerSettings { counters, ..settings(profile) });
        assert_eq!(cell.value("counterList"), json!(["7", "999999999"]));
        let mut cell = taught(profile, &step::count(1));
        changes(&mut cell, "curAlarm", "0", start, "300");
        assert_eq!(cell.value("counterList"), json!(["0", "2", "5"]));
    };
    counter_n "counter-n" => counters;
    cur_mode "curMode" => modes;
    board_io_num "boardIOnum" => |profile| {
        assert_eq!(Cell::of(settings(profile)).text("boardIOnum"), "2");
        assert_eq!(Cell::of(ControllerSettings { io_boards: 4, ..settings(profile) }).text("boardIOnum"), "4");
    };
    input_n "input-n" => |profile| {
        let mut cell = Cell::of(settings(profile));
        for (board, point) in (0..8).flat_map(|board| (0..32).map(move |point| (board, point))) {
            let set = |on| PanelAction::SetInput { board, point, on };
            let (address, word) = (format!("input-{board}"), (1_u32 << point).to_string());
            changes(&mut cell, &address, "0", |cell| person(cell, &set(true)), &word);
            changes(&mut cell, &address, &word, |cell| person(cell, &set(false)), "0");
        }
    };
    output_n "output-n" => |profile| words_of_a_program(profile, "Y", "output");
    cur_alarm "curAlarm" => |profile| {
        let mut cell = taught(profile, &step::alarm(5001));
        changes(&mut cell, "curAlarm", "0", start, "5001");
        changes(&mut cell, "curAlarm", "5001", |cell| person(cell, &PanelAction::ClearAlarm), "0");
        changes(&mut cell, "curAlarm", "0", |cell| person(cell, &PanelAction::RaiseAlarm(AlarmCode(850))), "850");
        changes(&mut cell, "curAlarm", "850", |cell| person(cell, &PanelAction::EmergencyStop), "7");
    };
    cur_cycle "curCycle" => |profile| {
        let mut cell = taught(profile, &(step::count(0) + &step::wait(4.0)));
        let run = |cell: &mut Cell| {
            start(cell);
            cell.pass(2.5);
        };
        changes(&mut cell, "curCycle", "0.000000", run, "2.500000");
        changes(&mut cell, "curCycle", "2.500000", |cell| cell.pass(2.0), "0.500000");
        changes(&mut cell, "curCycle", "0.500000", |cell| person(cell, &PanelAction::TurnKey(Key::Stop)), "0.000000");
    };
    last_cycle "lastCycle" => |profile| {
        let mut cell = taught(profile, &(step::count(0) + &step::wait(4.0) + &step::wait_for("X010")));
        let run = |cell: &mut Cell| {
            start(cell);
            cell.pass(5.0);
            person(cell, &PanelAction::SetInput { board: 0, point: 0, on: true });
        };
        changes(&mut cell, "lastCycle", "0.000000", run, "5.000000");
        changes(&mut cell, "lastCycle", "5.000000", |cell| cell.pass(4.0), "4.000000");
    };
    machine_name "machineName" => |profile| {
        assert_eq!(Cell::of(settings(profile)).text("machineName"), "r6 virtual BRTIRUS0707A");
        let machine_name = "cell 4".to_owned();
        assert_eq!(Cell::of(ControllerSettings { machine_name, ..settings(profile) }).text("machineName"), "cell 4");
    };
    cur_account "curAccount" => |profile| {
        assert_eq!(Cell::of(settings(profile)).text("curAccount"), "operator");
        let account = "anna".to_owned();
        assert_eq!(Cell::of(ControllerSettings { account, ..settings(profile) }).text("curAccount"), "anna");
    };
    mold_list "moldList" => |profile| {
        let shipped = ["default", "palletise", "pick-and-place", "register-follow", "register-move", "remote"];
        assert_eq!(Cell::of(settings(profile)).value("moldList"), json!(shipped));
        // A taught program.
        let mut names = shipped.to_vec();
        names.push("taught");
        let mut cell = taught(profile, step::REMOTE);
        assert_eq!(cell.value("moldList"), json!(names));
        // A program that the operator loads while the machine runs.
        let load = PanelAction::LoadProgram { name: "loaded".to_owned(), text: step::REMOTE.to_owned() };
        cell.controller.operate(cell.now, &load).unwrap();
        names.push("loaded");
        names.sort_unstable();
        assert_eq!(cell.value("moldList"), json!(names));
    };
    m_n "M-n" => |profile| words_of_a_program(profile, "M", "M");
    addr_n "Addr-n" => |profile| {
        let wanted = |register: i64| (register - 850) * 1_000_003;
        let program: String = (800..=900)
            .map(|n| format!("[[step]]\ndo = \"register\"\nnumber = {n}\nto = {}\n", wanted(n)))
            .collect();
        let more = "[[step]]\ndo = \"register\"\nnumber = 850\nby = -7\n";
        let mut cell = taught(profile, &(program + more + step::REMOTE));
        for register in 800..=900 {
            assert_eq!(cell.text(&format!("Addr-{register}")), "0");
        }
        start(&mut cell);
        for register in (800..=900).filter(|register| *register != 850) {
            assert_eq!(cell.text(&format!("Addr-{register}")), wanted(register).to_string());
        }
        assert_eq!(cell.text("Addr-850"), "-7");
    };
    remote_cmd_len "RemoteCmdLen" => |profile| {
        // The program takes the instructions off the list at its step that waits for them; the operator stops
        // and starts it.
        let mut cell = taught(profile, &(step::count(0) + step::REMOTE));
        start(&mut cell);
        let wait = json!({"oneshot": "1", "action": "100", "type": "100", "limit": "5"});
        cell.run_ok(&json!([wait, wait, wait]));
        changes(&mut cell, "RemoteCmdLen", "3", |cell| cell.pass(5.0), "2");
        press(&mut cell, Button::Pause);
        changes(&mut cell, "RemoteCmdLen", "2", |cell| cell.pass(100.0), "2");
        let go_on = |cell: &mut Cell| {
            start(cell);
            cell.pass(6.0);
        };
        changes(&mut cell, "RemoteCmdLen", "2", go_on, "1");
        // Another program has its own list.
        let load = |cell: &mut Cell| person(cell, &PanelAction::SwitchProgram("remote".to_owned()));
        changes(&mut cell, "RemoteCmdLen", "1", load, "0");
    };
}

/// Every counter of a new controller, and the highest possible number.
fn counters(profile: &Profile) {
    for id in [0, 2, 5, 999_999_999] {
        let mut settings = settings(profile);
        settings.counters.insert(id, (20, 4));
        let program = step::count(id) + &step::count(id) + &step::count(id) + step::REMOTE;
        settings.library.load("taught", &program).unwrap();
        "taught".clone_into(&mut settings.mold);
        let mut cell = Cell::of(settings);
        let written = |current: i64| match profile.name.as_str() {
            "hc1" => format!("[{id},20,{current}]"),
            "legacy" => format!("counter{id}[{id}][T:20][C:{current}]"),
            _ => format!(r#"["{id}","20","{current}"]"#),
        };
        changes(&mut cell, &format!("counter-{id}"), &written(4), start, &written(7));
        assert_eq!(count(&mut cell, id), 7);
    }
}

fn modes(profile: &Profile) {
    let mut cell = taught(profile, &(step::count(0) + &step::wait(1.0)));
    let key = |to| move |cell: &mut Cell| person(cell, &PanelAction::TurnKey(to));
    changes(&mut cell, "curMode", "2", key(Key::Manual), "1");
    changes(&mut cell, "curMode", "1", key(Key::Stop), "3");
    changes(&mut cell, "curMode", "3", key(Key::Auto), "2");
    changes(&mut cell, "curMode", "2", start, "7");
    changes(&mut cell, "curMode", "7", key(Key::Auto), "2");
    changes(&mut cell, "curMode", "2", |cell| press(cell, Button::SingleCycle), "9");
    changes(&mut cell, "curMode", "9", |cell| cell.pass(1.0), "2");
    // The first step takes no time, so it is over at once; the second one takes a second.
    changes(&mut cell, "curMode", "2", |cell| press(cell, Button::SingleStep), "2");
    changes(&mut cell, "curMode", "2", |cell| press(cell, Button::SingleStep), "8");
    changes(&mut cell, "curMode", "8", |cell| cell.pass(1.0), "2");
    // 0 means a controller that is switching on, and it does not answer.
}

/// A program sets one point of each board after another.
fn words_of_a_program(profile: &Profile, letter: &str, stem: &str) {
    for point in 0..32_u32 {
        let name = |board: u32| match board {
            0 => format!("{letter}{:03o}", point + 8),
            board => format!("{letter}{board}.{:03o}", point + 8),
        };
        let program: String = (0..8).map(|board| step::output(&name(board))).collect();
        let mut cell = taught(profile, &(program + step::REMOTE));
        for board in 0..8 {
            assert_eq!(value(&mut cell, &format!("{stem}-{board}")), "0");
        }
        start(&mut cell);
        for board in 0..8 {
            let word = (1_u32 << point).to_string();
            assert_eq!(value(&mut cell, &format!("{stem}-{board}")), word, "{}", name(board));
        }
    }
}

/// The list of values that nothing causes is right: those values stay the same, whatever is done.
#[test]
fn what_nobody_causes_stays_whatever_is_done() {
    for profile in profiles() {
        let program = step::count(0) + &step::output("Y010") + &step::turn(5.0, 50.0) + &step::alarm(5000);
        let mut cell = taught(&profile, &program);
        let names: Vec<_> = BY_NOBODY.iter().map(|(name, _)| *name).collect();
        let before = cell.query(&names);
        start(&mut cell);
        cell.pass(5.0);
        assert_eq!(cell.text("curAlarm"), "5000");
        person(&mut cell, &PanelAction::EmergencyStop);
        person(&mut cell, &PanelAction::ReleaseEmergencyStop);
        told(&mut cell, &["clearAlarmContinue"]);
        person(&mut cell, &PanelAction::TurnKey(Key::Manual));
        person(&mut cell, &PanelAction::SwitchProgram("remote".to_owned()));
        assert_eq!(cell.query(&names), before, "{}", profile.name);
    }
}
