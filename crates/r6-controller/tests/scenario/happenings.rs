//! The timeline: when its events happen, and what they do.

use r6_controller::PanelAction;
use serde_json::{Value, json};

use crate::common::{Cell, axis_move};
use crate::{cell, changes, input, seeded};

#[test]
fn once_at_its_time() {
    let mut cell = cell("[[at]]\ntime = 2.5\ndo = \"input\"\npoint = \"X012\"\non = true");
    cell.pass(2.499_999_999);
    assert!(!input(&mut cell, 2));
    cell.pass(0.000_000_001);
    assert!(input(&mut cell, 2));
    assert_eq!(cell.controller.poll_timeout(), None, "nothing is left");
    assert_eq!(cell.log(), "scenario: input X012 on\n");
}

#[test]
fn at_the_very_beginning() {
    let mut cell = cell("[[at]]\ntime = 0\ndo = \"input\"\npoint = \"EUX011\"\non = true");
    assert_eq!(cell.controller.snapshot(cell.now).io.eu_inputs, 2);
}

#[test]
fn again_and_again_as_often_as_told() {
    let blink = |more: &str| {
        let text = format!(
            "[[at]]\ntime = 1\nevery = 0.5\ndo = \"input\"\npoint = \"X010\"\non = true\n{more}\n[[at]]\ntime = 1.25\nevery = 0.5\ndo = \"input\"\npoint = \"X010\"\non = false\n{more}"
        );
        changes(&mut cell(&text), 0, 4.1)
    };
    let whole: Vec<_> =
        (0..7).flat_map(|n| [(1000 + n * 500, true), (1250 + n * 500, false)]).take(13).collect();
    assert_eq!(blink(""), whole);
    assert_eq!(blink("times = 2"), whole[..4]);
}

#[test]
fn a_spread_is_drawn_from_the_seed_anew_each_time() {
    let text = "seed = 4\n[[at]]\ntime = 1\nspread = 0.5\nevery = 2\ndo = \"input\"\npoint = \"X010\"\non = true\n\
                [[at]]\ntime = 1.9\nevery = 2\ndo = \"input\"\npoint = \"X010\"\non = false";
    let rises = |seed| -> Vec<u64> {
        let all = changes(&mut seeded(text, seed), 0, 20.0);
        all.into_iter().filter(|(_, on)| *on).map(|(at, _)| at).collect()
    };
    let found = rises(0);
    assert_eq!(found.len(), 10);
    assert_eq!(found, rises(0));
    assert_ne!(found, rises(1));
    let later: Vec<_> = found.iter().map(|at| at % 2000).collect();
    assert!(later.iter().all(|at| (1000..=1501).contains(at)), "{later:?}");
    assert!(later.iter().min().unwrap() + 200 < *later.iter().max().unwrap(), "{later:?}");
}

#[test]
fn a_contact_bounces_and_ends_as_told() {
    let bounce = |on: bool, times: u32| {
        let text = format!(
            "[[at]]\ntime = 0\ndo = \"input\"\npoint = \"X010\"\non = {}\n[[at]]\ntime = 1\ndo = \"bounce\"\npoint = \"X010\"\nchanges = {times}\nwithin = 0.05\non = {on}",
            !on
        );
        let mut cell = cell(&text);
        let found = changes(&mut cell, 0, 3.0);
        (found, input(&mut cell, 0))
    };
    let (found, end) = bounce(true, 5);
    assert_eq!(found, [(1000, true), (1010, false), (1020, true), (1030, false), (1040, true)]);
    assert!(end);
    assert!(!bounce(false, 5).1);
    assert_eq!(bounce(true, 1).0, [(1000, true)]);
}

#[test]
fn bounces_do_not_pile_up() {
    let mut cell = cell(
        "[[at]]\ntime = 0\nevery = 0.001\ndo = \"bounce\"\npoint = \"X010\"\nchanges = 1000\nwithin = 3600\non = true",
    );
    cell.pass(1.0);
    let log = cell.log();
    assert!(
        log.contains("X010 changes 1000 times and ends on: too many inputs are about to change already"),
        "{log}"
    );
    assert!(format!("{:?}", cell.controller).len() < 3_000_000);
}

#[test]
fn a_person_at_the_machine() {
    let mut cell = cell(
        "[[at]]\ntime = 1\ndo = \"key\"\nto = \"manual\"\n[[at]]\ntime = 2\ndo = \"button\"\nbutton = \"start\"\n\
         [[at]]\ntime = 3\ndo = \"key\"\nto = \"auto\"\n[[at]]\ntime = 4\ndo = \"emergency-stop\"\n\
         [[at]]\ntime = 5\ndo = \"clear-alarm\"\n[[at]]\ntime = 6\ndo = \"release-emergency-stop\"\n\
         [[at]]\ntime = 7\ndo = \"clear-alarm\"\n[[at]]\ntime = 8\ndo = \"button\"\nbutton = \"start\"\n\
         [[at]]\ntime = 9\ndo = \"alarm\"\nnumber = 5003\n",
    );
    let mut seen = Vec::new();
    for _ in 0..10 {
        cell.pass(0.5);
        seen.push((cell.text("curMode"), cell.text("curAlarm")));
        cell.pass(0.5);
    }
    let modes: Vec<_> = seen.iter().map(|(mode, _)| mode.as_str()).collect();
    assert_eq!(modes, ["7", "1", "1", "2", "2", "2", "2", "2", "7", "2"]);
    let alarms: Vec<_> = seen.iter().map(|(_, alarm)| alarm.as_str()).collect();
    assert_eq!(alarms, ["0", "0", "0", "0", "7", "7", "7", "0", "0", "5003"]);
    let log = cell.log();
    for line in [
        "scenario: key to manual\n",
        "scenario: button start: the machine is in manual: turn the key to automatic\n",
        "scenario: emergency-stop\n",
        "scenario: clear-alarm: the emergency stop is pressed",
        "scenario: release-emergency-stop\n",
        "scenario: alarm 5003\n",
    ] {
        assert!(log.contains(line), "{line}: {log}");
    }
}

#[test]
fn outputs_and_counters_are_set_at_the_pendant() {
    let mut cell = cell(
        "[[at]]\ntime = 1\ndo = \"output\"\npoint = \"Y011\"\non = true\n[[at]]\ntime = 1\ndo = \"output\"\npoint = \"M012\"\non = true\n\
         [[at]]\ntime = 1\ndo = \"counter\"\nnumber = 2\ncurrent = 9\ntarget = 10\n[[at]]\ntime = 2\ndo = \"counter\"\nnumber = 2\ncurrent = -4\n\
         [[at]]\ntime = 2\ndo = \"counter\"\nnumber = 9\ncurrent = 9007199254740992",
    );
    cell.pass(1.0);
    assert_eq!((cell.text("output-0"), cell.text("M-0")), ("2".to_owned(), "4".to_owned()));
    assert_eq!(cell.value("counter-2"), json!([2, 10, 9]));
    cell.pass(1.0);
    assert_eq!(cell.value("counter-2"), json!([2, 10, -4]));
    assert_eq!(cell.value("counter-9"), json!([9, 0, 9_007_199_254_740_992_i64]));
    let log = cell.log();
    assert!(
        log.contains(
            "scenario: output Y011 on
scenario: output M012 on
scenario: counter 2 is set to 9, its target to 10
"
        ),
        "{log}"
    );
}

#[test]
fn a_counter_at_its_end_stays_there() {
    let text = "[[at]]\ntime = 0\ndo = \"counter\"\nnumber = 0\ncurrent = 9007199254740992\n\
                [[at]]\ntime = 0\ndo = \"program\"\nname = \"count\"\ntext = '''\n[[step]]\ndo = \"counter\"\nnumber = 0\nby = 1\n\
                [[step]]\ndo = \"wait\"\nseconds = 0.1\n'''\n[[at]]\ntime = 1\ndo = \"button\"\nbutton = \"stop\"\n\
                [[at]]\ntime = 1.1\ndo = \"program\"\nname = \"count\"\n[[at]]\ntime = 1.2\ndo = \"button\"\nbutton = \"start\"";
    let mut cell = cell(text);
    cell.pass(5.0);
    assert_eq!(cell.controller.snapshot(cell.now).program, "count");
    let count = cell.value("counter-0")[2].as_i64().unwrap();
    assert!(count > 9_007_199_254_740_992, "{count}");
}

#[test]
fn another_master_is_heard_and_not_answered_to_us() {
    let list = json!({"reqType": "AddRCC", "emptyList": "0", "instructions": [axis_move([10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 50.0)]});
    let mut cell = cell(&format!(
        "[[at]]\ntime = 1\ndo = \"command\"\nwords = [\"modifyOutput\", \"0\", \"3\", \"1\"]\n\
         [[at]]\ntime = 2\ndo = \"request\"\nframe = '{list}'\n[[at]]\ntime = 3\ndo = \"request\"\nframe = '{{\"half\":'"
    ));
    cell.pass(5.0);
    assert_eq!(cell.frame(), None);
    assert_eq!(cell.text("output-0"), "8");
    assert_eq!(cell.number("axis-0"), 10.0);
    assert_eq!(cell.controller.snapshot(cell.now).connections, 1, "it has gone");
    let log = cell.log();
    assert!(log.contains("scenario: another master speaks\nconnection 1: modifyOutput"), "{log}");
}

#[test]
fn another_master_needs_none_of_the_sockets() {
    let mut cell =
        cell("[[at]]\ntime = 1\ndo = \"command\"\nwords = [\"modifyOutput\", \"0\", \"3\", \"1\"]");
    for _ in 1..8 {
        cell.controller.connect(cell.now);
    }
    cell.pass(1.0);
    assert_eq!(cell.text("output-0"), "8");
}

#[test]
fn a_camera_is_asked() {
    let mut cell = cell("[[at]]\ntime = 1\ndo = \"photo\"\ncamera = 3");
    cell.pass(1.0);
    let photo: Value = serde_json::from_str(&cell.frame().unwrap()).unwrap();
    assert_eq!((photo["reqType"].as_str(), photo["camID"].as_i64()), (Some("photo"), Some(3)));
}

#[test]
fn photos_for_somebody_who_reads_nothing_do_not_pile_up() {
    let mut cell = cell("[[at]]\ntime = 0\nevery = 0.001\ndo = \"photo\"\ncamera = 3");
    cell.pass(30.0);
    assert!(cell.controller.is_over(cell.id), "it is given up");
    assert!(format!("{:?}", cell.controller).len() < 8_000_000);
}

#[test]
fn programs_are_loaded_at_rest_only() {
    let program = "[[step]]\ndo = \"wait\"\nseconds = 1\n";
    let text = format!(
        "[[at]]\ntime = 1\ndo = \"program\"\nname = \"own\"\ntext = '''{program}'''\n[[at]]\ntime = 2\ndo = \"button\"\nbutton = \"stop\"\n\
         [[at]]\ntime = 3\ndo = \"program\"\nname = \"own\"\n[[at]]\ntime = 4\ndo = \"button\"\nbutton = \"start\"\n\
         [[at]]\ntime = 5\ndo = \"program\"\nname = \"own\"\ntext = '''{program}{program}'''\n[[at]]\ntime = 6\ndo = \"program\"\nname = \"ownn\"\n"
    );
    let mut cell = cell(&text);
    cell.pass(7.0);
    let log = cell.log();
    assert!(log.contains("scenario: program `own` is loaded: program `own` runs"), "{log}");
    assert!(!log.contains("2 steps"), "{log}");
    assert!(log.contains("scenario: program `ownn` is chosen: "), "{log}");
    assert_eq!(cell.controller.snapshot(cell.now).program, "own");
}

#[test]
fn the_same_bytes_twice() {
    let text = "seed = 3\n[[at]]\ntime = 0.3\nevery = 0.7\nspread = 0.3\ndo = \"alarm\"\nnumber = 15\n\
                [[at]]\ntime = 0.5\nevery = 0.7\nspread = 0.3\ndo = \"clear-alarm\"\n\
                [[at]]\ntime = 0.6\nevery = 0.7\nspread = 0.3\ndo = \"button\"\nbutton = \"start\"\n\
                [[fault]]\nfault = \"bad-json\"\nkind = \"truncated\"\nchance = 0.3\n[[fault]]\nfault = \"unsolicited\"\nchance = 0.3";
    let talk = |seed| {
        let mut cell: Cell = seeded(text, seed);
        let mut all = String::new();
        for n in 0..200 {
            cell.send(
                br#"{"reqType":"query","packID":"1","queryAddr":["curMode","curAlarm","isMoving","axis-0"]}"#,
            );
            if n % 20 == 0 {
                cell.add_rcc("1", &json!([axis_move([f64::from(n) / 10.0, 0.0, 0.0, 0.0, 0.0, 0.0], 90.0)]));
            }
            cell.pass(0.05);
            while let Some(frame) = cell.frame() {
                all.push_str(&frame);
            }
        }
        all + &cell.log()
    };
    assert_eq!(talk(0), talk(0));
    assert_ne!(talk(0), talk(1));
}

#[test]
fn what_nobody_could_do_is_refused_in_words() {
    let mut cell = cell(
        "[[at]]\ntime = 1\ndo = \"button\"\nbutton = \"single-cycle\"\n[[at]]\ntime = 0.5\ndo = \"key\"\nto = \"stop\"",
    );
    cell.pass(2.0);
    assert!(cell.log().contains("scenario: button single-cycle: the machine is in stop"));
    assert!(cell.controller.operate(cell.now, &PanelAction::ClearAlarm).is_ok());
}

/// A controller that was not advanced for a day does not make up for all of it.
#[test]
fn what_was_missed_too_often_is_left_out() {
    let mut cell = cell(
        "[[at]]\ntime = 0\nevery = 0.002\ndo = \"input\"\npoint = \"X010\"\non = true\n\
                         [[at]]\ntime = 0.5\nevery = 1000\ntimes = 3\ndo = \"counter\"\nnumber = 0\ncurrent = 7",
    );
    let day = std::time::Duration::from_secs(86_400);
    cell.now += day;
    cell.controller.handle_timeout(cell.now);
    let log = cell.log();
    assert!(log.contains("happenings were left out: too many at once"), "{log}");
    assert_eq!(cell.controller.machine().now(), cell.now);
    // It then continues as before.
    let due = cell.controller.poll_timeout().unwrap();
    assert!(due > cell.now && due.since(cell.now) <= std::time::Duration::from_millis(2), "{due:?}");
}
