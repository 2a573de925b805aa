//! Scenarios: what they do to a controller, when, and the errors for a wrong text.

#[path = "scenario/clock.rs"]
mod clock;
mod common;
#[path = "scenario/faults.rs"]
mod faults;
#[path = "scenario/happenings.rs"]
mod happenings;
#[path = "scenario/power.rs"]
mod power;
#[path = "scenario/reactions.rs"]
mod reactions;
#[path = "scenario/reading.rs"]
mod reading;

use std::sync::Arc;

use common::Cell;
use r6_controller::scenario::Scenario;
use r6_controller::{ControllerSettings, Profile, RobotModel};

fn read(text: &str) -> Scenario {
    Scenario::read(text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn settings(text: &str) -> ControllerSettings {
    let model = RobotModel::named("BRTIRUS0707A").unwrap().clone();
    ControllerSettings {
        scenario: Some(Arc::new(read(text))),
        ..ControllerSettings::new(Profile::hc1(), model)
    }
}

/// A cell with this scenario.
fn cell(text: &str) -> Cell {
    Cell::of(settings(text))
}

fn seeded(text: &str, seed: u64) -> Cell {
    Cell::of(ControllerSettings { seed, ..settings(text) })
}

/// An input X of board 0, point 0 being X010.
fn input(cell: &mut Cell, point: u8) -> bool {
    cell.controller.snapshot(cell.now).io.input(point)
}

/// When an input X changes, in milliseconds, sampled every millisecond.
fn changes(cell: &mut Cell, point: u8, seconds: f64) -> Vec<(u64, bool)> {
    let mut found = Vec::new();
    let mut before = input(cell, point);
    let mut ms = 0;
    while f64::from(u32::try_from(ms).unwrap()) < seconds * 1000.0 {
        ms += 1;
        cell.pass(0.001);
        let now = input(cell, point);
        if now != before {
            found.push((ms, now));
        }
        before = now;
    }
    found
}
