//! The figures of production of a robot.

use std::cmp::Reverse;
use std::time::Duration;

use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State as Of};
use r6_api::gateway::{
    AlarmFigure, AlarmFigures, Availability, CycleFigures, PartFigures, Production, StateFigures,
};
use r6_api::{Alarm, Problem};
use r6_client::Address;
use r6_http::Refusal;
use r6_proto::alarm::AlarmCode;
use serde::Deserialize;
use utoipa::IntoParams;

use super::State;
use super::caller::{Read, Robot};
use super::described::OfRight;
use super::history::{bad_value, permit, recorder, time};
use super::refusal;
use crate::clock::{self, text};
use crate::core::production::Figures;
use crate::core::watch::Before;
use crate::history::query::{Opens, ProductionAnswer, ProductionQuestion};

/// The range if no begin is given.
const USUAL_RANGE: Duration = Duration::from_secs(86_400);

/// The longest range, so that an answer takes a second or two at most.
const LONGEST_RANGE: Duration = Duration::from_secs(31 * 86_400);

/// How many alarms are listed.
const TOP: usize = 20;

/// What the availability is.
const AVAILABILITY: &str = "running_of_seen_time";

/// Which range.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Range {
    /// The begin, RFC 3339 in UTC; a day before the end if it is missing.
    #[param(example = "2026-11-25T06:00:00Z")]
    from: Option<String>,
    /// The end, which does not belong to the range, RFC 3339 in UTC; now if it is missing or later. At most
    /// 31 days behind the begin.
    #[param(example = "2026-11-25T14:00:00Z")]
    to: Option<String>,
}

/// What a robot did in a range of time: the time in each state, cycles, parts, alarms. Time that the gateway
/// did not see is told apart.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/production",
    operation_id = "production",
    params(("name" = String, Path, description = "The name of the robot"), Range),
    responses(
        (status = 200, description = "The figures", body = Production),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 422,
            description = "`bad_value`: a parameter is wrong, the history is off, or there is too much to read",
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
    range: Result<Query<Range>, QueryRejection>,
) -> Result<Json<Production>, Refusal> {
    let Query(range) = range.map_err(|error| bad_value(error.body_text()))?;
    let recorder = recorder(&state)?;
    let now = recorder.time(clock::now());
    let end = time("to", range.to.as_deref())?.unwrap_or(now);
    let from = time("from", range.from.as_deref())?.unwrap_or_else(|| end.min(now).before(USUAL_RANGE));
    // There is nothing behind now.
    let to = end.min(now).max(from);
    if from > end || to.before(LONGEST_RANGE) > from {
        return Err(bad_value("from is a time before to, and at most 31 days before".to_owned()));
    }
    let config = robot.station.config();
    let name = config.name.clone();
    let permit = permit(recorder)?;
    let read_until = match recorder.last_seen(name.clone()).await {
        Before::Seen(seen) => seen,
        // Nothing of it was seen.
        Before::Never => Some(from),
    };
    // Events are read from the disk alone. While it fails, samples in memory would go on without them.
    let kept_until = robot.station.counts.history.kept_until();
    let read_until = [read_until, kept_until].into_iter().flatten().min();
    let counter = config.parts().and_then(|address| match address {
        Address::Counter(number) => Some(number),
        _ => None,
    });
    let open = async |address| {
        let open = recorder.open(name.clone(), address).await;
        open.map_err(|error| refusal::of(error.into()))
    };
    let open = Opens {
        mode: open(Address::CurMode).await?,
        alarm: open(Address::CurAlarm).await?,
        counter: match counter {
            Some(number) => open(Address::Counter(number)).await?,
            None => Vec::new(),
        },
    };
    let question = ProductionQuestion { robot: name.clone(), from, to, read_until, counter };
    let answer = recorder.reader().production(permit, question, open).await;
    let ProductionAnswer { figures, unreadable, is_too_much } =
        answer.map_err(|error| refusal::of(error.into()))?;
    if is_too_much {
        return Err(bad_value("this range has too many events or changes: ask for a shorter one".to_owned()));
    }
    let alarms = alarms(&figures);
    Ok(Json(Production {
        robot: name.to_string(),
        from: text(from),
        to: text(to),
        seen_ms: ms(figures.seen()),
        unseen_ms: ms(figures.unseen),
        states: StateFigures {
            running_ms: ms(figures.running),
            waiting_ms: ms(figures.waiting),
            alarm_ms: ms(figures.alarm),
            manual_ms: ms(figures.manual),
            other_ms: ms(figures.other),
            computed_from: from_words(["curMode", "curAlarm", "unseen"]),
        },
        availability: Availability {
            value: figures.availability(),
            definition: AVAILABILITY.to_owned(),
            computed_from: from_words(["curMode", "curAlarm", "unseen"]),
        },
        parts: PartFigures {
            count: figures.parts,
            resets: figures.part_resets,
            computed_from: config
                .parts()
                .map(|address| address.to_string())
                .into_iter()
                .chain(from_words(["parts", "parts_reset"]))
                .collect(),
        },
        cycles: cycles(figures),
        alarms,
        kept_until: kept_until.map(text),
        unreadable,
    }))
}

fn cycles(figures: Figures) -> CycleFigures {
    let (p50_ms, p90_ms) = (figures.percentile(50), figures.percentile(90));
    let times = figures.cycle_times;
    CycleFigures {
        count: figures.cycles,
        at_least: figures.cycles_at_least,
        timed: times.len() as u64,
        p50_ms,
        p90_ms,
        min_ms: times.first().copied(),
        max_ms: times.last().copied(),
        mean_ms: mean(&times),
        computed_from: from_words(["lastCycle", "curCycle", "curMode", "cycle_done"]),
    }
}

#[expect(clippy::cast_precision_loss, reason = "cycles of a month, in ms, are below 2^53")]
fn mean(times: &[u64]) -> Option<f64> {
    let sum: u64 = times.iter().sum();
    (!times.is_empty()).then(|| (sum as f64 / times.len() as f64 * 1000.0).round() / 1000.0)
}

fn alarms(figures: &Figures) -> AlarmFigures {
    let mut all: Vec<_> = figures.alarms.iter().map(|(code, (count, lost))| (*code, *count, *lost)).collect();
    all.sort_by_key(|(code, count, lost)| (Reverse(*lost), Reverse(*count), *code));
    let top = all.iter().take(TOP).map(|(code, count, lost)| {
        let Alarm { text, remedy, .. } = Alarm::of(AlarmCode(*code));
        AlarmFigure { code: *code, text, remedy, count: *count, lost_ms: ms(*lost) }
    });
    AlarmFigures {
        codes: all.len() as u64,
        top: top.collect(),
        computed_from: from_words(["curAlarm", "curMode", "alarm_began", "unseen"]),
    }
}

fn from_words<const N: usize>(words: [&str; N]) -> Vec<String> {
    words.map(str::to_owned).into()
}

/// Milliseconds of µs.
fn ms(micros: i64) -> f64 {
    clock::milliseconds(Duration::from_micros(u64::try_from(micros).unwrap_or(0)))
}
