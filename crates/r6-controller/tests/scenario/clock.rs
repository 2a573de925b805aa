//! A scenario on the clock that runs as fast as it can (`docs/SIMULATOR.md`).

use r6_controller::{ConnectionId, Controller, ControllerSettings, FastClock};
use r6_proto::time::Instant;
use serde_json::json;

use crate::common::axis_move;
use crate::settings;

struct Fast {
    controller: Controller,
    clock: FastClock,
    id: ConnectionId,
}

impl Fast {
    fn new(text: &str) -> Self {
        let mut controller =
            Controller::new(ControllerSettings { seed: 5, ..settings(text) }, Instant::ORIGIN);
        let id = controller.connect(Instant::ORIGIN);
        Self { controller, clock: FastClock::new(Instant::ORIGIN), id }
    }

    fn send(&mut self, bytes: impl AsRef<[u8]>) -> String {
        self.clock.handle_input(&mut self.controller, self.id, bytes.as_ref());
        let mut all = String::new();
        while let Some(frame) = self.controller.poll_transmit(self.clock.now(), self.id) {
            all.push_str(&String::from_utf8_lossy(frame));
        }
        all
    }

    fn seconds(&self) -> f64 {
        self.clock.now().as_secs_f64()
    }
}

const SET: &str = r#"{"reqType":"command","cmdData":["modifyOutput","0","0","1"]}"#;
const LOOK: &str = r#"{"reqType":"query","queryAddr":["input-0"]}"#;

#[test]
fn a_reaction_counts_as_under_way() {
    let mut fast = Fast::new("[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nafter = 30");
    fast.send(SET);
    assert_eq!(fast.seconds(), 30.0);
    assert!(fast.send(LOOK).contains(r#""queryData":["1"]"#));
}

#[test]
fn the_timeline_does_not_and_comes_when_nobody_says_anything() {
    let mut fast = Fast::new("[[at]]\ntime = 40\ndo = \"input\"\npoint = \"X010\"\non = true");
    fast.send(LOOK);
    assert_eq!(fast.seconds(), 0.0);
    assert_eq!(fast.clock.pause(&fast.controller), Some(std::time::Duration::from_secs(40)));
    fast.clock.go_on(&mut fast.controller);
    assert_eq!(fast.seconds(), 40.0);
    assert!(fast.send(LOOK).contains(r#""queryData":["1"]"#));
    assert_eq!(fast.clock.pause(&fast.controller), None);
}

#[test]
fn a_move_that_is_jumped_over_meets_what_happens_on_the_way() {
    let mut fast = Fast::new("[[at]]\ntime = 1\ndo = \"alarm\"\nnumber = 15\n");
    let list = json!({"reqType": "AddRCC", "emptyList": "1", "instructions": [axis_move([100.0, 0.0, 0.0, 0.0, 0.0, 0.0], 10.0)]});
    fast.send(list.to_string());
    // The first query sees it begin to move.
    fast.send(r#"{"reqType":"query","queryAddr":["isMoving"]}"#);
    let look = fast.send(r#"{"reqType":"query","queryAddr":["curAlarm"]}"#);
    assert!(look.contains(r#""queryData":["15"]"#), "{look}");
    let axes = fast.controller.snapshot(fast.clock.now()).axes;
    assert!(axes[0] < 30.0, "{axes:?}");
}

#[test]
fn a_wait_with_a_limit_gets_what_reacts_in_time() {
    let wait = |after: f64| {
        let mut fast = Fast::new(&format!("[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nafter = {after:.1}"));
        let list = json!({"reqType": "AddRCC", "emptyList": "1", "instructions": [
            {"oneshot": "1", "action": "200", "type": "0", "io_status": "1", "point": "0", "delay": "0"},
            {"oneshot": "1", "action": "100", "type": "0", "point": "0", "io_status": "1", "limit": "2", "isUnlimit": "0"},
        ]});
        fast.send(list.to_string());
        (fast.seconds(), fast.controller.snapshot(fast.clock.now()).list_length)
    };
    assert_eq!(wait(1.5), (1.5, 0));
    let (seconds, left) = wait(3.0);
    assert!(seconds < 0.1 && left == 1, "the limit is left its real time: {seconds}, {left}");
}

#[test]
fn pieces_change_nothing_of_what_is_drawn() {
    let text = "[[fault]]\nfault = \"unsolicited\"\nchance = 0.5\n[[fault]]\nfault = \"not-acknowledged\"\nchance = 0.5\n\
                [[fault]]\nfault = \"late-reply\"\nchance = 0.3\n[[react]]\nwhen = \"Y010\"\nthen = \"X010\"\nspread = 5";
    let talk: String = (0..40)
        .map(|n| format!(r#"{{"reqType":"command","cmdData":["modifyOutput","0","0","{}"]}}{LOOK}"#, n % 2))
        .collect();
    let by = |size: usize| {
        let mut fast = Fast::new(text);
        let said: String = talk.as_bytes().chunks(size).map(|piece| fast.send(piece)).collect();
        (said, fast.clock.now())
    };
    let whole = by(talk.len());
    assert!(whole.0.len() > 1000);
    for size in [1, 3, 64, 1000] {
        assert_eq!(by(size), whole, "in pieces of {size}");
    }
}
