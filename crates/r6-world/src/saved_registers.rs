//! Registers that a controller keeps: what it acknowledges is on its disk by then, and there again when it is
//! switched on.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use crate::disk::SimDisk;
use crate::fault::Promise;
use crate::record::Record;

/// The file that a controller keeps its state in.
pub const STATE: &str = "state/controller-1.json";

/// A register that is kept: what was acknowledged last, and what was sent last.
#[derive(Clone, Copy, Debug, Default)]
pub struct SavedRegister {
    /// Acknowledged.
    pub acknowledged: i64,
    /// Sent.
    pub sent: i64,
}

/// A value was acknowledged just now: if the power failed in this instant, it would be there.
pub fn look_at_disk(disk: &SimDisk, (register, value): (u16, i64), at: Duration, record: &mut Record) {
    let bytes = disk.surely(Path::new(STATE)).unwrap_or_default();
    let found = value_in(&String::from_utf8_lossy(&bytes), register);
    record.check(Promise::I7, at, found >= value, || {
        format!("{value} in register {register} is acknowledged, and the disk is sure of {found}")
    });
}

/// What a controller has that was switched on: the values that were acknowledged last, or some that were sent
/// since.
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

/// The value of a register in a saved state; nought where there is none.
fn value_in(saved: &str, register: u16) -> i64 {
    let saved: serde_json::Value = serde_json::from_str(saved).unwrap_or_default();
    saved["registers"][register.to_string()].as_i64().unwrap_or(0)
}
