//! The history of a robot: its values, and what happened to it ([`events`]).

#[cfg(test)]
mod averages_tests;
pub mod events;

use std::time::Duration;

use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State as Of};
use axum::http::header::{ACCEPT, CONTENT_TYPE};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use r6_api::gateway::{AveragesUsed, History, HistoryAverages, HistoryBucket, HistorySample};
use r6_api::{Code, Problem, Unit};
use r6_client::Address;
use r6_http::Refusal;
use serde::Deserialize;
use tokio::sync::OwnedSemaphorePermit;
use utoipa::IntoParams;

use super::State;
use super::caller::{Read, Robot};
use super::csv;
use super::described::OfRight;
use super::parquet;
use super::range::{Lengths, check_limit, shown};
use super::refusal::{self, bad_value};
use crate::clock::{self, text};
use crate::core::history::buckets::Bucket;
use crate::core::history::sample::{Micros, Sample};
use crate::fleet::station::Station;
use crate::history::Recorder;
use crate::history::query::{Answer, Averaged, Question, Used};

/// The most samples or buckets of one answer: a megabyte of JSON.
const MAX_LIMIT: usize = 10_000;

/// An hour if no begin is given, and ten years at most.
const LENGTHS: Lengths = Lengths {
    usual: Duration::from_secs(3600),
    longest: Duration::from_secs(10 * 366 * 86_400),
    longest_words: "ten years",
};

/// The narrowest bucket: robots are read every 20 ms at most.
const NARROWEST_BUCKET: Duration = Duration::from_millis(1);

/// Names the place where a table of CSV goes on.
const NEXT_CURSOR: HeaderName = HeaderName::from_static("r6-next-cursor");

/// Says of a table or a file what `averages` says of JSON, as JSON.
const AVERAGES: HeaderName = HeaderName::from_static("r6-averages");

/// The most parts that the header names, so that it stays short: clients refuse heads of more than some
/// kilobytes. In general there is one.
const MAX_PARTS: usize = 16;

/// Which samples.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// The query address, one of those that are read.
    #[param(example = "axis-0")]
    signal: String,
    /// The begin, RFC 3339 in UTC; an hour before the end if it is missing.
    #[param(example = "2026-11-25T06:00:00Z")]
    from: Option<String>,
    /// The end, which does not belong to the range, RFC 3339 in UTC; now if it is missing or later.
    #[param(example = "2026-11-25T07:00:00Z")]
    to: Option<String>,
    /// The width of the buckets, such as `500ms`, `10s`, `1m` or `1h`; samples if it is missing.
    #[param(example = "1m")]
    bucket: Option<String>,
    /// The largest number of samples or buckets, 1 to 10000.
    #[serde(default = "usual_limit")]
    #[param(minimum = 1, maximum = 10_000, default = 1000)]
    limit: usize,
    /// Where to read on: `next_cursor` of the last answer.
    cursor: Option<String>,
}

fn usual_limit() -> usize {
    1000
}

/// The history of one value: its samples, or averages weighted by time. `Accept: text/csv` gives a table,
/// `Accept: application/vnd.apache.parquet` a file with the same columns; the header `r6-next-cursor` says
/// where they go on, and `r6-averages` where values are gone. Where the values of days are gone, buckets are
/// made of averages of minutes or hours that were kept: `averages` says where.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/history",
    operation_id = "history",
    params(("name" = String, Path, description = "The name of the robot"), Range),
    responses(
        (
            status = 200,
            description = "The samples or buckets",
            content(
                (History = "application/json"),
                (String = "text/csv"),
                (Vec<u8> = "application/vnd.apache.parquet"),
            ),
        ),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 422,
            description = "`bad_value`: a parameter is wrong, the history is off, or a bucket has too many samples",
            body = Problem
        ),
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
    range: Result<Query<Range>, QueryRejection>,
) -> Result<Response, Refusal> {
    let Query(range) = range.map_err(refusal::of_query_for_forms)?;
    let recorder = recorder(&state)?;
    let question = question(range, &robot.station, recorder)?;
    let (name, address) = (question.robot.clone(), question.address);
    let permit = permit(recorder)?;
    let open = recorder.open(name, address).await.map_err(|error| refusal::of(error.into()))?;
    let answer = recorder.reader().answer(permit, question.clone(), open).await;
    let answer = answer.map_err(|error| refusal::of(error.into()))?;
    if answer.is_too_wide {
        return Err(bad_value("a bucket of this width has too many samples: ask for a narrower one"));
    }
    let (station, form) = (robot.station, form(&headers, &[Form::Json, Form::Csv, Form::Parquet]));
    // A long page takes milliseconds to write. No stop waits for that.
    let work = tokio::task::spawn_blocking(move || written(form, &station, &question, &answer));
    work.await.map_err(refusal::of_lost_work)?
}

/// The answer in this form.
fn written(form: Form, station: &Station, question: &Question, answer: &Answer) -> Result<Response, Refusal> {
    let page = page(station, question, answer);
    match form {
        Form::Json => Ok(Json(page).into_response()),
        Form::Csv => Ok(with_averages(table(csv::table(&page), page.next_cursor), &page.averages)),
        Form::Parquet => {
            let kind = question.address.info().value;
            let file = match question.bucket {
                Some(_) => parquet::of_buckets(&answer.buckets, kind, &page),
                None => parquet::of_samples(&answer.samples, kind, &page),
            };
            let file = file.map_err(refusal::of_file)?;
            let response = with_next(([(CONTENT_TYPE, parquet::MEDIA_TYPE)], file), page.next_cursor);
            Ok(with_averages(response, &page.averages))
        }
    }
}

/// The history of this gateway.
pub(super) fn recorder(state: &State) -> Result<&Recorder, Refusal> {
    let off = || bad_value("the file of this gateway says that no history is kept");
    state.shared.history.as_ref().ok_or_else(off)
}

/// Leave to read.
pub(super) fn permit(recorder: &Recorder) -> Result<OwnedSemaphorePermit, Refusal> {
    recorder.reader().permit().ok_or_else(|| {
        let message = "other queries are under way: ask again";
        Refusal::new(StatusCode::SERVICE_UNAVAILABLE, Code::Overloaded, message)
    })
}

/// A table, and the place where it goes on.
pub(super) fn table(table: String, next_cursor: Option<String>) -> Response {
    with_next(([(CONTENT_TYPE, "text/csv; charset=utf-8; header=present")], table), next_cursor)
}

fn with_next(answer: impl IntoResponse, next_cursor: Option<String>) -> Response {
    let mut response = answer.into_response();
    let next = next_cursor.and_then(|cursor| HeaderValue::from_str(&cursor).ok());
    response.headers_mut().extend(next.map(|next| (NEXT_CURSOR, next)));
    response
}

fn with_averages(mut response: Response, averages: &[HistoryAverages]) -> Response {
    let parts = averages.get(..MAX_PARTS).unwrap_or(averages);
    let text = (!parts.is_empty()).then(|| serde_json::to_string(parts).ok()).flatten();
    let header = text.and_then(|text| HeaderValue::from_str(&text).ok());
    response.headers_mut().extend(header.map(|header| (AVERAGES, header)));
    response
}

/// In which form an answer can be given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Json,
    Csv,
    Parquet,
}

impl Form {
    fn media_type(self) -> &'static str {
        match self {
            Self::Json => "application/json",
            Self::Csv => "text/csv",
            Self::Parquet => parquet::MEDIA_TYPE,
        }
    }
}

/// Whether the caller wants a table of text. Without a wish it is JSON.
pub(super) fn wants_csv(headers: &HeaderMap) -> bool {
    form(headers, &[Form::Json, Form::Csv]) == Form::Csv
}

/// The first form that the caller names, of those that are offered. Without a wish it is JSON.
fn form(headers: &HeaderMap, offered: &[Form]) -> Form {
    let accept = headers.get(ACCEPT).and_then(|accept| accept.to_str().ok()).unwrap_or_default();
    let is_wanted =
        |kind: &&str| kind.split(';').all(|part| part.trim().trim_end_matches(['0', '.']) != "q=");
    let mut kinds = accept.split(',').filter(is_wanted).filter_map(|kind| kind.split(';').next());
    let of_kind = |kind: &str| match kind.trim() {
        "*/*" => Some(Form::Json),
        kind => offered.iter().copied().find(|form| form.media_type().eq_ignore_ascii_case(kind)),
    };
    kinds.find_map(of_kind).unwrap_or(Form::Json)
}

fn question(range: Range, station: &Station, recorder: &Recorder) -> Result<Question, Refusal> {
    let address = Address::parse(&range.signal).map_err(|unknown| bad_value(unknown.to_string()))?;
    let now = recorder.time(clock::now());
    let cursor = range.cursor.as_ref().and_then(|text| text.strip_prefix('t')?.parse().ok()).map(Micros);
    let of_time = LENGTHS.range((range.from.as_deref(), range.to.as_deref()), cursor, now)?;
    let bucket = range.bucket.as_ref().map(|text| {
        let width = humantime::parse_duration(text)
            .ok()
            .filter(|width| *width >= NARROWEST_BUCKET && width.subsec_nanos().is_multiple_of(1_000_000));
        let width = width.and_then(|width| i64::try_from(width.as_micros()).ok());
        width.ok_or_else(|| bad_value(format!("bucket: `{}` is not a width such as 10s or 1m", shown(text))))
    });
    check_limit(range.limit, MAX_LIMIT)?;
    of_time.check_cursor(range.cursor.as_deref(), cursor)?;
    let bucket = bucket.transpose()?;
    let super::range::Range { from, to } = of_time;
    let robot = station.config().name;
    Ok(Question { robot, address, from, to, bucket, limit: range.limit, cursor })
}

/// How long there was a value in a bucket, in milliseconds.
pub(super) fn good_ms(bucket: &Bucket) -> f64 {
    clock::milliseconds(Duration::from_micros(u64::try_from(bucket.good).unwrap_or(0)))
}

fn page(station: &Station, question: &Question, answer: &Answer) -> History {
    let Question { address, from, to, bucket, .. } = question;
    let kind = address.info().value;
    let sample = |sample: &Sample| HistorySample {
        time: text(sample.time),
        value: sample.state.value(kind),
        gap: sample.state.gap(),
    };
    let of = |bucket: &Bucket| HistoryBucket {
        time: text(bucket.start),
        mean: bucket.mean,
        min: bucket.range.map(|range| range.0),
        max: bucket.range.map(|range| range.1),
        last: bucket.last.as_ref().and_then(|last| last.value(kind)),
        good_ms: good_ms(bucket),
        samples: bucket.samples,
    };
    let averaged = |Averaged { from, to, step, used }: &Averaged| HistoryAverages {
        from: text(*from),
        to: text(*to),
        width_ms: u64::try_from(step.micros() / 1000).unwrap_or(0),
        used: match used {
            Used::Exact => AveragesUsed::Exact,
            Used::ByBegin => AveragesUsed::ByBegin,
            Used::Incomplete => AveragesUsed::Incomplete,
            Used::No => AveragesUsed::NotUsed,
        },
    };
    History {
        robot: question.robot.to_string(),
        signal: address.to_string(),
        unit: Unit::word_of(*address).map(str::to_owned),
        from: text(*from),
        to: text(*to),
        bucket_ms: bucket.map(|width| u64::try_from(width / 1000).unwrap_or(0)),
        samples: bucket.is_none().then(|| answer.samples.iter().map(sample).collect()),
        buckets: bucket.is_some().then(|| answer.buckets.iter().map(of).collect()),
        kept_until: station.counts.history.kept_until().map(text),
        unreadable_chunks: answer.unreadable,
        averages: answer.averages.iter().map(averaged).collect(),
        next_cursor: answer.next.map(|next| format!("t{}", next.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_given_to_those_who_want_it() {
        for (accept, is_wanted) in [
            ("text/csv", true),
            ("text/html, Text/CSV;q=0.9, */*;q=0.1", true),
            ("text/csv;q=0", false),
            ("text/csv; q=0.00, application/json", false),
            ("text/csv;q=0.01", true),
            ("application/json, text/csv", false),
            ("*/*", false),
        ] {
            let headers = HeaderMap::from_iter([(ACCEPT, HeaderValue::from_static(accept))]);
            assert_eq!(wants_csv(&headers), is_wanted, "{accept}");
        }
        assert!(!wants_csv(&HeaderMap::new()));
    }

    #[test]
    fn a_form_that_is_not_offered_is_passed_over() {
        let accept = HeaderValue::from_static("application/vnd.apache.parquet, text/csv;q=0.5");
        let headers = HeaderMap::from_iter([(ACCEPT, accept)]);
        assert_eq!(form(&headers, &[Form::Json, Form::Csv, Form::Parquet]), Form::Parquet);
        assert!(wants_csv(&headers));
    }
}
