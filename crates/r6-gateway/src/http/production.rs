//! The figures of production of a robot: of a range of time, of a shift, of each shift in a range.

mod figures;

use std::time::Duration;

use axum::Json;
use axum::extract::rejection::QueryRejection;
use axum::extract::{Query, State as Of};
use axum::http::HeaderMap;
use axum::response::{IntoResponse, Response};
use r6_api::Problem;
use r6_api::gateway::{Production, ProductionByShift, ProductionFigures, ShiftSpan};
use r6_client::Address;
use r6_http::Refusal;
use serde::Deserialize;
use utoipa::IntoParams;

use super::State;
use super::caller::{Read, Robot};
use super::csv;
use super::described::OfRight;
use super::history::{permit, recorder, table, wants_csv};
use super::range::{self, Lengths, shown};
use super::refusal::{self, bad_value};
use crate::clock::{self, text};
use crate::core::hall::{Hall, NoShift, Occurrence};
use crate::core::history::sample::Micros;
use crate::core::watch::Before;
use crate::fleet::station::Station;
use crate::history::query::{Opens, ProductionQuestion};

/// A day if no begin is given, and 31 days at most, so that an answer takes a second or two.
const LENGTHS: Lengths = Lengths {
    usual: Duration::from_secs(86_400),
    longest: Duration::from_secs(31 * 86_400),
    longest_words: "31 days",
};

/// The most shifts of one answer: a month with three a day.
const MAX_SHIFTS: usize = 100;

/// Which range or shift.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct Wanted {
    /// The begin, RFC 3339 in UTC; a day before the end if it is missing.
    #[param(example = "2026-11-25T06:00:00Z")]
    from: Option<String>,
    /// The end, which does not belong to the range, RFC 3339 in UTC; now if it is missing or later. At most
    /// 31 days behind the begin.
    #[param(example = "2026-11-25T14:00:00Z")]
    to: Option<String>,
    /// The name of a shift, with `date` and without `from` and `to`.
    #[param(example = "night")]
    shift: Option<String>,
    /// The date of the begin of the shift, on the calendar of the hall.
    #[param(example = "2026-11-25")]
    date: Option<String>,
    /// `shift`: the figures of each shift that begins in the range, 100 at most.
    #[param(example = "shift")]
    by: Option<String>,
}

/// What a robot did in a range of time: the time in each state, cycles, parts, alarms. Time that the gateway
/// did not see is told apart. `Accept: text/csv` gives a table, with a row for each shift.
#[utoipa::path(
    get,
    path = "/v1/robots/{name}/production",
    operation_id = "production",
    params(("name" = String, Path, description = "The name of the robot"), Wanted),
    responses(
        (
            status = 200,
            description = "The figures",
            content((ProductionFigures = "application/json"), (String = "text/csv")),
        ),
        (status = 404, description = "`no_such_robot`", body = Problem),
        (
            status = 422,
            description = "`bad_value`: a parameter is wrong, there is no such shift, the history is off, or \
                           there is too much to read",
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
    wanted: Result<Query<Wanted>, QueryRejection>,
) -> Result<Response, Refusal> {
    let Query(wanted) = wanted.map_err(refusal::of_query_for_forms)?;
    let now = recorder(&state)?.time(clock::now());
    let known = state.settings.now();
    let asked = Asked::of(&wanted, &known.hall, now)?;
    let spans = asked.spans(now);
    let time_zone = &known.hall.settings().time_zone;
    let all = production(&state, &robot.station, &spans).await?;
    let all: Vec<_> = all
        .into_iter()
        .zip(asked.shifts())
        .map(|(figures, shift)| Production {
            shift: shift.map(|shift| span(shift, time_zone, now)),
            ..figures
        })
        .collect();
    if wants_csv(&headers) {
        return Ok(table(csv::production_table(&all), None));
    }
    let figures = match asked {
        Asked::ByShift(range::Range { from, to }, _) => ProductionFigures::ByShift(ProductionByShift {
            robot: robot.station.name().to_owned(),
            from: text(from),
            to: text(to),
            shifts: all,
        }),
        Asked::Range(_) | Asked::Shift(_) => {
            // There is one set of figures for one span.
            let one = all.into_iter().next().ok_or_else(|| bad_value("there are no figures"))?;
            ProductionFigures::One(Box::new(one))
        }
    };
    Ok(Json(figures).into_response())
}

/// What is asked for.
enum Asked {
    Range(range::Range),
    Shift(Occurrence),
    ByShift(range::Range, Vec<Occurrence>),
}

impl Asked {
    fn of(wanted: &Wanted, hall: &Hall, now: Micros) -> Result<Self, Refusal> {
        let Wanted { from, to, shift, date, by } = wanted;
        let range = || LENGTHS.range((from.as_deref(), to.as_deref()), None, now);
        match (shift.as_deref(), date.as_deref(), by.as_deref()) {
            (None, None, None) => range().map(Self::Range),
            (Some(name), Some(date), None) if from.is_none() && to.is_none() => {
                let found = hall.shift(name, date).map_err(|why| no_shift(hall, name, date, &why))?;
                if found.begin > now {
                    return Err(bad_value(format!("date: the shift of {} has not begun", found.date)));
                }
                if found.end.0 < 0 {
                    return Err(bad_value("date: it is before 1970"));
                }
                Ok(Self::Shift(found))
            }
            (None, None, Some("shift")) => {
                let range = range()?;
                let shifts = hall.beginning(range.from, range.to, MAX_SHIFTS + 1);
                if hall.settings().shifts.is_empty() {
                    return Err(bad_value("by: the hall has no shifts: `PUT /v1/settings` sets them"));
                }
                if shifts.len() > MAX_SHIFTS {
                    return Err(bad_value(format!(
                        "the range has more than {MAX_SHIFTS} shifts: ask for a shorter one"
                    )));
                }
                Ok(Self::ByShift(range, shifts))
            }
            (None, None, Some(by)) => {
                Err(bad_value(format!("by: `{}` is not known; the only word is shift", shown(by))))
            }
            (_, _, Some(_)) => Err(bad_value("either by or shift, not both")),
            (Some(_), None, None) => Err(bad_value("date: a shift needs the date of its begin")),
            (None, Some(_), None) => Err(bad_value("shift: a date needs the name of a shift")),
            (Some(_), Some(_), None) => Err(bad_value("either from and to, or shift and date")),
        }
    }

    /// The ranges to compute, up to now.
    fn spans(&self, now: Micros) -> Vec<range::Range> {
        let of = |shift: &Occurrence| range::Range { from: shift.begin, to: shift.end.min(now) };
        match self {
            Self::Range(range) => vec![*range],
            Self::Shift(shift) => vec![of(shift)],
            Self::ByShift(_, shifts) => shifts.iter().map(of).collect(),
        }
    }

    /// The shift of each of them.
    fn shifts(&self) -> Vec<Option<&Occurrence>> {
        match self {
            Self::Range(_) => vec![None],
            Self::Shift(shift) => vec![Some(shift)],
            Self::ByShift(_, shifts) => shifts.iter().map(Some).collect(),
        }
    }
}

fn no_shift(hall: &Hall, name: &str, date: &str, why: &NoShift) -> Refusal {
    let (name, date) = (shown(name), shown(date));
    match why {
        NoShift::Name => {
            let names: Vec<_> = hall.settings().shifts.iter().map(|shift| shift.name.as_str()).collect();
            let advice = match &names[..] {
                [] => "the hall has no shifts: `PUT /v1/settings` sets them".to_owned(),
                names => format!("the shifts are {}", names.join(", ")),
            };
            bad_value(format!("shift: there is no `{name}`; {advice}"))
        }
        NoShift::Date => bad_value(format!("date: `{date}` is not a date such as 2026-11-25")),
        NoShift::Day(day) => {
            bad_value(format!("date: the shift `{name}` does not begin on {}, as {date} is", day.word()))
        }
        NoShift::LeftOut => {
            bad_value(format!("date: the calendar of the hall leaves out this shift of {date}"))
        }
    }
}

fn span(shift: &Occurrence, time_zone: &str, now: Micros) -> ShiftSpan {
    ShiftSpan {
        name: shift.name.clone(),
        date: shift.date.clone(),
        time_zone: time_zone.to_owned(),
        begin: text(shift.begin),
        end: text(shift.end),
        under_way: shift.end > now,
    }
}

/// The figures of a robot in each of these ranges, which are in the order of time.
async fn production(
    state: &State,
    station: &Station,
    spans: &[range::Range],
) -> Result<Vec<Production>, Refusal> {
    let recorder = recorder(state)?;
    let config = station.config();
    let name = config.name.clone();
    let permit = permit(recorder)?;
    let seen_until = recorder.last_seen(name.clone()).await;
    // Events are read from the disk alone. While it fails, samples in memory would go on without them.
    let kept_until = station.counts.history.kept_until();
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
    let question = |range::Range { from, to }: &range::Range| {
        let seen_until = match seen_until {
            Before::Seen(seen) => seen,
            // Nothing of it was seen.
            Before::Never => Some(*from),
        };
        let read_until = [seen_until, kept_until].into_iter().flatten().min();
        ProductionQuestion { robot: name.clone(), from: *from, to: *to, read_until, counter }
    };
    let questions: Vec<_> = spans.iter().map(question).collect();
    let answers = recorder.reader().production(permit, questions, open).await;
    let answers = answers.map_err(|error| refusal::of(error.into()))?;
    if answers.iter().any(|answer| answer.is_too_much) {
        return Err(bad_value("this range has too many events or changes: ask for a shorter one"));
    }
    let shown = spans.iter().zip(answers);
    Ok(shown.map(|(span, answer)| figures::shown(&config, *span, answer, kept_until)).collect())
}
