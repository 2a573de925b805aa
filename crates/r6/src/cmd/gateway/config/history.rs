//! `[history]` in the file of a gateway: what is kept of values, and for how long.

use r6_client::Address;
use r6_gateway::{HistorySettings, LEAST_MAX_BYTES};
use r6_program::form::{Fields, Found, Table, Wrong};

/// A mebibyte: the unit of `max_mb`.
const MEBIBYTE: u64 = 1024 * 1024;

/// The most days: about ten years.
const MAX_DAYS: u32 = 3660;

/// The largest size: a pebibyte.
const MAX_MEBIBYTES: u64 = 1024 * 1024 * 1024;

/// Reads the table.
pub(super) fn read(table: &Table, found: &mut Found<'_>) -> Option<HistorySettings> {
    let known = ["keep", "keep_days", "keep_minutes_days", "keep_hours_days", "max_mb", "deadband"];
    let fields = Fields::of(table, &known, "[history]: ");
    let mut settings = HistorySettings::default();
    let mut deadbands = Vec::new();
    for (number, table) in (1..).zip(fields.tables("deadband")) {
        let inner = Fields::of(table, &["address", "by"], format!("[[history.deadband]] {number}: "));
        let read = deadband(&inner);
        deadbands.extend(inner.finish(read, found));
    }
    let least = LEAST_MAX_BYTES / MEBIBYTE;
    if let Some(on) = fields.optional("keep", "true or false", |value| value.flag()) {
        settings.on = on;
    }
    if let Some(days) = fields.whole_in("keep_days", &format!("from 1 to {MAX_DAYS}"), 1..=MAX_DAYS) {
        settings.keep_days = days;
    }
    if let Some(days) = fields.whole_in("keep_minutes_days", &format!("from 1 to {MAX_DAYS}"), 1..=MAX_DAYS) {
        settings.keep_minutes_days = days;
        // What is not said of hours does not make that wrong.
        settings.keep_hours_days = settings.keep_hours_days.max(days);
    }
    let least_days = settings.keep_minutes_days;
    let wanted = format!("from {least_days} to {MAX_DAYS}: at least as many as `keep_minutes_days`");
    if let Some(days) = fields.whole_in("keep_hours_days", &wanted, least_days..=MAX_DAYS) {
        settings.keep_hours_days = days;
    }
    let wanted = format!("mebibytes, from {least} to {MAX_MEBIBYTES}");
    if let Some(size) = fields.whole_in("max_mb", &wanted, least..=MAX_MEBIBYTES) {
        settings.max_bytes = size.saturating_mul(MEBIBYTE);
    }
    settings.deadbands = deadbands.into_iter().collect();
    fields.finish(Ok(settings), found)
}

fn deadband(fields: &Fields<'_>) -> Result<(Address, f64), Wrong> {
    let address =
        fields.due("address", "a query address, such as axis-0", |value| Address::parse(value.text()?).ok());
    let by = fields.due("by", "a number from 0", |value| value.number().filter(|number| *number >= 0.0));
    Ok((address?, by?))
}
