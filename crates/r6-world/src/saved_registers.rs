//! Registers that a controller saves. An acknowledged value must be on its disk, and must be there after the
//! next start.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use crate::disk::SimDisk;
use crate::fault::Promise;
use crate::record::Record;

/// The file with the state of a controller.
pub const STATE: &str = "state/controller-1.json";

/// A saved register: the last acknowledged and the last sent value.
#[derive(Clone, Copy, Debug, Default)]
pub struct SavedRegister {
    /// Acknowledged.
    pub acknowledged: i64,
    /// Sent.
    pub sent: i64,
}

/// Checks a value that was just acknowledged: it must survive a power cut at this instant.
pub fn look_at_disk(disk: &SimDisk, (register, value): (u16, i64), at: Duration, record: &mut Record) {
    let bytes = disk.surely(Path::new(STATE)).unwrap_or_default();
    let found = value_in(&String::from_utf8_lossy(&bytes), register);
    record.check(Promise::I7, at, found >= value, || {
        format!("{value} in register {register} is acknowledged, and the disk is sure of {found}")
    });
}

/// Checks a controller that was just started: each register must have its last acknowledged value, or a value
/// that was sent later.
pub fn compare(
    (name, saved): (&str, &str),
    kept: &BTreeMap<u16, SavedRegister>,
    at: Duration,
    record: &mut Record,
) {
    for (register, kept) in kept {
        let found = value_in(saved, *register);
        let holds = (kept.acknowledged..=kept.sent).contains(&found);
        record
            .check(Promise::I7, at, holds, || format!("{name}: register {register} keeps {found}, {kept:?}"));
    }
}

/// The value of a register in a saved state; 0 if the state does not have it.
fn value_in(saved: &str, register: u16) -> i64 {
    let saved: serde_json::Value = serde_json::from_str(saved).unwrap_or_default();
    saved["registers"][register.to_string()].as_i64().unwrap_or(0)
}
