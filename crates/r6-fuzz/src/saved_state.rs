//! Fuzzes the state that a power cut leaves. Any text is a saved state, or is refused with a reason. An
//! accepted state is written and read again without a change, and nothing moves by itself after it.
//!
//! An input is the text of a state file.

use std::time::Duration;

use r6_controller::{Controller, ControllerSettings, Profile, RobotModel, SavedState, StartState};
use r6_proto::time::Instant;
use serde_json::Value;

use crate::controller::cell::Cell;

/// How long the machine is observed, s.
const WATCHED: f64 = 2.0;

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let saved = match SavedState::from_json(text) {
        Ok(saved) => saved,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let written = saved.to_json();
    assert_eq!(SavedState::from_json(&written).as_ref(), Ok(&saved), "written and read it is another state");

    let settings = settings();
    let mut controller = Controller::restored(settings.clone(), &saved, Instant::ORIGIN);
    assert_eq!(saved.to_json(), written);
    // The state that the controller saves is valid again and stable: restoring it once more changes nothing.
    let again = controller.machine().saved();
    let text = again.to_json();
    assert_eq!(SavedState::from_json(&text).as_ref(), Ok(&again), "what it saves, it does not read");
    nothing_is_lost(&written, &text);
    let restored = Controller::restored(settings.clone(), &again, Instant::ORIGIN).machine().saved();
    assert_eq!(restored, again, "a second power cut changes what the first one left");

    let at_rest = controller.snapshot(Instant::ORIGIN).axes;
    let mut now = Instant::ORIGIN;
    for _ in 0..20 {
        now += Duration::from_secs_f64(WATCHED / 20.0);
        controller.handle_timeout(now);
        let seen = controller.snapshot(now);
        assert!(!seen.moving && seen.axes == at_rest, "it moves by itself after a power cut");
    }
    let mut cell = Cell::around(controller, now);
    cell.ask_everything();
    cell.work();
}

/// Checks that everything written comes back, except a program in use that does not exist, and what that
/// program defines.
fn nothing_is_lost(written: &str, again: &str) {
    let [written, again] =
        [written, again].map(|text| serde_json::from_str::<Value>(text).expect("it was read before"));
    for member in ["mode", "registers", "tool", "bench", "tools", "benches"] {
        assert_eq!(written[member], again[member], "`{member}` is another after a power cut");
    }
    for member in ["counters", "stacks", "programs"] {
        for (name, value) in written[member].as_object().into_iter().flatten() {
            assert_eq!(
                Some(value),
                again[member].get(name),
                "`{member}.{name}` is another after a power cut"
            );
        }
    }
}

/// Settings of a controller that would run at once without a saved state.
pub(crate) fn settings() -> ControllerSettings {
    let model = RobotModel::default();
    ControllerSettings { start: StartState::Waiting, ..ControllerSettings::new(Profile::hc1(), model) }
}
