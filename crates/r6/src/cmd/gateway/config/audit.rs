//! `[audit]` in the file of a gateway: how much of the audit log is kept.

use r6_gateway::{AuditSettings, LEAST_ENTRIES};
use r6_program::form::{Fields, Found, Table};

/// The most entries: some hundred gigabytes.
const MAX_ENTRIES: u32 = 1_000_000_000;

/// Reads the table.
pub(super) fn read(table: &Table, found: &mut Found<'_>) -> Option<AuditSettings> {
    let fields = Fields::of(table, &["max_entries"], "[audit]: ");
    let mut settings = AuditSettings::default();
    let wanted = format!("from {LEAST_ENTRIES} to {MAX_ENTRIES}");
    if let Some(count) = fields.whole_in("max_entries", &wanted, LEAST_ENTRIES..=MAX_ENTRIES) {
        settings.max_entries = count.into();
    }
    fields.finish(Ok(settings), found)
}
