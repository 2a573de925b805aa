//! Alarm codes in words.

use r6_proto::alarm::{Alarm, AlarmCode};

/// An alarm in a few words, such as `135 (J6: positive soft limit)`; `none` for 0.
pub fn short(code: i64) -> String {
    if code == 0 { "none".to_owned() } else { r6_api::status::alarm_text(code) }
}

/// What to do about an alarm.
pub fn advice(code: i64) -> &'static str {
    decoded(code).map_or("read the pendant's display", |alarm| alarm.remedy)
}

fn decoded(code: i64) -> Option<Alarm> {
    u32::try_from(code).ok().map(|code| AlarmCode(code).decode())
}
