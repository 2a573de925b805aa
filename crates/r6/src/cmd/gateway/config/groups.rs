//! `[[robot.group]]` in the file of a gateway: values of a robot that are read with a period of their own.

use std::time::Duration;

use r6_gateway::{MAX_GROUPS, MAX_OF_GROUP, PollGroup};
use r6_program::form::{Fields, Found, Wrong};

use super::{address_of, periods};

/// Reads the groups of a robot, whose table is at this place.
pub fn read(robot: &Fields<'_>, place: &str, found: &mut Found<'_>) -> Vec<PollGroup> {
    let tables = robot.tables("group");
    if tables.len() > MAX_GROUPS {
        let _noted = robot.wrong("group", format!("a robot has at most {MAX_GROUPS} groups"));
    }
    let mut groups = Vec::new();
    for (number, table) in (1..).zip(tables) {
        let fields = Fields::of(
            table,
            &["period_ms", "read", "keep", "deadband"],
            format!("{place}[[robot.group]] {number}: "),
        );
        let group = group(&fields);
        groups.extend(fields.finish(group, found));
    }
    groups
}

fn group(fields: &Fields<'_>) -> Result<PollGroup, Wrong> {
    let (wanted, range) = periods();
    let period = fields.due_in("period_ms", &wanted, range);
    let wanted = format!("1 to {MAX_OF_GROUP} query addresses in brackets, such as [\"counter-0\"]");
    let addresses = fields.due("read", &wanted, |value| {
        let addresses = value.list()?.iter().map(address_of).collect::<Option<Vec<_>>>()?;
        (1..=MAX_OF_GROUP).contains(&addresses.len()).then_some(addresses)
    });
    let is_kept = fields.flag("keep").unwrap_or(true);
    let deadband = fields.number_in("deadband", "a number from 0", 0.0..=f64::MAX);
    let period = Duration::from_millis(period?.into());
    Ok(PollGroup { is_kept, deadband, ..PollGroup::new(period, addresses?) })
}
