//! The figures of production.

use std::time::{Duration, Instant};

use r6_controller::PanelAction;
use r6_sim::VirtualController;
use serde_json::{Value, json};

use crate::happenings::with_counter;
use crate::support::{Hall, PATIENCE};

const PRODUCTION: &str = "/v1/robots/press/production";

impl Hall {
    async fn until_production(&self, is: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let figures = self.get(&self.viewer, PRODUCTION).await;
            if is(&figures) {
                return figures;
            }
            assert!(begun.elapsed() < PATIENCE, "{figures:#}");
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }
}

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("{of} is no number"))
}

#[tokio::test]
async fn states_alarms_and_parts_are_those_that_were_seen() {
    let hall = with_counter(VirtualController::start().await.unwrap()).await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "modifyCounter 0 4 -1").await.0, 200);
    hall.until_production(|figures| figures["parts"]["count"] == 4).await;
    hall.robots[0].handle().operate(&PanelAction::EmergencyStop).unwrap();
    let figures = hall.until_production(|figures| number(&figures["states"]["alarm_ms"]) > 300.0).await;
    let states = &figures["states"];
    let names = ["running_ms", "waiting_ms", "alarm_ms", "manual_ms", "other_ms"];
    let sum: f64 = names.iter().map(|name| number(&states[name])).sum();
    assert!((sum - number(&figures["seen_ms"])).abs() < 0.01, "{figures:#}");
    // The range is a day, and the gateway has been there for seconds.
    let range = number(&figures["seen_ms"]) + number(&figures["unseen_ms"]);
    assert!((range - 86_400_000.0).abs() < 0.01, "{figures:#}");
    assert!(number(&figures["unseen_ms"]) > 86_000_000.0, "{figures:#}");
    assert!(number(&states["running_ms"]) > 0.0, "{figures:#}");
    let availability = &figures["availability"];
    assert_eq!(availability["definition"], "running_of_seen_time");
    let expected = number(&states["running_ms"]) / number(&figures["seen_ms"]);
    assert!((number(&availability["value"]) - expected).abs() < 1e-6, "{figures:#}");
    let alarm = &figures["alarms"]["top"][0];
    assert_eq!(
        (&alarm["code"], &alarm["count"], &figures["alarms"]["codes"]),
        (&json!(7), &json!(1), &json!(1))
    );
    assert_eq!(alarm["lost_ms"], states["alarm_ms"]);
    assert_eq!(figures["parts"]["computed_from"], json!(["counter-0", "parts", "parts_reset"]));
    assert_eq!((&figures["cycles"]["count"], &figures["cycles"]["p50_ms"]), (&json!(0), &json!(null)));
}

#[tokio::test]
async fn a_robot_that_is_gone_does_not_run_on_in_the_figures() {
    let mut hall = Hall::start().await;
    hall.until_production(|figures| number(&figures["states"]["running_ms"]) > 200.0).await;
    hall.robots.pop().unwrap().shutdown().await.unwrap();
    hall.until_events("kind=link_lost", |events| !events.is_empty()).await;
    let first = hall.get(&hall.viewer, PRODUCTION).await;
    tokio::time::sleep(Duration::from_millis(300)).await;
    let second = hall.get(&hall.viewer, PRODUCTION).await;
    assert_eq!(first["states"], second["states"]);
    assert_eq!(first["parts"]["count"], json!(null), "no counter of parts");
}

#[tokio::test]
async fn every_mistake_of_a_range_is_told() {
    let hall = Hall::start().await;
    for (query, part) in [
        ("from=2026-01-01T00:00:00Z&to=2026-02-01T00:00:01Z", "at most 31 days"),
        ("from=9999-01-01T00:00:00Z", "from is a time before to"),
        ("to=now", "to: `now`"),
        ("shift=early", "date: a shift needs the date"),
        ("date=2026-11-25", "shift: a date needs the name"),
        ("shift=early&date=2026-11-25", "shift: there is no `early`; the hall has no shifts"),
        ("by=shift", "by: the hall has no shifts"),
        ("by=day", "by: `day` is not known"),
        ("by=shift&shift=early", "either by or shift"),
        ("shift=early&date=2026-11-25&to=2026-11-25T00:00:00Z", "either from and to, or shift"),
    ] {
        let (status, problem) = hall.call(&hall.viewer, "GET", &format!("{PRODUCTION}?{query}"), None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{query}: {problem}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{query}: {problem}");
    }
    // Nothing was seen then.
    let path = format!("{PRODUCTION}?from=2020-01-01T00:00:00Z&to=2020-01-31T00:00:00Z");
    let figures = hall.get(&hall.viewer, &path).await;
    assert_eq!((&figures["seen_ms"], &figures["availability"]["value"]), (&json!(0.0), &json!(null)));
}

/// Shifts of 12 hours, one of which is under way, in a zone where the day is not that of UTC.
fn two_shifts() -> Value {
    let days = ["mon", "tue", "wed", "thu", "fri", "sat", "sun"];
    json!({ "time_zone": "Asia/Shanghai", "shifts": [
        { "name": "day", "days": days, "begin": "07:00", "end": "19:00" },
        { "name": "night", "days": days, "begin": "19:00", "end": "07:00" },
    ] })
}

#[tokio::test]
async fn figures_of_shifts_are_those_of_their_instants() {
    let begun = humantime::format_rfc3339_micros(std::time::SystemTime::now()).to_string();
    let hall = with_counter(VirtualController::start().await.unwrap()).await;
    hall.set(&two_shifts()).await;
    let lease = hall.lease(&hall.operator, "press").await;
    assert_eq!(hall.command(&hall.operator, "press", &lease, "modifyCounter 0 3 -1").await.0, 200);
    hall.until_production(|figures| figures["parts"]["count"] == 3).await;

    let by = hall.get(&hall.viewer, &format!("{PRODUCTION}?by=shift")).await;
    let shifts = by["shifts"].as_array().unwrap();
    assert!((1..=3).contains(&shifts.len()), "{by:#}");
    // A shift may end meanwhile: then the parts are in the one before the last.
    let of_parts = shifts.iter().rev().take(2).find(|shift| shift["parts"]["count"] == 3);
    let Some(of_parts) = of_parts else { panic!("{by:#}") };
    let shift = &of_parts["shift"];
    let (name, date) = (shift["name"].as_str().unwrap(), shift["date"].as_str().unwrap());
    assert_eq!(shift["time_zone"], "Asia/Shanghai");
    let begin = shift["begin"].as_str().unwrap();
    assert!(begin[11..].starts_with(if name == "day" { "23:00:00" } else { "11:00:00" }), "{shift:#}");
    assert_eq!(of_parts["from"], json!(begin));
    let last = shifts.last().unwrap();
    assert_eq!(last["shift"]["under_way"], true);
    assert!(last["to"].as_str() < last["shift"]["end"].as_str(), "up to now: {last:#}");
    for shift in &shifts[..shifts.len() - 1] {
        assert_eq!((&shift["shift"]["under_way"], &shift["to"]), (&json!(false), &shift["shift"]["end"]));
        let sum = number(&shift["seen_ms"]) + number(&shift["unseen_ms"]);
        assert!((sum - 43_200_000.0).abs() < 0.01, "{shift:#}");
        let was_there = shift["to"].as_str() > Some(&begun);
        assert!(was_there || shift["seen_ms"] == 0.0, "the gateway was not there: {shift:#}");
    }

    let path = format!("{PRODUCTION}?shift={name}&date={date}");
    let one = hall.get(&hall.viewer, &path).await;
    assert_eq!((&one["shift"]["begin"], &one["parts"]["count"]), (&json!(begin), &json!(3)));
    let total = number(&one["seen_ms"]) + number(&one["unseen_ms"]);
    let same = hall.get(&hall.viewer, &format!("{PRODUCTION}?from={begin}")).await;
    assert!(number(&same["seen_ms"]) + number(&same["unseen_ms"]) >= total, "{one:#} {same:#}");
    assert_eq!((&same["shift"], &same["parts"]["count"]), (&json!(null), &json!(3)));

    for (query, part) in [
        ("shift=late&date=2026-11-25", "there is no `late`; the shifts are day, night"),
        ("shift=day&date=25.11.2026", "date: `25.11.2026` is not a date"),
        ("shift=day&date=9000-01-01", "has not begun"),
        ("shift=day&date=0001-01-02", "before 1970"),
    ] {
        let (status, problem) = hall.call(&hall.viewer, "GET", &format!("{PRODUCTION}?{query}"), None).await;
        assert_eq!((status, &problem["code"]), (422, &json!("bad_value")), "{query}: {problem}");
        assert!(problem["message"].as_str().unwrap().contains(part), "{query}: {problem}");
    }
}

#[tokio::test]
async fn a_table_has_a_row_for_each_shift_and_a_month_is_too_many() {
    let hall = Hall::start().await;
    hall.set(&two_shifts()).await;
    let table = async |query: &str| {
        let headers = format!("Authorization: Bearer {}\r\nAccept: text/csv\r\n", hall.viewer);
        let path = format!("{PRODUCTION}?{query}");
        let answer = crate::support::request(hall.gateway.address(), &headers, "GET", &path, None).await;
        assert!(answer.status == 200 && answer.head.contains("content-type: text/csv"), "{}", answer.head);
        answer.body.as_str().unwrap().to_owned()
    };
    let told = table("by=shift&from=2026-01-01T00:00:00Z&to=2026-01-03T00:00:00Z").await;
    let rows: Vec<Vec<_>> = told.lines().map(|line| line.split(',').collect()).collect();
    assert!(rows.iter().all(|row| row.len() == 26), "{told}");
    let shifts: Vec<_> = rows[1..].iter().map(|row| [row[0], row[1], row[2], row[5], row[7]]).collect();
    let row = |name, date| ["press", name, date, "false", "43200000"];
    let wanted = [
        row("night", "2026-01-01"),
        row("day", "2026-01-02"),
        row("night", "2026-01-02"),
        row("day", "2026-01-03"),
    ];
    assert_eq!(shifts, wanted);
    assert_eq!(rows[1][3], "2026-01-01T11:00:00.000000Z");
    let plain = table("from=2026-01-01T00:00:00Z&to=2026-01-03T00:00:00Z").await;
    let cells: Vec<_> = plain.lines().nth(1).unwrap().split(',').collect();
    assert_eq!((cells.len(), cells[1], cells[5], cells[7]), (26, "", "", "172800000"));

    let mut many = two_shifts();
    many["shifts"] = (0..12)
        .map(|hour| {
            json!({
                "name": format!("s{hour}"), "days": ["mon", "tue", "wed", "thu", "fri", "sat", "sun"],
                "begin": format!("{:02}:00", hour * 2), "end": format!("{:02}:00", hour * 2 + 2),
            })
        })
        .collect();
    hall.set(&many).await;
    let path = format!("{PRODUCTION}?by=shift&from=2026-01-01T00:00:00Z&to=2026-01-31T00:00:00Z");
    let (status, problem) = hall.call(&hall.viewer, "GET", &path, None).await;
    assert_eq!((status, &problem["code"]), (422, &json!("bad_value")));
    assert!(problem["message"].as_str().unwrap().contains("more than 100 shifts"), "{problem}");
}
