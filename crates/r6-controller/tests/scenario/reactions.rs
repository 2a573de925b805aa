//! Inputs that react to outputs.

use serde_json::json;

use crate::{cell, changes, input, seeded};

fn output(cell: &mut crate::common::Cell, on: bool) {
    cell.ok(&["modifyOutput", "0", "0", if on { "1" } else { "0" }]);
}

#[test]
fn an_input_follows_both_ways() {
    let mut cell = cell("[[react]]\nwhen = \"Y010\"\nthen = \"X013\"\nafter = 0.2");
    output(&mut cell, true);
    assert_eq!(changes(&mut cell, 3, 1.0), [(200, true)]);
    output(&mut cell, true);
    assert_eq!(changes(&mut cell, 3, 1.0), [], "nothing changed");
    output(&mut cell, false);
    assert_eq!(changes(&mut cell, 3, 1.0), [(200, false)]);
    assert_eq!(cell.log().matches("scenario: input X013 on\n").count(), 1);
}

#[test]
fn to_one_change_only_and_set_as_told() {
    let mut cell = cell(
        "[[react]]\nwhen = \"Y010\"\nis = \"on\"\nthen = \"X010\"\nset = \"off\"\nafter = 0.1\n\
         [[react]]\nwhen = \"Y010\"\nis = \"off\"\nthen = \"X010\"\nset = \"on\"\nafter = 0.3\n\
         [[react]]\nwhen = \"Y010\"\nis = \"off\"\nthen = \"X011\"\n",
    );
    output(&mut cell, true);
    cell.pass(1.0);
    output(&mut cell, false);
    assert_eq!(changes(&mut cell, 0, 1.0), [(300, true)]);
    assert!(!input(&mut cell, 1), "like the output: off");
    output(&mut cell, true);
    assert_eq!(changes(&mut cell, 0, 1.0), [(100, false)]);
}

#[test]
fn m_points_and_the_eu_board_count_too() {
    let mut cell = cell(
        "[[react]]\nwhen = \"M010\"\nthen = \"EUX010\"\n[[react]]\nwhen = \"EUY011\"\nthen = \"X1.010\"\n",
    );
    cell.ok(&["modifyOutput", "4", "0", "1"]);
    cell.ok(&["modifyOutput", "7", "1", "1"]);
    cell.pass(0.001);
    let io = cell.controller.snapshot(cell.now).io;
    assert_eq!((io.eu_inputs, io.inputs[1]), (1, 1));
}

#[test]
fn a_spread_is_drawn_anew_and_the_last_change_wins() {
    let text = "seed = 9\n[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nafter = 0.1\nspread = 0.4";
    for seed in 0..40 {
        let mut cell = seeded(text, seed);
        output(&mut cell, true);
        cell.pass(0.05);
        output(&mut cell, false);
        let found = changes(&mut cell, 0, 1.0);
        assert!(!input(&mut cell, 0), "seed {seed}: the output is off, the input is not: {found:?}");
        assert!(found.iter().all(|(at, _)| (50..=501).contains(at)), "{found:?}");
    }
    let delay = |seed| {
        let mut cell = seeded(text, seed);
        output(&mut cell, true);
        changes(&mut cell, 0, 1.0)
    };
    assert_eq!(delay(1), delay(1));
    assert_ne!(delay(1), delay(2));
}

#[test]
fn a_list_waits_for_what_its_output_does() {
    let mut cell = cell("[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nafter = 0.5");
    cell.run_ok(&json!([
        {"oneshot": "1", "action": "200", "type": "0", "io_status": "1", "point": "0", "delay": "0"},
        {"oneshot": "1", "action": "100", "type": "0", "point": "0", "io_status": "1", "limit": "2", "isUnlimit": "0"},
        {"oneshot": "1", "action": "200", "type": "0", "io_status": "1", "point": "1", "delay": "0"},
    ]));
    cell.pass(0.48);
    assert_eq!(cell.text("output-0"), "1");
    cell.pass(0.01);
    assert_eq!((cell.text("output-0"), cell.text("curAlarm")), ("3".to_owned(), "0".to_owned()));
}

#[test]
fn a_timed_output_is_followed_although_nobody_looks() {
    let mut cell = cell(
        "[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nafter = 0.05\n[[react]]\nwhen = \"Y010\"\nis = \"off\"\nthen = \"X011\"\nset = \"on\"",
    );
    cell.run_ok(&json!([{"oneshot": "1", "action": "200", "type": "100", "io_status": "1", "point": "0", "delay": "0.3"}]));
    // One step over all of it.
    let end = cell.now + std::time::Duration::from_secs(2);
    cell.now = end;
    cell.controller.handle_timeout(end);
    assert!(input(&mut cell, 1), "it went off meanwhile");
    assert_eq!(cell.log().matches("input X010").count(), 2);
}

#[test]
fn an_output_that_flutters_does_not_fill_the_memory() {
    let mut cell = cell("[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nafter = 3600\n");
    for n in 0..10_100 {
        output(&mut cell, n % 2 == 0);
    }
    assert!(cell.log().contains("scenario: an input does not follow: too many inputs"));
    cell.pass(3601.0);
    output(&mut cell, true);
    cell.pass(3601.0);
    assert!(input(&mut cell, 0));
}

#[test]
fn a_ring_without_any_delay_ends() {
    let program = "[[step]]\ndo = \"wait\"\npoint = \"X010\"\n[[step]]\ndo = \"output\"\npoint = \"Y010\"\non = false\n\
                   [[step]]\ndo = \"wait\"\npoint = \"X010\"\nuntil = \"off\"\n[[step]]\ndo = \"output\"\npoint = \"Y010\"\non = true\n";
    let mut cell = cell(&format!(
        "[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\n[[at]]\ntime = 0\ndo = \"program\"\nname = \"ring\"\ntext = '''\n{program}'''\n\
         [[at]]\ntime = 1\ndo = \"button\"\nbutton = \"stop\"\n[[at]]\ntime = 1.5\ndo = \"program\"\nname = \"ring\"\n\
         [[at]]\ntime = 2\ndo = \"button\"\nbutton = \"start\"\n[[at]]\ntime = 2.5\ndo = \"output\"\npoint = \"Y010\"\non = true\n"
    ));
    cell.pass(3.0);
    assert_eq!(cell.controller.snapshot(cell.now).program, "ring");
    assert_eq!(cell.text("curMode"), "7");
}
