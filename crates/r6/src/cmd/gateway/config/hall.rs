//! `[hall]` and `[[shift]]` in the file of a gateway: the time zone of the hall and its shifts.

use r6_api::gateway::{HallSettings, Shift, Weekday};
use r6_gateway::{Hall, HallMistake};
use r6_program::form::{Fields, Found, Node, Table};

/// It stands in place of a time zone that is missing or of another type; that was told.
const UTC: &str = "UTC";

/// Reads the tables; `None` if there are none, or if something is wrong.
pub fn read(hall: Option<&Table>, shifts: &[&Table], found: &mut Found<'_>) -> Option<Hall> {
    if hall.is_none() && shifts.is_empty() {
        return None;
    }
    let of_hall = hall.map(|table| Fields::of(table, &["time_zone"], "[hall]: "));
    let wanted = "the name of a time zone, such as \"Europe/Berlin\"";
    let time_zone = of_hall
        .as_ref()
        .map(|fields| fields.due("time_zone", wanted, |value| value.text().map(str::to_owned)));
    let known = &["name", "days", "begin", "end"];
    let fields: Vec<_> = (1..)
        .zip(shifts)
        .map(|(number, table)| Fields::of(table, known, format!("[[shift]] {number}: ")))
        .collect();
    let read: Vec<_> = fields.iter().map(shift).collect();
    // What cannot be read was told. The rules are looked at for the others, each at its own place.
    let numbers: Vec<_> = (0..).zip(&read).filter(|(_, read)| read.is_some()).map(|(at, _)| at).collect();
    let zone = time_zone.as_ref().and_then(|zone| zone.as_ref().ok()).map_or(UTC, String::as_str);
    let settings =
        HallSettings { time_zone: zone.to_owned(), shifts: read.iter().flatten().cloned().collect() };
    let checked = Hall::new(settings);
    for HallMistake { shift, field, what } in checked.as_ref().err().into_iter().flatten() {
        let of_shift = shift.and_then(|at| fields.get(*numbers.get(at)?));
        match (of_shift, &of_hall) {
            (Some(fields), _) => drop(fields.wrong(field, what.clone())),
            (None, Some(of_hall)) if *field == "time_zone" => drop(of_hall.wrong(field, what.clone())),
            // There are too many shifts.
            (None, _) => {
                if let Some(last) = fields.last() {
                    drop(last.wrong("name", format!("shifts: {what}")));
                }
            }
        }
    }
    if hall.is_none()
        && let Some(first) = fields.first()
    {
        drop(first.wrong("name", "a shift needs the `time_zone` of [hall]"));
    }
    let is_whole = numbers.len() == read.len() && hall.is_some();
    for (fields, read) in fields.into_iter().zip(read) {
        fields.finish(Ok(read), found);
    }
    if let (Some(fields), Some(time_zone)) = (of_hall, time_zone) {
        fields.finish(time_zone, found);
    }
    checked.ok().filter(|_| is_whole)
}

/// A shift whose fields have the right types; `None` if one has not, which was noted.
fn shift(fields: &Fields<'_>) -> Option<Shift> {
    let text = |name, wanted| fields.due(name, wanted, |value| value.text().map(str::to_owned)).ok();
    let name = text("name", "a text, such as \"early\"");
    let days = fields.due("days", "days in brackets, such as [\"mon\", \"tue\"]", |value| {
        value.list()?.iter().map(day).collect::<Option<Vec<_>>>()
    });
    let begin = text("begin", "a time in quotes, such as \"06:00\"");
    let end = text("end", "a time in quotes, such as \"14:00\"");
    Some(Shift { name: name?, days: days.ok()?, begin: begin?, end: end? })
}

fn day(node: &Node) -> Option<Weekday> {
    Weekday::of_word(node.text()?)
}
