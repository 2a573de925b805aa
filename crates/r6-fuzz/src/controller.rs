//! Fuzzes the virtual controller. Whatever it receives, whatever is done at its panel and however much time
//! passes, it follows a small model of a controller. The same input gives the same bytes again.
//!
//! An input is three bytes for firmware, arm and state, then operations: a byte each, with the bytes that it
//! needs.

pub mod cell;
mod duty;
pub mod model;
mod operation;

use r6_controller::{Controller, ControllerSettings, Profile, RobotModel, SavedState, StartState};
use r6_proto::time::Instant;

use crate::input::Input;
use cell::Cell;
use duty::Duties;
use model::Model;
use operation::{MOST_OPERATIONS, Operation};

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let first = transcript(bytes);
    assert!(first == transcript(bytes), "the same input gave other bytes");
}

/// Runs an input, checks the controller against the model, and returns everything that it sent.
fn transcript(bytes: &[u8]) -> Vec<u8> {
    let mut input = Input::new(bytes);
    let settings = settings(&mut input);
    let mut model = Model::new(&settings);
    let mut duties = Duties::new(&settings);
    let mut cell = Cell::around(Controller::new(settings.clone(), Instant::ORIGIN), Instant::ORIGIN);
    model.hold(&mut cell);
    for _ in 0..MOST_OPERATIONS {
        if input.is_empty() {
            break;
        }
        let operation = Operation::read(&mut input);
        duties.before(&operation, &mut cell);
        model.before(&operation, &mut cell);
        carry_out(&operation, &mut cell, &settings);
        model.after(&operation, &mut cell);
        duties.after(&operation, &mut cell);
        model.hold(&mut cell);
    }
    cell.transcript
}

fn settings(input: &mut Input<'_>) -> ControllerSettings {
    let profile = Profile::named(input.pick(&Profile::names())).expect("a shipped profile");
    let names: Vec<_> = RobotModel::names().collect();
    let model = RobotModel::named(input.pick(&names)).expect("a shipped model").clone();
    let how = input.byte();
    let start = [StartState::Waiting, StartState::Auto, StartState::Manual, StartState::Stopped]
        [usize::from(how & 3)];
    let mold =
        ["remote", "default", "pick-and-place", "register-follow"][usize::from(how >> 2 & 3)].to_owned();
    ControllerSettings { start, mold, homed: how & 0xF0 != 0xF0, ..ControllerSettings::new(profile, model) }
}

fn carry_out(operation: &Operation<'_>, cell: &mut Cell, settings: &ControllerSettings) {
    match operation {
        Operation::List { frame, elsewhere: false, .. } => cell.send(frame.as_bytes()),
        Operation::List { frame, elsewhere: true, .. } => cell.send_elsewhere(frame.as_bytes()),
        Operation::Command(words) => {
            cell.send(format!(r#"{{"reqType":"command","cmdData":[{words}]}}"#).as_bytes());
        }
        Operation::Frame(frame) => cell.send(frame.as_bytes()),
        Operation::Bytes(bytes) => cell.send(&bytes.0),
        Operation::Panel(action) => {
            let before = cell.controller.snapshot(cell.now);
            if cell.controller.operate(cell.now, action).is_err() {
                let after = cell.controller.snapshot(cell.now);
                assert_eq!(before, after, "{action:?} was refused, and something has changed");
            }
        }
        Operation::Pass(seconds) => cell.pass(*seconds),
        Operation::Reconnect => cell.reconnect(),
        Operation::Lose => cell.lose(),
        Operation::PowerCut => {
            let saved = cell.controller.machine().saved();
            let read = SavedState::from_json(&saved.to_json()).expect("what is saved can be read");
            assert_eq!(read, saved);
            let controller = Controller::restored(settings.clone(), &read, cell.now);
            cell.replace(controller);
        }
        Operation::Photo(cam_id) => cell.controller.request_photo(cell.now, *cam_id),
        Operation::AskEverything => cell.ask_everything(),
    }
}
