//! What r6 says about the end of a motion, and what proves the end.

use std::time::Duration;

use r6_controller::PanelAction;
use r6_sim::Clock;
use r6_testkit::hostile::{
    Cabinet, Character, Foreign, Links, NeverExecuted, Reaction, Reboot, Stops, Swap, SwapWhen,
};
use serde_json::{Value, json};

use crate::streaming::{Cell, through};
use crate::support::{Outcome, TempFile, hostile, r6};

/// A move that an input may cut short.
const WATCHED: &str = "[[instruction]]\ndo = \"stop-on-signal\"\npoint = 0\non = true\n\
                       [[instruction]]\ndo = \"axis-move\"\nto = [90]\nspeed = 100\n";

/// The last line of a run with `--json`.
fn last(outcome: &Outcome) -> Value {
    serde_json::from_str(outcome.last_line()).unwrap_or_else(|error| panic!("{error}: {outcome:?}"))
}

fn text<'v>(event: &'v Value, what: &str) -> &'v str {
    event[what].as_str().unwrap()
}

/// Runs the program until the input is set in the middle of its move.
fn cut_short(name: &str, more: &[&str]) -> Outcome {
    let cell = Cell::new("hc1", Clock::Real);
    let file = TempFile::new(name, WATCHED);
    let mut args = vec!["-r", &cell.address, "run", file.path(), "--wait"];
    args.extend(more);
    std::thread::scope(|scope| {
        let run = scope.spawn(|| r6(&args));
        while cell.axes()[0] < 3.0 {
            assert!(!run.is_finished(), "it ended before it moved");
            std::thread::sleep(Duration::from_millis(5));
        }
        cell.controller.handle().operate(&PanelAction::SetInput { board: 0, point: 0, on: true }).unwrap();
        run.join().unwrap()
    })
}

#[test]
fn a_move_that_an_input_cut_short_is_told_as_such() {
    let outcome = cut_short("cut-short.toml", &[]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    assert!(outcome.out.contains("\nthe last move was CUT SHORT after "), "{}", outcome.out);
    assert!(
        outcome.out.contains("J1 is at ") && outcome.out.contains(", not at 90.000 deg or mm"),
        "{}",
        outcome.out
    );
    assert!(!outcome.out.contains("done after"), "{}", outcome.out);
    let outcome = cut_short("cut-short-json.toml", &["--json"]);
    assert_eq!(outcome.code, 0, "{outcome:?}");
    let stands = last(&outcome);
    assert_eq!((&stands["event"], &stands["proof"]), (&json!("stands"), &json!("cut_short")), "{stands}");
    let short = &stands["cut_short"];
    assert_eq!(
        (&short["axis"], &short["wanted"], &short["unit"]),
        (&json!("J1"), &json!(90.0), &Value::Null)
    );
    assert_eq!(short["found"], stands["axes"][0]["position"], "{stands}");
}

#[test]
fn what_proves_the_end_is_told() {
    let cell = Cell::new("hc1", Clock::Times(10.0));
    let stands = last(&cell.r6(&["move", "axes", "10", "--speed", "100", "--wait", "--json"]));
    assert_eq!((&stands["proof"], &stands["cut_short"]), (&json!("reached"), &Value::Null), "{stands}");
    let outcome = cell.r6(&["move", "axes", "0", "--speed", "100", "--wait"]);
    assert!(outcome.out.contains(" s: the arm stands where the last move ends\n"), "{}", outcome.out);
    let stands = last(&cell.r6(&["move", "axes", "5", "--speed", "100", "--append", "--wait", "--json"]));
    assert_eq!(stands["proof"], "reached", "{stands}");
    let signals =
        TempFile::new("signals.toml", "[[instruction]]\ndo = \"output\"\npoint = \"Y010\"\non = true\n");
    for more in [&[][..], &["--append"]] {
        let outcome = cell.r6(&[&["run", signals.path(), "--wait", "--json"], more].concat());
        assert_eq!((outcome.code, &last(&outcome)["proof"]), (0, &json!("at_rest")), "{outcome:?}");
    }
    let bench = TempFile::new("bench.toml", &workbench());
    let (address, _controller) = hostile(Character::default());
    let outcome = r6(&["-r", &address, "run", bench.path(), "--wait", "--json"]);
    assert_eq!((outcome.code, &last(&outcome)["proof"]), (0, &json!("consumed")), "{outcome:?}");
}

fn workbench() -> String {
    "[[instruction]]\ndo = \"workbench\"\nnumber = 1\n\
     [[instruction]]\ndo = \"linear-move\"\nto = [420, 30, 520]\nspeed = 20\n"
        .to_owned()
}

/// The controller answers ok and drops the list, and r6 cannot compare the end of the list with the arm's
/// position.
#[test]
fn an_appended_list_whose_end_cannot_be_compared_is_not_done() {
    let tool = "[[instruction]]\ndo = \"linear-move\"\nto = [420, 30, 520]\nspeed = 20\ntool = 1\n";
    let turn =
        "[[instruction]]\ndo = \"linear-move\"\nto = [420, 30, 520, 10, 20, 30]\nspeed = 20\nmask = 0x38\n";
    for (name, program) in
        [("workbench", workbench().as_str()), ("tool", tool), ("watched", WATCHED), ("orientation", turn)]
    {
        let character = Character { never_executed: Some(NeverExecuted::Always), ..Character::default() };
        let (address, _controller) = hostile(character);
        let file = TempFile::new(&format!("dropped-{name}.toml"), program);
        let outcome = r6(&["-r", &address, "run", file.path(), "--append", "--wait", "--json"]);
        assert_eq!(outcome.code, 4, "{name}: {outcome:?}");
        let failed = last(&outcome);
        assert_eq!(
            (&failed["event"], &failed["code"]),
            (&json!("failed"), &json!("outcome_unknown")),
            "{name}"
        );
        assert!(
            text(&failed, "message").contains("nothing proves that it was carried out"),
            "{name}: {failed}"
        );
        assert!(!outcome.out.contains("\"event\":\"stands\""), "{name}: {outcome:?}");
    }
}

/// The list ends where it begins, so the arm's position proves nothing.
#[test]
fn an_appended_list_that_leads_back_and_never_moved_is_not_done() {
    let (address, _controller) =
        hostile(Character { never_executed: Some(NeverExecuted::Always), ..Character::default() });
    let mut away = [[0.0; 6]; 2];
    away[0][0] = 30.0;
    let file = TempFile::new("there-and-back.toml", &through(&away, 50));
    let outcome = r6(&["-r", &address, "run", file.path(), "--append", "--wait", "--json"]);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    assert!(
        text(&last(&outcome), "message").contains("nothing proves that it was carried out"),
        "{outcome:?}"
    );
}

/// A program that keeps the arm going for some seconds.
fn long(name: &str) -> TempFile {
    let points: Vec<_> = (1..=12).map(|n| [f64::from(n) * 6.0, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    TempFile::new(name, &through(&points, 50))
}

#[test]
fn another_robot_in_the_middle_of_a_motion_is_told_once_and_in_words_of_the_shell() {
    let to = Cabinet { name: "cell 5".to_owned(), ..Cabinet::default() };
    let swap = Swap { when: SwapWhen::At(Duration::from_millis(800)), links: Links::End, to };
    let (address, _controller) = hostile(Character { swap: Some(swap), ..Character::default() });
    let file = long("swapped.toml");
    let outcome = r6(&["-r", &address, "run", file.path(), "--wait", "--json"]);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    let failed = last(&outcome);
    assert_eq!(failed["code"], "another_robot", "{failed}");
    let message = text(&failed, "message");
    assert!(
        message.starts_with(
            "the arm was NOT stopped: it may go on with what is in its list; use the emergency stop; "
        ),
        "{message}"
    );
    assert_eq!(message.matches("cell 5").count(), 1, "{message}");
    assert!(!outcome.out.contains("accept_identity"), "{failed}");
    assert!(text(&failed, "advice").contains("r6 --robot"), "{failed}");
    // The same for a query.
    assert!(!outcome.err.contains("accept_identity"), "{outcome:?}");
}

#[test]
fn a_state_that_cannot_be_read_after_the_list_left_does_not_say_that_nothing_was_sent() {
    let reboot =
        Reboot { at: Duration::from_millis(800), away: Duration::from_secs(60), ..Reboot::default() };
    for more in [&[][..], &["--append"]] {
        let (address, _controller) = hostile(Character { reboot: Some(reboot), ..Character::default() });
        let file = long(&format!("gone-{}.toml", more.len()));
        let run = ["-r", &address, "run", file.path(), "--wait", "--json"];
        let outcome = r6(&[&run[..], more].concat());
        assert_eq!(outcome.code, 4, "{outcome:?}");
        let failed = last(&outcome);
        let message = text(&failed, "message");
        let (_, read) = message.split_once("the list was sent, then the state could not be read: ").unwrap();
        assert!(!read.contains("nothing was sent") && !read.contains("ask again"), "{message}");
        // Something of the motion was sent. The text about the stop after it uses other words.
        assert!(!message.contains("nothing was sent"), "{message}");
        assert!(!outcome.err.contains("r6 up"), "{outcome:?}");
        assert!(text(&failed, "advice").contains("look at the arm"), "{failed}");
    }
}

#[test]
fn a_list_that_somebody_else_cleared_is_code_4_and_a_stop_that_was_made_is_not_advised() {
    let clear = Foreign { at: Duration::from_millis(800), replace: true, instructions: Vec::new() };
    let (address, _controller) = hostile(Character { foreign: vec![clear], ..Character::default() });
    let file = long("cleared.toml");
    let outcome = r6(&["-r", &address, "run", file.path(), "--wait", "--json"]);
    assert_eq!(outcome.code, 4, "{outcome:?}");
    let failed = last(&outcome);
    assert!(text(&failed, "message").contains("nothing proves that all of it was carried out"), "{failed}");
    assert_eq!(failed["stop"]["confirmed"], true, "{failed}");
    assert!(!text(&failed, "advice").contains("stops it"), "{failed}");
    for page in [
        r6(&["run", "--help"]).out,
        std::fs::read_to_string(crate::support::root().join("docs/COMMAND_LINE.md")).unwrap(),
    ] {
        let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(page.contains("4, even if the arm stands"), "{page}");
    }
}

#[test]
fn after_a_stop_the_program_has_to_be_started_again_and_that_is_said() {
    let cell = Cell::new("hc1", Clock::Real);
    let file = long("started-again.toml");
    let run = ["run", file.path(), "--wait", "--json", "--timeout", "500ms", "--stop-on-interrupt"];
    let outcome = cell.r6(&run);
    assert_eq!(outcome.code, 1, "{outcome:?}");
    assert!(
        text(&last(&outcome), "advice").contains("start the program again before the next motion"),
        "{outcome:?}"
    );
    let stop = cell.r6(&["stop"]);
    assert!(stop.out.contains("start the program again before the next motion"), "{stop:?}");
    assert_eq!(cell.r6(&["command", "startButton"]).code, 0);
    // Here the mode does not change.
    let stays = Reaction::default();
    let stops = Stops { action_stop: stays, stop_button: stays, action_pause: stays, clear: stays };
    let (address, _controller) = hostile(Character { stops, ..Character::default() });
    let stop = r6(&["-r", &address, "stop"]);
    assert!(!stop.out.contains("start the program again"), "{stop:?}");
}
