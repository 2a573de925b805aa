//! What the gateway tells of a robot.

use std::time::Duration;

use r6_api::AddressValue;
use r6_api::gateway::{RobotState, Signal, SignalQuality};
use r6_proto::Address;
use r6_proto::message::Reading;

use crate::fault::Promise;
use crate::floor::Floor;
use crate::record::Record;

/// A fresh value is no older than its period and this time: the client's own limit for a value that is
/// suspect.
const FRESH_FOR: Duration = Duration::from_millis(1000);

/// Ages are told in whole milliseconds, and hosts run one after the other.
const ROUNDING: Duration = Duration::from_millis(5);

/// Judges the values of a robot that were asked for at `asked`, and came at `heard`.
pub fn judge(
    (asked, heard): (Duration, Duration),
    (robot, told): (usize, &RobotState),
    floor: &Floor,
    record: &mut Record,
) {
    let period = Duration::from_millis(told.period_ms);
    for Signal { address, value, quality, age_ms, .. } in &told.signals {
        let age = age_ms.map(Duration::from_millis);
        let fits = match quality {
            SignalQuality::Fresh => {
                value.is_some() && age.is_some_and(|age| age <= period + FRESH_FOR + ROUNDING)
            }
            SignalQuality::Stale => value.is_some() && age.is_some(),
            SignalQuality::None => value.is_none(),
        };
        record.check(Promise::I5, heard, fits, || {
            format!("robot-{robot}: {address} is {quality:?}, {age:?} old, and has {value:?}")
        });
        let (SignalQuality::Fresh, Some(age), Some(reading)) =
            (quality, age, value.as_ref().and_then(reading_of))
        else {
            continue;
        };
        let Ok(parsed) = Address::parse(address) else { continue };
        if let Some(was) = floor.was(parsed, &reading, asked.saturating_sub(age + ROUNDING), heard) {
            record.check(Promise::I10, heard, was, || {
                format!("robot-{robot}: {address} is told as {value:?}, {age:?} old, and never was")
            });
        }
    }
}

/// Whether the mode is told as fresh.
#[must_use]
pub fn is_fresh(told: &RobotState) -> bool {
    let mode = told.signals.iter().find(|signal| signal.address == "curMode");
    mode.is_some_and(|mode| mode.quality == SignalQuality::Fresh)
}

fn reading_of(value: &AddressValue) -> Option<Reading> {
    match value {
        AddressValue::Integer(whole) => Some(Reading::Integer(*whole)),
        AddressValue::Decimal(decimal) => Some(Reading::Decimal(*decimal)),
        _ => None,
    }
}
