//! What was seen to happen at a robot.

use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State as Of};
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use r6_api::Problem;
use r6_api::gateway::{HistoryEvent, HistoryEvents};
use r6_http::Refusal;
use serde::Deserialize;
use utoipa::IntoParams;

use super::super::State;
use super::super::caller::{Read, Robot};
use super::super::csv;
use super::super::described::OfRight;
use super::super::range::{Range, check_limit, shown};
use super::super::refusal::{self, bad_value};
use super::{LENGTHS, permit, recorder, table, wants_csv};
use crate::clock::{self, text};
use crate::core::history::event::Kind;
use crate::core::history::sample::Micros;
use crate::history::query::{EventAnswer, EventPlace, EventQuestion};
use crate::live::happened::happened;

/// The most events of one answer: some hundred kilobytes of JSON.
const MAX_LIMIT: usize = 1_000;

/// Which events.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// The begin, RFC 3339 in UTC; an hour before the end if it is missing.
    #[param(example = "2026-11-25T06:00:00Z")]
    from: Option<String>,
    /// The end, which does not belong to the range, RFC 3339 in UTC; now if it is missing or later.
    #[param(example = "2026-11-25T07:00:00Z")]
    to: Option<String>,
    /// Only these kinds, with commas between them, such as `alarm_began,alarm_ended`; all if it is missing.
    #[param(example = "alarm_began,alarm_ended")]
    kind: Option<String>,
    /// The largest number of events, 1 to 1000.
    #[serde(default = "usual_limit")]
    #[param(minimum = 1, maximum = 1000, default = 1000)]
    limit: usize,
    /// Where to read on: `next_cursor` of the last answer.
    cursor: Option<String>,
}

fn usual_limit() -> usize {
    MAX_LIMIT
}

/// What was seen to happen at a robot: alarms, modes, programs, cycles, parts, links, and when it was not
/// seen. `Accept: text/csv` gives a table; the header `r6-next-cursor` says where it goes on.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/history/events",
    operation_id = "history_events",
    params(("name" = String, Path, description = "The name of the robot"), Wanted),
    responses(
        (
            status = 200,
            description = "The events",
            content((HistoryEvents = "application/json"), (String = "text/csv")),
        ),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (status = 422, description = "`bad_value`: a parameter is wrong, or the history is off", body = Problem),
        (
            status = 503,
            description = "`store_unavailable`; `overloaded`: other queries are under way",
            body = Problem
        ),
        OfRight,
    )
)]
pub async fn show(
    robot: Robot<Read>,
    Of(state): Of<State>,
    headers: HeaderMap,
    wanted: Result<Query<Wanted>, QueryRejection>,
) -> Result<Response, Refusal> {
    let Query(wanted) = wanted.map_err(refusal::of_query_for_forms)?;
    let recorder = recorder(&state)?;
    let now = recorder.time(clock::now());
    let question = question(wanted, robot.station.config().name, now)?;
    let permit = permit(recorder)?;
    // Before the answer: what is on the disk then is in it.
    let kept_until = robot.station.counts.history.kept_until().map(text);
    let answer = recorder.reader().events(permit, question.clone()).await;
    let page = page(question, answer.map_err(|error| refusal::of(error.into()))?, kept_until);
    if wants_csv(&headers) {
        return Ok(table(csv::event_table(&page), page.next_cursor));
    }
    Ok(Json(page).into_response())
}

fn question(
    wanted: Wanted,
    robot: crate::core::name::RobotName,
    now: Micros,
) -> Result<EventQuestion, Refusal> {
    let Wanted { from, to, kind, limit, cursor } = wanted;
    let kinds = kind.iter().flat_map(|kinds| kinds.split(',')).map(one_kind).collect::<Result<_, _>>()?;
    let after = cursor.as_deref().and_then(place);
    let place = after.map(|place| place.time);
    let range = LENGTHS.range((from.as_deref(), to.as_deref()), place, now)?;
    check_limit(limit, MAX_LIMIT)?;
    range.check_cursor(cursor.as_deref(), place)?;
    let Range { from, to } = range;
    Ok(EventQuestion { robot, from, to, kinds, limit, after })
}

fn one_kind(word: &str) -> Result<Kind, Refusal> {
    Kind::of_word(word).ok_or_else(|| {
        let words = Kind::ALL.map(Kind::word);
        let advice = match r6_proto::nearest(word, words) {
            Some(nearest) => format!("nearest: `{nearest}`"),
            None => format!("the kinds are {}", words.join(", ")),
        };
        bad_value(format!("kind: `{}` is no kind of event; {advice}", shown(word)))
    })
}

/// Reads a cursor: `e`, then time, file and row.
fn place(text: &str) -> Option<EventPlace> {
    let mut parts = text.strip_prefix('e')?.split('-');
    let (time, part, row) =
        (parts.next()?.parse().ok()?, parts.next()?.parse().ok()?, parts.next()?.parse().ok()?);
    let place = EventPlace { time: Micros(time), part, row };
    (cursor(place) == text).then_some(place)
}

fn cursor(EventPlace { time, part, row }: EventPlace) -> String {
    format!("e{}-{part}-{row}", time.0)
}

fn page(question: EventQuestion, answer: EventAnswer, kept_until: Option<String>) -> HistoryEvents {
    let EventAnswer { events, next, unreadable } = answer;
    let events = events.into_iter().map(|(part, row, event)| HistoryEvent {
        id: format!("{}-{}-{row}", part.day, part.number),
        time: text(event.time),
        true_time: event.true_time.map(text),
        happened: happened(event.observed),
    });
    HistoryEvents {
        robot: question.robot.to_string(),
        from: text(question.from),
        to: text(question.to),
        events: events.collect(),
        kept_until,
        unreadable,
        next_cursor: next.map(cursor),
    }
}
